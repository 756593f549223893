"""Cases about the 22 statistics: offsets, scales, spacings, grids, single features, arrays."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bench.references.half_space import Field
from bench.stability.case import EXACT_FACTORS, FACTORS, Answer, Case, Refusal
from bench.stability.surfaces.checks import EXACT, G, described, says, unchanged
from gen.runtime.errors import InputError
from gen.statistics import describe
from gen.surface import generate

SMALL = 33  # nodes a side of most surfaces
STEP = 1 / 1024  # steps of heights that are to take offsets and turns exactly [um]


def cases() -> Iterator[Case]:
    """Family after family."""
    families = _offsets(), _cancellation(), _sizes(), _grids(), _features(), _arrays(), _refused()
    return chain(*families)


def rough(nodes: int = SMALL, sigma0: float = 12.0) -> Field:
    """A surface of the paper's kind."""
    return generate("diamond-square", nodes, 0.65, sigma0, np.random.default_rng(0))


def stepped(nodes: int = SMALL, step: float = STEP) -> Field:
    """The same on steps: heights that tie, whose sums and differences are exact."""
    return np.asarray(np.round(rough(nodes) / step) * step)


def _case(
    family: str,
    name: str,
    asked: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    *words: str,
    **more: Any,
) -> Case:
    """Make a case of heights, or of a function that makes them when it is run.

    With words the surface has to be undefined for that reason; with `change` it is compared with
    its image, else with whole numbers.
    """

    def examine() -> Answer:
        heights: Any = surface() if callable(surface) else surface
        if words:
            return says(heights, *words)
        return (unchanged if "change" in more else described)(heights, **more)

    return Case(f"statistics: {family}", name, asked, examine)


def _offsets() -> Iterator[Case]:
    case, asked = partial(_case, "offset"), f"{SMALL} x {SMALL}, σ0 = 12 um"
    beside = f"{asked} in steps of 1/1024 um, beside the same without offset"
    for offset in (1e4, -1e8, 1e8, 1e10, 1e12):
        change = partial(np.add, offset)
        yield case(f"{offset:g} um", beside, stepped(), change=change, allowed=1e-13)
    for offset in (1e8, 1e12):
        yield case(f"{offset:g} um, heights as they were rounded", asked, rough() + offset)
    lost = "heights lost in rounding"
    for offset, sigma0 in ((1e14, 12.0), (1e16, 12.0), (1e8, 1e-6), (-1e300, 1e284)):
        name, far = f"{offset:g} um, σ0 = {sigma0:g} um", rough(sigma0=sigma0) + offset
        yield case(f"{name}: lost in rounding", f"{SMALL} x {SMALL}", far, lost)
    name, far = "1e6 um in single precision", (rough() + 1e6).astype(np.float32)
    yield case(f"{name}: lost in rounding", f"{SMALL} x {SMALL}, float32", far, lost)


def _cancellation() -> Iterator[Case]:
    """Where variance is a small difference of large numbers."""
    case = partial(_case, "cancellation")
    for spread in (1e-3, 1e-6, 1e-9, 1e-11):
        asked = f"high nodes of a checkerboard differ by {spread:g} of their height"
        noise = 1.0 + spread * np.random.default_rng(5).random((SMALL, SMALL))
        yield case(f"asperities within {spread:g}", asked, _board() * noise)
    asked = "the others σ0 = 12 um"
    for depth in (1e4, 1e8, 1e10):
        yield case(f"one node {depth:g} um deep", asked, _with(stepped(), -depth))
    yield case("one node 1e16 um deep", asked, _with(stepped(), -1e16), "equal height")
    for slope in (1e3, 1e6):
        asked, plane = "σ0 = 12 um in steps of 1/1024 um", slope * np.arange(SMALL)[:, None]
        yield case(f"tilted by {slope:g} um a node", asked, stepped() + plane)


def _board(nodes: int = SMALL) -> Field:
    """A checkerboard of 0 and 1."""
    return np.where(np.indices((nodes, nodes)).sum(axis=0) % 2 == 0, 1.0, 0.0)


def _with(heights: Field, height: float, at: tuple[int, int] = (5, 7)) -> Field:
    heights[at] = height
    return heights


def _sizes() -> Iterator[Case]:
    case = partial(_case, "size")
    for name, factor in (FACTORS | {"1e-290": 1e-290, "1e290": 1e290}).items():
        more = {"change": partial(np.multiply, factor), "length": factor}
        allowed = 0.0 if name in EXACT_FACTORS else EXACT
        yield case(f"heights times {name}", "beside σ0 = 12 um", rough(), allowed=allowed, **more)
    spacings = {f"{name} g": G * factor for name, factor in EXACT_FACTORS.items()}
    for name, spacing in (spacings | {"1e-15 um": 1e-15, "1e15 um": 1e15}).items():
        more = {"change": np.array, "spacings": ((G, G), (spacing, spacing))}
        yield case(f"spacing {name}", f"beside g = {G:g} um", rough(), allowed=4e-15, **more)
    for pair in ((1e-15, 1e15), (1e15, 1e-15), (1.0, 1e-3), (0.3, 0.7)):
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
    for rows, columns in ((2, 2), (2, 3), (3, 2), (3, 3), (2, 129), (129, 2), (9, 100), (128, 17)):
        corner, asked = rough(129)[:rows, :columns], "a corner of 129 x 129, g = 0.5 and 2 um"
        yield case(f"{rows} x {columns}", asked, corner, spacing=oblong)
    asked = "beside the surface as it is, g = 0.5 and 2 um"
    for name, image, swapped in (
        ("turned by 180°", lambda z: z[::-1, ::-1], False),
        ("mirrored in x", lambda z: z[::-1], False),
        ("mirrored in y", lambda z: z[:, ::-1], False),
        ("axes swapped", np.transpose, True),
        ("turned by 90°", np.rot90, True),
    ):
        more = {"spacings": (oblong, oblong[::-1] if swapped else oblong), "swapped": swapped}
        yield case(name, asked, rough(), change=image, allowed=EXACT, **more)


def _features() -> Iterator[Case]:
    """Bodies with closed forms, peaks that are few, equal or none."""
    case, x = partial(_case, "feature"), np.arange(SMALL) - SMALL // 2
    bowl = (x[:, None] ** 2 + x**2) / 64
    for name, asked, heights, word in (
        ("one peak", "a paraboloid", -bowl, "one asperity"),
        ("no peak", "a bowl", bowl, "no asperity"),
        ("a plane", "h = 3 i - 2 j um", 3.0 * x[:, None] - 2.0 * x, "no asperity"),
        ("flat", "all nodes at 3.3 um", np.full((SMALL, SMALL), 3.3), "flat surface"),
        ("flat, far up", "all nodes at 1e308 um", np.full((9, 9), 1e308), "flat surface"),
    ):
        yield case(name, asked, heights)
        yield case(f"{name}: said", asked, heights, word)
    apart = _board() * (0.1 + 0.2) + 0.1
    plain, spike = np.zeros((SMALL, SMALL)), _with(np.zeros((9, 9)), 1.0, (2, 2))
    noise = np.random.default_rng(1).standard_normal((SMALL, SMALL))
    for name, asked, heights in (
        ("exact ties", "a checkerboard of 0 and 1 um", _board()),
        ("ties of 0.1 + 0.2", "a checkerboard of 0.1 and 0.1 + 0.2 um", apart),
        ("plateaus", "each node four times", np.kron(stepped(17), np.ones((2, 2)))),
        ("ties and steps", "heights in steps of 5 um", stepped(step=5.0)),
        ("a spike", "flat but for one node of 1 um", _with(plain, 1.0)),
        ("a spike in a corner", "no interior node", _with(np.zeros((9, 9)), 1.0, (0, 0))),
        ("two spikes", "of 1 and 2 um", _with(spike, 2.0, (5, 5))),
        ("ridges", "profiles along y flat", np.repeat(stepped()[:, :1], 9, axis=1)),
        ("white noise", "σ = 1 um", noise),
        ("an outlier", "one node of 1e6 um, the others σ0 = 12 um", _with(stepped(), 1e6)),
    ):
        yield case(name, asked, heights)


def _arrays() -> Iterator[Case]:
    case, asked = (
        partial(_case, "array"),
        "whole numbers of um, beside the same in double precision",
    )
    changes: dict[str, Callable[[Field], ArrayLike]] = {
        "float32": lambda z: z.astype(np.float32),
        "big-endian": lambda z: z.astype(">f8"),
        "int64": lambda z: z.astype(np.int64),
        "int16": lambda z: z.astype(np.int16),
        "uint8": lambda z: z.astype(np.uint8),
        "Fortran order": np.asfortranarray,
        "every second column": lambda z: np.repeat(z, 2, axis=1)[:, ::2],
        "read-only": lambda z: np.broadcast_to(z, z.shape),
        "masked nowhere": np.ma.masked_invalid,
    }
    for name, change in changes.items():
        yield case(name, asked, stepped(step=1.0), change=change)
    yield case("float32, rough", "σ0 = 12 um", rough().astype(np.float32))
    yield case("booleans", "a checkerboard", np.asarray(_board(9), dtype=bool))


def _refused() -> Iterator[Case]:
    z, case = rough(9), partial(Case, "statistics: refused")
    for name, heights, words in (
        ("NaN", _with(z.copy(), np.nan), "give finite heights"),
        ("infinity", _with(z.copy(), -np.inf), "give finite heights"),
        ("an infinite range", _with(z * 1e306, -1.79e308), "give finite heights"),
        ("masked nodes", np.ma.masked_less(z, 5.0), "fill or crop"),
        ("complex", z.astype(complex), "give real numbers"),
        ("text", z.astype(str), "give real numbers"),
        ("objects", z.astype(object), "give real numbers"),
        ("one profile", z[:1], "2 x 2 nodes or more"),
        ("a list of heights", z.ravel(), "2-D"),
        ("nothing", np.zeros((0, 0)), "2 x 2 nodes or more"),
    ):
        asked, refusal = "9 x 9 or what is left of it", Refusal(InputError, ("heights", words))
        yield case(name, asked, partial(describe, heights, G), refusal)
    for spacing in (0.0, -1.0, np.nan, 1e-16, (1.0, np.inf), (1.0, 2.0, 3.0)):
        call: Callable[[], object] = partial(describe, z, spacing)  # type: ignore[arg-type]
        refusal = Refusal(InputError, ("spacing", "from 1e-15 to 1e+15 um"))
        yield case(f"spacing {spacing}", "9 x 9", call, refusal)
    for factor, spacing in ((1e290, 1e-15), (1e-290, 1e15)):
        name = f"heights times {factor:g} on {spacing:g} um"
        refusal = Refusal(InputError, ("beyond what numbers hold", "give other units"))
        asked, call = "9 x 9, curvatures beyond double precision", partial(describe, z * factor)
        yield case(name, asked, partial(call, spacing), refusal)
