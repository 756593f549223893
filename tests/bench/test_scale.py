"""The simulated farm against closed forms and bounds; its inputs; a real probe."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from launch import mpiexec

from bench.report import Report
from bench.scale import studies
from bench.scale.costs import (
    Costs,
    Line,
    bookkeeping_seconds,
    measure_write,
    read_costs,
)
from bench.scale.launch import launch
from bench.scale.simulation import simulate
from bench.scale.speedup import summary
from bench.table import read_table
from gen.generation import plan
from gen.runtime.errors import InputError

FREE = Costs(
    rows={129: (0.01, 0.02), 1025: (1.0, 3.0)},
    message=Line(0.0, 0.0),
    write=Line(0.0, 0.0),
    bookkeeping=Line(0.0, 0.0),
    gap=0.0,
    memory=50_000_000,
    task_memory=1000,
)
DEAR = replace(
    FREE, message=Line(2e-3, 1e-5), write=Line(1e-3, 2e-5), bookkeeping=Line(1e-4, 1e-6), gap=3e-3
)


def blocks(rows, workers, largest=64, smallest=1):
    return list(
        plan.blocks(
            [(0, rows)],
            samples=rows,
            samples_per_surface=1,
            workers=workers,
            largest=largest,
            smallest=smallest,
        )
    )


@pytest.mark.parametrize("workers", [1, 2, 7, 50])
def test_a_free_master_wastes_no_more_than_the_last_blocks(workers):
    seconds = np.random.default_rng(0).uniform(0.5, 1.5, 3000)
    cut = blocks(3000, workers)
    outcome = simulate(cut, seconds, workers, FREE, write="master")
    longest = max(seconds[start:stop].sum() for start, stop in cut)
    assert outcome.blocks == len(cut)
    assert outcome.makespan >= seconds.sum() / workers * (1 - 1e-12)
    assert outcome.makespan <= seconds.sum() / workers + longest
    assert outcome.efficiency == pytest.approx(seconds.sum() / workers / outcome.makespan)
    assert outcome.busy == 0.0


def test_one_worker_and_a_free_master_take_the_rows_time():
    seconds = np.linspace(0.1, 0.2, 100)
    outcome = simulate(blocks(100, 1), seconds, 1, FREE, write="master")
    assert outcome.makespan == pytest.approx(seconds.sum())
    assert outcome.tail == pytest.approx(0.0)


@pytest.mark.parametrize("write", ["master", "workers"])
def test_a_master_with_rows_that_cost_nothing_is_the_bound(write):
    """Then the time is the master's: a message, a turn of the loop and a write for each block."""
    workers, cut = 20, [(start, start + 8) for start in range(0, 4000, 8)]
    costs = replace(DEAR, gap=0.0)
    if write == "workers":
        costs = replace(costs, write=Line(0.0, 0.0))
    outcome = simulate(cut, np.zeros(4000), workers, costs, write=write)
    each = costs.message(8 if write == "master" else 0) + costs.bookkeeping(workers)
    each += costs.write(8) if write == "master" else 0.0
    assert outcome.makespan == pytest.approx(len(cut) * each, rel=1e-6)
    assert outcome.busy == pytest.approx(1.0)


def test_workers_that_write_take_longer_but_the_master_less():
    seconds = np.full(4000, 0.01)
    cut = blocks(4000, 30, largest=8)
    single = simulate(cut, seconds, 30, DEAR, write="master")
    parallel = simulate(cut, seconds, 30, DEAR, write="workers")
    assert parallel.busy * parallel.makespan < single.busy * single.makespan


def test_saturation_is_where_the_simulated_master_is_just_busy():
    costs = replace(DEAR, rows={129: (0.01,), 1025: (1.0,)}, gap=0.0)
    limit = studies.saturation(costs, 129, 16, write=True)
    cut = [(start, start + 16) for start in range(0, 64_000, 16)]
    seconds = np.full(64_000, 0.01)
    below = simulate(cut, seconds, limit // 2, costs, write="master")
    beyond = simulate(cut, seconds, 2 * limit, costs, write="master")
    assert 0.3 < below.busy < 0.7
    assert beyond.busy > 0.95
    assert below.efficiency > 0.9
    assert beyond.efficiency < 0.6


@pytest.mark.parametrize(("rows", "smallest"), [(1000, 16), (1000, 64), (10, 64), (129, 32)])
def test_blocks_of_some_size_at_least_hold_every_row_once(rows, smallest):
    cut = blocks(rows, 40, largest=64, smallest=smallest)
    assert [start for start, _ in cut] == [0, *(stop for _, stop in cut[:-1])]
    assert cut[-1][1] == rows
    assert all(stop - start >= smallest for start, stop in cut[:-1])
    assert all(stop - start <= 64 for start, stop in cut)


def test_the_programs_own_blocks_are_simulated():
    from gen.generation.run import blocks_of

    scene = studies.scene_with(1025).model_copy(update={"samples": 300})
    assert list(studies.blocks(1025, 300, 9)) == list(blocks_of(scene, [(0, 300)], 9))


def kept(folder, costs):
    Report({}, records={"costs": asdict(costs)}).write(folder)


def test_costs_are_kept(tmp_path):
    kept(tmp_path, DEAR)
    assert read_costs(tmp_path / "costs.json") == DEAR


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"rows": 3}'])
def test_costs_that_are_none_are_refused(tmp_path, text):
    (tmp_path / "costs.json").write_text(text)
    with pytest.raises(InputError, match=r"costs\.json: no measured costs"):
        read_costs(tmp_path / "costs.json")


def test_measured_costs_are_times():
    assert 0 < bookkeeping_seconds(5) < 1
    assert 0 < measure_write(3) < 10


def test_a_report_has_a_table_and_a_picture(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(studies, "RANKS", (10, 30))
    monkeypatch.setattr(studies, "ROWS", {129: (1000, 2000), 1025: (100,)})
    monkeypatch.setattr(studies, "GOAL_RANKS", 30)
    monkeypatch.setattr(studies, "GOAL_ROWS", {129: 1000, 1025: 100})
    kept(tmp_path, DEAR)
    made = studies.report(tmp_path / "costs.json", validate=False)
    paths, text = made.write(tmp_path / "report"), made.text
    assert [path.name for path in paths] == ["scale.csv", "costs.json", "scale.png"]
    assert all(path.stat().st_size for path in paths)
    assert read_costs(paths[1]) == DEAR
    _, rows = read_table(paths[0])
    assert {row["writer"] for row in rows} == {"single", "parallel"}
    assert all(0 < float(row["efficiency"]) <= 1 for row in rows)
    assert text.startswith("Simulation, from costs measured")
    assert "1,000 rows, 129 nodes, single writer" in text
    assert "129 x 129 nodes, 1000 rows" in capsys.readouterr().err


@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_a_real_farm_is_not_faster_than_a_free_one(tmp_path):
    cut = blocks(200, 2, largest=20)
    tasks = [((start, stop), 0.005 * (stop - start)) for start, stop in cut]
    arguments = {"tasks": tasks, "output": "rows.h5"}
    (timing,) = launch(3, "bench.scale.probe", arguments, tmp_path)
    ideal = simulate(cut, np.full(200, 0.005), 2, FREE, write="master").makespan
    assert timing["wall"] >= 0.999 * ideal
    assert 0 < timing["master"] < timing["wall"]
    assert timing["gap"] > 0


def test_the_speed_up_is_a_median_of_rounds():
    others = {"alone": 1.9, "1 worker": 2.0, "2 copies": 2.0}
    turns = [others | {"2 workers": time} for time in (1.0, 1.25, 2.0)]
    assert "over 1 worker: 1.60 (median of 3 rounds, 1.00 to 2.00)" in summary(turns)
