"""The search for a model's best settings over a grid of candidates, by cross-validation.

`spaces` has the grids, and `pruning` reduces them to the candidates that differ. `grid_search` fits
candidates on the workers (`fits`, `staged`) and keeps their scores on disk (`trials`); `scores`
ranks them beside the baseline. `budget` searches as far as a time allows, `whole_grid` estimates
the time of a whole grid.
"""
