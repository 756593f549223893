"""fit, card, predict and law as a user types them."""

import csv
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from launch import launch, mpiexec

import bem
from learn import Surrogate, cli

DELTAS = "6,20,40"


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


def table(path):
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_card_says_what_it_was_made_of(work, capsys):
    assert run("card", "hybrid.surrogate") == 0
    said = capsys.readouterr().out
    for text in (
        "Kernel Ridge for area, force, hybrid features",
        "58 trained, 14 calibrated, 18 tested",
        "33 x 33 nodes, side 1000 um",
        "scikit-learn",
        "BSD-3-Clause",
        "refined_share",
        "95 %",
    ):
        assert text in said, text


def test_a_folder_is_predicted_and_written(work, capsys):
    arguments = ["predict", "hybrid.surrogate", "many", "--side", 1000, "--delta", DELTAS]
    assert run(*arguments, "-o", "p.csv") == 0
    said = capsys.readouterr()
    assert "left out 1 files" in said.err
    rows = table("p.csv")
    assert [row["input"] for row in rows[::3]] == [f"many/s{seed}.npy" for seed in range(3)]
    surrogate = Surrogate.load("hybrid.surrogate")
    for row in rows:
        own = surrogate.predict(np.load(row["input"]), 1000.0, float(row["delta_um"]))
        for key, value in (
            ("area_percent", own.area),
            ("force_uN", own.force),
            ("area_percent_low", own.low["area"]),
            ("force_uN_high", own.high["force"]),
        ):
            if own.reasons[0] and key.endswith(("_low", "_high")):
                assert row[key] == "", "no interval holds on unknown ground"
            else:
                assert float(row[key]) == pytest.approx(float(value[0]), rel=1e-9)
        assert row["reason"] == own.reasons[0]
        assert row["flag"] == ("outside" if own.reasons[0] else "inside")
        solved = bem.solve(np.load(row["input"]), 1000.0, float(row["delta_um"]))
        assert float(row["force_uN"]) == pytest.approx(solved.force, rel=0.15)


def test_single_precision_and_oblong_surfaces_are_taken_and_named(work):
    assert run(*PREDICT, "oblong.npy") == 2  # one length fits no grid that is not square
    for name in ("many/s0.npy", "single.npy", "oblong.npy"):
        sides = ["--side", "1000,593.75"] if name == "oblong.npy" else []
        assert run(*PREDICT, *sides, name, "-o", "p.csv") == 0
        (row,) = table("p.csv")
        if name == "many/s0.npy":
            first = row
        elif name == "single.npy":
            assert float(row["area_percent"]) == pytest.approx(float(first["area_percent"]), 1e-2)
            assert row["flag"] == first["flag"]
        else:
            assert "33 x 20 nodes, trained on 33 x 33" in row["reason"]


def test_statistics_give_what_the_surface_gives(work):
    for features in ("dimensionless", "paper"):
        ask = ["predict", f"{features}.surrogate"]
        assert run(*ask, "table.csv", "--delta", DELTAS, "-o", "a.csv") == 0
        assert run(*ask, "many/s0.npy", "--side", 1000, "--delta", DELTAS, "-o", "b.csv") == 0
        for one, two in zip(table("a.csv"), table("b.csv"), strict=True):
            for key in ("area_percent", "force_uN_low", "area_percent_high"):
                assert bool(one[key]) == bool(two[key])
                assert float(one[key] or 0) == pytest.approx(float(two[key] or 0), rel=1e-6)
            assert one["reason"] == two["reason"]


def test_a_table_may_have_its_own_delta(work):
    (row,) = table("table.csv")
    with Path("own.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*row, "delta_um"])
        writer.writeheader()
        writer.writerows([{**row, "delta_um": delta} for delta in (6, 20)])
    assert run("predict", "dimensionless.surrogate", "own.csv", "-o", "p.csv") == 0
    assert [float(each["delta_um"]) for each in table("p.csv")] == [6.0, 20.0]


def test_force_follows_the_modulus_and_area_does_not(work):
    ask = ["predict", "hybrid.surrogate", "many/s0.npy", "--side", 1000, "--delta", "9"]
    assert run(*ask, "-o", "a.csv") == 0
    assert run(*ask, "--young", "210e3", "--poisson", "0.3", "-o", "b.csv") == 0
    (soft,), (steel,) = table("a.csv"), table("b.csv")
    assert soft["area_percent"] == steel["area_percent"]
    for key in ("force_uN", "force_uN_low", "force_uN_high"):
        assert float(steel[key]) == pytest.approx(float(soft[key]) * 210e3 / (1 - 0.09))


def test_a_process_writes_its_standard_deviation(work):
    arguments = ["database.h5", "--model", "gaussian-process", "--target", "area"]
    assert run("fit", *arguments, "-o", "gp.surrogate") == 0
    ask = ["predict", "gp.surrogate", "table.csv", "--delta", "9", "-o", "p.csv"]
    assert run(*ask) == 0
    (row,) = table("p.csv")
    assert 0 < float(row["area_percent_std"]) < 10


def test_a_tuned_winner_is_taken_with_what_it_rests_on(work, capsys, monkeypatch):
    from learn.comparison import spaces

    space = {"alpha": [1e-5, 1e-3], "gamma": [0.01], "kernel": ["rbf"]}
    monkeypatch.setitem(spaces.SCALED, "kernel-ridge", space)
    tune = ["tune", "database.h5", "-o", "out", "--model", "kernel-ridge", "--seed", "3"]
    assert run(*tune, "--features", "dimensionless", "--target", "area") == 0
    assert "for features without" in capsys.readouterr().out
    assert table("out/area/tuning.csv")[0]["grid"] == "for features without units"
    fit = ["fit", "database.h5", "--from", "out", "--target", "area", "-o", "t.surrogate"]
    assert run(*fit) == 0
    card = Surrogate.load("t.surrogate").card
    assert card["seed"] == 3
    assert card["features"] == "dimensionless"
    assert card["targets"]["area"]["settings_from"] == "tuned in out/area"
    assert card["targets"]["area"]["settings"]["gamma"] == "0.01"
    assert run(*fit, "--features", "paper") == 2
    assert "made with features 'dimensionless', not 'paper'" in capsys.readouterr().err
    assert run(*fit, "--model", "svm") == 2
    assert "no tuned svm" in capsys.readouterr().err


def test_hybrid_features_go_through_compare_and_importance(work, capsys):
    options = ["--features", "hybrid", "--model", "kernel-ridge"]
    both = [*options, "--model", "gaussian-process"]
    assert run("compare", "database.h5", "-o", "out", *both) == 0
    assert "hybrid features" in capsys.readouterr().err
    for row in table("out/area/scores.csv"):
        assert float(row["r2"]) > 40, "a linear model has its intercept, a kernel a length of use"
    assert run("importance", "database.h5", "-o", "out", *options) == 0
    ranked = table("out/area/importance.csv")
    assert len(ranked) == 30
    assert run("compare", "database.h5", "-o", "out", "--model", "kernel-ridge") == 2
    assert "features 'hybrid', not 'paper'" in capsys.readouterr().err


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


@pytest.mark.parametrize("how", [["--solver"], []])
@pytest.mark.parametrize("inputs", [["many/s0.npy", "--side", 1000], ["many", "--side", 1000]])
def test_a_law_is_monotone_and_consistent(work, how, inputs):
    ask = ["law", "hybrid.surrogate", *inputs, "--delta", "2:40:12", "--csv", "law.csv", *how]
    assert run(*ask, "--header", "law.h", "--young", "210e3", "--poisson", "0.3") == 0
    rows = table("law.csv")
    by_delta = [row for row in rows if row["against"] == "delta_um"]
    by_pressure = [row for row in rows if row["against"] == "pressure_MPa"]
    assert len(by_delta) == 13
    delta = column(by_delta, "delta_um")
    for name, sign in (("area_percent", 1), ("force_uN", 1), ("mean_gap_um", -1)):
        value = column(by_delta, name)
        assert (sign * np.diff(value) >= 0).all()
        assert (sign * column(by_delta, f"{name}_slope") >= 0).all()
        banded = [row for row in by_delta if row[f"{name}_low"]]
        value = column(banded, name)
        assert (column(banded, f"{name}_low") <= value).all()
        assert (value <= column(banded, f"{name}_high")).all()
        alone = "--solver" in how and inputs[0] != "many"
        inside = sum(not alone and not row["reason"] for row in by_delta)
        assert inside <= len(banded) <= (0 if alone else 13)
        assert all(row["reason"] for row in by_delta if row not in banded) or alone
    pressure = column(by_delta, "pressure_MPa")
    cells = (1000 / 32 * 33) ** 2
    np.testing.assert_allclose(pressure, column(by_delta, "force_uN") / cells, rtol=1e-9)
    back = np.interp(delta, column(by_pressure, "delta_um"), column(by_pressure, "pressure_MPa"))
    np.testing.assert_allclose(back, pressure, atol=0.02 * pressure[-1])
    assert (np.diff(column(by_pressure, "area_percent")) >= 0).all()
    assert (np.diff(column(by_pressure, "mean_gap_um")) <= 0).all()


def test_a_solved_law_is_the_solvers_and_the_predicted_one_near_it(work):
    ask = ["law", "hybrid.surrogate", "many/s1.npy", "--side", 1000, "--delta", "5:40:8", "--csv"]
    assert run(*ask, "solved.csv", "--solver") == 0
    assert run(*ask, "predicted.csv") == 0
    heights = np.load("many/s1.npy")
    solved, predicted = (
        [row for row in table(name) if row["against"] == "delta_um"][1:]
        for name in ("solved.csv", "predicted.csv")
    )
    for one, two in zip(solved, predicted, strict=True):
        contact = bem.solve(heights, 1000.0, float(one["delta_um"]))
        for name, value in (
            ("area_percent", contact.area_percent),
            ("force_uN", contact.force),
            ("mean_gap_um", contact.mean_gap),
        ):
            assert float(one[name]) == pytest.approx(value, rel=1e-5)
        assert float(two["force_uN"]) == pytest.approx(contact.force, rel=0.2)
        assert float(two["mean_gap_um"]) == pytest.approx(contact.mean_gap, abs=0.5)


def test_a_law_says_where_it_is_outside(work):
    ask = ["law", "hybrid.surrogate", "many", "--side", 1000, "--delta", "10,400", "--csv"]
    assert run(*ask, "law.csv") == 0
    rows = [row for row in table("law.csv") if row["against"] == "delta_um"]
    own = Surrogate.load("hybrid.surrogate")
    surfaces = [np.load(f"many/s{seed}.npy") for seed in range(3)]
    inside = [own.for_surface(each, 1000.0).predict([10.0, 400.0]).inside for each in surfaces]
    expected = [0.0, *(1 - np.mean(inside, axis=0))]
    np.testing.assert_allclose([float(row["outside"]) for row in rows], expected)
    assert expected[2] == 1
    assert [bool(row["reason"]) for row in rows] == [share > 0 for share in expected]
    others = [row for row in table("law.csv") if row["against"] != "delta_um"]
    assert float(others[0]["outside"]) == 0
    assert float(others[-1]["outside"]) == 1


def test_a_prediction_names_modulus_and_reasons(work, capsys):
    ask = ["predict", "dimensionless.surrogate", "many", "--side", 1000, "--delta", "10,400"]
    assert run(*ask, "--young", "210e3", "--poisson", "0.3", "-o", "p.csv") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "E* = 230769 MPa" in said
    reasons = [row["reason"] for row in table("p.csv")]
    outside = sum("delta/h" in reason for reason in reasons)
    assert f"{outside} of 6: delta/h" in said
    assert run(*ask) == 0
    assert "E* = 1 MPa" in " ".join(capsys.readouterr().out.split())


def test_laws_of_scenes_databases_and_given_pressures(work, capsys):
    for text in ("database.h5", "scene.toml"):
        (work / "scene.toml").write_text("samples = 9\n[surface]\nnodes = 33\n")
        ask = ["law", "hybrid.surrogate", text, "--surfaces", 3, "--delta", "5:40:5"]
        assert run(*ask, "--pressure", "0:0.005:6", "--csv", f"{text}.csv") == 0
        assert "quantiles of 3 surfaces" in " ".join(capsys.readouterr().out.split())
    assert (work / "database.h5.csv").read_text() == (work / "scene.toml.csv").read_text()
    rows = [row for row in table("scene.toml.csv") if row["against"] == "pressure_MPa"]
    np.testing.assert_allclose(column(rows, "pressure_MPa"), np.linspace(0, 0.005, 6))
    assert run(*ask, "--pressure", "9") == 2
    assert "give a larger --delta" in capsys.readouterr().err


PROGRAM = r"""
#include <stdio.h>
#include "law.h"
int main(void)
{
    for (int i = -2; i <= 50; ++i) {
        double d = 0.9 * i;
        double p = 1e-4 * i;
        printf("%.17g %.17g %.17g %.17g %.17g\n", asperity_law_pressure(d), asperity_law_area(d),
               asperity_law_pressure_tangent(d), asperity_law_mean_gap_at_pressure(p),
               asperity_law_delta_at_pressure_tangent(p));
    }
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_header_compiles_and_interpolates(work):
    ask = ["law", "hybrid.surrogate", "many/s0.npy", "--side", 1000, "--delta", "2:40:12"]
    assert run(*ask, "--csv", "law.csv", "--header", "law.h") == 0
    (work / "main.c").write_text(PROGRAM)
    build = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "main.c", "-o", "main"]
    subprocess.run(build, check=True, timeout=60)
    said = subprocess.run(["./main"], check=True, capture_output=True, text=True, timeout=60).stdout
    found = np.array([[float(each) for each in line.split()] for line in said.splitlines()])
    rows = table("law.csv")
    by_delta = [row for row in rows if row["against"] == "delta_um"]
    by_pressure = [row for row in rows if row["against"] == "pressure_MPa"]
    steps = np.arange(-2, 51)
    delta, pressure = 0.9 * steps, 1e-4 * steps
    over, force = column(by_delta, "delta_um"), column(by_delta, "pressure_MPa")
    np.testing.assert_allclose(found[:, 0], np.interp(delta, over, force), rtol=1e-12)
    area = np.interp(delta, over, column(by_delta, "area_percent"))
    np.testing.assert_allclose(found[:, 1], area, rtol=1e-12)
    # The tangent is that of the interpolation: differences between neighbours inside a segment.
    segment = np.searchsorted(over, delta, side="right") - 1
    inside = (delta > 0) & (delta < over[-1])
    slopes = np.diff(force) / np.diff(over)
    np.testing.assert_allclose(found[inside, 2], slopes[segment[inside]], rtol=1e-9)
    assert found[0, 2] == 0
    at, gap = column(by_pressure, "pressure_MPa"), column(by_pressure, "mean_gap_um")
    np.testing.assert_allclose(found[:, 3], np.interp(pressure, at, gap), rtol=1e-12)
    assert (found[(pressure > 0) & (pressure < at[-1]), 4] > 0).all()
    assert not math.isnan(found.sum())


@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_workers_generate_the_surfaces_of_hybrid_features(made, database, tmp_path):
    arguments = ["fit", "database.h5", "--features", "hybrid", "-o", "r3.surrogate"]
    done = launch(3, *arguments, folder=tmp_path, module="learn")
    assert done.returncode == 0, done.stderr
    assert "generating 90 surfaces anew" in done.stderr
    with (
        np.load(tmp_path / "database.h5.pressed.npz") as ours,
        np.load(made / "database.h5.pressed.npz") as serial,
    ):
        np.testing.assert_array_equal(ours["values"], serial["values"])
    scores = [
        Surrogate.load(path).card["targets"]["area"]["scores"]
        for path in (tmp_path / "r3.surrogate", made / "hybrid.surrogate")
    ]
    assert scores[0] == scores[1]


@pytest.mark.parametrize("name", ["fit", "card", "predict", "law"])
def test_help_imports_no_numerics(name, tmp_path):
    code = f"from learn import cli; assert cli.main([{name!r}, '--help']) == 0"
    code += "\nimport sys; print(sorted({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    loaded = done.stdout.splitlines()[-1]
    for library in ("numpy", "scipy", "sklearn", "mapie", "h5py", "mpi4py"):
        assert f"'{library}'" not in loaded


PREDICT = ["predict", "hybrid.surrogate", "--side", "1000", "--delta", "5"]
LAW = ["law", "hybrid.surrogate", "many/s0.npy", "--side", "1000"]
WRONG = [
    (["card", "missing.surrogate"], "missing.surrogate"),
    (["card", "database.h5"], "is no surrogate"),
    (["predict", "hybrid.surrogate", "table.csv", "--delta", "5"], "need the surface"),
    (["predict", "hybrid.surrogate", "many/s0.npy", "--delta", "5"], "--side"),
    (["predict", "hybrid.surrogate", "many/s0.npy", "--side", "9"], "give --delta"),
    (["predict", "hybrid.surrogate", "many", "--side", "9", "--delta", "0"], "above 0"),
    (["predict", "hybrid.surrogate", "many", "--side", "9", "--delta", "1,,2"], "--delta"),
    (["predict", "hybrid.surrogate", "nowhere", "--delta", "5"], "neither a file nor a folder"),
    (["predict", "paper.surrogate", "table.csv"], "has no Delta: give --delta"),
    (["predict", "paper.surrogate", "broken.csv", "--delta", "5"], "row 1: peak_mean is 'x'"),
    (["predict", "paper.surrogate", "short.csv", "--delta", "5"], "has no column"),
    (["predict", "paper.surrogate", "table.csv", "--delta", "5", "--interval", "2"], "--interval"),
    (["predict", "paper.surrogate", "table.csv", "--delta", "5", "--e-star", "-1"], "--e-star"),
    (["fit", "database.h5", "-o", "nowhere/x"], "folder that exists"),
    (["fit", "database.h5", "-o", "x", "--features", "all"], "dimensionless"),
    (["fit", "database.h5", "-o", "x", "--model", "oracle"], "kernel-ridge"),
    (["fit", "database.h5", "-o", "x", "--target", "mean_gap"], "stores area, force"),
    (["fit", "database.h5", "-o", "x", "--normalise", "l1"], "min-max"),
    (["fit", "missing.h5", "-o", "x"], "missing.h5"),
    (["fit", "database.h5", "-o", "x", "--from", "out"], "is no comparison"),
    (["law", "hybrid.surrogate", "table.csv"], "needs surfaces"),
    (["law", "hybrid.surrogate", "missing.toml"], "missing.toml"),
    ([*PREDICT, "holes.npy"], "--fill closes holes"),
    ([*PREDICT, "cube.npy"], "cube.npy: holds 3 x 4 x 5"),
    ([*PREDICT, "complex.npy"], "complex.npy: holds complex128 values"),
    ([*PREDICT, "bare"], "bare: holds no surface"),
    ([*PREDICT[:2], "database.h5", "--delta", "5"], "database.h5: is a database; python -m learn"),
    ([*PREDICT, "many", "--delta", "5;9"], "as 2, 1,2,5 or 5:45:9"),
    ([*PREDICT, "many", "--delta", "five"], "--delta 'five'"),
    ([*PREDICT, "many", "--delta", "1:5:99999999999"], "100,000 values at most"),
    ([*PREDICT, "many", "--crop", "0:1"], "--crop"),
    ([*PREDICT, "many", "-o", "nowhere/p.csv"], "folder that exists"),
    ([*PREDICT, "many", "-o", "many/s0.npy"], "not replaced"),
    ([*PREDICT, "many", "-o", "hybrid.surrogate"], "not replaced"),
    (
        ["predict", "database.h5", "many", "--side", "1000", "--delta", "5"],
        "is no surrogate; it is a database",
    ),
    (["predict", "table.csv", "many", "--side", "1000", "--delta", "5"], "is no surrogate: make"),
    (["predict", "paper.surrogate", "table.csv", "--delta", "5", "-o", "table.csv"], "is an input"),
    (["fit", "database.h5", "-o", "database.h5"], "not replaced"),
    (["fit", "empty.h5", "-o", "x"], "empty.h5 is empty"),
    (["fit", "unfinished.h5", "-o", "x"], "5 usable rows, 10 at least are needed"),
    (["fit", "many/s0.npy", "-o", "x"], "is not a database"),
    (["fit", "database.h5", "-o", "x", "--area-max", "nan"], "--area-max nan"),
    (["fit", "database.h5", "-o", "x", "--target", "area,area"], "each once"),
    ([*LAW, "--pressure", "-1"], "--pressure '-1'"),
    ([*LAW, "--pressure", "1:2:3:4"], "--pressure '1:2:3:4'"),
    ([*LAW, "--csv", "nowhere/law.csv"], "folder that exists"),
    ([*LAW, "--header", "hybrid.surrogate"], "not replaced"),
    ([*LAW, "--interval", "1.5"], "--interval 1.5"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG)
def test_wrong_input_is_one_line_and_code_2(work, capsys, arguments, word):
    text = (work / "table.csv").read_text()
    header, values = text.splitlines()[:2]
    first = values.partition(",")[0]
    (work / "broken.csv").write_text(f"{header}\n{values.replace(first, 'x', 1)}\n")
    (work / "short.csv").write_text("peak_mean,peak_rms\n1,2\n")
    before = sorted(work.iterdir())
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("learn: "), said
    assert word in said[-1]
    assert sorted(work.iterdir()) == before, "nothing was written"


def test_an_overruled_scale_is_told_beside_the_predictions(work, capsys):
    heights = np.load("many/s0.npy")
    header = "Channel: Topo\nWidth: 1 m\nHeight: 1 m\nValue units: um"
    np.savetxt("scan.txt", heights, header=header)
    ask = ["predict", "dimensionless.surrogate", "scan.txt", "--delta", "9", "-o", "p.csv"]
    assert run(*ask, "--side", 1000) == 2
    assert "--override-scale" in capsys.readouterr().err
    assert run(*ask, "--side", 1000, "--override-scale", "--channel", "Topo") == 0
    said = capsys.readouterr()
    assert "OVERRULED" in said.err
    assert "warning: the file's own scale is overruled" in said.err
    (row,) = table("p.csv")
    assert "taken as 1000 x 1000 um" in row["warnings"]
    law = ["law", "scan.txt", "--solver", "--side", 1000, "--override-scale", "--delta", "9"]
    assert run(*law, "--header", "law.h") == 0
    told = "the file's own scale is overruled"
    assert told in capsys.readouterr().out
    assert told in Path("law.h").read_text()
    assert run(*ask, "--channel", "Phase") == 2
    assert "holds 0 'Topo'" in capsys.readouterr().err
