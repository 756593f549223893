"""The paper's first check: a smooth paraboloid against Hertz, force and area (section 2.4).

Both kernels on the paper's two grids, beside the closed form, for E* = 1 MPa. The displacement
counts from the paraboloid's tip, which on an even number of nodes lies a little above the highest
of them.
"""

from typing import Any

import numpy as np
import pandas as pd

import bem
from bem.analytic import Paraboloid, distances_to_centre
from bem.influence import KERNELS, Kernel
from bench.picture import STYLES, new_figure
from bench.report import Report

SPHERE = Paraboloid(5000.0)
SIDE = 1000.0  # um
NODES = (128, 256)
LARGEST_DELTA = 1.0  # um
STEPS = 50

COLOURS = {"uniform-pressure": STYLES[0]["color"], "concentrated-force": STYLES[1]["color"]}
DASHES = {128: (4, 2), 256: (1, 0)}


def closed_form(delta: float) -> tuple[float, float]:
    """Compute force [uN] and area [% of the patch] by Hertz."""
    return SPHERE.force(delta), 100 * np.pi * SPHERE.contact_radius(delta) ** 2 / SIDE**2


def solved(kernel: Kernel, nodes: int, delta: float) -> tuple[float, float]:
    """Compute the same by boundary elements."""
    heights = SPHERE.heights(distances_to_centre((nodes, nodes), SIDE))
    contact = bem.solve(heights, SIDE, delta + float(heights.max()), kernel=kernel)
    return contact.force, contact.area_percent


def compare(steps: int = STEPS) -> pd.DataFrame:
    """Compute the closed form first, then every kernel on every grid, at `steps` displacements.

    A row names the solution, "hertz" or the kernel, and its nodes a side, "" for the closed form.
    """
    delta = np.linspace(0, LARGEST_DELTA, steps + 1).tolist()
    rows: list[tuple[Any, ...]] = [("hertz", "", each, *closed_form(each)) for each in delta]
    for kernel in KERNELS:
        for nodes in NODES:
            rows += [(kernel, nodes, each, *solved(kernel, nodes, each)) for each in delta]
    columns = ["solution", "nodes", "delta_um", "force_uN", "area_percent"]
    return pd.DataFrame(rows, columns=columns).astype({"nodes": object})


def hertz() -> Report:
    """Press the paraboloid, and draw what `compare` returns."""
    rows = compare()
    return Report({"hertz": rows.to_dict("records")}, pictures={"hertz": picture(rows)})


def picture(rows: pd.DataFrame) -> Any:
    """Draw force and area above, and their deviations from Hertz below."""
    figure = new_figure(11, 7.5)
    panels = figure.subplots(2, 2, sharex=True, gridspec_kw={"height_ratios": (3, 2)})
    (_, closed), *numerical = rows.groupby(["solution", "nodes"], sort=False)
    for (above, below), quantity in zip(panels.T, ("force_uN", "area_percent"), strict=True):
        exact = closed[quantity].to_numpy()
        for (kernel, nodes), curve in numerical:
            label = f"{kernel}, {nodes} × {nodes}"
            style = {"color": COLOURS[kernel], "dashes": DASHES[nodes], "label": label}
            values = curve[quantity].to_numpy()
            above.plot(curve["delta_um"], values, **style)
            below.plot(curve["delta_um"], 100 * (values - exact) / exact[-1], **style)
        above.plot(closed["delta_um"], exact, "k:", lw=2, label="Hertz")
        below.axhline(0, color="k", ls=":", lw=2)
        below.set(xlabel="far-field displacement Δ [µm]", xlim=(0, LARGEST_DELTA))
    (force, area), (force_off, area_off) = panels
    force.set(ylabel="force F [µN], E* = 1 MPa", ylim=(0, None), title="(a) contact force")
    area.set(ylabel="contact area [% of the nodes]", ylim=(0, None), title="(b) contact area")
    force_off.set(ylabel="deviation of F\n[% of Hertz's at Δ = 1 µm]")
    area_off.set(ylabel="deviation of the area\n[% of Hertz's at Δ = 1 µm]")
    force.legend()
    figure.align_ylabels()
    return figure
