"""Speed-up is measured within rounds."""

from bench.farm.speedup import summary


def test_the_speed_up_is_a_median_of_rounds():
    others = {"alone": 1.9, "1 worker": 2.0, "2 copies": 2.0}
    turns = [others | {"2 workers": time} for time in (1.0, 1.25, 2.0)]
    assert "over 1 worker: 1.60 (median of 3 rounds, 1.00 to 2.00)" in summary(turns)
