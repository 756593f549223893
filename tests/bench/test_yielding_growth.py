"""Contact area and mean pressure on finer grids, with a hardness and without."""

from pathlib import Path

import pytest

from bench.page.content import Absent, Figure
from bench.report import Report
from bench.yielding_growth import HARDNESSES, YieldingRow, contents, grids, picture


@pytest.fixture(scope="module")
def rows() -> list[YieldingRow]:
    return grids((65, 129), 1)


def test_a_hardness_bounds_the_mean_pressure(rows: list[YieldingRow]) -> None:
    assert [row.hardness for row in rows] == [each for each in HARDNESSES for _ in range(2)]
    elastic = rows[:2]
    assert elastic[0].area_percent > elastic[1].area_percent
    for row in rows[2:]:
        assert row.hardness is not None
        assert row.mean_pressure <= row.hardness * (1 + 1e-12)
        assert 0 < row.yielded_percent <= row.area_percent
        assert row.area_percent >= min(each.area_percent for each in elastic)


def test_the_page_shows_the_picture_once_it_is_drawn(
    rows: list[YieldingRow], tmp_path: Path
) -> None:
    assert isinstance(contents(tmp_path)[-1], Absent)
    Report({"yielding": rows}, pictures={"yielding": picture(rows)}).write(tmp_path)
    assert isinstance(contents(tmp_path)[-1], Figure)
