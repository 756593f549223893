"""The paper's numbers, captions and reasons."""

import pytest

from bench.paper import facts
from learn.comparison import paper


def test_the_papers_numbers_fit_together():
    assert facts.TRAIN_ROWS == 12_703
    # Most models' nMSE and R2 are of the same test rows: one ratio for all but AdaBoost.
    spreads = {name: paper.spread_of(each) for name, each in paper.TEST["baseline"].items()}
    odd = [name for name, value in spreads.items() if abs(value / paper.SPREAD - 1) > 0.15]
    assert odd == ["adaboost"]
    assert max(facts.RANGES["area_percent"]) == facts.AREA_MAX


@pytest.mark.parametrize(
    ("ours", "theirs", "text"),
    [(2.0, 1.0, "x 2"), (0.02, 190.0, "1/9,500"), (1.0, 0.0, ""), (300.0, 1.0, "x 300")],
)
def test_ratios_are_readable(ours, theirs, text):
    assert facts.ratio(ours, theirs) == text
