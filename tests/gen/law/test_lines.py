"""Points of tables whose straight lines follow a law."""

import numpy as np
import pytest

from gen.law.lines import Column


def column(at, values, own=None):
    """A column that is known at points, all of which are the law's own unless they are named."""
    whole = np.ones(at.size, dtype=bool)
    return Column.through(
        at, values, whole if own is None else own, whole, power_law=True
    )


def diverging(points):
    """A conductance that diverges towards full contact at a pressure of 1."""
    at = np.append(0.0, np.geomspace(1e-3, 0.99, points))
    return at, at / (1 - at)


@pytest.mark.few(2)
@pytest.mark.parametrize("room", [8, 12, None, 20])
def test_lines_are_as_close_as_there_is_room_for(room):
    at, values = diverging(60)
    few = np.zeros(at.size, dtype=bool)
    few[[0, 1, 30, -1]] = True
    law = column(at, values, few)
    line = law.laid(room)
    assert room is None or line.at.size <= room
    assert (np.diff(line.at) > 0).all()
    assert (np.diff(line.values) >= 0).all()
    for end in (0, 1, -1):
        assert line.values[end] == pytest.approx(values[end], rel=1e-9)
    even = column(at, values)
    places = np.unique(np.linspace(0, 16 * 60, room or 30).round().astype(int))
    places = np.unique(np.append(places, 16))
    assert law.deviation(line).inside < even.deviation(even._on_law(places)).inside
    if room is None:
        assert law.deviation(line).inside <= 0.0101


def test_points_beside_a_law_that_is_level_at_its_end_do_not_fall():
    """Steps of few asperities, the last one level within rounding."""
    at = np.append(0.0, np.geomspace(1e-3, 1, 30))
    steps = np.append(0.0, 1.37 ** np.floor(np.arange(30) / 2))
    line = column(at, steps).laid(9)
    assert line.at.size <= 9
    assert (np.diff(line.values) >= -1e-9 * line.values[1:]).all()
