"""The influence matrix of a patch without edges under a load, for whole fields and lists of nodes.

All nodes may touch here. Contact sets of many nodes are masks, so that no field is gathered or
scattered; those of few nodes are lists.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bem.arrays import Field, Mask, Nodes, Real, Values
from bem.convolution import FieldFilter, kept_filter
from bem.interface import make_means
from bem.iterate import CONVOLUTION, Effort, inner
from bem.preconditioner import BLOCK, VACANT, Preconditioner, block_sums, whole_blocks
from bem.sections import computed_once
from bem.spacing import Boundary
from bem.spectrum import inverse_filter, spectral_filter
from bem.vectors import clear, each_row

# Values from which the constant of `cut_to_load` is guessed first, and a height that a share of the
# nodes exceeds.
SAMPLE = 1024


@dataclass
class Pressed:
    """A pressure on the whole patch that carries a load, on its way to equilibrium.

    Attributes
    ----------
    pressure : ndarray, shape (nx, ny)
        Pressure [reduced].
    residual : ndarray, shape (nx, ny)
        Penetration, negative where a gap is open.
    shift : float
        Displacement of the far field.
    effort : Effort
        Work so far.
    converged : bool
        Whether this is known to be the solution, from a residual in double precision.
    """

    pressure: Field
    residual: Real
    shift: float
    effort: Effort
    converged: bool = False

    def violation(self) -> float:
        """Return the largest penetration, or gap under pressure."""
        found: list[float] = []

        def measure(some: slice) -> None:
            residual = self.residual[some]
            gap = -float((residual * (self.pressure[some] > 0)).min())
            found.append(max(float(residual.max()), gap))

        each_row(measure, *self.residual.shape)
        return max(float(np.max(found)), 0.0)


class WholePatch:
    """The influence matrix of a patch without edges under a load, for whole fields.

    Parameters
    ----------
    below : ndarray, shape (nx, ny)
        Heights less the highest [unit of displacement].
    boundary : str
        "periodic" or "mirror".
    aspect : float
        Second side of a cell over its first [1].
    load : float
        Sum of the pressure, above 0 [reduced].
    keep_displacement : bool
        Whether the displacement under an exact residual is wanted too.

    Attributes
    ----------
    patch : tuple
        Shape (nx, ny), boundary and aspect.
    displacement : ndarray, shape (nx, ny), or None
        Displacement under the last pressure whose residual is exact, if it is wanted.
    working : FieldFilter
        The influence matrix in single precision.
    outside : ndarray, shape (nx, ny)
        Zero on the contact set and one elsewhere.
    """

    def __init__(
        self,
        below: Field,
        boundary: Boundary,
        aspect: float,
        load: float,
        *,
        keep_displacement: bool = False,
    ) -> None:
        shape: tuple[int, int] = below.shape[0], below.shape[1]
        patch = whole_blocks(shape[0]), whole_blocks(shape[1])
        self.below, self.load = below, load
        self.displacement: Field | None = None
        self._keep_displacement = keep_displacement
        self.patch = shape, boundary, aspect
        self._double = spectral_filter(shape, boundary, aspect)
        self.working = spectral_filter(shape, boundary, aspect, "float32")
        self._inverse = inverse_filter(patch, boundary, aspect, "float32")
        self._means = kept_filter(make_means, patch, boundary, aspect)
        self._grid = slice(0, shape[0]), slice(0, shape[1])
        self._correction = np.zeros(patch, np.float32)
        self._contact = np.zeros(patch, np.float32)
        self._outside = np.ones(patch, np.float32)
        self.outside = self._outside[self._grid]

    @computed_once
    def preconditioner(self) -> Preconditioner:
        """The approximate inverse for contact sets that are lists of nodes."""
        return Preconditioner(self.patch[0], None, self._inverse, self._means)

    def press(self, pressure: Field, effort: Effort) -> Pressed:
        """Scale a pressure to the load, and compute its residual in double precision."""
        pressure = pressure * (self.load / float(pressure.sum()))
        displacement = self._double.field
        displacement[:] = pressure
        self._double.transform()
        self.displacement = displacement.copy() if self._keep_displacement else None
        return self._pressed(pressure, displacement, effort)

    def press_on(self, nodes: Nodes, values: Values) -> tuple[Real, float]:
        """Compute the residual by a pressure on some nodes in double precision.

        Parameters
        ----------
        nodes : ndarray, shape (a,)
            Flat indices of the nodes.
        values : ndarray, shape (a,)
            Pressure on them, which carries the load.

        Returns
        -------
        residual : ndarray, shape (nx, ny)
            Residual once the far field is in balance, in single precision.
        shift : float
            Displacement of the far field.
        """
        displacement = displaced_by(self._double, (nodes, values))
        if self._keep_displacement:
            self.displacement = displacement.copy()
        gaps = self.below.reshape(-1)[nodes] - displacement.reshape(-1)[nodes]
        shift = -inner(values, gaps) / float(values.sum())
        return self._residual(displacement, shift), shift

    def _pressed(self, pressure: Field, displacement: Real, effort: Effort) -> Pressed:
        """Return a pressure that carries the load, with its residual in balance."""
        work = total(pressure, displacement) - total(pressure, self.below)
        shift = work / self.load
        return Pressed(pressure, self._residual(displacement, shift), shift, effort + CONVOLUTION)

    def _residual(self, displacement: Real, shift: float) -> Real:
        """Return the residual at a displacement of the far field, rounded at the end."""
        residual = np.empty(self.below.shape, np.float32)

        def subtract(some: slice) -> None:
            rows = self.below[some] - displacement[some]
            np.add(rows, shift, out=residual[some], casting="same_kind")

        each_row(subtract, *self.patch[0])
        return residual

    def full_contact(self) -> Field:
        """Compute the pressure that closes all gaps, which is negative where it has to pull."""
        inverse = inverse_filter(*self.patch)
        inverse.field[:] = self.below
        inverse.transform()
        pressure: Field = inverse.field + self.load / self.below.size
        return pressure

    def closed(self, pressure: Field) -> Pressed:
        """Return the pressure of full contact as the solution that it is where it pushes."""
        flat = np.zeros(pressure.shape, np.float32)
        self.displacement = self.below - self.below.mean()
        return Pressed(pressure, flat, -float(self.below.mean()), CONVOLUTION, converged=True)

    def begin(self, pressure: Field, effort: Effort) -> Pressed:
        """Scale a pressure to the load, and compute its residual in single precision."""
        return self._loaded(pressure * (self.load / float(pressure.sum())), effort)

    def start(self, pressure: Field) -> Pressed:
        """Project the pressure of full contact onto pressures that carry the load.

        The projection subtracts a constant before it cuts off tension: under a small load only the
        highest pressures stay.
        """
        return self._loaded(cut_to_load(pressure, self.load), CONVOLUTION)

    def start_on_peaks(self, share: float) -> Pressed:
        """Press some share of the nodes, the highest ones, as deep as a plane at their foot would.

        The approximate inverse finds the pressure on them, of which a constant is subtracted, and
        tension cut off, until it carries the load.
        """
        heights = self.below.reshape(-1)
        sample = heights[:: heights.size // SAMPLE | 1]
        number = min(int(share * sample.size) + 1, sample.size)
        foot = np.partition(sample, -number)[-number]
        nodes: Nodes = (heights >= foot).nonzero()[0]
        values = self.preconditioner.restricted_to(nodes)(heights[nodes] - foot)
        pressure = np.zeros(self.below.shape)
        pressure.reshape(-1)[nodes] = cut_to_load(values, self.load)
        return self._loaded(pressure, Effort())

    def _loaded(self, pressure: Field, effort: Effort) -> Pressed:
        """Compute the residual of a pressure that carries the load in single precision."""
        return self._pressed(pressure, self.displace(pressure), effort)

    def displace(self, pressure: Real, less: Real | None = None) -> Real:
        """Compute a displacement in single precision; the next call spoils it.

        Parameters
        ----------
        pressure : ndarray, shape (nx, ny)
            Pressure.
        less : ndarray, shape (nx, ny), optional
            Pressure to subtract before.
        """
        field: Real = self.working.field

        def load(some: slice) -> None:
            field[some] = pressure[some] if less is None else pressure[some] - less[some]

        each_row(load, *field.shape)
        self.working.transform()
        return field

    def level(self, pressed: Pressed) -> None:
        """Shift the far field so that the mean of the residual weighted by the pressure is zero."""
        shift_by(pressed, -total(pressed.pressure, pressed.residual) / self.load)

    def set_contact(self, touching: Callable[[slice], Mask]) -> None:
        """Take a contact set for `inside` and `correct`, as a test of rows of the grid."""
        contact, outside, (rows, columns) = self._contact, self._outside, self.below.shape

        def mark(some: slice) -> None:
            contact[some, :columns] = touching(some)
            np.subtract(1, contact[some], out=outside[some])

        each_row(mark, rows, columns)
        self._means.field[:] = BLOCK**2 - block_sums(outside)
        self._means.transform()
        self._weights = 1 / (self._means.field + np.float32(VACANT))

    def inside(self, residual: Real) -> float:
        """Keep the residual in contact for `correct`, and return its largest magnitude."""
        field, (rows, columns) = self._inverse.field, residual.shape
        field[rows:], field[:, columns:] = 0, 0
        found: list[float] = []

        def keep(some: slice) -> None:
            here = field[some, :columns]
            np.multiply(residual[some], self._contact[some, :columns], out=here)
            found.append(max(float(here.max()), -float(here.min())))

        each_row(keep, rows, columns)
        return float(np.max(found))

    def correct(self) -> Real:
        """Apply the approximate inverse of `bem.preconditioner` to the residual in contact.

        Returns
        -------
        ndarray, shape (nx, ny)
            Correction of the pressure, which the next call overwrites.
        """
        field, means = self._inverse.field, self._means
        blocks, outside, contact, corrections = (
            array.reshape(-1, BLOCK, field.shape[1])
            for array in (field, self._outside, self._contact, self._correction)
        )
        means.field[:] = block_sums(field)
        means.transform()
        np.multiply(means.field, self._weights, out=means.field)

        def extend(some: slice) -> None:
            blocks[some] += outside[some] * _columns(means.field[some])

        def finish(some: slice) -> None:
            np.add(blocks[some], _columns(means.field[some]), out=corrections[some])
            corrections[some] *= contact[some]

        each_row(extend, len(blocks), BLOCK * field.shape[1])
        self._inverse.transform()
        np.multiply(self._weights, block_sums(field, self._outside), out=means.field)
        means.transform()
        each_row(finish, len(blocks), BLOCK * field.shape[1])
        return self._correction[self._grid]


def _columns(blocks: Real) -> Real:
    """Repeat the values of blocks along their columns, for rows of blocks."""
    repeated: Real = np.repeat(blocks, BLOCK, axis=1)[:, np.newaxis]
    return repeated


def displaced_by(operator: FieldFilter, *loads: tuple[Nodes, Real]) -> Real:
    """Compute the displacement of a whole patch by pressures on lists of nodes.

    Parameters
    ----------
    operator : FieldFilter
        The influence matrix, whose field is as large as the patch.
    *loads : tuple of ndarray, shape (a,)
        Flat indices of nodes and the pressure on them; later lists take precedence.

    Returns
    -------
    ndarray, shape (nx, ny)
        Displacement, which the next use of the operator overwrites.
    """
    field = operator.field.reshape(-1)
    clear(field)
    for nodes, values in loads:
        field[nodes] = values
    operator.transform()
    return operator.field


def cut_to_load(pressure: Field, load: float) -> Field:
    """Return max(p - c, 0) with the constant c that leaves a load."""
    values = pressure.reshape(-1)
    constant = _bound(values, load)
    if values.size >= 8 * SAMPLE:
        some = values[:: values.size // SAMPLE]
        share = load * some.size / values.size
        high = values[values > _constant(some, share, _bound(some, share))]
        constant = max(constant, _bound(high, load))
    cut: Field = pressure - _constant(values, load, constant)
    np.maximum(cut, 0, out=cut)
    carried = float(cut.sum())
    if not carried > 0:
        cut.reshape(-1)[np.argmax(pressure)] = carried = load
    cut *= load / carried
    return cut


def _bound(values: Values, load: float) -> float:
    """Return the constant that leaves a load on all of these; that of `cut_to_load` is no lower."""
    return (float(values.sum()) - load) / values.size if values.size else -math.inf


def _constant(values: Values, load: float, bound: float) -> float:
    """Find the constant c with which max(p - c, 0) carries a load, from a bound below it."""
    above, constant = values, bound
    for _ in range(50):  # each time from fewer nodes, so that the constant only rises
        left = above[above > constant]
        if len(left) in {0, len(above)}:  # none, where the load is lost to rounding
            break
        above = left
        constant = _bound(above, load)
    return constant


def touching_nodes(pressed: Pressed) -> int:
    """Count the nodes that are under pressure or would penetrate."""
    return int(np.count_nonzero(touching_in(pressed, slice(None))))


def touching_in(pressed: Pressed, some: slice) -> Mask:
    """Return which nodes of some rows are under pressure or would penetrate."""
    touching: Mask = (pressed.pressure[some] > 0) | (pressed.residual[some] > 0)
    return touching


def total(a: Real, b: Real) -> float:
    """Compute an inner product of fields, row by row in their precision, then in double."""
    sums = np.empty(len(a))

    def add_up(some: slice) -> None:
        sums[some] = np.einsum("ij,ij->i", a[some], b[some])

    each_row(add_up, *a.shape)
    return float(sums.sum())


def load_of(field: Real) -> float:
    """Add up a field, row by row in its precision, then in double."""
    sums = np.empty(len(field))

    def add_up(some: slice) -> None:
        sums[some] = field[some].sum(axis=1)

    each_row(add_up, *field.shape)
    return float(sums.sum())


def shift_by(pressed: Pressed, shift: float) -> None:
    """Move the far field."""
    residual = pressed.residual

    def move(some: slice) -> None:
        residual[some] += shift

    each_row(move, *residual.shape)
    pressed.shift += shift
