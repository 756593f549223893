"""The composite surface of two rough bodies: both maps added on one grid, as they face each other.

The gap between two rough bodies is that between the sum of their heights and a plane, and so is the
contact, with the E* of both bodies. Heights of both maps point out of their body, and both are seen
from outside. One body has to be turned over to face the other: one axis of its map then runs
backwards. The centres of both maps lie on each other unless one is shifted; maps of one
spacing lie node on node, so that none is smoothed by an interpolation.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.prepare import prepare
from gen.maps.read import Sides, Topography, read
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from bem.problem import Boundary

TURNS = ("x", "y", "none")

# largest distance of nodes that count as one, in spacings, and relative difference of lengths that
# count as equal: files round their lengths
SAME = 1e-6
COARSE = 10.0  # ratio of the spacings of two maps above which one of them probably has another unit
# nodes by which a map without edges is continued before it is interpolated: a spline forgets what
# is further away, by a factor of 0.27 a node
REACH = 24


class _Line(NamedTuple):
    """Nodes of a grid along one axis that lie on another map, and their places there."""

    nodes: slice  # nodes of the grid
    places: Values  # places in the other map, in spacings from its first node, shape (k,)
    # {"wrap", "symmetric", ""}: mode of `numpy.pad` that continues the other map along this axis;
    # "" where it ends
    continued: Literal["wrap", "symmetric", ""]

    @property
    def exact(self) -> bool:
        """Whether every place is a node of the other map."""
        return bool((self.places == np.rint(self.places)).all())


def composite(
    first: Topography, second: Topography, turned: str = "x", shift: Sides = (0.0, 0.0)
) -> Topography:
    """Add the heights of two bodies that face each other, where both have some.

    `turned` and `shift` are those of `Opposite`.

    The sum stands on the finer of the two grids. The other map is interpolated there by cubic
    splines, and not at all where its nodes lie on those of the grid. Heights of the second body
    count from its highest node, so that a flat one changes nothing. Raises InputError if fewer
    than 2 x 2 nodes lie on both bodies.
    """
    below, below_doubtful = second.heights - second.heights.max(), second.doubtful
    if turned != "none":
        below = np.flip(below, axis=TURNS.index(turned))
        if below_doubtful is not None:
            below_doubtful = np.flip(below_doubtful, axis=TURNS.index(turned))
    other = replace(second, heights=below, doubtful=below_doubtful)
    onto_first = math.prod(first.spacing) <= math.prod(other.spacing) * (1 + SAME)
    grid, added = (first, other) if onto_first else (other, first)
    sign = 1 if onto_first else -1
    lines = [_line(grid, added, axis, sign * shift[axis]) for axis in (0, 1)]
    name = f"{first.name} against {second.name}"
    if min(line.places.size for line in lines) < 2:
        raise InputError(
            f"{name}: fewer than 2 x 2 nodes lie on both maps, of {_size(first.sides)} and"
            f" {_size(other.sides)} um with their centres {_size(shift)} um apart"
        )
    heights = grid.heights[lines[0].nodes, lines[1].nodes] + _at(added.heights, lines)
    x, y = (
        side if nodes == of_all else (nodes - (grid.boundary == "free")) * step
        for side, nodes, of_all, step in zip(
            grid.sides, heights.shape, grid.heights.shape, grid.spacing, strict=True
        )
    )
    turn = (
        "not turned over"
        if turned == "none"
        else f"turned over (its {turned} runs backwards)"
    )
    said = [f"pressed against body 2 ({second.name}), {turn}"]
    if any(shift):
        said.append("its centre shifted by {:g} and {:g} um".format(*shift))
    said.append("heights added on {} x {} nodes".format(*heights.shape))
    if not all(
        np.allclose((x, y), body.sides, rtol=SAME, atol=0) for body in (first, other)
    ):
        shared = f"{_size(first.sides)} and {_size(other.sides)} um share"
        said.append(f"the {_size((x, y))} um that {shared}")
    if not all(line.exact for line in lines):
        said.append(
            f"body {2 if onto_first else 1} interpolated by cubic splines from nodes every"
            f" {_size(added.spacing)} um to those of the other, every {_size(grid.spacing)} um"
        )
    bodies = (("body 1", first), ("body 2", second))
    steps = [f"{body}: {step}" for body, each in bodies for step in each.steps]
    warnings = [f"{body}: {line}" for body, each in bodies for line in each.warnings]
    ratio = max(
        wide / fine for wide, fine in zip(added.spacing, grid.spacing, strict=True)
    )
    if ratio > COARSE:
        apart = (
            f"nodes of one body are {ratio:.3g} times as far apart as those of the other"
        )
        warnings.append(
            f"{apart}: its short waves are not there; check --unit and --side"
        )
    both = first.followed & second.followed
    result = replace(grid, name=name, heights=heights, sides=(x, y), followed=both)
    result = replace(result, doubtful=_doubtful(grid, added, lines))
    return replace(result, steps=(*steps, ", ".join(said)), warnings=tuple(warnings))


def _doubtful(
    grid: Topography, added: Topography, lines: list[_Line]
) -> NDArray[np.bool_] | None:
    """Return the nodes of a sum at which either body has a code, pit or spike, None without any.

    Those of a body that is interpolated are left out: its splines spread them.
    """
    parts: list[NDArray[np.bool_]] = []
    if grid.doubtful is not None:
        parts.append(grid.doubtful[lines[0].nodes, lines[1].nodes])
    if added.doubtful is not None and all(line.exact for line in lines):
        parts.append(_at(added.doubtful.astype(np.float64), lines) > 0)
    return np.any(parts, axis=0) if parts else None


def _line(grid: Topography, added: Topography, axis: int, shift: float) -> _Line:
    """Find the nodes of a grid along one axis that lie on another map."""
    nodes, others = grid.heights.shape[axis], added.heights.shape[axis]
    if shift == 0 and math.isclose(grid.spacing[axis], added.spacing[axis], rel_tol=SAME):
        shift = grid.spacing[axis] * ((nodes - others) % 2) / 2  # nodes on nodes
    across = (np.arange(nodes) - (nodes - 1) / 2) * grid.spacing[axis] - shift
    places = across / added.spacing[axis] + (others - 1) / 2
    places = np.where(np.abs(places - np.rint(places)) < SAME, np.rint(places), places)
    if math.isclose(grid.sides[axis], added.sides[axis], rel_tol=SAME):
        if grid.boundary == "periodic":
            return _Line(slice(0, nodes), places % others, "wrap")
        if grid.boundary == "mirror" and shift == 0:
            return _Line(slice(0, nodes), places, "symmetric")
    inside = np.flatnonzero((places >= 0) & (places <= others - 1))
    start, stop = (int(inside[0]), int(inside[-1]) + 1) if inside.size else (0, 0)
    return _Line(slice(start, stop), places[start:stop], "")


def _at(heights: Heights, lines: list[_Line]) -> Heights:
    """Interpolate a map at the places of two lines of nodes, one axis after the other."""
    from scipy.interpolate import make_interp_spline

    for axis, line in enumerate(lines):
        if line.exact:
            heights = np.take(heights, line.places.astype(np.int64), axis=axis)
            continue
        width = REACH if line.continued else 0
        if line.continued:
            widths = [(width, width) if each == axis else (0, 0) for each in (0, 1)]
            heights = np.pad(heights, widths, mode=line.continued)
        nodes = heights.shape[axis]
        spline = make_interp_spline(
            np.arange(nodes), heights, k=min(3, nodes - 1), axis=axis
        )
        heights = np.asarray(spline(line.places + width))
    return heights


def _size(lengths: Sides) -> str:
    """Write two lengths as "1000 x 500"."""
    return f"{lengths[0]:.6g} x {lengths[1]:.6g}"


@dataclass(frozen=True)
class Opposite:
    """The second of two rough bodies, and how it is laid on the first one."""

    path: Path  # file of its surface
    reading: Reading  # how it is read and prepared
    # {"x", "y", "none"}: axis of its map that runs backwards as it is turned over; none for a map
    # that is seen through its body
    turned: str = "x"
    # distance of its centre from that of the first map, along x and y of that map [um]
    shift: Sides = (0.0, 0.0)
    # whether it is read as the first body: lengths and unit that its own file states then stand
    shared: bool = True

    def prepared(self, boundary: Boundary) -> Topography:
        """Read the surface as a patch of a boundary, and prepare it."""
        reading = self.reading
        try:
            return prepare(read(self.path, reading, boundary), reading)
        except InputError:
            if (
                self.shared
                and not reading.override_scale
                and (reading.side or reading.unit)
            ):
                own = replace(reading, side="", unit="")
                with suppress(InputError):
                    return prepare(read(self.path, own, boundary), own)
            raise
