"""Surfaces that are pressed: a prepared map, or the composite surface of two rough bodies.

The contact of two rough bodies is that of a plane with a surface whose heights are the sum of both
bodies' heights, with the E* of both bodies. Heights of each map point out of its body, and each map
is seen from outside. The second body is turned over to face the first: one axis of its map then
runs backwards. The centres of the maps coincide unless the second map is shifted. Maps with equal
spacings are laid with their nodes on each other, so that neither is smoothed by interpolation.
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
"""Axes of the second map that may run backwards, or "none". x and y come first, so that their index
is the axis of the array."""

# Files round their lengths: a distance of nodes of at most this number of spacings counts as 0, and
# lengths with at most this relative difference count as equal.
SAME = 1e-6
COARSE = 10.0  # ratio of the spacings of two maps above which a unit is probably wrong
# number of nodes by which a map without edges is continued on each side before it is interpolated:
# the influence of a node on a spline falls by a factor of 0.27 with each node of distance
REACH = 24


@dataclass(frozen=True)
class Opposite:
    """The second of two rough bodies, and how it is laid on the first one."""

    path: Path  # file of the second surface
    reading: Reading  # how this file is read and prepared
    # {"x", "y", "none"}: axis of the second map that runs backwards as the body is turned over;
    # "none" for a map that is seen through its body
    turned: str = "x"
    # distance of the second map's centre from the first one's, along x and y of the first map [um]
    shift: Sides = (0.0, 0.0)
    # Whether `reading` was given for the first body. Its lengths and its unit may then not suit
    # this file, and `prepared` leaves them out if they do not.
    shared: bool = True

    def prepared(self, boundary: Boundary) -> Topography:
        """Read and prepare the second surface.

        A shared reading may have lengths (`side`) or a unit that the second file does not allow,
        because it states its own. So if reading or preparing fails, both are tried again without
        lengths and unit, unless `reading.override_scale` is set. If they fail again, the first
        error is raised.

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
            raise  # the first error, which is about the reading that the user gave


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
        The prepared surface, or the composite surface; without holes.
    warnings : list of str
        One line for each reason to distrust contacts of the surface.

    Raises
    ------
    InputError
        If a file cannot be read, a setting does not suit its map, or the maps share fewer than
        2 x 2 nodes. For a single body the message begins with its file or with an option.
    """
    try:
        surface = prepare(read(path, reading, boundary), reading)
        if opposite is not None:
            body = opposite.prepared(boundary)
            surface = composite(surface, body, opposite.turned, opposite.shift)
    except InputError as error:
        message = str(error)
        names_its_cause = message.startswith(("--", str(path)))
        # With two bodies, the message may be about the other file.
        if opposite is None and not names_its_cause:
            message = f"{path}: {message}"
        raise InputError(message) from None
    return surface, surface_warnings(surface)


def composite(
    first: Topography, second: Topography, turned: str = "x", shift: Sides = (0.0, 0.0)
) -> Topography:
    """Add the heights of two bodies that face each other, where their maps overlap.

    The sum has the nodes of the finer grid that are on both maps. The other map is interpolated to
    these nodes by cubic splines, along each axis on which its nodes are elsewhere. The height of
    the second body's highest node is subtracted from its map, so that a flat body changes nothing.

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
        The composite surface. It has the steps and warnings of both maps, which begin with "body 1"
        and "body 2", and one more step. `followed` are the settings that both maps followed, and
        `instrument` has the larger limits of both. Its name, heights, sides and doubtful nodes are
        new. All other fields, as the unit, are those of the map with the finer grid.

    Raises
    ------
    InputError
        If fewer than 2 x 2 nodes are on both maps.
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
        overlay.finer,
        name=name,
        heights=overlay.heights,
        sides=overlay.sides,
        followed=first.followed & second.followed,
        doubtful=overlay.doubtful,
        instrument=first.instrument.or_worse(second.instrument),
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
    """Return the second map as it faces the first one.

    The axis `turned` ("x", "y" or "none") runs backwards, and the highest height is 0.
    """
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
    """Nodes of a grid along one axis that are on the added map, and their places there."""

    nodes: slice  # range of the k nodes in the grid
    # places of these nodes in the added map, in its spacings from its first node, shape (k,)
    places: Values
    # {"wrap", "symmetric", ""}: mode of `numpy.pad` that continues the added map along this axis;
    # "" if the map ends at its borders
    continued: Literal["wrap", "symmetric", ""]

    @property
    def exact(self) -> bool:
        """Whether every place is a node of the added map, so that nothing is interpolated."""
        return bool((self.places == np.rint(self.places)).all())


@dataclass(frozen=True, eq=False)
class _Overlay:
    """Two maps that are laid on each other: the finer one gives the grid, the other is added."""

    finer: Topography  # map with the finer grid; the first one if both are equally fine
    added: Topography  # the other map, which is interpolated to this grid
    # number of the body of the added map: 1 for the first, 2 for the second
    added_number: int
    along_x: _Line  # nodes of the grid along x that are on the added map
    along_y: _Line  # nodes of the grid along y that are on the added map

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of nodes of the sum along x and y."""
        return self.along_x.places.size, self.along_y.places.size

    @property
    def exact(self) -> bool:
        """Whether the nodes of the sum are nodes of the added map, which is not interpolated."""
        return self.along_x.exact and self.along_y.exact

    @property
    def heights(self) -> Heights:
        """Sum of the heights of both maps [um], shape (nx, ny)."""
        of_finer = self.finer.heights[self.along_x.nodes, self.along_y.nodes]
        return of_finer + self._at_nodes(self.added.heights)

    @property
    def sides(self) -> Sides:
        """Lengths of the sum along x and y [um]."""
        return self._side(0), self._side(1)

    @property
    def doubtful(self) -> NDArray[np.bool_] | None:
        """Whether a map has a code, pit or spike at each node of the sum, shape (nx, ny).

        None if no node is marked in either map. Marks of an added map that is interpolated are left
        out, because splines would spread them.
        """
        doubtful: NDArray[np.bool_] | None = None
        if self.finer.doubtful is not None:
            doubtful = self.finer.doubtful[self.along_x.nodes, self.along_y.nodes]
        if self.added.doubtful is None or not self.exact:
            return doubtful
        of_added = self._at_nodes(self.added.doubtful.astype(np.float64)) > 0
        return of_added if doubtful is None else doubtful | of_added

    @property
    def warnings(self) -> list[str]:
        """One line if the spacings differ by more than a factor of `COARSE`, otherwise no line."""
        ratio = max(np.divide(self.added.spacing, self.finer.spacing).tolist())
        if ratio <= COARSE:
            return []
        warning = (
            f"nodes of one body are {ratio:.3g} times as far apart as those of the other:"
            " its short waves are not there; check --unit and --side"
        )
        return [warning]

    def _side(self, axis: int) -> float:
        """Return the length of the sum along an axis [um]."""
        nodes = self.shape[axis]
        # All nodes: return the side as it is, not a product that rounds.
        if nodes == self.finer.heights.shape[axis]:
            return self.finer.sides[axis]
        spacings = nodes - 1 if self.finer.boundary == "free" else nodes
        return spacings * self.finer.spacing[axis]

    def _at_nodes(self, values: Values) -> Values:
        """Interpolate values, shape (mx, my), of the added map to the sum's nodes (nx, ny)."""
        along_x = _interpolated(values, self.along_x, axis=0)
        return _interpolated(along_x, self.along_y, axis=1)


def _overlay(first: Topography, second: Topography, shift: Sides) -> _Overlay:
    """Lay the second map on the first one.

    The second map faces the first one already. `shift` is the distance of its centre from that of
    the first map, along x and y [um].
    """
    if math.prod(first.spacing) <= math.prod(second.spacing) * (1 + SAME):
        return _Overlay(
            finer=first,
            added=second,
            added_number=2,
            along_x=_line(first, second, axis=0, shift=shift[0]),
            along_y=_line(first, second, axis=1, shift=shift[1]),
        )
    return _Overlay(
        finer=second,
        added=first,
        added_number=1,
        along_x=_line(second, first, axis=0, shift=-shift[0]),
        along_y=_line(second, first, axis=1, shift=-shift[1]),
    )


def _line(finer: Topography, added: Topography, axis: int, shift: float) -> _Line:
    """Return the nodes of the grid along an axis that are on the added map.

    `finer` is the map with the grid. `shift` is the distance of the added map's centre from the
    centre of the grid along the axis [um].
    """
    grid_nodes = finer.heights.shape[axis]
    added_nodes = added.heights.shape[axis]
    step = finer.spacing[axis]
    if shift == 0 and math.isclose(step, added.spacing[axis], rel_tol=SAME):
        # If one map has an odd number of nodes and the other an even one, half a spacing brings the
        # nodes of both maps together.
        shift = step * ((grid_nodes - added_nodes) % 2) / 2
    from_grid_centre = (np.arange(grid_nodes) - (grid_nodes - 1) / 2) * step
    from_added_centre = from_grid_centre - shift
    places = from_added_centre / added.spacing[axis] + (added_nodes - 1) / 2
    nearest = np.rint(places)
    places = np.where(np.abs(places - nearest) < SAME, nearest, places)
    # Maps of equal length without edges overlap everywhere: periodic ones always, mirrored ones if
    # they are not shifted.
    if math.isclose(finer.sides[axis], added.sides[axis], rel_tol=SAME):
        all_nodes = slice(0, grid_nodes)
        if finer.boundary == "periodic":
            wrapped = places % added_nodes
            return _Line(nodes=all_nodes, places=wrapped, continued="wrap")
        if finer.boundary == "mirror" and shift == 0:
            return _Line(nodes=all_nodes, places=places, continued="symmetric")
    inside = np.flatnonzero((places >= 0) & (places <= added_nodes - 1))
    if not inside.size:
        return _Line(nodes=slice(0, 0), places=places[:0], continued="")
    nodes = slice(int(inside[0]), int(inside[-1]) + 1)
    return _Line(nodes=nodes, places=places[nodes], continued="")


def _interpolated(values: Values, line: _Line, axis: int) -> Values:
    """Interpolate values of the added map along an axis to the places of a line.

    `values` is of shape (m, n); in the result, this axis has the length of `line.places`.
    """
    from scipy.interpolate import make_interp_spline

    if line.exact:
        return np.take(values, line.places.astype(np.int64), axis=axis)
    first = 0  # index of the map's first node after it is continued
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
    """Write the line for `Topography.steps` about how the second map was added to the first.

    `turned` and `shift` are the arguments of `composite`.
    """
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
            f" {_size(overlay.finer.spacing)} um"
        )
    return ", ".join(parts)


def _size(lengths: Sides) -> str:
    """Write two lengths as "1000 x 500"."""
    return f"{lengths[0]:.6g} x {lengths[1]:.6g}"
