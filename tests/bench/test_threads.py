"""Times on several threads: each contact is the same, and each gain is a ratio of its times."""

import pytest

from bem.threads import cores
from bench import threads as study
from bench.report import Report, part_of
from gen.runtime.errors import InputError


@pytest.mark.skipif(cores() < 2, reason="needs two processors")
def test_gains_are_ratios_of_times(monkeypatch, tmp_path):
    monkeypatch.setattr(study, "ENTRIES", 1e5)
    rows = study.threads([65], [10, 50], 2, 1)
    assert [row["percent"] for row in rows] == [10, 50]
    for row in rows:
        assert row["gain"] == pytest.approx(row["seconds_one"] / row["seconds"])
        assert row["gain_over_copies"] == pytest.approx(row["gain"] / row["copies"])
        assert row["area_percent"] == pytest.approx(row["percent"], rel=0.1)
    paths = Report({"threads": rows}).write(tmp_path, part_of("threads").contents)
    assert [path.name for path in paths] == ["threads.csv", "threads.png"]


@pytest.mark.parametrize(
    ("nodes", "threads", "message"),
    [(66, 2, "nodes 66: give 2"), (65, 10_000, "--threads 10000: this machine has")],
)
def test_what_cannot_be_timed_is_refused(nodes, threads, message):
    with pytest.raises(InputError, match=message):
        study.threads([nodes], [10], threads, 1)


@pytest.mark.skipif(cores() < 2, reason="needs two processors")
def test_other_bits_on_several_threads_are_an_error(monkeypatch):
    solve = study.bem.solve
    monkeypatch.setattr(study, "ENTRIES", 1e5)
    monkeypatch.setattr(
        study.bem,
        "solve",
        lambda heights, *rest, threads=None, **options: solve(
            heights * (1 + 1e-9 * (threads == 2)), *rest, **options
        ),
    )
    with pytest.raises(ArithmeticError, match="2 threads change the pressure of 65"):
        study.threads([65], [10], 2, 1)
