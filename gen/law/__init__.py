"""Contact laws of interfaces: tables that a finite-element code reads at an integration point.

`order` is the request for a law, `surfaces` reads its surfaces, `solver` solves their contacts, and
`contact_law` puts these into the tables of a law, whose numbers are in `curves`, with the bands of
`bands` and the further contacts of `between`. `layer` has the part of a layer in a law. `means`
makes the law of the means over the population of a scene within errors, which `population` samples
as `multilevel` says, with the record of `sampled`. `files` prints a law and writes it, and
`finite_elements` and `cubics` write it for programs. The laws of surrogates use the same numbers
and writers.
"""

from gen.law.contact_law import Law, by_solver
from gen.law.means import by_means
from gen.law.order import Order

__all__ = ["Law", "Order", "by_means", "by_solver"]
