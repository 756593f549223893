"""The search finds the reading that no single level betters, and goes on where it was stopped."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.paper.nearest import search as searches
from bench.paper.nearest.candidates import Candidate, Factor
from bench.paper.nearest.population import Population, Rows, TooFew
from bench.paper.nearest.search import Search
from bench.table import read_table
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.statistics import NAMES
from learn.metrics import Scores

SCORES = Scores(9.0, 8.0, 25.0, 96.0)
FACTORS = (
    Factor("split", ("rows", "surfaces")),
    Factor("loads", (1, 2, 3, 4), "samples_per_surface"),
    Factor("sigma0", (10.0, 11.0, 12.0), "surface.sigma0"),
)


def wide(_: Any, candidate: Candidate) -> Rows:
    """Ranges that fit best with four loads and 11 um."""
    off = abs(candidate.value("loads") - 4) + abs(candidate.value("sigma0") - 11.0)
    columns = {name: np.array([0.0, 60.0 + 10 * off]) for name in (*NAMES, "hurst", "delta")}
    return Rows(columns | {"area_percent": np.array([1.0, 3.0])}, np.arange(2))


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Search, "database", wide)
    monkeypatch.setattr(searches, "baseline", lambda *_, **__: SCORES)


def search(folder: Path, seconds: float = 60.0) -> Search:
    return Search(folder, rows=100, surfaces=50, deadline=time.monotonic() + seconds)


def test_the_nearest_reading_is_found_and_written_down(tmp_path: Path) -> None:
    best, settled = search(tmp_path).nearest(FACTORS)
    assert (best.value("loads"), best.value("sigma0"), settled) == (4, 11.0, True)
    header, rows = read_table(tmp_path / "search.csv")
    assert header[:5] == ["asked", "seed", "split", "loads", "sigma0"]
    assert len(rows) == len({tuple(row.values())[:5] for row in rows}) < 24
    nearest = min(rows, key=lambda row: float(row["distance"]))
    assert (nearest["loads"], nearest["sigma0"]) == ("4", "11.0")
    for row in rows:
        total = float(row["table_1"]) + float(row["table_4"])
        assert float(row["distance"]) == pytest.approx(total, rel=1e-4)


def test_a_search_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    best, settled = search(tmp_path, -1.0).nearest(FACTORS)
    assert not settled
    assert best.levels == (0, 0, 0)
    found, _ = search(tmp_path).nearest(FACTORS)
    monkeypatch.setattr(searches, "judged", None)  # nothing is measured again
    again, settled = search(tmp_path).nearest(FACTORS)
    assert (again, settled) == (found, True)


def test_finalists_are_judged_on_several_splits(tmp_path: Path) -> None:
    made = search(tmp_path)
    made.nearest(FACTORS)
    nearest, *others = made.finalists()
    assert (nearest["loads"], nearest["sigma0"]) == ("4", "11.0")
    assert nearest["mean"] == pytest.approx(nearest["seed_1"], abs=1e-4)
    assert len(others) == 2
    assert all(row["mean"] >= nearest["mean"] for row in others)
    _, rows = read_table(tmp_path / "search.csv")
    assert sum(row["seed"] != "0" for row in rows) == 6


def test_another_size_is_another_search(tmp_path: Path) -> None:
    search(tmp_path).nearest(FACTORS)
    other = Search(tmp_path, rows=200, surfaces=50, deadline=time.monotonic() + 60)
    other.judge(Candidate(FACTORS, (0, 0, 0)))
    _, rows = read_table(tmp_path / "search.csv")
    assert {row["asked"] for row in rows} == {"100 of 50", "200 of 50"}


def test_a_table_of_other_factors_is_refused(tmp_path: Path) -> None:
    search(tmp_path).nearest(FACTORS)
    with pytest.raises(InputError, match="is of other factors"):
        search(tmp_path).nearest(FACTORS[:2])


def test_rows_are_as_many_as_the_surfaces_allow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    asked = []

    def drawn(scene: Scene, _: Population) -> None:
        asked.append(scene.samples)
        if scene.samples > 90:
            raise TooFew("too few")

    monkeypatch.setattr(searches, "rows_of", drawn)
    monkeypatch.setattr(searches, "population", lambda *_: Population(*[np.empty(0)] * 3))
    kernel = Factor("kernel", ("concentrated-force",), "contact.kernel")
    made = Search(Path(), rows=100, surfaces=50, deadline=0.0)
    for level in (0, 3):
        made.database(Candidate((*FACTORS, kernel), (0, level, 0, 0)))
    assert asked == [50, 100, 90]
