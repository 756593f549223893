"""Nine models compared: baselines, searches of grids, tables and pictures beside the paper's.

`jobs` is where the commands compare and tune begin, and fits and times the winners. `paper` has the
paper's numbers, `grid` the candidates that differ; `search` fits these on the workers (`fits`).
`folder` keeps what is found, `tables` shows it. `importance` ranks the inputs.
"""
