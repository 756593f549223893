"""Predictions for files, folders and tables."""

import contextlib
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from comparisons import run, table

import bem
from gen import cli as gen_cli
from learn import Prediction, Surrogate, cli

DELTAS = "6,20,40"


@dataclass(frozen=True)
class Row:
    """A row of a table of predictions, and the prediction in Python that it has to hold."""

    cells: dict[str, str]
    heights: np.ndarray
    answer: Prediction

    @property
    def outside(self) -> bool:
        """Whether the surface is outside the training."""
        return self.answer.reasons != ("",)


@pytest.fixture(scope="module")
def rows(made, tmp_path_factory):
    """The rows that are written for a folder of three surfaces, at three Deltas each."""
    path = tmp_path_factory.mktemp("predicted") / "p.csv"
    with contextlib.chdir(made):
        ask = ["predict", "hybrid.surrogate", "many", "--side", 1000, "--delta", DELTAS]
        assert run(*ask, "-o", path) == 0
        surrogate = Surrogate.load("hybrid.surrogate")
        rows = []
        for cells in table(path):
            heights = np.load(cells["input"])
            answer = surrogate.predict(heights, 1000.0, float(cells["delta_um"]))
            rows.append(Row(cells, heights, answer))
    return rows


def test_the_surfaces_of_a_folder_are_predicted_in_order(rows):
    inputs = [row.cells["input"] for row in rows[::3]]
    assert inputs == [f"many/s{seed}.npy" for seed in range(3)]


def test_a_table_of_predictions_has_what_python_predicts(rows):
    for row in rows:
        for key, value in (
            ("area_percent", row.answer.area),
            ("force_uN", row.answer.force),
        ):
            assert float(row.cells[key]) == pytest.approx(float(value[0]), rel=1e-9)


def test_intervals_are_written_inside_the_training_alone(rows):
    for row in rows:
        for key, value in (
            ("area_percent_low", row.answer.low["area"]),
            ("force_uN_high", row.answer.high["force"]),
        ):
            if row.outside:
                assert row.cells[key] == ""
            else:
                assert float(row.cells[key]) == pytest.approx(float(value[0]), rel=1e-9)


def test_rows_outside_the_training_have_a_flag_and_a_reason(rows):
    for row in rows:
        assert row.cells["reason"] == row.answer.reasons[0]
        assert row.cells["flag"] == ("outside" if row.outside else "inside")


def test_predicted_forces_are_near_solved_ones(rows):
    for row in rows:
        solved = bem.solve(row.heights, 1000.0, float(row.cells["delta_um"]))
        assert float(row.cells["force_uN"]) == pytest.approx(solved.force, rel=0.15)


def test_a_surface_without_asperities_has_no_prediction_and_the_others_have(work, capsys):
    Path("some").mkdir()
    np.save("some/a.npy", np.outer(np.arange(33.0), np.ones(33)))  # a ramp
    assert run(*PREDICT, "some/a.npy") == 2
    assert "some/a.npy: statistics undefined" in capsys.readouterr().err
    np.save("some/b.npy", np.load("many/s1.npy"))
    assert run(*PREDICT, "some", "-o", "p.csv") == 0
    assert "warning: some/a.npy: statistics undefined" in capsys.readouterr().err
    without, other = table("p.csv")
    assert "no asperity" in without["reason"]
    assert (without["flag"], without["area_percent"]) == ("outside", "")
    assert float(other["area_percent"]) > 0


def test_statistics_give_what_the_surface_gives(work):
    for features in ("dimensionless", "paper"):
        ask = ["predict", f"{features}.surrogate"]
        assert run(*ask, "table.csv", "--delta", DELTAS, "-o", "a.csv") == 0
        assert (
            run(*ask, "many/s0.npy", "--side", 1000, "--delta", DELTAS, "-o", "b.csv")
            == 0
        )
        for one, two in zip(table("a.csv"), table("b.csv"), strict=True):
            for key in ("area_percent", "force_uN_low", "area_percent_high"):
                assert bool(one[key]) == bool(two[key])
                assert float(one[key] or 0) == pytest.approx(
                    float(two[key] or 0), rel=1e-6
                )
            assert one["reason"] == two["reason"]


@pytest.fixture(scope="module")
def gaussian_process(made, tmp_path_factory):
    """The path of a surrogate whose model cannot predict from NaN."""
    path = tmp_path_factory.mktemp("gp") / "gp.surrogate"
    fit = ["fit", made / "database.h5", "--model", "gaussian-process", "-o", path]
    assert run(*fit) == 0
    return path


@pytest.fixture
def lacking(work):
    """In the working directory, tables in which some or all rows lack statistics."""
    (row,) = table("table.csv")
    undefined = {"asperity_mean": "nan", "asperity_rms": "NaN", "asperity_skewness": ""}
    without = {**row, **undefined}
    for name, rows in (("mixed.csv", [without, row, without]), ("none.csv", [without])):
        with Path(name).open("w", newline="") as file:
            writer = csv.DictWriter(file, row)
            writer.writeheader()
            writer.writerows(rows)
    return work


@pytest.mark.usefixtures("lacking")
@pytest.mark.parametrize("name", ["dimensionless", "paper", "gp"])
def test_rows_of_a_table_that_lack_statistics_have_no_prediction(name, gaussian_process):
    surrogate = gaussian_process if name == "gp" else f"{name}.surrogate"
    ask = ["predict", surrogate, "--delta", "6,20", "-o", "p.csv"]
    assert run(*ask, "table.csv") == 0
    alone = table("p.csv")
    assert run(*ask, "mixed.csv") == 0
    first_two, complete, last_two = np.split(np.array(table("p.csv")), 3)
    for row, row_alone in zip(complete, alone, strict=True):
        for key in ("area_percent", "force_uN", "force_uN_low", "force_uN_high"):
            assert float(row[key]) == pytest.approx(float(row_alone[key]), rel=1e-9)
        assert row["reason"] == row_alone["reason"]
    for row in (*first_two, *last_two):
        assert (row["area_percent"], row["force_uN_low"]) == ("", "")
        assert row["reason"] == "statistics undefined: nan in the table"


@pytest.mark.usefixtures("lacking")
def test_a_table_without_any_statistics_is_refused(refused):
    ask = ["predict", "paper.surrogate", "--delta", "6", "none.csv"]
    assert "none.csv: every row lacks statistics" in refused(cli, *ask)


def test_a_prediction_names_modulus_and_reasons(work, capsys):
    ask = [
        "predict",
        "dimensionless.surrogate",
        "many",
        "--side",
        1000,
        "--delta",
        "10,400",
    ]
    assert run(*ask, "--young", "210e3", "--poisson", "0.3", "-o", "p.csv") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "E* = 230769 MPa" in said
    reasons = [row["reason"] for row in table("p.csv")]
    outside = sum("delta/h" in reason for reason in reasons)
    assert f"{outside} of 6: delta/h" in said
    assert run(*ask) == 0
    assert "E* = 1 MPa" in " ".join(capsys.readouterr().out.split())


PREDICT = ["predict", "hybrid.surrogate", "--side", "1000", "--delta", "5"]


def test_codes_of_a_map_are_told_beside_the_predictions(work, capsys):
    heights = np.load("many/s0.npy")
    heights[3, 5:9] = -9999.0
    np.save("coded.npy", heights)
    assert run(*PREDICT, "coded.npy", "-o", "p.csv") == 0
    assert (
        "4 nodes (0.367 %) are at -9999 um, the first is (3, 5)"
        in capsys.readouterr().err
    )
    (row,) = table("p.csv")
    assert "--mask " in row["warnings"]


SCALED = ["--delta", "9", "--side", "1000"]
OVERRULED = [*SCALED, "--override-scale"]


@pytest.fixture
def scan(work):
    """In the working directory, a map whose own scale is 1 m."""
    header = "Channel: Topo\nWidth: 1 m\nHeight: 1 m\nValue units: um"
    np.savetxt("scan.txt", np.load("many/s0.npy"), header=header)
    return "scan.txt"


def test_a_scale_that_contradicts_the_map_is_refused(scan, refused):
    line = refused(cli, "predict", "dimensionless.surrogate", scan, *SCALED)
    assert "--override-scale" in line


def test_a_channel_that_a_map_lacks_is_refused(scan, refused):
    ask = ["predict", "dimensionless.surrogate", scan, "--delta", "9"]
    assert "holds 0 'Topo'" in refused(cli, *ask, "--channel", "Phase")


def test_an_overruled_scale_is_told_beside_the_predictions(scan, capsys):
    ask = ["predict", "dimensionless.surrogate", scan, *OVERRULED, "-o", "p.csv"]
    assert run(*ask, "--channel", "Topo") == 0
    told = capsys.readouterr().err
    assert "OVERRULED" in told
    assert "warning: the file's own scale is overruled" in told
    (row,) = table("p.csv")
    assert "taken as 1000 x 1000 um" in row["warnings"]


def test_an_overruled_scale_is_told_by_a_law_and_in_its_files(scan, capsys):
    assert run("law", scan, "--solver", *OVERRULED, "--header", "law.h") == 0
    told = "the file's own scale is overruled"
    assert told in capsys.readouterr().out
    assert told in Path("law.h").read_text()


SURFACE = ["many/s0.npy", "--side", "1000"]
"""A surface, and its lengths."""


@pytest.mark.usefixtures("work")
@pytest.mark.parametrize(
    ("name", "inputs"), [("hybrid", SURFACE), ("dimensionless", ["table.csv"])]
)
def test_a_hardness_is_refused_by_surrogates_of_elastic_bodies(name, inputs, refused):
    ask = ["predict", f"{name}.surrogate", *inputs, "--delta", "10"]
    line = refused(cli, *ask, "--hardness", "0.01")
    assert "trained on elastic bodies" in line


@pytest.fixture(scope="module")
def plastic(yielding, tmp_path_factory):
    """The path of a surrogate of bodies that yield."""
    path = tmp_path_factory.mktemp("plastic") / "plastic.surrogate"
    assert run("fit", yielding, "-o", path, "--model", "decision-tree") == 0
    return path


@pytest.mark.usefixtures("work")
def test_a_surrogate_of_bodies_that_yield_asks_for_their_hardness(plastic, refused):
    line = refused(cli, "predict", plastic, "table.csv", "--delta", "10")
    assert "give --hardness" in line


@pytest.mark.usefixtures("work")
def test_a_hardness_is_named_with_the_predictions(plastic, capsys):
    ask = ["predict", plastic, "table.csv", "--delta", "10", "--hardness", "0.01"]
    assert run(*ask) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "hardness = 0.01 MPa" in told
    assert "solids have" not in told


@pytest.mark.usefixtures("work")
@pytest.mark.parametrize(
    ("options", "question"),
    [
        ([], "is the modulus left out?"),
        (["--young", "210"], "is the modulus in GPa?"),
    ],
)
def test_a_hardness_that_no_solid_has_is_doubted(plastic, options, question, capsys):
    ask = ["predict", plastic, "table.csv", "--delta", "10", "--hardness", "2000"]
    assert run(*ask, *options) == 0
    assert question in capsys.readouterr().out


def test_a_card_has_the_hardnesses_of_the_training(plastic, capsys):
    assert run("card", plastic) == 0
    assert "hardness 0.003 to 0.1 E*" in " ".join(capsys.readouterr().out.split())


@pytest.fixture(scope="module")
def cells(mirrored, made, tmp_path_factory):
    """A folder with a surrogate of patches between mirror images, a patch and its statistics."""
    folder = tmp_path_factory.mktemp("cells")
    fit = ["fit", mirrored, "-o", folder / "cells.surrogate", "--model", "decision-tree"]
    assert run(*fit) == 0
    np.save(folder / "cells.npy", np.load(made / "many/s0.npy")[:-1, :-1])
    describe = ["describe", folder / "cells.npy", "--side", "1000"]
    describe += ["--csv", folder / "cells.csv", "--boundary", "mirror"]
    assert gen_cli.main([str(word) for word in describe]) == 0
    return folder


def test_a_surface_has_the_boundary_of_the_surrogate_as_its_statistics_have(cells, here):
    ask = ["predict", cells / "cells.surrogate", "--delta", "1,3"]
    assert run(*ask, cells / "cells.npy", "--side", 1000, "-o", "a.csv") == 0
    assert run(*ask, cells / "cells.csv", "-o", "b.csv") == 0
    for one, two in zip(table("a.csv"), table("b.csv"), strict=True):
        area = float(two["area_percent"])
        assert float(one["area_percent"]) == pytest.approx(area, rel=1e-6)
        assert one["reason"] == two["reason"]
        assert "spacing" not in one["reason"]


def test_statistics_of_another_boundary_are_refused(cells, work, refused):
    ask = ["predict", cells / "cells.surrogate", "table.csv", "--delta", "1"]
    assert "table.csv: has no column boundary" in refused(cli, *ask)
    ask = ["predict", "dimensionless.surrogate", cells / "cells.csv", "--delta", "9"]
    assert "cells.csv: has a mirror boundary" in refused(cli, *ask)


def test_a_card_has_the_boundary_of_the_training(cells, capsys):
    assert run("card", cells / "cells.surrogate") == 0
    assert "E* 1 MPa, mirror boundary" in " ".join(capsys.readouterr().out.split())
