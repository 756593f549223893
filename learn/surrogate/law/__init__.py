"""Contact laws: what a finite-element code needs at an integration point, as tables.

`contact_law.make` makes a law; `predicted` and `solved` are the two ways to it, `subjects` the
surfaces that it is about, `points` and `curves` its numbers, `table` and `c_header` its files.
"""

from learn.surrogate.law.contact_law import Law, Order, make

__all__ = ["Law", "Order", "make"]
