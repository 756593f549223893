"""The paper's pictures of surfaces (sections 2.2 to 2.4), and two equal models (Appendix A).

The paper does not give its random numbers. So our pictures show other surfaces, of the paper's
kinds and parameters.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import bem
from bench.files import Row
from bench.paper.facts import AREA_MAX, DELTAS, GRIDS
from bench.picture import COLOURS, new_figure
from bench.report import Report
from gen.arrays import Heights, Values
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
"""Seed of the random numbers of the surface that all pictures show."""

_PAPER = load("paper").surface
assert isinstance(_PAPER, DisplacedSurface)

PRESET = _PAPER
"""The table `surface` of the paper preset, with the ranges of its parameters."""

SIDE = PRESET.side
"""Scan length [um]."""

NODES = PRESET.nodes
"""Nodes a side."""

ROUGH, SMOOTH = limits(PRESET.hurst)
"""Smallest and largest Hurst exponent of the preset: the roughest and the smoothest surfaces."""

SIGMA0 = sum(limits(PRESET.sigma0)) / 2
"""Middle of the preset's range of sigma0 [um]."""

Offset = tuple[int, int]
"""Position of a neighbour relative to a node: numbers of nodes along x and along y."""

ALONG: tuple[Offset, ...] = ((-1, 0), (1, 0))
"""The two neighbours of a node in a profile along x."""

ACROSS: tuple[Offset, ...] = ((0, -1), (0, 1))
"""The two neighbours of a node in a profile along y."""


def shown_surface(
    hurst: float, generator: str = "diamond-square", nodes: int = NODES
) -> Heights:
    """Generate the surface that all pictures show, at a Hurst exponent and on a grid.

    Parameters
    ----------
    hurst : float
        The generator's Hurst exponent.
    generator : str
        One of `GENERATORS`.
    nodes : int
        Nodes a side, 2^k + 1. A finer grid keeps the nodes of a coarser one.

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    return generate(generator, nodes, hurst, SIGMA0, np.random.default_rng(SEED))


def above(heights: Heights, *offsets: Offset) -> NDArray[np.bool_]:
    """Mark the nodes that are higher than all of their neighbours.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights, in any unit.
    *offsets : pair of int
        Positions of the neighbours relative to the node: -1, 0 or 1 along x and along y.

    Returns
    -------
    ndarray of bool, shape (nx, ny)
        True for a node that is higher than all of these neighbours. A node at the border that lacks
        one of them is not marked.
    """
    # No number is higher than NaN.
    padded = np.pad(heights, 1, constant_values=np.nan)
    nx, ny = heights.shape
    is_above = np.ones((nx, ny), dtype=bool)
    for i, j in offsets:
        neighbours = padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny]
        is_above &= heights > neighbours
    return is_above


def levels() -> Report:
    """Draw one surface on finer and finer grids, by both generators (section 2.2).

    Returns
    -------
    Report
        Table and picture `levels`: a line of panels for each of `GENERATORS`, a panel for each of
        `GRIDS`.
    """
    figure = new_figure(10.5, 4.9)
    axes = figure.subplots(len(GENERATORS), len(GRIDS))
    rows: list[Row] = []
    for line, generator in zip(axes, GENERATORS, strict=True):
        grids = [
            shown_surface((ROUGH + SMOOTH) / 2, generator, cells + 1) for cells in GRIDS
        ]
        highest = max(float(heights.max()) for heights in grids)
        for axis, cells, heights in zip(line, GRIDS, grids, strict=True):
            image = _draw_field(axis, heights, vmin=0, vmax=highest)
            axis.set_title(f"{cells} × {cells}", fontsize=10)
            axis.set_xlabel("x [µm]")
            rows.append(
                {
                    "generator": generator,
                    "cells_a_side": cells,
                    "nodes_a_side": cells + 1,
                    "rms_height_um": float(heights.std()),
                    "largest_height_um": float(heights.max()),
                }
            )
        figure.colorbar(image, ax=line, label="height [µm]", shrink=0.9)
        line[0].set_ylabel(f"{generator}\ny [µm]")
    return Report({"levels": rows}, pictures={"levels": figure})


def profile() -> Report:
    """Draw a topography and one of its profiles, with peaks and asperities (section 2.3).

    Returns
    -------
    Report
        Table and picture `profile`.
    """
    heights = shown_surface(ROUGH)
    asperities = above(heights, *ALONG, *ACROSS)
    middle = NODES // 2  # index along y of the profile
    shown = _Profile(
        x=np.linspace(0, SIDE, NODES),
        heights=heights[:, middle],
        peaks=above(heights, *ALONG)[:, middle],
        asperities=asperities[:, middle],
    )
    figure = new_figure(11, 4.2)
    map_axis, profile_axis = figure.subplots(1, 2, width_ratios=(1, 1.7))
    figure.colorbar(_draw_field(map_axis, heights), ax=map_axis, label="height [µm]")
    map_axis.axhline(shown.x[middle], color="w", lw=1.5)
    ix, iy = np.nonzero(asperities)
    map_axis.plot(shown.x[ix], shown.x[iy], "w.", ms=1.2)
    map_axis.set(
        title="(a) topography: asperities, a profile", xlabel="x [µm]", ylabel="y [µm]"
    )
    _draw_profile(profile_axis, shown)
    rows = _rows_of_profile(heights, shown, number_of_asperities=int(asperities.sum()))
    return Report({"profile": rows}, pictures={"profile": figure})


@dataclass(frozen=True, eq=False)
class _Profile:
    """A profile along x of n nodes."""

    x: Values  # (n,) places of the nodes [um]
    heights: Heights  # (n,) heights of the nodes [um]
    peaks: NDArray[np.bool_]  # (n,) True for nodes above both neighbours in the profile
    # (n,) True for nodes above all four neighbours in the surface.
    asperities: NDArray[np.bool_]


def _rows_of_profile(
    heights: Heights, shown: _Profile, number_of_asperities: int
) -> list[Row]:
    """Return the rows of the table `profile`, one for each kind of nodes.

    The kinds are the peaks of the shown profile, the peaks of all profiles, asperities, and all
    nodes. A row has the number of nodes, their mean height and the rms of their heights [um].
    `heights` are those of the surface.
    """
    statistics = describe(heights, PRESET.side / (NODES - 1)).values
    peak_heights = shown.heights[shown.peaks]
    return [
        {
            "of": "profile peaks, this profile",
            "number": int(shown.peaks.sum()),
            "mean_height_um": peak_heights.mean(),
            "rms_um": peak_heights.std(),
        },
        {
            "of": "profile peaks, all profiles",
            # The density is the number of peaks of all profiles, along x and along y, over twice
            # the number of nodes.
            "number": round(statistics["peak_density"] * 2 * heights.size),
            "mean_height_um": statistics["peak_mean"],
            "rms_um": statistics["peak_rms"],
        },
        {
            "of": "asperities",
            "number": number_of_asperities,
            "mean_height_um": statistics["asperity_mean"],
            "rms_um": statistics["asperity_rms"],
        },
        {
            "of": "all nodes",
            "number": heights.size,
            "mean_height_um": statistics["height_mean"],
            "rms_um": statistics["height_rms"],
        },
    ]


def _draw_profile(axis: Any, shown: _Profile) -> None:
    """Draw a profile with its peaks and asperities, and the mean, rms and largest peak height."""
    peak_heights = shown.heights[shown.peaks]
    peak_places = shown.x[shown.peaks]
    mean = float(peak_heights.mean())
    rms = float(peak_heights.std())
    highest = float(peak_heights.max())
    axis.plot(shown.x, shown.heights, color="0.45", lw=1, label="profile")
    axis.plot(peak_places, peak_heights, "^", ms=4, color=COLOURS[0], label="peaks")
    axis.plot(
        shown.x[shown.asperities],
        shown.heights[shown.asperities],
        "o",
        label="also asperities",
        ms=8,
        mfc="none",
        color=COLOURS[1],
    )
    axis.axhspan(mean - rms, mean + rms, color=COLOURS[5], alpha=0.25, lw=0)
    mean_label = f"mean of peaks {mean:.3g} ± {rms:.2g} µm"
    axis.axhline(mean, color=COLOURS[0], ls="--", label=mean_label)
    axis.axhline(highest, color="k", ls=":", label=f"highest peak {highest:.3g} µm")
    axis.set(
        title="(b) the profile",
        xlabel="x [µm]",
        ylabel="height [µm]",
        xlim=(shown.x[0], shown.x[-1]),
    )
    axis.margins(y=0.25)
    axis.legend(ncols=2, fontsize=8, loc="upper center")


@dataclass(frozen=True, eq=False)
class _Pressed:
    """A surface that is pressed at a displacement, with the letters of its two panels."""

    panels: str  # letters of the panels of topography and forces, as "ad"
    hurst: float  # the generator's Hurst exponent
    delta: float  # far-field displacement [um]
    heights: Heights  # (n, n) [um]
    contact: bem.Contact  # solved for E* = 1 MPa

    @property
    def forces(self) -> Values:
        """Force on each node for E* = 1 MPa, shape (n, n) [uN]."""
        spacing = SIDE / (NODES - 1)
        return np.asarray(self.contact.pressure * spacing**2)


def _pressed(panels: str, hurst: float, delta: float) -> _Pressed:
    """Press the surface that all pictures show; see the fields of `_Pressed`."""
    heights = shown_surface(hurst)
    return _Pressed(
        panels=panels,
        hurst=hurst,
        delta=delta,
        heights=heights,
        contact=bem.solve(heights, SIDE, delta),
    )


def topographies() -> Report:
    """Draw three topographies, each above the forces on its nodes (section 2.4).

    The rough surface is pressed at two displacements, the smooth one at the smaller of them.

    Returns
    -------
    Report
        Table and picture `topographies`.
    """
    small, large = DELTAS
    cases = [
        _pressed("ad", ROUGH, small),
        _pressed("be", ROUGH, large),
        _pressed("cf", SMOOTH, small),
    ]
    highest = max(float(case.heights.max()) for case in cases)
    strongest = max(float(case.forces.max()) for case in cases)
    figure = new_figure(10.5, 6.6)
    axes = figure.subplots(2, len(cases))
    for (upper, lower), case in zip(axes.T, cases, strict=True):
        topography = _draw_field(upper, case.heights, vmin=0, vmax=highest)
        upper.set_title(f"({case.panels[0]}) H = {case.hurst:g}", fontsize=10)
        spots = np.ma.masked_equal(case.forces, 0)  # nodes out of contact stay white
        forces = _draw_field(lower, spots, vmin=0, vmax=strongest, cmap="inferno_r")
        area = f"area {case.contact.area_percent:.2f} %"
        lower.set_title(f"({case.panels[1]}) Δ = {case.delta:g} µm: {area}", fontsize=10)
        lower.set_xlabel("x [µm]")
    for line, image, label in (
        (axes[0], topography, "height [µm]"),
        (axes[1], forces, "force on a node [µN], E* = 1 MPa"),
    ):
        line[0].set_ylabel("y [µm]")
        figure.colorbar(image, ax=line, label=label)
    rows: list[Row] = [
        {
            "panels": ", ".join(case.panels),
            "hurst": case.hurst,
            DELTA.in_tables: case.delta,
            AREA.name: case.contact.area_percent,
            FORCE.in_tables: case.contact.force,
            "largest_uN": float(case.forces.max()),
            "residual": case.contact.residual,
        }
        for case in cases
    ]
    return Report({"topographies": rows}, pictures={"topographies": figure})


def _draw_field(axis: Any, field: Any, **options: Any) -> Any:
    """Draw a field of nodes, shape (nx, ny), with x to the right; return matplotlib's image.

    `options` are those of `Axes.imshow`.
    """
    return axis.imshow(field.T, origin="lower", extent=(0, SIDE, 0, SIDE), **options)


APPENDIX_ROWS = 3000
"""Largest number of training rows of Appendix A. More are not needed to see that two predictions
agree, and the memory of a Gaussian process grows with their square."""


class _EqualModels(NamedTuple):
    """A Gaussian process and a kernel ridge that predict equal values."""

    kernel: Any  # scikit-learn's kernel of the Gaussian process
    # Settings of kernel ridge. Their `alpha` is also the noise of the Gaussian process.
    ridge: dict[str, Any]


def _equal_models() -> dict[str, _EqualModels]:
    """Return the two cases of Appendix A by the names of their kernels.

    The radial basis function has length 1, which is gamma = 1/2 of kernel ridge, and a noise of
    1e-10 on the diagonal. In the paper the linear kernel has no noise. With 23 inputs its matrix
    would then be singular, so that both models get a noise of 1, the default of kernel ridge.
    """
    from sklearn.gaussian_process.kernels import RBF, DotProduct

    return {
        "radial basis function": _EqualModels(
            kernel=RBF(1.0, "fixed"),
            ridge={"kernel": "rbf", "gamma": 0.5, "alpha": 1e-10},
        ),
        "linear": _EqualModels(
            kernel=DotProduct(0.0, "fixed"),
            ridge={"kernel": "linear", "alpha": 1.0},
        ),
    }


def equal_kernels(database: Path) -> Report:
    """Compare a Gaussian process and kernel ridge with equal kernels (Appendix A).

    Their predictions are equal, except for rounding.

    Parameters
    ----------
    database : Path
        A database of the paper preset.

    Returns
    -------
    Report
        Table and picture `appendix`.

    Raises
    ------
    InputError
        If the database has too few usable rows.
    """
    (rows,) = dataset.read(Request((database,), area_max=AREA_MAX))
    parts = split.draw(rows, seed=0, train_rows=APPENDIX_ROWS)
    truth = rows.target[parts.test]

    def predicted(name: str, settings: dict[str, Any]) -> Values:
        """Fit the model of this name to the training part, and return predictions for the test."""
        model = pipeline(MODELS[name], settings)
        model.fit(rows.inputs[parts.train], rows.target[parts.train])
        return np.asarray(model.predict(rows.inputs[parts.test]), dtype=float)

    figure = new_figure(8.7, 8.2)
    axes = figure.subplots(2, 2)
    lines: list[Row] = []
    for (areas, differences), (case, models) in zip(
        axes, _equal_models().items(), strict=True
    ):
        process_settings = {"kernel": models.kernel, "alpha": models.ridge["alpha"]}
        process = predicted("gaussian-process", process_settings)
        ridge = predicted("kernel-ridge", models.ridge)
        difference = np.abs(process - ridge)
        lines.append(
            {
                "case": case,
                "gp_r2": scores(truth, process).r2,
                "ridge_r2": scores(truth, ridge).r2,
                "largest_difference": float(difference.max() / np.abs(truth).max()),
            }
        )
        areas.plot(
            truth, process, "o", ms=4, mew=0.5, mfc="none", label="Gaussian process"
        )
        areas.plot(truth, ridge, ".", ms=2, label="kernel ridge")
        areas.set(xlabel="solved area [%]", ylabel="predicted area [%]", title=case)
        areas.legend()
        # A difference of 0 has no logarithm, so that a very small number is added.
        differences.semilogy(truth, difference + 1e-18, ".", ms=3)
        differences.set(
            xlabel="solved area [%]", ylabel="difference of the predictions [%]"
        )
    return Report({"appendix": lines}, pictures={"appendix": figure})
