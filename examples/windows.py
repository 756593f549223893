"""How large does a map have to be for the law of its interface? (--plot and --table write it.)

One surface is cut into windows of several sizes, each pressed between its mirror images. Their
closures and conductances scatter less where windows are larger than the roll-off wavelength.
"""

import argparse

import numpy as np

import bem
from gen.runtime.command_line import run_script
from gen.spectral import SelfAffineSpectrum, generate_spectral

PRESSURES = (10.0, 100.0)
LAWS = [f"{law} at {p:g} MPa" for law in ("closure", "conductance") for p in PRESSURES]


def laws(heights: np.ndarray, spacing: float, hardness: float) -> np.ndarray:
    """Return closure [um] and stiffness per area [MPa / um] at all pressures, shape (2, loads)."""
    level = np.linspace(-1, 1, len(heights))[
        :, None
    ]  # a window's tilt belongs to its form
    heights = heights - sum(
        x * (heights * x).mean() / (x**2).mean() for x in (level, level.T)
    )
    side = spacing * len(heights)
    settings = {"boundary": "mirror", "modulus": 230e3, "hardness": hardness}
    contacts = bem.ladder(heights, side, pressures=PRESSURES, **settings)
    return np.array([(each.delta, each.stiffness / side**2) for each in contacts]).T


def main(arguments: list[str]) -> np.ndarray:
    """Return sizes over roll-off, and standard deviations over means, (sizes, 1 + 2 x loads)."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hardness", type=float, default=2000.0, help="[MPa]")
    parser.add_argument("--small", action="store_true", help="256 nodes a side")
    parser.add_argument("--plot", metavar="FILE", help="scatter over size")
    parser.add_argument("--table", metavar="FILE", help="sizes and scatter as CSV")
    given = parser.parse_args(arguments)
    nodes, spacing, roll_off = 256 if given.small else 1024, 1.0, 64.0
    spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=roll_off, cut_off=4 * spacing)
    shape, random = (nodes, nodes), np.random.default_rng(2025)
    heights = generate_spectral(shape, nodes * spacing, spectrum, random, rms_slope=0.1)
    found = []
    for size in (nodes // 2 ** np.arange(1, 6 if nodes > 256 else 4)).tolist():
        places = [(i, j) for i in range(0, nodes, size) for j in range(0, nodes, size)][
            :64
        ]
        windows = [heights[i : i + size, j : j + size] for i, j in places]
        each = np.array(
            [laws(window, spacing, given.hardness).ravel() for window in windows]
        )
        found.append([size * spacing / roll_off, *(each.std(axis=0) / each.mean(axis=0))])
        percent = 100 * np.round(found[-1][1:], 3)
        print(f"{found[-1][0]:g} roll-offs, {len(windows)} windows: {percent} %")
    if given.table:
        np.savetxt(
            given.table,
            found,
            "%g",
            ",",
            header="roll-offs," + ",".join(LAWS),
            comments="",
        )
    if given.plot:
        from matplotlib.figure import Figure

        axis = Figure(figsize=(5.5, 3.6), layout="constrained").subplots()
        sizes, *scatters = np.transpose(found)
        axis.semilogx(sizes, 100 * np.transpose(scatters), "o-", base=2, label=LAWS)
        axis.set(
            xlabel="window / roll-off wavelength", ylabel="scatter [%]", ylim=(0, None)
        )
        axis.legend()
        axis.figure.savefig(given.plot, dpi=110)
    return np.array(found)


if __name__ == "__main__":
    run_script(main)
