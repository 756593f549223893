"""Cases about the 22 statistics: offsets, scales, spacings, grids, single features, arrays."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.stability.case import Answer, Case, Refusal
from bench.stability.surfaces.checks import EXACT, G, described, says, unchanged
from gen.runtime.errors import InputError
from gen.statistics import describe
from gen.surface import generate

Field = NDArray[np.float64]

FAMILY_OF_REFUSED = "statistics: refused"

NEARLY = 1e-12
"""Allowed where values are nearly equal, as elsewhere: none of their digits may be lost."""

SMALL = 33
"""Nodes a side of most surfaces."""

STEP = 1 / 1024
"""Steps of heights that are to take offsets and turns exactly [um]."""


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _offsets()
    yield from _cancellation()
    yield from _sizes()
    yield from _grids()
    yield from _features()
    yield from _arrays()
    yield from _refused()


def rough(nodes: int = SMALL, sigma0: float = 12.0, offset: float = 0.0) -> Field:
    """A surface of the paper's kind, above an offset."""
    return generate("diamond-square", nodes, 0.65, sigma0, np.random.default_rng(0)) + offset


def stepped(nodes: int = SMALL, step: float = STEP) -> Field:
    """The same on steps: heights that tie, whose sums and differences are exact."""
    return np.asarray(np.round(rough(nodes) / step) * step)


def _case(
    family: str,
    name: str,
    asked: str,
    surface: Callable[[], ArrayLike],
    judge: Callable[..., Answer] = described,
    *words: str,
    **more: Any,
) -> Case:
    """A case that makes its surface when it is run, and no surface before."""
    return Case(f"statistics: {family}", name, asked, lambda: judge(surface(), *words, **more))


def _offsets() -> Iterator[Case]:
    beside = f"{SMALL} x {SMALL}, σ0 = 12 um in steps of 1/1024 um, beside the same without offset"
    for offset in (1e4, -1e8, 1e8, 1e10, 1e12):
        change = partial(np.add, offset)
        yield _case(
            "offset", f"{offset:g} um", beside, stepped, unchanged, change=change, allowed=1e-13
        )
    asked = f"{SMALL} x {SMALL}, σ0 = 12 um"
    for offset in (1e8, 1e12):
        name = f"{offset:g} um, heights as they were rounded"
        yield _case("offset", name, asked, partial(rough, offset=offset))
    for offset, sigma0 in ((1e14, 12.0), (1e16, 12.0), (1e8, 1e-6), (-1e300, 1e284)):
        yield _case(
            "offset",
            f"{offset:g} um, σ0 = {sigma0:g} um: lost in rounding",
            f"{SMALL} x {SMALL}",
            partial(rough, sigma0=sigma0, offset=offset),
            says,
            "heights lost in rounding",
        )
    yield _case(
        "offset",
        "1e6 um in single precision: lost in rounding",
        f"{SMALL} x {SMALL}, float32",
        lambda: (rough() + 1e6).astype(np.float32),
        says,
        "heights lost in rounding",
    )


def _cancellation() -> Iterator[Case]:
    """Where variance is a small difference of large numbers."""
    for spread in (1e-3, 1e-6, 1e-9, 1e-11):
        asked = f"high nodes of a checkerboard differ by {spread:g} of their height"
        surface = partial(_nearly_equal, spread)
        yield _case("cancellation", f"asperities within {spread:g}", asked, surface, allowed=NEARLY)
    for depth in (1e4, 1e8, 1e10):
        name, asked = f"one node {depth:g} um deep", "the others σ0 = 12 um"
        yield _case("cancellation", name, asked, partial(_pit, depth))
    name, asked = "one node 1e16 um deep", "the others σ0 = 12 um"
    yield _case("cancellation", name, asked, partial(_pit, 1e16), says, "equal height")
    for slope in (1e3, 1e6):
        yield _case(
            "cancellation",
            f"tilted by {slope:g} um a node",
            "σ0 = 12 um in steps of 1/1024 um",
            partial(_tilted, slope),
        )


def _nearly_equal(spread: float) -> Field:
    """A checkerboard whose high nodes differ a little."""
    random, place = np.random.default_rng(5), np.indices((SMALL, SMALL)).sum(axis=0)
    noise = random.random((SMALL, SMALL))
    return np.where(place % 2 == 0, 1.0 + spread * noise, 0.0)


def _with(heights: Field, height: float, at: tuple[int, int] = (5, 7)) -> Field:
    heights[at] = height
    return heights


def _pit(depth: float) -> Field:
    return _with(stepped(), -depth)


def _tilted(slope: float) -> Field:
    return stepped() + slope * np.arange(SMALL)[:, None]


def _corner(rows: int, columns: int) -> Field:
    return rough(129)[:rows, :columns]


def _sizes() -> Iterator[Case]:
    for name, factor, allowed in (
        ("2^-40", 2.0**-40, 0.0),
        ("2^40", 2.0**40, 0.0),
        ("1e-12", 1e-12, EXACT),
        ("1e12", 1e12, EXACT),
        ("1e-290", 1e-290, EXACT),
        ("1e290", 1e290, EXACT),
    ):
        more = {"change": partial(np.multiply, factor), "allowed": allowed, "length": factor}
        asked = "beside σ0 = 12 um"
        yield _case("size", f"heights times {name}", asked, rough, unchanged, **more)
    for name, spacing in (
        ("2^-40 g", G * 2.0**-40),
        ("2^40 g", G * 2.0**40),
        ("1e-15 um", 1e-15),
        ("1e15 um", 1e15),
    ):
        more = {"change": np.array, "allowed": 4e-15, "spacings": ((G, G), (spacing, spacing))}
        yield _case("size", f"spacing {name}", f"beside g = {G:g} um", rough, unchanged, **more)
    for pair in ((1e-15, 1e15), (1e15, 1e-15), (1.0, 1e-3), (0.3, 0.7)):
        name = f"spacings {pair[0]:g} and {pair[1]:g} um"
        yield _case("size", name, "σ0 = 12 um", rough, spacing=pair)


def _grids() -> Iterator[Case]:
    for k in range(1, 12):
        nodes = 2**k + 1
        asked, surface = f"{nodes} x {nodes}", partial(rough, nodes)
        if k > 5:  # whole numbers of small steps are counted much faster
            asked += ", heights in steps of 1/16 um"
            surface = partial(stepped, nodes, 1 / 16)
        yield _case("grid", f"k = {k}", asked, surface)
    for rows, columns in ((2, 2), (2, 3), (3, 2), (3, 3), (2, 129), (129, 2), (9, 100), (128, 17)):
        yield _case(
            "grid",
            f"{rows} x {columns}",
            "a corner of 129 x 129, g = 0.5 and 2 um",
            partial(_corner, rows, columns),
            spacing=(0.5, 2.0),
        )
    for name, image, swapped in (
        ("turned by 180°", lambda z: z[::-1, ::-1], False),
        ("mirrored in x", lambda z: z[::-1], False),
        ("mirrored in y", lambda z: z[:, ::-1], False),
        ("axes swapped", np.transpose, True),
        ("turned by 90°", np.rot90, True),
    ):
        turned = (2.0, 0.5) if swapped else (0.5, 2.0)
        more = {"spacings": ((0.5, 2.0), turned), "swapped": swapped, "allowed": EXACT}
        asked = "beside the surface as it is, g = 0.5 and 2 um"
        yield _case("grid", name, asked, rough, unchanged, change=image, **more)


def _features() -> Iterator[Case]:
    """Bodies with closed forms, peaks that are few, equal or none."""
    x = np.arange(SMALL) - SMALL // 2
    bowl = (x[:, None] ** 2 + x**2) / 64
    for name, asked, heights, word in (
        ("one peak", "a paraboloid", -bowl, "one asperity"),
        ("no peak", "a bowl", bowl, "no asperity"),
        ("a plane", "h = 3 i - 2 j um", 3.0 * x[:, None] - 2.0 * x, "no asperity"),
        ("flat", "all nodes at 3.3 um", np.full((SMALL, SMALL), 3.3), "flat surface"),
        ("flat, far up", "all nodes at 1e308 um", np.full((9, 9), 1e308), "flat surface"),
    ):
        yield _case("feature", name, asked, heights.copy)
        yield _case("feature", f"{name}: said", asked, heights.copy, says, word)
    board = np.where(np.indices((SMALL, SMALL)).sum(axis=0) % 2 == 0, 1.0, 0.0)
    stairs = np.repeat(np.repeat(stepped(17), 2, axis=0), 2, axis=1)
    others: dict[str, tuple[str, ArrayLike]] = {
        "exact ties": ("a checkerboard of 0 and 1 um", board),
        "ties of 0.1 + 0.2": ("a checkerboard of 0.1 and 0.1 + 0.2 um", board * (0.1 + 0.2) + 0.1),
        "plateaus": ("each node four times", stairs),
        "ties and steps": ("heights in steps of 5 um", stepped(step=5.0)),
        "a spike": ("flat but for one node of 1 um", _with(np.zeros((SMALL, SMALL)), 1.0)),
        "a spike in a corner": ("no interior node", _with(np.zeros((9, 9)), 1.0, (0, 0))),
        "two spikes": (
            "of 1 and 2 um",
            _with(_with(np.zeros((9, 9)), 1.0, (2, 2)), 2.0, (5, 5)),
        ),
        "ridges": ("profiles along y flat", np.repeat(stepped()[:, :1], 9, axis=1)),
        "white noise": ("σ = 1 um", np.random.default_rng(1).standard_normal((SMALL, SMALL))),
        "an outlier": ("one node of 1e6 um, the others σ0 = 12 um", _with(stepped(), 1e6)),
    }
    for name, (asked, each) in others.items():
        yield _case("feature", name, asked, np.asarray(each).copy)


def _arrays() -> Iterator[Case]:
    asked = "whole numbers of um, beside the same in double precision"
    base = partial(stepped, SMALL, 1.0)
    kinds: dict[str, Callable[[Field], ArrayLike]] = {
        "float32": lambda z: z.astype(np.float32),
        "big-endian": lambda z: z.astype(">f8"),
        "int64": lambda z: z.astype(np.int64),
        "int16": lambda z: z.astype(np.int16),
        "uint8": lambda z: z.astype(np.uint8),
        "Fortran order": np.asfortranarray,
        "every second column": lambda z: np.repeat(z, 2, axis=1)[:, ::2],
        "read-only": _read_only,
        "masked nowhere": np.ma.masked_invalid,
    }
    for name, kind in kinds.items():
        yield _case("array", name, asked, base, unchanged, change=kind)
    yield _case("array", "float32, rough", "σ0 = 12 um", lambda: rough().astype(np.float32))
    board = np.indices((9, 9)).sum(axis=0) % 2 == 0
    yield _case("array", "booleans", "a checkerboard", board.copy)


def _read_only(heights: Field) -> Field:
    heights = heights.copy()
    heights.setflags(write=False)
    return heights


def _refused() -> Iterator[Case]:
    z = rough(9)
    for name, heights, words in (
        ("NaN", _with(z.copy(), np.nan), "give finite heights"),
        ("infinity", _with(z.copy(), -np.inf), "give finite heights"),
        ("an infinite range", _with(z * 1e306, -1.79e308), "give finite heights"),
        ("masked nodes", np.ma.masked_less(z, 5.0), "fill holes"),
        ("complex", z.astype(complex), "give real numbers"),
        ("text", z.astype(str), "give real numbers"),
        ("objects", z.astype(object), "give real numbers"),
        ("one profile", z[:1], "2 x 2 nodes or more"),
        ("a list of heights", z.ravel(), "2-D"),
        ("nothing", np.zeros((0, 0)), "2 x 2 nodes or more"),
    ):
        yield Case(
            FAMILY_OF_REFUSED,
            name,
            "9 x 9 or what is left of it",
            partial(describe, heights, G),
            Refusal(InputError, ("heights", words)),
        )
    for spacing in (0.0, -1.0, np.nan, 1e-16, (1.0, np.inf), (1.0, 2.0, 3.0)):
        yield Case(
            FAMILY_OF_REFUSED,
            f"spacing {spacing}",
            "9 x 9",
            partial(describe, z, spacing),  # type: ignore[arg-type]
            Refusal(InputError, ("spacing", "from 1e-15 to 1e+15 um")),
        )
    for factor, spacing in ((1e290, 1e-15), (1e-290, 1e15)):
        yield Case(
            FAMILY_OF_REFUSED,
            f"heights times {factor:g} on {spacing:g} um",
            "9 x 9, curvatures beyond double precision",
            partial(describe, z * factor, spacing),
            Refusal(InputError, ("beyond what numbers hold", "give other units")),
        )
