"""Laws at the given loads, their bands, and no band outside the training."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest
from comparisons import table
from databases import database_of
from strict import json_of

from gen.law.curves import Points
from learn import cli
from learn.surrogate.law import at_pressures

STEEL = ["--young", "210e3", "--poisson", "0.3"]


def run(*arguments, ends=0):
    """Run a command of learn; it has to end with this exit code."""
    assert cli.main([str(argument) for argument in arguments]) == ends


def rows_of(path, against=None):
    """Rows of a table, or those against one argument."""
    return [row for row in table(path) if against is None or row["against"] == against]


def column(rows, name):
    """A column of numbers."""
    return np.array([float(row[name]) for row in rows])


COLUMNS = ("delta_um", "area_percent", "mean_gap_um")
FREE = ["--boundary", "free"]


SHORT = ["hybrid.surrogate", "--side", "1000", "--delta", "5:10:3", "--csv", "law.csv"]


@pytest.fixture
def ramp(work):
    """In the working directory, a folder with a surface without asperities."""
    Path("some").mkdir()
    np.save("some/ramp.npy", np.outer(np.arange(33.0), np.ones(33)))
    return work


@pytest.fixture
def mixed(ramp):
    """In the working directory, a folder with this surface and three others."""
    for seed in range(3):
        np.save(f"some/s{seed}.npy", np.load(f"many/s{seed}.npy"))
    return ramp


@pytest.mark.usefixtures("ramp")
def test_surfaces_without_asperities_alone_have_no_law(capsys):
    run("law", *SHORT, "some", ends=2)
    assert "ramp.npy: statistics undefined" in capsys.readouterr().err


@pytest.mark.usefixtures("mixed")
def test_a_law_tells_which_surfaces_are_left_out_and_what_its_band_is(capsys):
    run("law", *SHORT, "some")
    told = " ".join(capsys.readouterr().out.split())
    left_out = "1 of 4 surfaces were left out, the first: some/ramp.npy: statistics"
    assert f"warning: {left_out}" in told
    band = "90 % of further surfaces lie inside, at each load by itself; 3 surfaces"
    assert band in told
    assert "the errors of the surrogate come on top of it" in told


@pytest.mark.usefixtures("mixed")
def test_a_law_is_that_of_the_surfaces_that_are_not_left_out():
    run("law", *SHORT, "some")
    text = Path("law.csv").read_text()
    assert "ramp.npy" not in text
    run("law", *SHORT, "many")
    assert Path("law.csv").read_text() == text.replace("some/", "many/")


def test_a_predicted_population_has_bands_at_given_pressure(work):
    ask = ["--side", "1000", "--delta", "4:40:13", "--pressure", "0.002:0.02:4", "--csv"]
    run("law", "hybrid.surrogate", "many", *ask, "predicted.csv")
    run("law", "many", *ask, "solved.csv", "--solver", *FREE)
    for against in ("delta_um", "pressure_MPa"):
        predicted, solved = (
            rows_of(f"{name}.csv", against) for name in ("predicted", "solved")
        )
        pairs = zip(predicted, solved, strict=True)
        known = [
            each
            for each in pairs
            if each[0]["area_percent_low"] and float(each[0][against])
        ]
        predicted, solved = zip(*known, strict=True)
        assert len(predicted) >= 3
        for name in set(COLUMNS) - {against}:
            # Mean gaps follow from forces, and are small differences at the largest.
            off = 0.2 if name == "mean_gap_um" else 0.1
            low, high = (column(predicted, f"{name}_{end}") for end in ("low", "high"))
            assert (low < column(predicted, name)).all()
            assert (column(predicted, name) < high).all()
            for end, times in (
                ("", 1),
                ("_low", 2),
                ("_high", 2),
            ):  # far from three surfaces
                values = column(predicted, f"{name}{end}"), column(solved, f"{name}{end}")
                np.testing.assert_allclose(*values, rtol=times * off)


def test_a_law_of_the_solver_says_that_it_leaves(work, capsys):
    run("law", "many/s0.npy", "--side", "1000", "--delta", "5,9", "--solver")
    lines = capsys.readouterr().err.splitlines()
    (warning,) = (line for line in lines if "leaves with version 2.0" in line)
    assert warning.startswith("warning: --solver leaves with version 2.0: use ")
    assert warning.endswith("gen law, for a scene with its --boundary")


CELLS = """
samples = 9
[surface]
nodes = 17
[contact]
boundary = "mirror"
[delta]
pieces = [{ share = 1.0, range = [0.5, 3.0] }]
"""


def test_a_population_without_edges_has_a_law(work, mirrored):
    Path("cells.toml").write_text(CELLS)
    ask = ["cells.toml", "--surfaces", "3"]
    run("law", *ask, "--solver", "--pressure", "0.001,0.01,1", "--csv", "law.csv")
    found = rows_of("law.csv", "pressure_MPa")
    assert column(found, "pressure_MPa").tolist() == [0.001, 0.01], (
        "full contact at 1 MPa"
    )
    deltas = column(rows_of("law.csv", "delta_um"), "delta_um")
    assert 2 <= len(deltas) <= 3, "none at which a surface would be beyond full contact"
    run("fit", mirrored, "-o", "cells.surrogate", "--model", "kernel-ridge")
    run("law", "cells.surrogate", *ask, "--delta", "1:3:3", "--csv", "law.csv")
    predicted = rows_of("law.csv", "delta_um")
    gaps = column(predicted, "mean_gap_um")
    np.testing.assert_allclose(gaps + column(predicted, "delta_um"), gaps[0], rtol=1e-9)


ONE = ["hybrid.surrogate", "many/s0.npy", "--side", "1000"]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (
            ["many/s0.npy", "--side", "1000"],
            "give a surrogate and then surfaces, or surfaces and",
        ),
        (["many/s0.npy", "--side", "1000", "--solver"], "give --delta or --pressure"),
        (
            ["a.toml", "b.toml", "--solver", "--surfaces", "2", "--delta", "5"],
            "E* = 1 and 2 MPa",
        ),
        ([*ONE, "--delta", "5,9", "--pressure", "9"], "give a larger --delta"),
        (
            [*ONE, "--delta", "5", "--boundary", "mirror"],
            "--boundary mirror: the surrogate was",
        ),
        (
            [*ONE, "--solver", "--delta", "1"],
            "--solver solves the law without a surrogate",
        ),
        (
            ["hybrid.surrogate", "cells.toml"],
            "cells.toml: has a mirror boundary, the law a free",
        ),
    ],
)
def test_a_law_that_cannot_be_is_refused(work, capsys, arguments, word):
    for name, modulus in (("a", 1.0), ("b", 2.0)):
        text = f"samples = 2\n[surface]\nnodes = 9\n[contact]\nmodulus = {modulus}\n"
        Path(f"{name}.toml").write_text(text)
    Path("cells.toml").write_text(CELLS)
    run("law", *arguments, ends=2)
    assert word in capsys.readouterr().err.splitlines()[-1]


FIVE = ["many/s0.npy", "--side", "1000", "--delta", "5:25:5"]
SOFT = [*FIVE, "--hardness", "0.01"]


@pytest.fixture(scope="module")
def plastic(yielding, tmp_path_factory):
    """The path of a surrogate of bodies that yield, with hybrid features."""
    path = tmp_path_factory.mktemp("plastic") / "plastic.surrogate"
    run("fit", yielding, "--features", "hybrid", "-o", path)
    return path


@pytest.mark.usefixtures("work")
def test_a_law_of_bodies_that_yield_needs_a_hardness(plastic, capsys):
    run("law", plastic, *FIVE, ends=2)
    assert "give --hardness" in capsys.readouterr().err


@pytest.mark.usefixtures("work")
def test_a_law_of_elastic_bodies_takes_no_hardness(capsys):
    run("law", "hybrid.surrogate", *SOFT, ends=2)
    assert "trained on elastic bodies" in capsys.readouterr().err


@pytest.mark.usefixtures("work")
def test_a_law_of_bodies_that_yield_tells_its_hardness_and_doubts_its_gap(
    plastic, capsys
):
    run("law", plastic, *SOFT, "--header", "law.h")
    told = capsys.readouterr().out
    assert "the mean gap of bodies that yield is a coarse estimate" in told
    assert "hardness 0.01" in Path("law.h").read_text()


@pytest.mark.usefixtures("work")
def test_a_predicted_law_of_bodies_that_yield_is_near_the_solved_one(plastic):
    run("law", plastic, *SOFT, "--csv", "predicted.csv")
    run("law", *SOFT, "--csv", "solved.csv", "--solver", *FREE)
    predicted, solved = (
        rows_of(name, "delta_um")[1:] for name in ("predicted.csv", "solved.csv")
    )
    for name in ("area_percent", "force_uN"):
        true = column(solved, name)
        assert np.abs(column(predicted, name) - true).max() < 0.15 * true.max()


CONDUCTING = """
samples = 160
[surface]
nodes = 17
[contact]
boundary = "mirror"
hardness_ratio = 0.02
[delta]
pieces = [{ share = 1.0, range = [2.0, 6.0] }]
[store]
stiffness = true
"""


def inside(predicted, solved):
    """Rows of two laws against Delta, behind the first, where closures are predicted."""
    pairs = zip(
        *(rows_of(name, "delta_um")[1:] for name in (predicted, solved)), strict=True
    )
    return zip(*((one, other) for one, other in pairs if one["closure_um"]), strict=True)


CONDUCTIVE = ["law", "hybrid.surrogate", "many/s1.npy", "--side", "1000"]
CONDUCTIVE += ["--conductivity", "50"]


@pytest.fixture(scope="module")
def files(made, tmp_path_factory):
    """A folder with all files of a law that reaches far outside the training, and what it tells."""
    folder = tmp_path_factory.mktemp("law")
    ask = [*CONDUCTIVE, "--delta", "0.02:40:21", "-o", folder / "law"]
    with contextlib.chdir(made), contextlib.redirect_stdout(io.StringIO()) as told:
        run(*ask, "--plot", folder / "law.png")
    (folder / "told.txt").write_text(told.getvalue())
    return folder


@pytest.fixture(scope="module")
def by_pressure(files):
    """The rows of this law against pressure."""
    return rows_of(files / "law.csv", "pressure_MPa")


def is_flagged(row):
    """Whether a row is outside the training."""
    return float(row["outside"]) == 1


def kept_pressures(rows):
    """The pressures of the rows that are inside the training."""
    return {float(row["pressure_MPa"]) for row in rows if not is_flagged(row)}


def test_a_law_tells_that_values_are_withheld_outside_the_training(files):
    told = (files / "told.txt").read_text()
    assert "; outside, neither closure nor stiffness is given (-)" in told


def test_a_table_withholds_what_follows_from_predictions_outside(by_pressure):
    flagged = [row for row in by_pressure if is_flagged(row)]
    assert 0 < len(flagged) < len(by_pressure) - 1
    for name in ("closure_um", "stiffness_MPa_per_um", "conductance_W_per_mm2_K"):
        assert all((row[name] == "") == is_flagged(row) for row in by_pressure)


def test_json_withholds_what_follows_from_predictions_outside(files, by_pressure):
    curves = json_of(files / "law.json")["tables"][1]["curves"]
    withheld = [value is None for value in curves["closure_um"]["value"]]
    assert withheld == [is_flagged(row) for row in by_pressure]


def test_a_file_for_abaqus_ends_inside_the_training(files, by_pressure):
    behaviour, _, _ = (files / "law-abaqus.inp").read_text().partition("*GAP")
    lines = [line for line in behaviour.splitlines() if not line.startswith("*")]
    pressures = [float(line.split(",")[0]) for line in lines]
    largest = float(f"{max(kept_pressures(by_pressure)):.10g}")
    assert max(pressures) <= largest


def test_a_c_header_has_the_pressures_inside_the_training(files, by_pressure):
    number = len(kept_pressures(by_pressure) | {0.0})
    told = f"define ASPERITY_LAW_PRESSURES {number}"
    assert re.search(rf"{told}\b", (files / "law.h").read_text())


def test_a_law_outside_the_training_writes_nothing(work, capsys):
    run(*CONDUCTIVE, "--delta", "0.02,0.03", "-o", "law", ends=2)
    told = capsys.readouterr().err
    assert "no load lies inside the surrogate's training; --solver" in told
    assert not list(work.glob("law*"))


def test_the_conductance_of_elastic_bodies_is_the_slope_of_their_force(work):
    """Of a surrogate of area and force; in files for finite elements too."""
    ask = [
        "many/s1.npy",
        "--side",
        "1000",
        *STEEL,
        "--delta",
        "4:40:13",
        "--conductivity",
        "50",
    ]
    run(
        "law", "hybrid.surrogate", *ask, "--csv", "predicted.csv", "--calculix", "law.inp"
    )
    run("law", *ask, "--csv", "solved.csv", "--solver", *FREE)
    predicted, solved = inside("predicted.csv", "solved.csv")
    assert len(predicted) > 6
    for name in ("stiffness_MPa_per_um", "conductance_W_per_mm2_K"):
        near = column(predicted, name)[2:-2] / column(solved, name)[2:-2]
        assert np.abs(np.median(near) - 1) < 0.3
    assert "*GAP CONDUCTANCE" in Path("law.inp").read_text()
    closures = column(predicted, "closure_um") / column(solved, "closure_um")
    assert np.abs(np.median(closures) - 1) < 0.2


@pytest.mark.long
def test_the_conductance_of_bodies_that_yield_is_learnt_from_their_stiffness(
    work, capsys
):
    database_of(Path(), CONDUCTING, "yielding")
    fit = ["fit", "yielding.h5", "--model", "kernel-ridge", "--features", "hybrid"]
    run(*fit, "--target", "area,force,stiffness", "-o", "stiff.surrogate")
    run(*fit, "-o", "both.surrogate")
    ask = ["yielding.toml", "--surfaces", "8", "--delta", "3:6:4", "--conductivity", "50"]
    run("law", "stiff.surrogate", *ask, "--csv", "predicted.csv")
    run("law", *ask, "--solver", "--csv", "solved.csv")
    predicted, solved = inside("predicted.csv", "solved.csv")
    assert predicted
    ratio = column(predicted, "conductance_W_per_mm2_K") / column(
        solved, "conductance_W_per_mm2_K"
    )
    np.testing.assert_allclose(ratio, 1, atol=0.4)
    capsys.readouterr()
    run("law", "both.surrogate", *ask, ends=2)
    assert "fit a surrogate with --target area,force,stiffness" in capsys.readouterr().err


def test_the_inverse_of_a_law_knows_its_level_stretches():
    """A force predicted as 0 up to some Delta: a small pressure is reached behind that."""
    delta = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    names = ("delta_um", "area_percent", "closure_um", "pressure_MPa")
    values = dict.fromkeys(names, delta) | {"mean_gap_um": 4 - delta}
    low = {**values, "pressure_MPa": np.array([0.0, 0.0, 0.0, 1.0, 2.0])}
    high = {**values, "pressure_MPa": values["pressure_MPa"] + [0, 1, 1, 1, 1]}
    points = Points(values, low, high, ("",) * 5)
    found = at_pressures(points, np.array([0.0, 1e-9, 2.0, 3.0]))
    np.testing.assert_allclose(found.values["delta_um"], [0, 0, 2, 3], atol=1e-6)
    np.testing.assert_allclose(found.low["delta_um"], [0, 0, 1, 2], atol=1e-6)
    np.testing.assert_allclose(found.high["delta_um"], [0, 2, 4, np.nan], atol=1e-2)
    assert found.why_no_interval == (
        "",
        "",
        "",
        "its interval ends beyond the last displacement",
    )
    unknown = Points(values, low, high, ("", "", "", "", "far"))
    found = at_pressures(unknown, np.array([0.5, 2.0, 3.5]))
    assert found.reasons == ("", "", "far")
    assert found.why_no_interval[:2] == ("", "its interval ends where far")


def test_a_further_quantity_of_a_predicted_law_is_one_that_was_learnt(
    work, solved, capsys
):
    run(
        "fit",
        solved,
        "--model",
        "kernel-ridge",
        "--features",
        "dimensionless",
        "--target",
        "area,force,contact_nodes",
        "-o",
        "nodes.surrogate",
    )
    ask = ["nodes.surrogate", "many/s0.npy", "--side", "1000", "--delta", "5:25:5"]
    run("law", *ask, "--also", "contact_nodes", "--csv", "nodes.csv")
    rows = rows_of("nodes.csv", "delta_um")
    shares = 100 * column(rows, "contact_nodes") / 33**2
    np.testing.assert_allclose(shares, column(rows, "area_percent"), rtol=0.01, atol=0.01)
    capsys.readouterr()
    run("law", *ask, "--also", "perimeter", "--csv", "edges.csv", ends=2)
    said = capsys.readouterr().err
    assert (
        "was not learnt: fit one with --target area,force,contact_nodes,perimeter" in said
    )
