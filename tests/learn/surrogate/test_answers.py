"""Predictions for files, folders and tables."""

import csv
from pathlib import Path

import numpy as np
import pytest
from comparisons import run, table

import bem
from gen import cli as gen_cli
from learn import Surrogate

DELTAS = "6,20,40"


def test_a_folder_is_predicted_and_written(work):
    arguments = ["predict", "hybrid.surrogate", "many", "--side", 1000, "--delta", DELTAS]
    assert run(*arguments, "-o", "p.csv") == 0
    rows = table("p.csv")
    assert [row["input"] for row in rows[::3]] == [
        f"many/s{seed}.npy" for seed in range(3)
    ]
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


def test_rows_of_a_table_that_lack_statistics_have_no_prediction(work, capsys):
    (row,) = table("table.csv")
    assert (
        run("fit", "database.h5", "--model", "gaussian-process", "-o", "gp.surrogate")
        == 0
    )
    lacking = {
        **row,
        "asperity_mean": "nan",
        "asperity_rms": "NaN",
        "asperity_skewness": "",
    }
    for rows, name in (([lacking, row, lacking], "mixed.csv"), ([lacking], "none.csv")):
        with Path(name).open("w", newline="") as file:
            writer = csv.DictWriter(file, row)
            writer.writeheader()
            writer.writerows(rows)
    for surrogate in ("dimensionless", "paper", "gp"):
        ask = ["predict", f"{surrogate}.surrogate", "--delta", "6,20", "-o", "p.csv"]
        assert run(*ask, "table.csv") == 0
        alone = table("p.csv")
        assert run(*ask, "mixed.csv") == 0
        found = table("p.csv")
        for each, own in zip(found[2:4], alone, strict=True):
            for name in ("area_percent", "force_uN", "force_uN_low", "force_uN_high"):
                assert float(each[name]) == pytest.approx(float(own[name]), rel=1e-9)
            assert each["reason"] == own["reason"]
        for each in (*found[:2], *found[4:]):
            assert (each["area_percent"], each["force_uN_low"]) == ("", "")
            assert each["reason"] == "statistics undefined: nan in the table"
    capsys.readouterr()
    assert run(*ask, "none.csv") == 2
    assert "none.csv: every row lacks statistics" in capsys.readouterr().err


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


def test_an_overruled_scale_is_told_beside_the_predictions(work, capsys):
    heights = np.load("many/s0.npy")
    header = "Channel: Topo\nWidth: 1 m\nHeight: 1 m\nValue units: um"
    np.savetxt("scan.txt", heights, header=header)
    ask = [
        "predict",
        "dimensionless.surrogate",
        "scan.txt",
        "--delta",
        "9",
        "-o",
        "p.csv",
    ]
    assert run(*ask, "--side", 1000) == 2
    assert "--override-scale" in capsys.readouterr().err
    assert run(*ask, "--side", 1000, "--override-scale", "--channel", "Topo") == 0
    said = capsys.readouterr()
    assert "OVERRULED" in said.err
    assert "warning: the file's own scale is overruled" in said.err
    (row,) = table("p.csv")
    assert "taken as 1000 x 1000 um" in row["warnings"]
    law = [
        "law",
        "scan.txt",
        "--solver",
        "--side",
        1000,
        "--override-scale",
        "--delta",
        "9",
    ]
    assert run(*law, "--header", "law.h") == 0
    told = "the file's own scale is overruled"
    assert told in capsys.readouterr().out
    assert told in Path("law.h").read_text()
    assert run(*ask, "--channel", "Phase") == 2
    assert "holds 0 'Topo'" in capsys.readouterr().err


def test_a_hardness_is_named_and_refused_by_surrogates_of_elastic_bodies(
    work, yielding, capsys
):
    """In one line, for surfaces and for tables of statistics."""
    surface, statistics = ["many/s0.npy", "--side", "1000"], ["table.csv"]
    for name, given in (("hybrid", surface), ("dimensionless", statistics)):
        ask = [
            "predict",
            f"{name}.surrogate",
            *given,
            "--delta",
            "10",
            "--hardness",
            "0.01",
        ]
        assert run(*ask) == 2
        assert "trained on elastic bodies" in capsys.readouterr().err.splitlines()[-1]
    assert (
        run("fit", yielding, "-o", "plastic.surrogate", "--model", "decision-tree") == 0
    )
    ask = ["predict", "plastic.surrogate", *statistics, "--delta", "10"]
    assert run(*ask) == 2
    assert "give --hardness" in capsys.readouterr().err
    assert run(*ask, "--hardness", "0.01") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "hardness = 0.01 MPa" in said
    assert "solids have" not in said
    assert run(*ask, "--hardness", "2000") == 0
    assert "is the modulus left out?" in capsys.readouterr().out
    assert run(*ask, "--hardness", "2000", "--young", "210") == 0
    assert "is the modulus in GPa?" in capsys.readouterr().out
    assert run("card", "plastic.surrogate") == 0
    assert "hardness 0.003 to 0.1 E*" in " ".join(capsys.readouterr().out.split())


def test_surfaces_and_statistics_have_the_boundary_of_the_surrogate(
    work, mirrored, capsys
):
    assert run("fit", mirrored, "-o", "cells.surrogate", "--model", "decision-tree") == 0
    np.save("cells.npy", np.load("many/s0.npy")[:-1, :-1])
    describe = ["describe", "cells.npy", "--side", "1000", "--csv"]
    assert gen_cli.main([*describe, "cells.csv", "--boundary", "mirror"]) == 0
    ask = ["predict", "cells.surrogate"]
    assert run(*ask, "cells.npy", "--side", 1000, "--delta", "1,3", "-o", "a.csv") == 0
    assert run(*ask, "cells.csv", "--delta", "1,3", "-o", "b.csv") == 0
    for one, two in zip(table("a.csv"), table("b.csv"), strict=True):
        assert float(one["area_percent"]) == pytest.approx(
            float(two["area_percent"]), rel=1e-6
        )
        assert one["reason"] == two["reason"]
        assert "spacing" not in one["reason"]
    capsys.readouterr()
    assert run(*ask, "table.csv", "--delta", "1") == 2
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert (
        "table.csv: has a free boundary, the surrogate was trained on patches with a"
        in line
    )
    assert run("predict", "dimensionless.surrogate", "cells.csv", "--delta", "9") == 2
    assert "cells.csv: has a mirror boundary" in capsys.readouterr().err
    assert run("card", "cells.surrogate") == 0
    assert "E* 1 MPa, mirror boundary" in " ".join(capsys.readouterr().out.split())
