"""Nine models compared: baselines, searches of grids, tables and pictures beside the paper's.

`jobs` is where the commands compare and tune begin. `paper` has the paper's numbers, `grid` the
candidates that differ; `search` fits these on the workers (`fits`), within a time by `halving`.
`results` fits and times the winners, `folder` keeps what is found, `tables` and `pictures` show it.
`importance` ranks the inputs, `estimate` tells what whole grids take.
"""
