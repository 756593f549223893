"""A filter applied to values on some nodes of its grid, with zero on all other nodes."""

from copy import copy
from typing import Any

import numpy as np

from bem.arrays import Field, Nodes, Real, Values
from bem.convolution import FieldFilter
from bem.places import is_whole
from bem.vectors import (
    SHORT,
    add_product,
    add_scaled,
    add_taken_product,
    clear,
    each_row,
    put,
    take,
)


class Selection:
    """A filter applied to values on some nodes, with zero on all other nodes.

    Where all nodes of the grid are selected, rows are copied whole, without a list of places.

    Parameters
    ----------
    operator : FieldFilter
        The filter of the whole field.
    nodes : ndarray, shape (m,), or None
        Flat indices into its (nx, ny); None for all of them in their order.
    """

    def __init__(self, operator: FieldFilter, nodes: Nodes | None) -> None:
        size = operator.shape[0] * operator.shape[1]
        self._size = size if nodes is None else nodes.size
        whole = nodes is None or is_whole(operator.shape, nodes)
        self._places = None if nodes is None or whole else operator.places(nodes)
        self._use(operator)

    def through(self, operator: FieldFilter) -> "Selection":
        """Return the same nodes of another filter, whose field has as many columns."""
        other = copy(self)
        other._use(operator)
        return other

    def _use(self, operator: FieldFilter) -> None:
        """Filter by an operator from now on."""
        self._operator = operator
        self._field = operator.field.reshape(-1)
        self._inside = operator.field[:, : operator.shape[1]]
        self._beyond = operator.field[:, operator.shape[1] :]
        self._last: tuple[Nodes, Nodes] | None = None
        self._filtered: Values | None = None

    def __call__(self, values: Real) -> Real:
        """Filter (m,) values on the nodes, and return (m,) values on the same nodes."""
        self._apply(self._places, values)
        return self._collected(np.empty(self._size, self._field.dtype))

    def everywhere(self, values: Real) -> Field:
        """Filter (m,) values on the nodes into a new (nx, ny) field on all nodes of the grid."""
        self._apply(self._places, values)
        return self._inside.copy()

    def spread(self, some: Nodes | slice, values: Real) -> Values:
        """Filter (a,) values on nodes[some], and return (m,) values on all the nodes.

        The places of the same list, which must not change, are looked up once. Long results are
        overwritten by the next call.
        """
        self._apply(self._places_of(some), values)
        if self._filtered is None or self._size < SHORT:
            self._filtered = np.empty(self._size)
        return self._collected(self._filtered)

    def image(self, some: Nodes | slice, values: Real) -> "Image":
        """Filter (a,) values on nodes[some], and return the image before it is gathered."""
        places = self._places_of(some)
        self._apply(places, values)
        return Image(self, places)

    def _places_of(self, some: Nodes | slice) -> Nodes | None:
        """Return the places of nodes[some] in the flat field, None for those of the whole grid."""
        if isinstance(some, slice):
            if self._places is not None:
                return self._places[some]
            if some == slice(None):
                return None
            some = np.arange(self._size)[some]
        if self._last is not None and self._last[0] is some:
            return self._last[1]
        self._last = None  # before the next takes as much memory
        here = some if self._places is None else take(self._places, some)
        places = self._operator.places(here) if self._places is None else here
        self._last = some, places
        return places

    def _apply(self, places: Nodes | None, values: Real) -> None:
        """Filter values at some places of the filter's own buffer."""
        if places is None:
            self._fill(values)
        else:
            clear(self._field)  # the filter is shared: that was the last input
            put(values, places, self._field)
        self._operator.transform()

    def _fill(self, values: Real) -> None:
        """Set the field to values on the whole grid, with zeros beyond it."""
        whole = values.reshape(self._operator.shape)

        def fill(some: slice) -> None:
            self._inside[some] = whole[some]
            self._beyond[some] = 0

        each_row(fill, *self._operator.field.shape)

    def _collected(self, out: Values) -> Values:
        """Gather the filtered values on all the nodes."""
        if self._places is not None:
            return take(self._field, self._places, out)
        whole = out.reshape(self._operator.shape)

        def collect(some: slice) -> None:
            whole[some] = self._inside[some]

        each_row(collect, *whole.shape)
        return out


class Image:
    """What a filter has made of values on some of the nodes; the next use of it overwrites that.

    Parameters
    ----------
    selection : Selection
        The nodes, whose filter has just been applied.
    places : ndarray, shape (a,), or None
        Places of the nodes that the values were on, None for the whole grid.
    """

    def __init__(self, selection: Selection, places: Nodes | None) -> None:
        self._selection, self._places = selection, places

    def on_nodes(self, out: Values) -> Values:
        """Return it on the nodes that the values were on, in `out`."""
        if self._places is None:
            return self._selection._collected(out)
        return take(self._selection._field, self._places, out)

    def add_to(self, target: Values, factor: float) -> None:
        """Add a factor times it to an (m,) target on all the nodes."""
        here: Any = self._selection
        if here._places is None:
            add_product(target.reshape(here._inside.shape), factor, here._inside)
        else:
            add_taken_product(target, factor, here._field, here._places)


class PlainImage:
    """An image that has been gathered: what `Image` says of one holds for it.

    Parameters
    ----------
    values : ndarray, shape (m,)
        The image on all the nodes.
    nodes : ndarray, shape (a,), or slice
        The nodes that the values were on.
    """

    def __init__(self, values: Values, nodes: Nodes | slice) -> None:
        self._values, self._nodes = values, nodes

    def on_nodes(self, out: Values) -> Values:
        """Return it on the nodes that the values were on, in `out`."""
        out[:] = self._values[self._nodes]
        return out

    def add_to(self, target: Values, factor: float) -> None:
        """Add a factor times it to an (m,) target on all the nodes."""
        add_scaled(target, factor, self._values)
