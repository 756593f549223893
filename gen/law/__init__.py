"""Contact laws of interfaces: tables that a finite-element code reads at an integration point.

`contact_law` solves a law. `surfaces` are what it is about, `curves` its numbers.
`files` shows and writes it, `finite_elements` for programs.
The laws of surrogates use the same numbers and writers.
"""

from gen.law.contact_law import Law, Order, by_solver

__all__ = ["Law", "Order", "by_solver"]
