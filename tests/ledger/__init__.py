"""The ledger of counts: convolutions, contact nodes, rows, bytes and fits that no load changes.

Times differ between machines and between runs; these counts do not, so that a loss of efficiency or
a change of results shows at once. `counts.csv` beside this module is committed and compared by
`make check`, which runs `python -m tests.ledger`.

A count of work (iterations, convolutions, fits, bytes) may fall, but a rise by more than 2 % fails.
A count of results (contact nodes, rows, candidates) may not change by more than 0.1 % either way.
A wanted change updates the file in the same commit, with its reason:

    python -m tests.ledger --update "Why the counts have changed"

Which counts a constant of the solver moves is shown by

    python -m tests.ledger --halved bem.active_set.ADVANCE

or `--doubled`; the comments of these constants name what was found.

Exact on every processor are solves, rows, candidates, fits and bytes per row, which follow from
scenes and grids of settings. Convolutions, and rarely iterations and contact nodes, may differ by
one in a solve between processors, whose sums of many numbers round differently. Every entry adds up
enough solves that this stays below its bound: with NumPy and BLAS switched to code for processors
of 2004 to 2011, convolutions rose by 1.2 % at most, and nothing else changed. The bytes of a file
may differ a little between versions of HDF5.
"""
