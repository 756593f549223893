"""The whole report on few rows: what it holds, and what its tables say."""

import csv

import pytest

import learn.cli
from bench import commands as bench
from bench import databases, picture
from bench.contents import Figure, tables_of
from bench.paper import database, facts, models, report
from bench.paper.facts import why
from bench.report import part_of
from gen.database import Reader

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def preset(tmp_path_factory):
    """120 rows of the paper preset."""
    return databases.of_the_paper(None, tmp_path_factory.mktemp("paper"), 120)


def table_of(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module", autouse=True)
def _few_rows():
    """Fewer rows on the finer grid, and pictures that are drawn faster."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(database, "number_of_fine_rows", lambda rows: 20)
        patch.setattr(picture, "DPI", 40)
        yield


@pytest.fixture(scope="module")
def comparison(preset, tmp_path_factory):
    """Two baselines and a small search."""
    folder = tmp_path_factory.mktemp("comparison")
    compared = [str(preset), "-o", str(folder), "--area-max", "60"]
    trees = [*compared, "--model", "decision-tree", "--model", "kernel-ridge"]
    assert learn.cli.main(["compare", *trees]) == 0
    assert learn.cli.main(["tune", *compared, "--model", "kernel-ridge"]) == 0
    return folder


@pytest.fixture(scope="module")
def made(preset, comparison, tmp_path_factory):
    """The whole report on few rows: its folder and files."""
    folder = tmp_path_factory.mktemp("made")
    made = report.paper(folder, 200, preset, comparison)
    return folder, made.write(folder, part_of("paper").contents)


def test_everything_there_is_shown_in_the_papers_order(made):
    folder, paths = made
    shown = part_of("paper").show(folder)
    pictures = {each.picture for each in shown if isinstance(each, Figure)}
    assert pictures | {path for each in shown for path in tables_of(each)} == set(paths)
    assert all(path.stat().st_size > 60 for path in paths)
    sections = [
        each.caption.split()[:2] for each in shown if each.caption.startswith("Section")
    ]
    numbers = [float(number.rstrip(",")) for _, number in sections]
    assert numbers == sorted(numbers)


def test_table_1_has_our_ranges_and_the_papers(made, preset):
    folder, _ = made
    with Reader(preset) as reader:
        highest = reader.column("height_max").max()
    first = {row["parameter"]: row for row in table_of(folder / "table-1.csv")}
    assert len(first) == len(facts.RANGES)
    heights = first["largest height of the surface"]
    assert float(heights["ours_high"]) == pytest.approx(highest, rel=1e-3)
    assert float(heights["paper_high"]) == 79.25


def test_table_1_explains_what_the_paper_defines_otherwise(made):
    folder, _ = made
    first = {row["parameter"]: row for row in table_of(folder / "table-1.csv")}
    bandwidth = first["Nayak's bandwidth parameter along x"]
    assert bandwidth["explanation"] == why("bandwidth")
    assert float(bandwidth["ours_inside_percent"]) < 90


def test_table_2_has_our_optima_of_the_models_that_were_searched(made):
    folder, _ = made
    tuned = [row for row in table_of(folder / "table-2.csv") if row["our_optimum"]]
    assert {row["model"] for row in tuned} == {"Kernel Ridge"}


def test_table_3_says_which_models_were_searched_by_how_many_fits(made):
    folder, _ = made
    third = {row["model"]: row for row in table_of(folder / "table-3.csv")}
    assert "55 fits instead of 800" in third["Kernel Ridge"]["explanation"]
    assert third["AdaBoost"]["explanation"] == "not searched"


def test_table_4_has_the_results_that_there_are_beside_the_papers(made):
    folder, _ = made
    fourth = table_of(folder / "table-4.csv")
    assert [(row["model"], row["result"]) for row in fourth] == [
        ("Decision Tree", "baseline"),
        ("Kernel Ridge", "baseline"),
        ("Kernel Ridge", "tuned"),
    ]
    assert fourth[0]["R2_paper"] == "96.31"


def test_table_5_has_a_column_for_each_feature_set(made):
    folder, _ = made
    fifth = {row["score_percent"]: row for row in table_of(folder / "table-5.csv")}
    assert float(fifth["r2"]["ours_hybrid"]) > float(fifth["r2"]["ours_paper"])
    assert fifth["nmae"]["paper"] == "3.95"


def test_parts_whose_files_are_there_are_shown(tmp_path):
    models.table_2().write(tmp_path)
    assert len(part_of("paper").show(tmp_path)) == 1


def test_bad_input_is_one_line(preset, tmp_path, capsys):
    given = ["--database", str(preset), "--comparison", "nowhere"]
    assert bench.main(["paper", *given, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "--comparison nowhere: give a folder of learn compare" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
