"""Contact laws that a surrogate predicts, with the numbers and the writers of `gen.law`.

`contact_law.make` makes a law; `predicted` predicts its contacts, and `inversion` reads them at
given pressures.
"""

from learn.surrogate.law.contact_law import Order, make

__all__ = ["Order", "make"]
