"""Cases of the generators and of the 22 statistics, judged without `gen`."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
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

SEED = 3
NODES = 33  # nodes a side of most surfaces
G = 7.8125  # spacing of the paper's nodes [um]
STEP = 1 / 1024  # steps of heights that are to take offsets exactly [um]
EXACT = 1e-12  # what a few hundred roundings may add up to, relative to each statistic
ROUNDING = (
    1e-14  # what the roundings of a few levels may add up to, over the range of heights
)

LENGTHS = {name for name in NAMES if name.split("_")[-1] in {"mean", "rms", "max"}}
CURVATURES = {name for name in LENGTHS if "curvature" in name}
SHAPES = {name for name in NAMES if "kurtosis" in name or "skewness" in name}

# As near to 0 and 1 as numbers go.
HURSTS = {"0": 0.0, "5e-324": 5e-324, "1e-3": 1e-3, "1 - 1e-3": 0.999}
HURSTS |= {"1 less one ulp": math.nextafter(1.0, 0.0), "1": 1.0}
FACTORS = {"2^-40": 2.0**-40, "2^40": 2.0**40, "1e-12": 1e-12, "1e12": 1e12}
# From nothing to all that numbers hold [um].
AMPLITUDES = {"0": 0.0} | FACTORS | {"1e-300": 1e-300, "1e300": 1e300}


def cases() -> Iterator[Case]:
    """Yield the generators' families, then those of the statistics."""
    yield from generator_cases()
    yield from chain(_offsets(), _cancellation(), _sizes(), _grids(), _features())


def generator_cases() -> Iterator[Case]:
    """Yield the families of each generator."""
    for generator in GENERATORS:
        for name, hurst in HURSTS.items():
            examine = partial(_nested, generator, NODES, hurst)
            title = f"H = {name}, {generator}"
            yield Case(
                "generator: Hurst exponent", title, "33 x 33, beside 17 x 17", examine
            )
        for name, sigma0 in AMPLITUDES.items():
            asked = "129 x 129, H = 0.65" + ", beside σ0 = 1 um" * bool(sigma0)
            allowed = 0.0 if name.startswith(("0", "2^")) else ROUNDING
            title = f"σ0 = {name}{' um' * bool(sigma0)}, {generator}"
            examine = partial(_scaled, generator, sigma0, allowed)
            yield Case("generator: amplitude", title, asked, examine)
        for k in range(1, 12):
            nodes = 2**k + 1
            asked = f"{nodes} x {nodes}, H = 0.65, σ0 = 12 um, beside k = {max(k - 1, 1)}"
            examine = partial(_nested, generator, nodes)
            yield Case("generator: levels", f"k = {k}, {generator}", asked, examine)


def _surface(
    generator: str, nodes: int, hurst: float = 0.65, sigma0: float = 12.0
) -> Field:
    return generate(generator, nodes, hurst, sigma0, np.random.default_rng(SEED))


def _answer(heights: Field, *findings: Finding) -> Answer:
    largest = float(heights.max()) or 1.0
    rms = float((heights / largest).std()) * largest  # without the overflow of squares
    return Answer(f"range {np.ptp(heights):.4g} um, rms {rms:.4g} um", findings)


def _scaled(generator: str, sigma0: float, allowed: float) -> Answer:
    """Heights are proportional to sigma0."""
    unit, heights = (_surface(generator, 129, sigma0=each) for each in (1.0, sigma0))
    error = float(
        np.abs(heights / (sigma0 or 1.0) - unit * bool(sigma0)).max() / unit.max()
    )
    return _answer(heights, Finding("off proportion [range]", error, allowed))


def _nested(generator: str, nodes: int, hurst: float = 0.65) -> Answer:
    """The same seed gives the same coarse nodes, the same bits, and the lowest node is 0."""
    heights, again = (_surface(generator, nodes, hurst) for _ in range(2))
    coarse = _surface(generator, max((nodes + 1) // 2, 3), hurst)
    step = (nodes - 1) // (len(coarse) - 1)
    shared = heights[::step, ::step]
    off = np.abs((shared - shared[0, 0]) - (coarse - coarse[0, 0])).max() / np.ptp(
        heights
    )
    unlike = int(np.count_nonzero(heights != again)) + abs(heights.shape[0] - nodes)
    return _answer(
        heights,
        Finding("coarse nodes off [range]", float(off), ROUNDING),
        Finding("nodes unlike a second time", unlike, 0),
        Finding("lowest height", abs(float(heights.min())), 0),
    )


def described(heights: ArrayLike, spacing: Spacing = (G, G)) -> Answer:
    """Describe a surface of any type, and compare with whole numbers."""
    given = np.asanyarray(heights)
    expected = exact.statistics(np.array(given, dtype=np.float64), spacing)
    found = describe(given, spacing)
    errors = [
        _error(name, found.values[name], expected[name], expected) for name in NAMES
    ]
    worst = int(np.argmax(errors))
    unlike = [n for n in NAMES if math.isnan(found.values[n]) != math.isnan(expected[n])]
    error = Finding(f"off exact: {NAMES[worst]}", errors[worst], EXACT)
    undefined = Finding(", ".join(["defined unlike", *unlike]), len(unlike), 0)
    return Answer(in_words(found), [error, undefined])


def _error(name: str, value: float, expected: float, beside: dict[str, float]) -> float:
    """Relative, over 1 or the largest of its kind where the expected value is smaller."""
    if value == expected or math.isnan(value) or math.isnan(expected):
        return 0.0
    if name in SHAPES:
        return abs(value - expected) / max(1.0, abs(expected))
    if expected:
        return abs(value / expected - 1)
    kind = CURVATURES if name in CURVATURES else LENGTHS - CURVATURES
    largest = max(
        (abs(beside[each]) for each in kind if beside[each] == beside[each]), default=0.0
    )
    return abs(value) / largest if largest else math.inf


def says(heights: ArrayLike, *words: str) -> Answer:
    """Describe a surface that does not define everything, for a reason with these words."""
    found = describe(np.asanyarray(heights), (G, G))
    missing = [word for word in words if word not in found.reason]
    said = Finding(", ".join(["words missing in the reason", *missing]), len(missing), 0)
    defined = not any(map(math.isnan, found.values.values()))
    return Answer(
        in_words(found), [said, Finding("undefined without a reason", int(defined), 0)]
    )


def in_words(found: Description) -> str:
    """Return the result in a line."""
    values = found.values
    said = f"rms {values['height_rms']:.4g} um, mean {values['height_mean']:.4g} um"
    if not math.isnan(values["asperity_density"]):
        said += f", {values['asperity_density']:.3g} asperities a node"
    undefined = sum(map(math.isnan, values.values()))
    return f"{said}; {undefined} undefined ({found.reason})" if undefined else said


def rough(nodes: int = NODES, sigma0: float = 12.0) -> Field:
    """Make a surface of the paper's kind."""
    return generate("diamond-square", nodes, 0.65, sigma0, np.random.default_rng(0))


def stepped(nodes: int = NODES, step: float = STEP) -> Field:
    """Make the same on steps: heights that tie, whose sums and differences are exact."""
    return np.asarray(np.round(rough(nodes) / step) * step)


def _case(
    family: str,
    name: str,
    asked: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    *words: str,
    spacing: Spacing = (G, G),
) -> Case:
    """Make a case of heights, or of a function that makes them when it is run.

    With words the surface has to be undefined for that reason, else it is compared with whole
    numbers.
    """

    def examine() -> Answer:
        heights: Any = surface() if callable(surface) else surface
        return says(heights, *words) if words else described(heights, spacing)

    return Case(f"statistics: {family}", name, asked, examine)


def _offsets() -> Iterator[Case]:
    case = partial(_case, "offset")
    for offset in (1e4, -1e8, 1e8, 1e10, 1e12):
        asked = f"{NODES} x {NODES}, σ0 = 12 um in steps of 1/1024 um"
        yield case(f"{offset:g} um", asked, stepped() + offset)
    for offset in (1e8, 1e12):
        name = f"{offset:g} um, heights as they were rounded"
        yield case(name, f"{NODES} x {NODES}, σ0 = 12 um", rough() + offset)
    lost = "heights lost in rounding"
    for offset, sigma0 in ((1e14, 12.0), (1e16, 12.0), (1e8, 1e-6), (-1e300, 1e284)):
        name, far = f"{offset:g} um, σ0 = {sigma0:g} um", rough(sigma0=sigma0) + offset
        yield case(f"{name}: lost in rounding", f"{NODES} x {NODES}", far, lost)
    name, far = "1e6 um in single precision", (rough() + 1e6).astype(np.float32)
    yield case(f"{name}: lost in rounding", f"{NODES} x {NODES}, float32", far, lost)


def _cancellation() -> Iterator[Case]:
    """Yield surfaces whose variance is a small difference of large numbers."""
    case = partial(_case, "cancellation")
    for spread in (1e-3, 1e-6, 1e-9, 1e-11):
        asked = f"high nodes of a checkerboard differ by {spread:g} of their height"
        noise = 1.0 + spread * np.random.default_rng(5).random((NODES, NODES))
        yield case(f"asperities within {spread:g}", asked, checkerboard(NODES) * noise)
    asked = "the others σ0 = 12 um"
    for depth in (1e4, 1e8, 1e10):
        yield case(f"one node {depth:g} um deep", asked, _with(stepped(), -depth))
    yield case(
        "one node 1e16 um deep", asked, _with(stepped(), -1e16), "lost in rounding"
    )
    for slope in (1e3, 1e6):
        asked, plane = (
            "σ0 = 12 um in steps of 1/1024 um",
            slope * np.arange(NODES)[:, None],
        )
        yield case(f"tilted by {slope:g} um a node", asked, stepped() + plane)


def _with(heights: Field, height: float, at: tuple[int, int] = (5, 7)) -> Field:
    heights[at] = height
    return heights


def _sizes() -> Iterator[Case]:
    case = partial(_case, "size")
    for name, factor in (FACTORS | {"1e-290": 1e-290, "1e290": 1e290}).items():
        yield case(f"heights times {name}", "σ0 = 12 um", rough() * factor)
    for pair in ((1e-15, 1e-15), (1e15, 1e15), (1e-15, 1e15), (1e15, 1e-15), (0.3, 0.7)):
        name = f"spacings {pair[0]:g} and {pair[1]:g} um"
        yield case(name, "σ0 = 12 um", rough(), spacing=pair)


def _grids() -> Iterator[Case]:
    case, oblong = partial(_case, "grid"), (0.5, 2.0)
    for k in range(1, 12):
        nodes = 2**k + 1
        asked, surface = f"{nodes} x {nodes}", partial(rough, nodes)
        if k > 5:  # whole numbers of small steps are counted much faster
            asked += ", heights in steps of 1/16 um"
            surface = partial(stepped, nodes, 1 / 16)
        yield case(f"k = {k}", asked, surface)
    for rows, columns in (
        (2, 2),
        (2, 3),
        (3, 2),
        (3, 3),
        (2, 129),
        (129, 2),
        (9, 100),
        (128, 17),
    ):
        corner, asked = (
            rough(129)[:rows, :columns],
            "a corner of 129 x 129, g = 0.5 and 2 um",
        )
        yield case(f"{rows} x {columns}", asked, corner, spacing=oblong)
    turned = {"turned by 180°": rough()[::-1, ::-1], "axes swapped": rough().T}
    for name, image in (turned | {"turned by 90°": np.rot90(rough())}).items():
        yield case(
            name, "seen otherwise in memory, g = 0.5 and 2 um", image, spacing=oblong
        )


def _features() -> Iterator[Case]:
    """Yield bodies with closed forms, and peaks that are few, equal or none."""
    case, x = partial(_case, "feature"), np.arange(NODES) - NODES // 2
    bowl = (x[:, None] ** 2 + x**2) / 64
    for name, asked, heights, word in (
        ("one peak", "a paraboloid", -bowl, "asperity or one"),
        ("no peak", "a bowl", bowl, "no asperity"),
        ("a plane", "h = 3 i - 2 j um", 3.0 * x[:, None] - 2.0 * x, "no asperity"),
        ("flat", "all nodes at 3.3 um", np.full((NODES, NODES), 3.3), "flat surface"),
        ("flat, far up", "all nodes at 1e308 um", np.full((9, 9), 1e308), "flat surface"),
    ):
        yield case(name, asked, heights)
        yield case(f"{name}: said", asked, heights, word)
    apart = checkerboard(NODES) * (0.1 + 0.2) + 0.1
    plain, spike = np.zeros((NODES, NODES)), _with(np.zeros((9, 9)), 1.0, (2, 2))
    noise = np.random.default_rng(1).standard_normal((NODES, NODES))
    for name, asked, heights in (
        ("exact ties", "a checkerboard of 0 and 1 um", checkerboard(NODES)),
        ("ties of 0.1 + 0.2", "a checkerboard of 0.1 and 0.1 + 0.2 um", apart),
        ("plateaus", "each node four times", np.kron(stepped(17), np.ones((2, 2)))),
        ("ties and steps", "heights in steps of 5 um", stepped(step=5.0)),
        ("a spike", "flat but for one node of 1 um", _with(plain, 1.0)),
        ("a spike in a corner", "no interior node", _with(np.zeros((9, 9)), 1.0, (0, 0))),
        ("two spikes", "of 1 and 2 um", _with(spike, 2.0, (5, 5))),
        ("ridges", "profiles along y flat", np.repeat(stepped()[:, :1], 9, axis=1)),
        ("white noise", "σ = 1 um", noise),
        (
            "an outlier",
            "one node of 1e6 um, the others σ0 = 12 um",
            _with(stepped(), 1e6),
        ),
    ):
        yield case(name, asked, heights)
