"""The order of candidates: ties, failures, and grids on which every fit fails."""

import numpy as np


def test_ties_go_to_the_first_in_the_grid(searching):
    space = {"min_samples_split": [2, 3, 4], "min_samples_leaf": [2], "max_depth": [3]}
    search = searching("decision-tree", space)
    assert len(search.grid.differing) == 1
    assert search.grid.first(search.exhaustive().scores.winner)["min_samples_split"] == 2


def test_candidates_that_fail_come_last_with_their_reason(searching):
    search = searching("svm", {"C": [-1.0, 1.0], "kernel": ["rbf"]})
    scores = search.exhaustive().scores
    assert np.isnan(scores.means[0])
    assert scores.scored == 1
    assert search.grid.first(scores.winner)["C"] == 1.0
    (reason,) = scores.failures
    assert "'C' parameter" in reason
    assert scores.failures[reason] == 5


def test_a_grid_on_which_all_fail_has_no_winner(searching):
    assert searching("svm", {"C": [-1.0, -2.0]}).exhaustive().scores.winner == -1
