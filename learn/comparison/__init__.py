"""Nine models compared: baselines, searches of grids, tables and pictures beside the paper's.

`jobs` is where the commands compare, tune and estimate begin. `paper` has its numbers, `grid`
reduces them to the candidates that differ, `search` fits these on the workers (`fits`) and keeps
their scores on disk (`trials`), `halving` searches within a time,
and `estimate` tells the time of a whole grid. `timing` fits and times the winners, `results` and
`folder` keep the results, `tables` and `pictures` show them. `importance` and `appendix` are
reports of their own.
"""
