"""How far ours is from the paper's, in words."""

import pytest

from bench.paper import texts


@pytest.mark.parametrize(
    ("ours", "theirs", "text"),
    [(2.0, 1.0, "x 2"), (0.02, 190.0, "1/9,500"), (1.0, 0.0, ""), (300.0, 1.0, "x 300")],
)
def test_ratios_are_readable(ours, theirs, text):
    assert texts.ratio(ours, theirs) == text
