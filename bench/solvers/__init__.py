"""Solvers of one contact problem, ours and those of other people, which are all called alike.

On free patches all have equal influence coefficients, of a uniform pressure on each square cell.
Each runs on one thread of one process. A solver whose transforms are slow on the case's own grid
also runs on a larger grid with a margin that never touches. Only solvers take part that a package
index installs on today's Python; slippy 0.5.2 does not.
"""
