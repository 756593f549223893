"""The paper's first check: a smooth paraboloid against Hertz, force and area (section 2.4).

Both kernels on the paper's two grids, beside the closed form. The displacement counts from the
paraboloid's tip, which on an even number of nodes lies a little above the highest of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bem
from bem.analytic import Paraboloid, distances_to_centre
from bem.influence import KERNELS, Kernel
from bench.page.content import Content, Figure
from bench.picture import new_figure
from bench.report import Report
from bench.style import STYLES

SPHERE = Paraboloid(5000.0)
SIDE = 1000.0  # um
NODES = (128, 256)
LARGEST_DELTA = 1.0  # um
STEPS = 50

COLUMNS = ("solution", "nodes", "delta_um", "force_uN", "area_percent")
COLOURS = {"uniform-pressure": STYLES[0]["color"], "concentrated-force": STYLES[1]["color"]}
DASHES = {128: (4, 2), 256: (1, 0)}

Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """One solution for E* = 1 MPa.

    Attributes
    ----------
    solution : str
        "hertz", or the kernel.
    nodes : int
        Nodes a side; 0 for the closed form.
    delta, force, area_percent : ndarray, shape (m,)
        Displacements of the far field [um], forces [uN], and areas [% of the patch].
    """

    solution: str
    nodes: int
    delta: Values
    force: Values
    area_percent: Values


def closed_form(delta: Values) -> Curve:
    """Compute force and area by Hertz."""
    force = np.array([SPHERE.force(float(value)) for value in delta])
    radius = np.array([SPHERE.contact_radius(float(value)) for value in delta])
    return Curve("hertz", 0, delta, force, 100 * np.pi * radius**2 / SIDE**2)


def solved(kernel: Kernel, nodes: int, delta: Values) -> Curve:
    """Compute force and area by boundary elements."""
    heights = SPHERE.heights(distances_to_centre((nodes, nodes), SIDE))
    tip = float(heights.max())
    contacts = [bem.solve(heights, SIDE, float(value) + tip, kernel=kernel) for value in delta]
    force, area = np.array([(each.force, each.area_percent) for each in contacts]).T
    return Curve(kernel, nodes, delta, force, area)


def compare(steps: int = STEPS) -> list[Curve]:
    """Compute the closed form first, then every kernel on every grid, at `steps` displacements."""
    delta = np.linspace(0, LARGEST_DELTA, steps + 1)
    curves = [solved(kernel, nodes, delta) for kernel in KERNELS for nodes in NODES]
    return [closed_form(delta), *curves]


def report(curves: Sequence[Curve]) -> Report:
    """Make a report of all curves, the closed form first."""
    rows = (
        dict(zip(COLUMNS, (curve.solution, curve.nodes or "", *map(float, values)), strict=True))
        for curve in curves
        for values in zip(curve.delta, curve.force, curve.area_percent, strict=True)
    )
    return Report({"hertz": rows}, pictures={"hertz": _picture(curves)})


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that holds this report."""
    return [
        Figure(
            folder / "hertz.png",
            "A rigid paraboloid (R = 5 mm) pressed into a half-space: force and contact area over"
            " the displacement, with the deviation from Hertz below, in per cent of Hertz's largest"
            " value. Areas move in steps because nodes touch one after the other. The default"
            " kernel, uniform pressure on cells, is the nearer one; the concentrated-force kernel,"
            " MIRCO's, gives way too little under a cell's own force.",
            data=(folder / "hertz.csv",),
        )
    ]


def _picture(curves: Sequence[Curve]) -> Any:
    """Draw force and area above, and their deviations from Hertz below."""
    figure = new_figure(11, 7.5)
    panels = figure.subplots(2, 2, sharex=True, gridspec_kw={"height_ratios": (3, 2)})
    (force, area), (force_off, area_off) = panels
    closed, *numerical = curves
    for above, below, quantity in ((force, force_off, "force"), (area, area_off, "area_percent")):
        exact = getattr(closed, quantity)
        for curve in numerical:
            style = {
                "color": COLOURS[curve.solution],
                "dashes": DASHES[curve.nodes],
                "label": f"{curve.solution}, {curve.nodes} × {curve.nodes}",
            }
            values = getattr(curve, quantity)
            above.plot(curve.delta, values, **style)
            below.plot(curve.delta, 100 * (values - exact) / exact[-1], **style)
        above.plot(closed.delta, exact, "k:", lw=2, label="Hertz")
        below.axhline(0, color="k", ls=":", lw=2)
        below.set(xlabel="far-field displacement Δ [µm]", xlim=(0, LARGEST_DELTA))
    force.set(ylabel="force F [µN], E* = 1 MPa", ylim=(0, None), title="(a) contact force")
    area.set(ylabel="contact area [% of the nodes]", ylim=(0, None), title="(b) contact area")
    force_off.set(ylabel="deviation of F\n[% of Hertz's at Δ = 1 µm]")
    area_off.set(ylabel="deviation of the area\n[% of Hertz's at Δ = 1 µm]")
    force.legend()
    figure.align_ylabels()
    return figure
