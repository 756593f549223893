"""Contact laws of interfaces: tables that a finite-element code reads at an integration point.

`contact_law` makes a law with the solver; `subjects` are the surfaces that it is about, `points`
and `curves` its numbers. `writers` writes its files: `table` (CSV), `json_file`, `c_header`,
`finite_elements` (CalculiX, Abaqus) and `picture`. The laws of surrogates use the same numbers and
writers.
"""

from gen.law.contact_law import Law, Order, by_solver

__all__ = ["Law", "Order", "by_solver"]
