"""The report of the error as input: surfaces on two grids, asked against got, and times."""

import math
from dataclasses import dataclass, field
from statistics import median

import numpy as np
import pytest

from bench.accuracy import asked, full_grid, promises, summary, surfaces, times
from bench.accuracy.surfaces import KINDS, MARGIN, MeasuredMap, read_maps, window_of_map
from bench.accuracy.times import Rough, Solved, extrapolated
from bench.answers import times_of_others
from bench.commands import main
from bench.peers import PERIODIC_SOLVERS
from bench.solvers.solver import Answer, Case, Failure, Solver
from gen.runtime.errors import InputError


@pytest.mark.parametrize("kind", KINDS)
def test_a_sample_is_one_surface_on_all_grids(kind):
    sample = KINDS[kind](np.random.default_rng(3))
    nodes = sample.nodes
    first = 0 if sample.boundary == "periodic" else 1
    finer = sample.heights(3 * nodes)[first::3, first::3]
    assert finer == pytest.approx(sample.heights(nodes), abs=1e-12)
    assert sample.exact_nodes >= 3 * nodes


def test_a_window_of_a_map_has_its_heights():
    heights = np.random.default_rng(0).normal(size=(80, 75))
    maps = [MeasuredMap(heights, aspect=2.0)]
    for seed in range(10):
        window = window_of_map(maps, np.random.default_rng(seed))
        if math.isnan(window.nodes_in_wave):  # not filtered
            break
    assert window.aspect == 2.0
    nodes = window.nodes
    read = window.heights(nodes) * nodes
    places = [
        (row, column)
        for row in range(80 - nodes + 1)
        for column in range(75 - nodes + 1)
        if np.allclose(heights[row : row + nodes, column : column + nodes], read)
    ]
    assert len(places) == 1
    assert min(places[0]) >= MARGIN


def test_maps_that_cannot_be_read_are_named_and_left_out(tmp_path, capsys):
    np.save(tmp_path / "flat.npy", np.add.outer(np.arange(9.0) ** 2, np.arange(9.0)))
    (tmp_path / "note.txt").write_text("no map")
    with pytest.raises(InputError, match="neither a file nor a folder"):
        read_maps(tmp_path / "none")
    with pytest.raises(InputError, match="no map of it can be read"):
        read_maps(tmp_path)
    printed = capsys.readouterr().err
    assert "left out" in printed
    assert "flat.npy" in printed  # a file without a scan length
    assert "note.txt" in printed


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surfaces, "NODES", (64,))
        patch.setattr(surfaces, "FINEST", 200)
        kinds = ("spheres", "no shortest wave", "layers")
        return asked.asked_and_got(contacts=2, kinds=kinds, processes=1)


def test_errors_that_were_asked_for_are_got(rows):
    (spheres,) = (
        row
        for row in summary.by_error(rows, "area", "kind")
        if (row["asked_percent"], row["kind"]) == (3.0, "spheres")
    )
    assert spheres["answered_percent"] == spheres["within_percent"] == 100
    assert spheres["largest_off_percent"] < 1


def test_what_has_no_limit_is_not_answered_unless_it_yields(rows):
    limitless = [row for row in rows if not row["has_limit"] and not row["yields"]]
    assert limitless
    assert not any(row["answered"] for row in limitless)
    assert all(row["reason"] for row in limitless)


def test_every_answer_is_asked_for_but_what_is_given(rows):
    for row in rows:
        given = {"delta"} if row["load"] == "delta" else {"force"}
        assert (
            row["answer"] in {"area", "mean_gap", "stiffness", "delta", "force"} - given
        )
    together = {row["answer"] for row in rows if row["asked_for"] == "all"}
    assert together >= {"area", "mean_gap", "stiffness"}
    assert {row["answer"] for row in rows if row["asked_for"] == "area"} == {"area"}
    of_maps = summary.bars_of_maps(rows)
    assert {row["answer"] for row in of_maps} == together


def judged(kind, off, bar, *, answered=True):
    return {
        "kind": kind,
        "answered": answered,
        "asked_for": "area",
        "asked_percent": 3.0,
        "answer": "area",
        "off_percent": off,
        "bar_percent": bar,
        "nodes_in_wave": 8.0,
        "has_limit": True,
        "yields": False,
    }


def test_shares_are_of_answers_that_were_given():
    made = [
        judged("a", 1.0, 2.0),
        judged("a", 4.0, 2.0),
        judged("a", "", "", answered=False),
        judged("b", 0.5, 2.0),
    ]
    of_a, of_b, of_all = summary.by_error(made, "area", "kind")
    assert of_a["answered_percent"] == pytest.approx(200 / 3)
    assert of_a["within_percent"] == of_a["bar_holds_percent"] == 50
    assert of_a["bar_over_error"] == pytest.approx(1.25)
    assert of_a["largest_off_percent"] == 4
    assert of_b["contacts"] == 1
    assert (of_all["kind"], of_all["contacts"]) == ("all", 4)


def test_promises_are_kept_or_not_by_their_bounds():
    made = [judged("a", 1.0, 2.0)] * 19 + [judged("a", 4.0, 2.0)]
    within, answered = promises.promises(made, [], [])
    assert (within["measured"], within["least"], within["kept"]) == (95, 95, "yes")
    assert (answered["measured"], answered["kept"]) == (100, "yes")
    off = promises.promises([*made, judged("a", 4.0, 2.0)], [], [])
    assert off[0]["kept"] == "no"
    assert promises.promises([], [], []) == []


def test_each_other_solver_is_judged_by_what_was_measured_of_it():
    ratios = [
        {
            "within_percent": within,
            "way": way,
            "measured_surfaces": 2,
            "measured_times_ours": measured,
            "extrapolated_surfaces": 0,
            "extrapolated_times_ours": None,
        }
        for way, within, measured in (("A", 1.0, 29.0), ("B", 1.0, 31.0), ("B", 3.0, 1.0))
    ]
    of_a, of_b = promises.promises([], ratios, [])
    assert "time of A, measured" in of_a["promise"]
    assert (of_a["measured"], of_a["number"], of_a["kept"]) == (29.0, 2, "no")
    assert of_b["kept"] == "yes"


def test_the_fastest_other_solver_is_that_of_all_surfaces_and_not_of_the_measured_ones():
    rows = [
        {
            "within_percent": within,
            "way": way,
            "all_surfaces": "3",
            "all_times_ours": times_of_all,
            "measured_times_ours": "10.0",
            "extrapolated_surfaces": extrapolated_surfaces,
        }
        for within in ("1.0", "3.0")
        for way, times_of_all, extrapolated_surfaces in (
            ("A", "40.0", "1"),
            ("B", "50.0", "0"),
        )
    ]
    answer = times_of_others(rows)
    assert "40 times our time for 1 % (A, 3 surfaces, 1 of them extrapolated)" in answer


def test_a_larger_grid_is_extrapolated_by_the_spacing_and_a_power_of_the_nodes():
    solved = [
        Solved(nodes, seconds=1e-6 * nodes**2.5, error=1.6 / nodes, tolerance=1e-3)
        for nodes in (100, 200, 400)
    ]
    larger = extrapolated(solved, within=0.001)
    assert larger.nodes == 1600
    assert larger.seconds == pytest.approx(1e-6 * 1600**2.5)
    assert larger.error == 0.001
    steep = [Solved(one.nodes, one.nodes**5.0, one.error) for one in solved]
    assert extrapolated(steep, 0.001).seconds == pytest.approx(400.0**5 * 4**3)


@dataclass
class Stub:
    """A solver that counts too many nodes, the more the looser its tolerance is."""

    name: str = "Tamaas"
    version: str = "0"
    tried: list[tuple[int, float]] = field(default_factory=list)

    def solve(self, case, tolerance):
        self.tried.append((case.nodes, tolerance))
        touching = case.solve(1e-7).pressure > 0
        further = round(10 * tolerance * touching.sum())
        touching.flat[np.flatnonzero(~touching)[:further]] = True
        return Answer(touching.astype(float))


def test_other_solvers_are_timed_at_the_loosest_tolerance_that_keeps_the_count(
    monkeypatch,
):
    monkeypatch.setattr(times, "PERIODIC_SOLVERS", (None, Stub()))
    monkeypatch.setattr(times, "installed", list)
    monkeypatch.setattr(times, "missing", lambda _: {})
    monkeypatch.setattr(times, "TRUTH_IN_WAVE", 32)
    monkeypatch.setattr(times, "MAP_IN_WAVE", 16)
    monkeypatch.setattr(times, "TURN", 1e-6)
    rows = times.time_to_area(waves=[4], surfaces=1, largest=64)
    stub = [row for row in rows if row["way"] == "Tamaas"]
    grids = [row for row in stub if row["row"] == "grid"]
    assert [row["nodes"] for row in grids] == [32, 40, 48, 56, 64]
    errors = [row["area_error_percent"] for row in grids]
    assert errors[0] == max(errors)
    # 10 times the tolerance is at most a tenth of the error, and the next looser one is not.
    assert all(
        0.1 < row["tolerance"] / (row["area_error_percent"] / 1e4) < 10 for row in grids
    )
    needed = {row["within_percent"]: row for row in stub if row["row"] in times.NEEDED}
    assert sorted(needed) == pytest.approx([0.3, 1, 3])
    assert needed[1.0]["row"] == "extrapolated"
    by_nodes = median(row["nodes"] * row["area_error_percent"] for row in grids[-4:])
    assert needed[1.0]["nodes"] == math.ceil(by_nodes)
    ours = [row for row in rows if row["way"] == times.OURS]
    assert [row["row"] for row in ours] == ["grid"] * (len(ours) - 1) + ["default"]
    assert all(abs(row["area_error_percent"]) < 3 for row in ours)
    (ratio,) = (row for row in times.ratios(rows) if row["within_percent"] == 1.0)
    assert ratio["measured_times_ours"] is None
    assert ratio["extrapolated_times_ours"] == pytest.approx(needed[1.0]["times_ours"])
    assert ratio["all_times_ours"] == ratio["extrapolated_times_ours"]
    points = times.curves(rows)
    assert {row["way"] for row in points} == {"Tamaas", times.OURS}
    assert all(row["default_seconds"] > 0 for row in points)


def test_no_finer_grid_is_solved_once_a_solve_takes_too_long(monkeypatch):
    rough = Rough.drawn(waves=4, number=0)
    solver = Stub()
    peer = times._Peer(rough, solver)
    monkeypatch.setattr(times, "PATIENCE", 1e-9)
    for in_wave in (8, 10):
        peer.take_grid(times._Grid.solved(rough, in_wave))
    assert {nodes for nodes, _ in solver.tried} == {32}


def test_a_solver_that_fails_is_left_out(monkeypatch, capsys):
    rough = Rough.drawn(waves=4, number=0)
    grid = times._Grid.solved(rough, 8)

    class Failing(Stub):
        def solve(self, case, tolerance):
            message = "stalled"
            raise Failure(message)

    peer = times._Peer(rough, Failing())
    peer.take_grid(grid)
    ours = times._Ours(rough)
    assert peer.rows(ours) == []
    assert peer.default_rows(grid, ours) == []
    assert "Tamaas, 32 nodes: stalled" in capsys.readouterr().err


def test_all_solvers_without_edges_have_a_default_tolerance():
    assert times.DEFAULTS.keys() == {solver.name for solver in PERIODIC_SOLVERS[1:]}


def test_the_force_of_a_periodic_patch_follows_from_its_load():
    forces = []

    def press(case, force, tolerance):
        forces.append(force)
        return Answer(np.zeros((case.nodes, case.nodes)))

    solver = Solver("records its force", lambda *_: press, control="force")
    heights = np.random.default_rng(0).normal(size=(8, 8))
    solver.solve(Case("small", heights, side=4.0, delta=1.0, load=0.5), 1e-3)
    assert forces == [pytest.approx(0.5 * 4.0**2)]


@pytest.mark.long
def test_full_grids_are_timed_beside_ours():
    rows = full_grid.full_grid([64], [2])
    assert [row["boundary"] for row in rows] == ["periodic"] * 2 + ["mirror"] * 2
    assert any(row["grid"] for row in rows)
    for row in rows:
        if row["grid"]:
            assert row["times"] == pytest.approx(row["full_seconds"] / row["seconds"])
    table = full_grid.medians(rows)
    assert [(row["asked_percent"], row["nodes"]) for row in table] == [
        (3.0, 64),
        (3.0, "all"),
        (1.0, 64),
        (1.0, "all"),
    ]
    assert all(row["maps"] == 2 for row in table)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--of", "speed"], "--of speed: give some of asked, times, full"),
        (["--maps", "none"], "none: is neither a file nor a folder"),
        (["--contacts", "0"], "contacts"),
        (
            ["--of", "asked", "--kinds", "cubes"],
            "--kinds cubes: give some of waves without",
        ),
        (["--waves", "8,0"], "--waves 0: give numbers from 1 on"),
        (["--nodes", "63"], "--nodes 63: give numbers from 64 on"),
    ],
)
def test_wrong_options_are_one_line(arguments, message, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert main(["accuracy", *arguments]) == 2
    assert message in capfd.readouterr().err
