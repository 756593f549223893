"""The paper's first check: a smooth paraboloid against Hertz, force and area (section 2.4).

Both kernels on the paper's two grids, beside the closed form. The displacement counts from the
paraboloid's tip, which on an even number of nodes lies a little above the highest of them.
"""

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

Values = NDArray[np.float64]

SPHERE = Paraboloid(5000.0)
SIDE = 1000.0  # um
NODES = (128, 256)
LARGEST_DELTA = 1.0  # um
STEPS = 50

COLOURS = {"uniform-pressure": STYLES[0]["color"], "concentrated-force": STYLES[1]["color"]}
DASHES = {128: (4, 2), 256: (1, 0)}


@dataclass(frozen=True, eq=False)
class Curve:
    """One solution of the paraboloid's contact, for E* = 1 MPa.

    Attributes
    ----------
    solution : "hertz", or the kernel
    nodes : nodes a side; 0 for the closed form
    delta : (m,) displacement of the far field [um]
    force : (m,) normal force [uN]
    area_percent : (m,) contact area as a share of the patch or of its nodes [%]
    """

    solution: str
    nodes: int
    delta: Values
    force: Values
    area_percent: Values


def closed_form(delta: Values) -> Curve:
    """Force and area by Hertz."""
    force = np.array([SPHERE.force(float(value)) for value in delta])
    radius = np.array([SPHERE.contact_radius(float(value)) for value in delta])
    return Curve("hertz", 0, delta, force, 100 * np.pi * radius**2 / SIDE**2)


def solved(kernel: Kernel, nodes: int, delta: Values) -> Curve:
    """Force and area by boundary elements."""
    heights = SPHERE.heights(distances_to_centre((nodes, nodes), SIDE))
    below_tip = float(heights.max())
    contacts = [
        bem.solve(heights, SIDE, float(value) + below_tip, kernel=kernel) for value in delta
    ]
    force = np.array([contact.force for contact in contacts])
    area = np.array([contact.area_percent for contact in contacts])
    return Curve(kernel, nodes, delta, force, area)


def compare(steps: int = STEPS) -> list[Curve]:
    """The closed form first, then every kernel on every grid.

    Parameters
    ----------
    steps : displacements above 0, evenly spaced up to `LARGEST_DELTA`
    """
    delta = np.linspace(0, LARGEST_DELTA, steps + 1)
    curves = [solved(kernel, nodes, delta) for kernel in KERNELS for nodes in NODES]
    return [closed_form(delta), *curves]


def report(curves: list[Curve]) -> Report:
    """Return the table and the picture of all curves, the closed form first."""
    figure = new_figure(11, 7.5)
    _draw(figure, curves)
    rows = (
        {
            "solution": curve.solution,
            "nodes": curve.nodes or "",
            "delta_um": float(curve.delta[step]),
            "force_uN": float(curve.force[step]),
            "area_percent": float(curve.area_percent[step]),
        }
        for curve in curves
        for step in range(curve.delta.size)
    )
    return Report({"hertz": rows}, pictures={"hertz": figure})


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


def _draw(figure: Any, curves: list[Curve]) -> None:
    """Force and area above, what separates them from Hertz below."""
    (force, area), (force_off, area_off) = figure.subplots(
        2, 2, sharex=True, gridspec_kw={"height_ratios": (3, 2)}
    )
    exact, *numerical = curves
    for curve in numerical:
        style = {
            "color": COLOURS[curve.solution],
            "dashes": DASHES[curve.nodes],
            "label": f"{curve.solution}, {curve.nodes} × {curve.nodes}",
        }
        force.plot(curve.delta, curve.force, **style)
        area.plot(curve.delta, curve.area_percent, **style)
        force_off.plot(curve.delta, _deviation(curve.force, exact.force), **style)
        area_off.plot(curve.delta, _deviation(curve.area_percent, exact.area_percent), **style)
    for axis, values in ((force, exact.force), (area, exact.area_percent)):
        axis.plot(exact.delta, values, "k:", lw=2, label="Hertz")
    for axis in (force_off, area_off):
        axis.axhline(0, color="k", ls=":", lw=2)
        axis.set(xlabel="far-field displacement Δ [µm]", xlim=(0, LARGEST_DELTA))
    force.set(ylabel="force F [µN], E* = 1 MPa", ylim=(0, None), title="(a) contact force")
    area.set(ylabel="contact area [% of the nodes]", ylim=(0, None), title="(b) contact area")
    force_off.set(ylabel="deviation of F\n[% of Hertz's at Δ = 1 µm]")
    area_off.set(ylabel="deviation of the area\n[% of Hertz's at Δ = 1 µm]")
    force.legend()
    figure.align_ylabels()


def _deviation(values: Values, exact: Values) -> Values:
    """Difference as a share of the largest exact value [%]."""
    return np.asarray(100 * (values - exact) / exact[-1])
