"""The report on grids: what its rows hold."""

from typing import Any

import pytest

from bench.growth import HARDNESSES, cost, growth, pressures
from gen.runtime.errors import InputError


@pytest.fixture(scope="module")
def costs() -> list[dict[str, Any]]:
    return cost((65, 129), surfaces=1, percents=(5.0,))


@pytest.fixture(scope="module")
def pressed() -> list[dict[str, Any]]:
    return pressures((65, 129), 1)


def test_rows_reach_their_contact_and_say_what_it_took(costs: list[dict[str, Any]]) -> None:
    assert [row["nodes"] for row in costs] == [65, 129]
    for row in costs:
        assert row["area_percent"] == pytest.approx(5, rel=0.2)
        assert row["convolutions"] >= 3
        assert row["seconds"] > 0
        assert row["padded_arrays"] > 0
    # Of the finer grid, whose arrays are larger than what else a process may take meanwhile.
    assert costs[-1]["padded_arrays"] < 6
    assert costs[0]["growth"] == 1
    ratio = costs[1]["convolutions"] / costs[0]["convolutions"]
    assert costs[1]["growth"] == pytest.approx(ratio)


def test_a_hardness_bounds_the_mean_pressure(pressed: list[dict[str, Any]]) -> None:
    assert [row["hardness"] for row in pressed] == [each for each in HARDNESSES for _ in range(2)]
    elastic = pressed[:2]
    assert elastic[0]["area_percent"] > elastic[1]["area_percent"]
    for row in pressed[2:]:
        assert row["mean_pressure"] <= row["hardness"] * (1 + 1e-12)
        assert 0 < row["yielded_percent"] <= row["area_percent"]
        assert row["area_percent"] >= min(each["area_percent"] for each in elastic)


@pytest.mark.parametrize("nodes", [100, 33])
def test_grids_that_cannot_be_nested_are_refused(nodes: int) -> None:
    with pytest.raises(InputError, match=f"nodes {nodes}: give 2"):
        growth((nodes,), 1)
