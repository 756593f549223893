"""Learning curves, and the rows that they ask for."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from learn.grow.accuracy import Accuracy, Sizes
from learn.grow.curve import Curve, advise, fitted, values


@pytest.mark.parametrize("exact", [(0.0, 50.0, 0.5), (1.0, 300.0, 0.9), (0.5, 20.0, 0.3)])
def test_the_fit_finds_the_curve_that_points_lie_on(exact):
    rows = np.array([100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0])
    found = fitted(rows, values(np.array(exact), rows))
    further = np.array([6400.0, 25_600.0])
    assert values(found, further) == pytest.approx(values(np.array(exact), further), rel=0.02)


def appraised(nmae, error, mark, rows=240, *, by_tile=False):
    """What `advise` looks at."""
    judged = {"area": SimpleNamespace(accuracy=Accuracy(nmae, error, rows // 5))}
    sets = [SimpleNamespace(by_tile=by_tile)]
    number = Sizes(1).number(rows)
    return SimpleNamespace(rows=rows, number=number, mark=mark, judged=judged, sets=sets)


def curve_of(*fit):
    here, nothing = np.array([60.0, 120.0, 240.0]), np.ones(3)
    return Curve("area", here, nothing, nothing, nothing, np.array(fit, dtype=float))


def test_an_exact_error_asks_for_the_rows_of_the_curve():
    """nMAE 4 % at 240 rows, halved by four times the rows: 960 rows, a size, for 2 %."""
    assert advise(appraised(4.0, 0.0, 2.001), curve_of(0, 62.0, 0.5), Sizes(1), 20_000) == 960


def test_a_standard_error_asks_for_more():
    curve = curve_of(0, 62.0, 0.5)
    exact, uncertain = (
        advise(appraised(4.0, error, 2.0), curve, Sizes(1), 20_000) for error in (0.0, 0.5)
    )
    assert exact < uncertain < math.inf
    tiles = advise(appraised(4.0, 0.5, 2.0, by_tile=True), curve, Sizes(1), 20_000)
    assert tiles > uncertain  # more windows, but no more tiles


def test_a_floor_above_the_mark_is_hopeless():
    found = appraised(4.0, 0.1, 2.0)
    assert math.isinf(advise(found, curve_of(3.0, 15.5, 0.5), Sizes(1), 20_000))
