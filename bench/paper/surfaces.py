"""The paper's pictures of surfaces and of a paraboloid, and two equal models (Appendix A)."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bem
from bench.paper.facts import AREA_MAX, DELTAS, GRIDS, rows_of
from bench.picture import COLOURS, new_figure
from bench.report import Report
from gen.arrays import Heights
from gen.distribution import limits
from gen.quantities import AREA, DELTA, FORCE
from gen.scene import load
from gen.statistics import describe
from gen.surface import GENERATORS, DisplacedSurface, generate
from learn import dataset, split
from learn.dataset import Request
from learn.metrics import scores
from learn.models import MODELS, pipeline

SEED = 3
_PAPER = load("paper").surface
assert isinstance(_PAPER, DisplacedSurface)
PRESET = _PAPER
SIDE, NODES = PRESET.side, PRESET.nodes
ROUGH, SMOOTH = limits(PRESET.hurst)
# The middle of the preset's range [um].
SIGMA0 = sum(limits(PRESET.sigma0)) / 2
ALONG, ACROSS = (
    ((-1, 0), (1, 0)),
    ((0, -1), (0, 1)),
)  # neighbours in profiles along x and along y


def shown_surface(
    hurst: float, generator: str = "diamond-square", nodes: int = NODES
) -> Heights:
    """Return the heights, shape (nodes, nodes), of the surface that all pictures show [um]."""
    return generate(generator, nodes, hurst, SIGMA0, np.random.default_rng(SEED))


def above(heights: Heights, *offsets: tuple[int, int]) -> NDArray[np.bool_]:
    """Mark the nodes that are above all of their neighbours, given by places relative to a node.

    Nodes at the border are not marked.
    """
    padded = np.pad(heights, 1, constant_values=np.nan)  # no number is above NaN
    nx, ny = heights.shape
    neighbours = (padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny] for i, j in offsets)
    return np.asarray(np.all([heights > neighbour for neighbour in neighbours], axis=0))


def levels() -> Report:
    """Draw one surface at four levels, by both generators (section 2.2)."""
    figure = new_figure(10.5, 4.9)
    axes = figure.subplots(len(GENERATORS), len(GRIDS))
    rows = []
    for line, generator in zip(axes, GENERATORS, strict=True):
        grids = [
            shown_surface((ROUGH + SMOOTH) / 2, generator, cells + 1) for cells in GRIDS
        ]
        highest = max(float(heights.max()) for heights in grids)
        for axis, cells, heights in zip(line, GRIDS, grids, strict=True):
            shown = _image(axis, heights, vmin=0, vmax=highest)
            axis.set_title(f"{cells} × {cells}", fontsize=10)
            axis.set_xlabel("x [µm]")
            rows.append(
                (generator, cells, cells + 1, float(heights.std()), float(heights.max()))
            )
        figure.colorbar(shown, ax=line, label="height [µm]", shrink=0.9)
        line[0].set_ylabel(f"{generator}\ny [µm]")
    header = (
        "generator",
        "cells_a_side",
        "nodes_a_side",
        "rms_height_um",
        "largest_height_um",
    )
    return Report({"levels": rows_of(header, rows)}, {"levels": figure})


def profile() -> Report:
    """Draw a topography and one of its profiles, statistics marked (section 2.3)."""
    heights = shown_surface(ROUGH)
    middle = NODES // 2
    x, line = np.linspace(0, SIDE, NODES), heights[:, middle]
    peaks = above(heights, *ALONG)[:, middle]
    asperities = above(heights, *ALONG, *ACROSS)
    figure = new_figure(11, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.7))
    figure.colorbar(_image(left, heights), ax=left, label="height [µm]")
    left.axhline(x[middle], color="w", lw=1.5)
    left.plot(*(x[places] for places in np.nonzero(asperities)), "w.", ms=1.2)
    left.set(
        title="(a) topography: asperities, a profile", xlabel="x [µm]", ylabel="y [µm]"
    )
    _draw_profile(right, x, line, peaks, asperities[:, middle])
    values = describe(heights, PRESET.side / (NODES - 1)).values
    number = round(values["peak_density"] * 2 * heights.size)
    counted = (
        (
            "profile peaks, this profile",
            int(peaks.sum()),
            line[peaks].mean(),
            line[peaks].std(),
        ),
        ("profile peaks, all profiles", number, values["peak_mean"], values["peak_rms"]),
        ("asperities", asperities.sum(), values["asperity_mean"], values["asperity_rms"]),
        ("all nodes", heights.size, values["height_mean"], values["height_rms"]),
    )
    header = ("of", "number", "mean_height_um", "rms_um")
    return Report({"profile": rows_of(header, counted)}, {"profile": figure})


def _draw_profile(
    axis: Any,
    x: Heights,
    line: Heights,
    peaks: NDArray[np.bool_],
    asperities: NDArray[np.bool_],
) -> None:
    """Draw a profile, its peaks and their statistics."""
    heights = line[peaks]
    mean, rms, top = (
        float(each) for each in (heights.mean(), heights.std(), heights.max())
    )
    circles = {"ms": 8, "mfc": "none", "color": COLOURS[1]}
    axis.plot(x, line, color="0.45", lw=1, label="profile")
    axis.plot(x[peaks], heights, "^", ms=4, color=COLOURS[0], label="peaks")
    axis.plot(x[asperities], line[asperities], "o", label="also asperities", **circles)
    axis.axhspan(mean - rms, mean + rms, color=COLOURS[5], alpha=0.25, lw=0)
    axis.axhline(
        mean, color=COLOURS[0], ls="--", label=f"mean of peaks {mean:.3g} ± {rms:.2g} µm"
    )
    axis.axhline(top, color="k", ls=":", label=f"highest peak {top:.3g} µm")
    axis.set(
        title="(b) the profile", xlabel="x [µm]", ylabel="height [µm]", xlim=(x[0], x[-1])
    )
    axis.margins(y=0.25)
    axis.legend(ncols=2, fontsize=8, loc="upper center")


def topographies() -> Report:
    """Draw two topographies, and the forces on their nodes at two displacements (section 2.4)."""
    small, large = DELTAS
    cases = [("ad", ROUGH, small), ("be", ROUGH, large), ("cf", SMOOTH, small)]
    figure = new_figure(10.5, 6.6)
    axes = figure.subplots(2, len(cases))
    surfaces = [shown_surface(hurst) for _, hurst, _ in cases]
    pairs = zip(surfaces, cases, strict=True)
    pressed = [bem.solve(heights, SIDE, delta) for heights, (*_, delta) in pairs]
    fields = [contact.pressure * (SIDE / (NODES - 1)) ** 2 for contact in pressed]
    highest, strongest = (
        max(float(each.max()) for each in both) for both in (surfaces, fields)
    )
    rows = []
    together = zip(axes.T, cases, surfaces, pressed, fields, strict=True)
    for (upper, lower), (names, hurst, delta), heights, contact, force in together:
        shown = _image(upper, heights, vmin=0, vmax=highest)
        upper.set_title(f"({names[0]}) H = {hurst:g}", fontsize=10)
        spots = np.ma.masked_equal(force, 0)
        forces = _image(lower, spots, vmin=0, vmax=strongest, cmap="inferno_r")
        area = contact.area_percent
        lower.set_title(f"({names[1]}) Δ = {delta:g} µm: area {area:.2f} %", fontsize=10)
        lower.set_xlabel("x [µm]")
        numbers = (area, contact.force, float(force.max()), contact.residual)
        rows.append((", ".join(names), hurst, delta, *numbers))
    labels = "height [µm]", "force on a node [µN], E* = 1 MPa"
    for line, drawn, label in zip(axes, (shown, forces), labels, strict=True):
        line[0].set_ylabel("y [µm]")
        figure.colorbar(drawn, ax=line, label=label)
    header = (
        "panels",
        "hurst",
        DELTA.in_tables,
        AREA.name,
        FORCE.in_tables,
        "largest_uN",
        "residual",
    )
    return Report({"topographies": rows_of(header, rows)}, {"topographies": figure})


def _image(axis: Any, field: Any, **options: Any) -> Any:
    """Draw a field of nodes, x (axis 0) to the right."""
    return axis.imshow(field.T, origin="lower", extent=(0, SIDE, 0, SIDE), **options)


APPENDIX_ROWS = 3000
"""Training rows of Appendix A at most: that two predictions agree needs no more, and a Gaussian
process's memory grows with their square."""


def equal_kernels(database: Path) -> Report:
    """Fit Gaussian process and kernel ridge with equal kernels: they predict alike (Appendix A).

    Case 1 has a radial basis function of length 1, which is gamma = 1/2, and 1e-10 on the diagonal.
    Case 2 has the linear kernel; the paper gives it no noise, but a linear kernel of 23 inputs is
    singular then, so both get 1, the default of kernel ridge.
    """
    from sklearn.gaussian_process.kernels import RBF, DotProduct

    radial = RBF(1.0, "fixed"), {"kernel": "rbf", "gamma": 0.5, "alpha": 1e-10}
    linear = DotProduct(0.0, "fixed"), {"kernel": "linear", "alpha": 1.0}
    cases = {"radial basis function": radial, "linear": linear}
    (rows,) = dataset.read(Request((database,), area_max=AREA_MAX))
    parts = split.draw(rows, 0, APPENDIX_ROWS)
    test, truth = rows.inputs[parts.test], rows.target[parts.test]
    figure = new_figure(8.7, 8.2)
    lines: list[tuple[str, float, float, float]] = []
    for panels, (case, (kernel, ridge)) in zip(
        figure.subplots(2, 2), cases.items(), strict=True
    ):
        process = {"kernel": kernel, "alpha": ridge["alpha"]}
        both = []
        for name, settings in (("gaussian-process", process), ("kernel-ridge", ridge)):
            model = pipeline(MODELS[name], settings)
            model.fit(rows.inputs[parts.train], rows.target[parts.train])
            both.append(np.asarray(model.predict(test), dtype=float))
        off = np.abs(both[0] - both[1])
        largest = float(off.max() / np.abs(truth).max())
        lines.append(
            (case, scores(truth, both[0]).r2, scores(truth, both[1]).r2, largest)
        )
        panels[0].plot(
            truth, both[0], "o", ms=4, mew=0.5, mfc="none", label="Gaussian process"
        )
        panels[0].plot(truth, both[1], ".", ms=2, label="kernel ridge")
        panels[0].set(xlabel="solved area [%]", ylabel="predicted area [%]", title=case)
        panels[0].legend()
        panels[1].semilogy(truth, off + 1e-18, ".", ms=3)
        panels[1].set(
            xlabel="solved area [%]", ylabel="difference of the predictions [%]"
        )
    header = ("case", "gp_r2", "ridge_r2", "largest_difference")
    return Report({"appendix": rows_of(header, lines)}, {"appendix": figure})
