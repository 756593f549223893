"""Surfaces that are pressed: a prepared map, or the composite surface of two rough bodies.

The gap between two rough bodies is the gap between the sum of their heights and a plane, and so is
their contact, with the E* of both bodies. Heights of both maps point out of their body, and both
maps are seen from outside. One body has to be turned over to face the other: one axis of its map
then runs backwards. The centres of both maps lie on each other unless one map is shifted. Nodes of
maps with the same spacing lie on each other, so that neither map is smoothed by an interpolation.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Heights, Values
from gen.maps.prepare import prepare, surface_warnings
from gen.maps.read import Sides, Topography, read
from gen.maps.settings import Reading
from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from bem.problem import Boundary

TURNS = ("x", "y", "none")
"""Axes of the second map that may run backwards; those of the map come first, in their order."""

# largest distance of nodes that count as one, in spacings, and relative difference of lengths that
# count as equal: files round their lengths
SAME = 1e-6
COARSE = 10.0  # ratio of the spacings of two maps above which one of them probably has another unit
# nodes by which a map without edges is continued before it is interpolated: the influence of a node
# on a spline falls by a factor of 0.27 with each node of distance
REACH = 24


@dataclass(frozen=True)
class Opposite:
    """The second of two rough bodies, and how it is laid on the first one."""

    path: Path  # file of its surface
    reading: Reading  # how its file is read and prepared
    # {"x", "y", "none"}: axis of its map that runs backwards as the body is turned over; "none" for
    # a map that is seen through its body
    turned: str = "x"
    # distance of its centre from that of the first map, along x and y of that map [um]
    shift: Sides = (0.0, 0.0)
    # whether `reading` is that of the first body, so that a scale in the file of this one counts
    shared: bool = True

    def prepared(self, boundary: Boundary) -> Topography:
        """Read and prepare the surface.

        If the reading is that of the first body, its lengths and unit are left out where the file
        of this body does not allow them, because it states its own.

        Parameters
        ----------
        boundary : {"free", "periodic", "mirror"}
            Boundary of the patch.

        Returns
        -------
        Topography
            The prepared map.

        Raises
        ------
        InputError
            If the file cannot be read, or a setting does not suit its map.
        """
        reading = self.reading
        scale_may_be_left_out = self.shared and not reading.override_scale
        try:
            return prepare(read(self.path, reading, boundary), reading)
        except InputError:
            if scale_may_be_left_out and (reading.side or reading.unit):
                unscaled = replace(reading, side="", unit="")
                with suppress(InputError):
                    return prepare(read(self.path, unscaled, boundary), unscaled)
            raise


def read_surface(
    path: Path,
    reading: Reading,
    boundary: Boundary = "free",
    opposite: Opposite | None = None,
) -> tuple[Topography, list[str]]:
    """Read and prepare the surface of one body, or the composite surface of two bodies.

    Parameters
    ----------
    path : Path
        File of the (first) surface.
    reading : Reading
        How this file is read and prepared.
    boundary : {"free", "periodic", "mirror"}, optional
        Boundary of the patch.
    opposite : Opposite, optional
        The second rough body; without it the surface faces a flat body.

    Returns
    -------
    surface : Topography
        The prepared surface, without holes.
    warnings : list of str
        One line for each reason to distrust contacts of the surface.

    Raises
    ------
    InputError
        If a file cannot be read, a setting does not suit its map, or two maps hardly overlap.
        The message names the file.
    """
    try:
        surface = prepare(read(path, reading, boundary), reading)
        if opposite is not None:
            body = opposite.prepared(boundary)
            surface = composite(surface, body, opposite.turned, opposite.shift)
    except InputError as error:
        message = str(error)
        names_its_file = message.startswith(("--", str(path)))
        if opposite is None and not names_its_file:
            message = f"{path}: {message}"
        raise InputError(message) from None
    return surface, surface_warnings(surface)


def composite(
    first: Topography, second: Topography, turned: str = "x", shift: Sides = (0.0, 0.0)
) -> Topography:
    """Add the heights of two bodies that face each other, at the nodes that lie on both.

    The sum has the nodes of the finer of the two grids. The other map is interpolated there by
    cubic splines along each axis on which its nodes do not lie on those of the grid. Heights of
    the second body count from its highest node, so that a flat one changes nothing.

    Parameters
    ----------
    first, second : Topography
        Maps of both bodies without holes, with the same boundary.
    turned : {"x", "y", "none"}, optional
        Axis of the second map that runs backwards, see `Opposite`.
    shift : tuple of float, optional
        Distance of the centre of the second map from that of the first, along x and y [um].

    Returns
    -------
    Topography
        The composite surface, with the steps and warnings of both maps.

    Raises
    ------
    InputError
        If fewer than 2 x 2 nodes lie on both bodies.
    """
    facing = _turned_over(second, turned)
    name = f"{first.name} against {second.name}"
    overlay = _overlay(first, facing, shift)
    if min(overlay.shape) < 2:
        raise InputError(
            f"{name}: fewer than 2 x 2 nodes lie on both maps, of {_size(first.sides)}"
            f" and {_size(facing.sides)} um with their centres {_size(shift)} um apart"
        )
    step = _step_in_words(first, facing, overlay, turned, shift)
    return replace(
        overlay.grid,
        name=name,
        heights=overlay.heights,
        sides=overlay.sides,
        followed=first.followed & second.followed,
        doubtful=overlay.doubtful,
        steps=(
            *(f"body 1: {line}" for line in first.steps),
            *(f"body 2: {line}" for line in second.steps),
            step,
        ),
        warnings=(
            *(f"body 1: {line}" for line in first.warnings),
            *(f"body 2: {line}" for line in second.warnings),
            *overlay.warnings,
        ),
    )


def _turned_over(second: Topography, turned: str) -> Topography:
    """Return the second map as it faces the first one, its heights from its highest node [um]."""
    heights = second.heights - second.heights.max()
    doubtful = second.doubtful
    if turned != "none":
        axis = TURNS.index(turned)
        heights = np.flip(heights, axis)
        if doubtful is not None:
            doubtful = np.flip(doubtful, axis)
    return replace(second, heights=heights, doubtful=doubtful)


@dataclass(frozen=True, eq=False)
class _Line:
    """Nodes of a grid along one axis that lie on another map, and their places there."""

    nodes: slice  # nodes of the grid
    places: Values  # places in the other map, in spacings from its first node, shape (k,)
    # {"wrap", "symmetric", ""}: mode of `numpy.pad` that continues the other map along this axis;
    # "" if it ends at its borders
    continued: Literal["wrap", "symmetric", ""]

    @property
    def exact(self) -> bool:
        """Whether every place is a node of the other map."""
        return bool((self.places == np.rint(self.places)).all())


@dataclass(frozen=True, eq=False)
class _Overlay:
    """Two maps that are laid on each other: one gives the grid, the other is added to it."""

    grid: Topography  # map with the finer grid
    added: Topography  # map that is interpolated to this grid
    added_number: int  # 1 if the added map is that of the first body, 2 of the second
    along_x: _Line  # nodes of the grid along x that lie on the added map
    along_y: _Line

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of nodes along x and y that lie on both maps."""
        return self.along_x.places.size, self.along_y.places.size

    @property
    def exact(self) -> bool:
        """Whether the nodes of the sum are nodes of the added map, which is not interpolated."""
        return self.along_x.exact and self.along_y.exact

    @property
    def heights(self) -> Heights:
        """Sum of the heights of both maps [um], shape (nx, ny)."""
        grid = self.grid.heights[self.along_x.nodes, self.along_y.nodes]
        return grid + self._at_nodes(self.added.heights)

    @property
    def sides(self) -> Sides:
        """Lengths of the part along x and y that both maps share [um]."""
        return self._side(0), self._side(1)

    @property
    def doubtful(self) -> NDArray[np.bool_] | None:
        """Nodes, shape (nx, ny), at which a map has a code, pit or spike; None if there are none.

        Those of a map that is interpolated are left out, because its splines spread them.
        """
        doubtful: NDArray[np.bool_] | None = None
        if self.grid.doubtful is not None:
            doubtful = self.grid.doubtful[self.along_x.nodes, self.along_y.nodes]
        if self.added.doubtful is None or not self.exact:
            return doubtful
        of_added = self._at_nodes(self.added.doubtful.astype(np.float64)) > 0
        return of_added if doubtful is None else doubtful | of_added

    @property
    def warnings(self) -> list[str]:
        """One line if the spacings of the maps differ so much that a unit is probably wrong."""
        ratio = max(np.divide(self.added.spacing, self.grid.spacing).tolist())
        if ratio <= COARSE:
            return []
        warning = (
            f"nodes of one body are {ratio:.3g} times as far apart as those of the other:"
            " its short waves are not there; check --unit and --side"
        )
        return [warning]

    def _side(self, axis: int) -> float:
        """Return the length along an axis that both maps share [um]."""
        nodes = self.shape[axis]
        if nodes == self.grid.heights.shape[axis]:
            return self.grid.sides[axis]
        spacings = nodes - 1 if self.grid.boundary == "free" else nodes
        return spacings * self.grid.spacing[axis]

    def _at_nodes(self, values: Values) -> Values:
        """Interpolate values at the nodes of the added map to the nodes of the grid."""
        along_x = _interpolated(values, self.along_x, axis=0)
        return _interpolated(along_x, self.along_y, axis=1)


def _overlay(first: Topography, second: Topography, shift: Sides) -> _Overlay:
    """Lay the second map, which faces the first, on it, its centre shifted along x and y [um]."""
    if math.prod(first.spacing) <= math.prod(second.spacing) * (1 + SAME):
        return _Overlay(
            grid=first,
            added=second,
            added_number=2,
            along_x=_line(first, second, 0, shift[0]),
            along_y=_line(first, second, 1, shift[1]),
        )
    return _Overlay(
        grid=second,
        added=first,
        added_number=1,
        along_x=_line(second, first, 0, -shift[0]),
        along_y=_line(second, first, 1, -shift[1]),
    )


def _line(grid: Topography, added: Topography, axis: int, shift: float) -> _Line:
    """Return the nodes of a grid along an axis that lie on a map shifted along this axis [um]."""
    grid_nodes = grid.heights.shape[axis]
    added_nodes = added.heights.shape[axis]
    step = grid.spacing[axis]
    if shift == 0 and math.isclose(step, added.spacing[axis], rel_tol=SAME):
        # Half a spacing brings nodes on nodes if one number of nodes is odd and one is even.
        shift = step * ((grid_nodes - added_nodes) % 2) / 2
    from_centre = (np.arange(grid_nodes) - (grid_nodes - 1) / 2) * step - shift
    places = from_centre / added.spacing[axis] + (added_nodes - 1) / 2
    nearest = np.rint(places)
    places = np.where(np.abs(places - nearest) < SAME, nearest, places)
    if math.isclose(grid.sides[axis], added.sides[axis], rel_tol=SAME):
        if grid.boundary == "periodic":
            return _Line(slice(0, grid_nodes), places % added_nodes, "wrap")
        if grid.boundary == "mirror" and shift == 0:
            return _Line(slice(0, grid_nodes), places, "symmetric")
    inside = np.flatnonzero((places >= 0) & (places <= added_nodes - 1))
    if not inside.size:
        return _Line(slice(0, 0), places[:0], "")
    nodes = slice(int(inside[0]), int(inside[-1]) + 1)
    return _Line(nodes, places[nodes], "")


def _interpolated(values: Values, line: _Line, axis: int) -> Values:
    """Interpolate values at the nodes (nx, ny) of a map to the places of a line along an axis."""
    from scipy.interpolate import make_interp_spline

    if line.exact:
        return np.take(values, line.places.astype(np.int64), axis=axis)
    first = 0
    if line.continued:
        first = REACH
        widths = [(0, 0), (0, 0)]
        widths[axis] = (REACH, REACH)
        values = np.pad(values, widths, mode=line.continued)
    nodes = values.shape[axis]
    degree = min(3, nodes - 1)
    spline = make_interp_spline(np.arange(nodes), values, k=degree, axis=axis)
    return np.asarray(spline(line.places + first))


def _step_in_words(
    first: Topography,
    second: Topography,
    overlay: _Overlay,
    turned: str,
    shift: Sides,
) -> str:
    """Write the step that adds two maps, for the record of the preparation."""
    turn = "not turned over"
    if turned != "none":
        turn = f"turned over (its {turned} runs backwards)"
    parts = [f"pressed against body 2 ({second.name}), {turn}"]
    if any(shift):
        parts.append(f"its centre shifted by {shift[0]:g} and {shift[1]:g} um")
    nx, ny = overlay.shape
    parts.append(f"heights added on {nx} x {ny} nodes")
    if not all(
        np.allclose(overlay.sides, body.sides, rtol=SAME, atol=0)
        for body in (first, second)
    ):
        parts.append(
            f"the {_size(overlay.sides)} um that {_size(first.sides)} and"
            f" {_size(second.sides)} um share"
        )
    if not overlay.exact:
        parts.append(
            f"body {overlay.added_number} interpolated by cubic splines from nodes every"
            f" {_size(overlay.added.spacing)} um to those of the other, every"
            f" {_size(overlay.grid.spacing)} um"
        )
    return ", ".join(parts)


def _size(lengths: Sides) -> str:
    """Write two lengths as "1000 x 500"."""
    return f"{lengths[0]:.6g} x {lengths[1]:.6g}"
