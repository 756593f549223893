"""What a budget allows, by a clock that the tests set."""

import pytest

from learn.grow import rows as module
from learn.grow.rows import Pace


class Clock:
    """A clock that stands still unless it is moved."""

    def __init__(self):
        self.now = 1000.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def test_rows_features_and_the_fit_have_to_end_in_time(clock):
    pace = Pace(100.0, 1)
    pace.row, pace.features = 1.0, 0.5
    assert pace.affordable(60, 1000) == 66  # 66 (1 + 1/2) = 99
    pace.fit = 60, 10.0
    rows = pace.affordable(60, 1000)
    assert rows * 1.5 + 10 * ((60 + rows) / 60) ** 2 <= 100
    assert (rows + 1) * 1.5 + 10 * ((61 + rows) / 60) ** 2 > 100
    clock.now += 200
    assert pace.affordable(60, 1000) == 0


def test_tasks_become_single_rows_towards_the_end(clock):
    pace = Pace(80.0, 1)
    tasks = pace.paced(iter([(0, 64), (64, 128)]))
    assert next(tasks) == (0, 1)  # nobody knows what a row takes
    pace.row = 1.0
    assert next(tasks) == (1, 11)
    clock.now += 70.0
    assert next(tasks) == (11, 12)
    clock.now += 70.0
    assert next(tasks) == (12, 13)
