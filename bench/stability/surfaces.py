"""Cases of the generators and of the 22 statistics, judged without `gen`."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bench.references import exact
from bench.references.half_space import Field
from bench.stability.case import Answer, Case, Finding
from bench.stability.setup import checkerboard
from gen.statistics import NAMES, Description, describe
from gen.surface import GENERATORS, generate

Spacing = tuple[float, float]
"""Spacings of the nodes along x and y [um]."""

SEED = 3
"""Seed of the surfaces of the generators' cases."""

NODES = 33
"""Nodes a side of the surfaces, unless a case is about another grid."""

PAPER_SPACING = 7.8125
"""Spacing of the nodes of the paper's surfaces [um]."""

STEP = 1 / 1024
"""Steps of heights, a power of two, so that offsets are added to them without rounding [um]."""

EXACT = 1e-12
"""Largest relative error of a statistic through a few hundred roundings [1]."""

ROUNDING = 1e-14
"""Largest error of heights through roundings at all levels of a grid [range of heights]."""

WITH_UNIT = {name for name in NAMES if name.split("_")[-1] in {"mean", "rms", "max"}}
"""Names of the statistics with a unit: heights [um] and curvatures [um-1]."""

CURVATURES = {name for name in WITH_UNIT if "curvature" in name}
"""Names of the statistics with the unit um-1."""

SHAPES = {name for name in NAMES if "kurtosis" in name or "skewness" in name}
"""Names of the kurtoses and skewnesses [1]."""

HURSTS = {
    "0": 0.0,
    "5e-324": 5e-324,
    "1e-3": 1e-3,
    "1 - 1e-3": 0.999,
    "1 less one ulp": math.nextafter(1.0, 0.0),
    "1": 1.0,
}
"""Hurst exponents by their names; some are the floats next to 0 and to 1 [1]."""

FACTORS = {
    "2^-40": 2.0**-40,
    "2^40": 2.0**40,
    "1e-12": 1e-12,
    "1e12": 1e12,
}
"""Factors of heights by their names [1]."""

AMPLITUDES = {"0": 0.0, **FACTORS, "1e-300": 1e-300, "1e300": 1e300}
"""Amplitudes sigma0 by their names, from zero to nearly the largest float [um]."""


def cases() -> Iterator[Case]:
    """Yield the families of the generators, then the families of the statistics."""
    yield from generator_cases()
    yield from _offsets()
    yield from _cancellation()
    yield from _sizes()
    yield from _grids()
    yield from _bodies()
    yield from _peaks()


def generator_cases() -> Iterator[Case]:
    """Yield the families of each generator."""
    for generator in GENERATORS:
        yield from _hurst_exponents(generator)
        yield from _amplitudes(generator)
        yield from _levels(generator)


def _hurst_exponents(generator: str) -> Iterator[Case]:
    """Yield Hurst exponents from 0 to 1, each on two grids."""
    for name, hurst in HURSTS.items():
        yield Case(
            family="generator: Hurst exponent",
            name=f"H = {name}, {generator}",
            input="33 x 33, beside 17 x 17",
            examine=partial(_nested, generator, NODES, hurst),
        )


def _amplitudes(generator: str) -> Iterator[Case]:
    """Yield amplitudes from 0 to nearly the largest float, beside an amplitude of 1 um."""
    for name, sigma0 in AMPLITUDES.items():
        surface = "129 x 129, H = 0.65"
        title = f"σ0 = {name}"
        if sigma0:
            surface += ", beside σ0 = 1 um"
            title += " um"
        allowed = ROUNDING
        if name.startswith(("0", "2^")):  # these factors round nothing
            allowed = 0.0
        yield Case(
            family="generator: amplitude",
            name=f"{title}, {generator}",
            input=surface,
            examine=partial(_scaled, generator, sigma0, allowed),
        )


def _levels(generator: str) -> Iterator[Case]:
    """Yield grids of 2^k + 1 nodes a side, beside the next coarser grid."""
    for k in range(1, 12):
        nodes = 2**k + 1
        grid = f"{nodes} x {nodes}, H = 0.65, σ0 = 12 um"
        yield Case(
            family="generator: levels",
            name=f"k = {k}, {generator}",
            input=f"{grid}, beside k = {max(k - 1, 1)}",
            examine=partial(_nested, generator, nodes),
        )


def _surface(
    generator: str, nodes: int, hurst: float = 0.65, sigma0: float = 12.0
) -> Field:
    """Generate heights [um] of `nodes` = 2^k + 1 nodes a side; `sigma0` is in um."""
    random = np.random.default_rng(SEED)
    return generate(generator, nodes, hurst, sigma0, random)


def _answer(heights: Field, *findings: Finding) -> Answer:
    """Return the answer of a case of a generator, with the range and the rms height in words."""
    largest = float(heights.max()) or 1.0
    # Heights are divided by the largest one, so that no squares overflow.
    rms = float((heights / largest).std()) * largest
    height_range = np.ptp(heights)
    out = f"range {height_range:.4g} um, rms {rms:.4g} um"
    return Answer(out=out, findings=findings)


def _scaled(generator: str, sigma0: float, allowed: float) -> Answer:
    """Check that heights are proportional to sigma0 [um], within `allowed` [range of heights].

    They are compared with the heights for a sigma0 of 1 um, or with 0 if `sigma0` is 0.
    """
    of_unit = _surface(generator, 129, sigma0=1.0)
    heights = _surface(generator, 129, sigma0=sigma0)
    off = heights
    if sigma0:
        off = heights / sigma0 - of_unit
    error = float(np.abs(off).max() / of_unit.max())
    finding = Finding(name="off proportion [range]", error=error, allowed=allowed)
    return _answer(heights, finding)


def _nested(generator: str, nodes: int, hurst: float = 0.65) -> Answer:
    """Check that one seed always gives one surface, also on another grid.

    A second call has to give equal heights. Heights on the next coarser grid may differ from those
    at the same places by a constant only. The lowest height has to be 0.
    """
    heights = _surface(generator, nodes, hurst)
    repeated = _surface(generator, nodes, hurst)
    coarse = _surface(generator, max((nodes + 1) // 2, 3), hurst)
    step = (nodes - 1) // (len(coarse) - 1)
    shared = heights[::step, ::step]
    # Heights above the first corner: the lowest node, at 0, may be another one on each grid.
    above_corner = shared - shared[0, 0]
    expected = coarse - coarse[0, 0]
    difference = np.abs(above_corner - expected).max()
    off = float(difference / np.ptp(heights))
    unlike = int(np.count_nonzero(heights != repeated))
    unlike += abs(heights.shape[0] - nodes)  # a grid of another size fails too
    lowest = abs(float(heights.min()))
    return _answer(
        heights,
        Finding(name="coarse nodes off [range]", error=off, allowed=ROUNDING),
        Finding(name="nodes unlike a second time", error=unlike, allowed=0),
        Finding(name="lowest height", error=lowest, allowed=0),
    )


def described(
    heights: ArrayLike, spacing: Spacing = (PAPER_SPACING, PAPER_SPACING)
) -> Answer:
    """Describe a surface, and compare the statistics with the exact ones of `exact.statistics`.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights of any type [um].
    spacing : (float, float)
        Spacings of the nodes along x and y [um].

    Returns
    -------
    Answer
        The description in words. The findings are the largest error of a statistic [1], and the
        number of statistics that only one of the two leaves undefined.
    """
    surface = np.asanyarray(heights)
    expected = exact.statistics(np.array(surface, dtype=np.float64), spacing)
    description = describe(surface, spacing)
    values = description.values
    errors = [_error(name, values[name], expected) for name in NAMES]
    worst = int(np.argmax(errors))
    undefined = {name for name in NAMES if math.isnan(values[name])}
    exactly_undefined = {name for name in NAMES if math.isnan(expected[name])}
    in_one_only = undefined ^ exactly_undefined
    unlike = [name for name in NAMES if name in in_one_only]
    findings = [
        Finding(name=f"off exact: {NAMES[worst]}", error=errors[worst], allowed=EXACT),
        Finding(
            name=", ".join(["defined unlike", *unlike]),
            error=len(unlike),
            allowed=0,
        ),
    ]
    return Answer(out=in_words(description), findings=findings)


def _error(name: str, value: float, exact_values: dict[str, float]) -> float:
    """Return the error of a statistic [1]; 0 if it or the exact value is undefined.

    The error is relative to the exact value, or to 1 for a kurtosis or skewness below 1. If the
    exact value of a height or curvature is 0, the error is relative to the largest exact value of
    the statistics with the same unit.
    """
    expected = exact_values[name]
    if value == expected or math.isnan(value) or math.isnan(expected):
        return 0.0
    if name in SHAPES:
        return abs(value - expected) / max(1.0, abs(expected))
    if expected:
        return abs(value / expected - 1)
    same_unit = CURVATURES if name in CURVATURES else WITH_UNIT - CURVATURES
    sizes = [abs(exact_values[statistic]) for statistic in same_unit]
    largest = max((size for size in sizes if not math.isnan(size)), default=0.0)
    if not largest:  # all are exactly 0, so that any other value is wrong
        return math.inf
    return abs(value) / largest


def says(heights: ArrayLike, *words: str) -> Answer:
    """Describe a surface that has undefined statistics, and check the reason that is stated.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights of any type, at the paper's spacing [um].
    *words : str
        Texts that the reason has to contain.

    Returns
    -------
    Answer
        The description in words. The findings are the number of texts that the reason lacks, and 1
        if all statistics are defined or else 0.
    """
    description = describe(np.asanyarray(heights), (PAPER_SPACING, PAPER_SPACING))
    missing = [word for word in words if word not in description.reason]
    all_defined = not any(map(math.isnan, description.values.values()))
    findings = [
        Finding(
            name=", ".join(["words missing in the reason", *missing]),
            error=len(missing),
            allowed=0,
        ),
        Finding(name="undefined without a reason", error=int(all_defined), allowed=0),
    ]
    return Answer(out=in_words(description), findings=findings)


def in_words(description: Description) -> str:
    """Put a description into a line of text.

    Parameters
    ----------
    description : Description
        The 22 statistics, with the reason why some are undefined.

    Returns
    -------
    str
        Rms height, mean height and density of asperities, then the number of undefined statistics
        and the reason, if there are any.
    """
    values = description.values
    rms = values["height_rms"]
    mean = values["height_mean"]
    density = values["asperity_density"]
    line = f"rms {rms:.4g} um, mean {mean:.4g} um"
    if not math.isnan(density):
        line += f", {density:.3g} asperities a node"
    undefined = [name for name, value in values.items() if math.isnan(value)]
    if undefined:
        line += f"; {len(undefined)} undefined ({description.reason})"
    return line


def rough(nodes: int = NODES, sigma0: float = 12.0) -> Field:
    """Generate a surface like the paper's, always the same one.

    Parameters
    ----------
    nodes : int
        Nodes a side, 2^k + 1.
    sigma0 : float
        Standard deviation of the first displacement [um].

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    random = np.random.default_rng(0)
    return generate("diamond-square", nodes, hurst=0.65, sigma0=sigma0, random=random)


def stepped(nodes: int = NODES, step: float = STEP) -> Field:
    """Round the heights of `rough` to steps, so that some are equal, and their sums are exact.

    Parameters
    ----------
    nodes : int
        Nodes a side, 2^k + 1.
    step : float
        Steps of the heights [um].

    Returns
    -------
    ndarray, shape (nodes, nodes)
        Heights [um].
    """
    return np.asarray(np.round(rough(nodes) / step) * step)


def _case(
    family: str,
    name: str,
    text: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    *words: str,
    spacing: Spacing = (PAPER_SPACING, PAPER_SPACING),
) -> Case:
    """Make a case of the statistics of heights.

    `text` is the input in words. `surface` is an array, or a function that makes it when the case
    runs. If `words` are given, some statistics have to be undefined for a reason that contains
    these texts. If not, the statistics are compared with exact ones.
    """

    def examine() -> Answer:
        """Describe the surface and judge the description."""
        heights: Any = surface() if callable(surface) else surface
        if words:
            return says(heights, *words)
        return described(heights, spacing)

    return Case(
        family=f"statistics: {family}",
        name=name,
        input=text,
        examine=examine,
    )


LOST = "heights lost in rounding"
"""Part of the reason why a surface far above or below zero has undefined statistics."""

LOST_HEIGHTS = (
    (1e14, 12.0),
    (1e16, 12.0),
    (1e8, 1e-6),
    (-1e300, 1e284),
)
"""Offsets at which rounding destroys a surface, and amplitudes sigma0 of the surface [um]."""


def _offsets() -> Iterator[Case]:
    """Yield surfaces far above or below zero, some of which rounding destroys."""
    case = partial(_case, "offset")
    grid = f"{NODES} x {NODES}"
    for offset in (1e4, -1e8, 1e8, 1e10, 1e12):
        text = f"{grid}, σ0 = 12 um in steps of 1/1024 um"
        heights = stepped() + offset
        yield case(f"{offset:g} um", text, heights)
    for offset in (1e8, 1e12):
        name = f"{offset:g} um, heights as they were rounded"
        yield case(name, f"{grid}, σ0 = 12 um", rough() + offset)
    for offset, sigma0 in LOST_HEIGHTS:
        name = f"{offset:g} um, σ0 = {sigma0:g} um: lost in rounding"
        heights = rough(sigma0=sigma0) + offset
        yield case(name, grid, heights, LOST)
    name = "1e6 um in single precision: lost in rounding"
    heights = rough() + 1e6
    yield case(name, f"{grid}, float32", heights.astype(np.float32), LOST)


def _cancellation() -> Iterator[Case]:
    """Yield surfaces with a statistic whose variance is a small difference of large numbers."""
    case = partial(_case, "cancellation")
    for spread in (1e-3, 1e-6, 1e-9, 1e-11):
        text = f"high nodes of a checkerboard differ by {spread:g} of their height"
        noise = np.random.default_rng(5).random((NODES, NODES))
        heights = checkerboard(NODES) * (1.0 + spread * noise)
        yield case(f"asperities within {spread:g}", text, heights)
    text = "the others σ0 = 12 um"
    for depth in (1e4, 1e8, 1e10):
        heights = _with(stepped(), -depth)
        yield case(f"one node {depth:g} um deep", text, heights)
    deepest = _with(stepped(), -1e16)
    yield case("one node 1e16 um deep", text, deepest, "lost in rounding")
    text = "σ0 = 12 um in steps of 1/1024 um"
    for slope in (1e3, 1e6):
        plane = slope * np.arange(NODES)
        heights = stepped() + plane[:, None]
        yield case(f"tilted by {slope:g} um a node", text, heights)


def _with(heights: Field, height: float, at: tuple[int, int] = (5, 7)) -> Field:
    """Put the node with the indices `at` at a height [um]; changes the array and returns it."""
    heights[at] = height
    return heights


SPACINGS = (
    (1e-15, 1e-15),
    (1e15, 1e15),
    (1e-15, 1e15),
    (1e15, 1e-15),
    (0.3, 0.7),
)
"""Spacings along x and y [um]."""


def _sizes() -> Iterator[Case]:
    """Yield extreme heights, and extreme spacings."""
    case = partial(_case, "size")
    factors = {**FACTORS, "1e-290": 1e-290, "1e290": 1e290}
    for name, factor in factors.items():
        yield case(f"heights times {name}", "σ0 = 12 um", rough() * factor)
    for dx, dy in SPACINGS:
        name = f"spacings {dx:g} and {dy:g} um"
        yield case(name, "σ0 = 12 um", rough(), spacing=(dx, dy))


SHAPES_OF_GRIDS = (
    (2, 2),
    (2, 3),
    (3, 2),
    (3, 3),
    (2, 129),
    (129, 2),
    (9, 100),
    (128, 17),
)
"""Nodes along x and y of grids that are not square, or have other than 2^k + 1 nodes a side."""


def _grids() -> Iterator[Case]:
    """Yield numbers of nodes, and arrays with their heights in another order in memory."""
    case = partial(_case, "grid")
    for k in range(1, 12):
        nodes = 2**k + 1
        text = f"{nodes} x {nodes}"
        surface = partial(rough, nodes)
        if k > 5:  # exact statistics of heights with few different values are much faster
            text += ", heights in steps of 1/16 um"
            surface = partial(stepped, nodes, 1 / 16)
        yield case(f"k = {k}", text, surface)
    oblong = (0.5, 2.0)
    text = "a corner of 129 x 129, g = 0.5 and 2 um"
    for rows, columns in SHAPES_OF_GRIDS:
        corner = rough(129)[:rows, :columns]
        yield case(f"{rows} x {columns}", text, corner, spacing=oblong)
    views = {
        "turned by 180°": rough()[::-1, ::-1],
        "axes swapped": rough().T,
        "turned by 90°": np.rot90(rough()),
    }
    text = "seen otherwise in memory, g = 0.5 and 2 um"
    for name, view in views.items():
        yield case(name, text, view, spacing=oblong)


def _bodies() -> Iterator[Case]:
    """Yield bodies with one peak or none.

    Each body has two cases: one about its statistics, one about the reason for undefined ones.
    """
    case = partial(_case, "feature")
    x = np.arange(NODES) - NODES // 2
    squares = x**2
    # Whole numbers over a power of two, so that no height is rounded.
    bowl = (squares[:, None] + squares) / 64
    plane = 3.0 * x[:, None] - 2.0 * x
    level = np.full((NODES, NODES), 3.3)
    far_up = np.full((9, 9), 1e308)
    for name, text, heights, word in (
        ("one peak", "a paraboloid", -bowl, "asperity or one"),
        ("no peak", "a bowl", bowl, "no asperity"),
        ("a plane", "h = 3 i - 2 j um", plane, "no asperity"),
        ("flat", "all nodes at 3.3 um", level, "flat surface"),
        ("flat, far up", "all nodes at 1e308 um", far_up, "flat surface"),
    ):
        yield case(name, text, heights)
        yield case(f"{name}: said", text, heights, word)


def _peaks() -> Iterator[Case]:
    """Yield surfaces with few peaks, equally high ones, or very different ones."""
    case = partial(_case, "feature")
    board = checkerboard(NODES)
    yield case("exact ties", "a checkerboard of 0 and 1 um", board)
    ties = board * (0.1 + 0.2) + 0.1
    yield case("ties of 0.1 + 0.2", "a checkerboard of 0.1 and 0.1 + 0.2 um", ties)
    plateaus = np.kron(stepped(17), np.ones((2, 2)))
    yield case("plateaus", "each node four times", plateaus)
    yield case("ties and steps", "heights in steps of 5 um", stepped(step=5.0))
    spike = _with(np.zeros((NODES, NODES)), 1.0)
    yield case("a spike", "flat but for one node of 1 um", spike)
    in_corner = _with(np.zeros((9, 9)), 1.0, at=(0, 0))
    yield case("a spike in a corner", "no interior node", in_corner)
    first = _with(np.zeros((9, 9)), 1.0, at=(2, 2))
    yield case("two spikes", "of 1 and 2 um", _with(first, 2.0, at=(5, 5)))
    ridges = np.repeat(stepped()[:, :1], 9, axis=1)
    yield case("ridges", "profiles along y flat", ridges)
    noise = np.random.default_rng(1).standard_normal((NODES, NODES))
    yield case("white noise", "σ = 1 um", noise)
    outlier = _with(stepped(), 1e6)
    yield case("an outlier", "one node of 1e6 um, the others σ0 = 12 um", outlier)
