"""Nine models compared: baselines, searches of whole grids, tables and pictures beside the paper's.

`jobs` is where the commands compare, tune and estimate begin. `search` finds the best settings of a
model, within the time that `clock` gives it, `timing` fits and times the winners, `results` and
`folder` keep the results, `tables` and `pictures` show them. `importance` and `appendix` are
reports of their own.
"""
