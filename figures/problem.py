"""Draw the contact problem, a section through a solved contact, which the glossary explains.

python figures/problem.py -o problem.svg
"""

from argparse import ArgumentParser
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

import bem
from gen.spectral import SelfAffineSpectrum, generate_spectral

SIDE = 100.0  # um
SHOWN = slice(10, 118)  # nodes along the section
ARROW = {"arrowstyle": "<->", "color": "black", "shrinkA": 0, "shrinkB": 0}


def main(path: Path) -> None:
    """Solve the contact, and draw the section through its highest node into a file."""
    spectrum = SelfAffineSpectrum(hurst=0.9, roll_off=30.0, cut_off=12.0)
    random = np.random.default_rng(11)
    heights = generate_spectral((128, 128), SIDE, spectrum, random, rms_height=1.0)
    highest = np.unravel_index(heights.argmax(), heights.shape)
    heights = np.roll(heights, (40 - highest[0], 0), (0, 1))
    contact = bem.solve(heights, SIDE, pressure=0.025, boundary="periodic")
    row = int(highest[1])
    x = np.arange(128)[SHOWN] * SIDE / 128
    interference = (heights[:, row] - heights.max() + contact.delta)[SHOWN]
    displacement = interference + contact.gap[SHOWN, row]
    mpl.rcParams["svg.hashsalt"] = "asperity"  # the same file from every run
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    axis = figure.subplots()
    _draw_bodies(axis, x, interference, displacement, contact.pressure[SHOWN, row] > 0)
    _draw_names(axis, x, interference, displacement, contact.delta)
    figure.savefig(path, metadata={"Date": None}, facecolor="white")


def _draw_bodies(axis, x, interference, displacement, in_contact) -> None:  # type: ignore[no-untyped-def]
    """Draw the rigid rough body above the elastic one, and where they would overlap."""
    top, bottom = 4.6, -3.8
    axis.fill_between(x, -displacement, bottom, color="#cfe3f5", linewidth=0)
    axis.fill_between(x, -interference, top, color="#c9c4bd", linewidth=0)
    inside = interference > 0
    axis.fill_between(
        x, 0, -interference, where=inside, facecolor="none", edgecolor="#b5402f", hatch="////",
        linewidth=0,
    )  # fmt: skip
    axis.plot(x, -interference, color="#55504a", linewidth=1.5)
    axis.plot(x, -displacement, color="#2f6fb0", linewidth=1.5)
    touching = np.where(in_contact, -displacement, np.nan)
    axis.plot(x, touching, color="#b5402f", linewidth=4, solid_capstyle="butt")
    axis.axhline(0, color="#2f6fb0", linestyle="--", linewidth=1)
    axis.set(xlim=(x[0], x[-1]), ylim=(bottom, top), xticks=[], yticks=[])


def _draw_names(axis, x, interference, displacement, delta) -> None:  # type: ignore[no-untyped-def]
    """Write what is what."""
    peak = int(interference.argmax())
    axis.annotate("", (x[peak], 0), (x[peak], -delta), arrowprops=ARROW)
    axis.text(x[peak] + 1, -delta / 2, "Delta", va="center", weight="bold")
    open_gap = displacement - interference
    widest = int(open_gap[: len(x) * 9 // 10].argmax())
    ends = (x[widest], -interference[widest]), (x[widest], -displacement[widest])
    axis.annotate("", *ends, arrowprops=ARROW)
    axis.text(x[widest] + 1, np.mean([end[1] for end in ends]), "gap", va="center")
    axis.text(
        x[1], 4.0, "rigid rough surface: asperities are its local peaks", va="center"
    )
    axis.text(x[1], -3.2, "elastic half-space: modulus E*, hardness", va="center")
    axis.annotate(
        "its surface before contact", (x[2], 0), (x[1], -2.3), color="#2f6fb0",
        arrowprops={"arrowstyle": "->", "color": "#2f6fb0"},
    )  # fmt: skip
    axis.annotate(
        "interference (hatched); contact (red), which carries the pressure",
        (x[peak] + 14, -delta / 4), (x[peak] + 6, -2.3), color="#b5402f",
        arrowprops={"arrowstyle": "->", "color": "#b5402f"},
    )  # fmt: skip


if __name__ == "__main__":
    parser = ArgumentParser()
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="picture to write"
    )
    main(parser.parse_args().output)
