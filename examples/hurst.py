"""Which Hurst exponent has the spectrum of a generated surface? (--table writes it.)

Surfaces of each generator are made with several exponents and on several grids. The exponent of
each one's power spectrum is estimated as `gen describe` does it. The generator `spectral` gives
what it is asked for; those of random midpoint displacement give less, and the less the coarser
the grid.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

from gen.maps.read import Topography
from gen.maps.texture import fit_self_affine, radial_spectrum
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.surface import generate

GENERATORS = ("diamond-square", "midpoint", "spectral")
SIDE = 1000.0  # um


def surface(generator: str, nodes: int, hurst: float, seed: int) -> np.ndarray:
    """Return the heights of one surface [um]; a spectral one is a window of a longer period."""
    random = np.random.default_rng(seed)
    if generator != "spectral":
        return generate(generator, nodes, hurst, 12.5, random)
    spectrum = SelfAffineSpectrum(
        hurst, roll_off=SIDE / 2, cut_off=2.1 * SIDE / (nodes - 1)
    )
    shape, period = (2 * nodes, 2 * nodes), 2 * nodes * SIDE / (nodes - 1)
    return generate_spectral(shape, period, spectrum, random, rms_height=5.0)[
        :nodes, :nodes
    ]


def estimates(generator: str, nodes: int, hurst: float, surfaces: int) -> list[float]:
    """Return the exponents of the surfaces whose spectra follow a self-affine law."""
    exponents = []
    for seed in range(surfaces):
        heights = surface(generator, nodes, hurst, seed)
        topography = Topography(generator, heights, (SIDE, SIDE))
        fit = fit_self_affine(topography, radial_spectrum(topography))
        if not isinstance(fit, str):
            exponents.append(fit.spectrum.hurst)
    return exponents


def main(arguments: list[str]) -> list[dict[str, object]]:
    """Return a row for each generator, grid and exponent."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--small", action="store_true", help="two surfaces on the coarsest grid"
    )
    parser.add_argument("--table", metavar="FILE", help="the table as CSV")
    options = parser.parse_args(arguments)
    rows: list[dict[str, object]] = []
    for generator in GENERATORS:
        for nodes in (129,) if options.small else (129, 257, 513):
            for hurst in (0.3, 0.5, 0.7, 0.9):
                exponents = estimates(generator, nodes, hurst, 2 if options.small else 20)
                row = {"generator": generator, "nodes": nodes, "asked_for": hurst}
                row |= {
                    "fitted": len(exponents),
                    "hurst": round(float(np.mean(exponents)), 3),
                }
                row |= {"deviation": round(float(np.std(exponents, ddof=1)), 3)}
                rows.append(row)
                print(
                    ", ".join(f"{name} {value}" for name, value in row.items()),
                    flush=True,
                )
    if options.table:
        with Path(options.table).open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    return rows


if __name__ == "__main__":
    main(sys.argv[1:])
