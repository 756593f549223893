"""Nine models compared: baselines, searches of grids, tables and pictures beside the paper's.

The commands `compare` and `tune` begin in `jobs`, which reads the rows, and fits and times
baselines and winners. `paper` has the paper's numbers, and `grid` the candidates of its Table 2
that differ. `search` has these candidates fitted on the workers, by the fits of `fits`. `folder`
keeps the results as files. `tables` collects them beside the paper's Tables 3 and 4, `printing`
prints them, and `plots` draws them. `importance` ranks the inputs.

`docs/results/models.md` leads from each table and figure of the paper to its command and to the
function that makes its numbers. `bench.paper` sets the results of a folder beside the paper's.
"""
