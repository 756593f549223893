"""Solvers of one contact problem, ours and those of other people, all called in the same way.

Influence coefficients are the same for all: a uniform pressure on each square cell, free
boundaries. Everything runs on one thread of one process. Where a solver's own grid is one that its
transforms are slow on, it also runs with a margin that never touches, up to a better one. Those
take part that install from a package index on today's Python; slippy 0.5.2 does not.
"""
