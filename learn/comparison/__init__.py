"""Nine models compared: baselines, searches of whole grids, tables and pictures beside the paper's.

`spaces` has the grids and `pruning` what of them differs; `search`, `staged`, `budget` and `trials`
fit candidates on the farm and keep what they find; `timing` measures the winners, `folder` holds
it all, `tables` and `pictures` show it. `jobs` is where compare and tune begin.
"""
