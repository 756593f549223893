"""Files of version 1.0.0: each kind is read, or refused with the command that makes it anew.

`files-1.0.0.zip` has the script that made them; docs/compatibility.md lists what becomes of each.
"""

import csv
import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from gen import cli as gen
from gen import scene
from gen.database import Reader
from gen.schema import PHYSICS
from learn import cli as learn

ARCHIVE = Path(__file__).with_name("files-1.0.0.zip")

PREDICT = "--side 500 --pressure 5:50:3 --e-star 2.3e5 --hardness 2000"
"""Options of `learn predict` with which version 1.0.0 wrote answers.csv."""

LAW = "--side 100 --pressure 1,2,4 --e-star 1e3"
"""Options of `gen law` with which version 1.0.0 wrote law.csv and law.json."""


@pytest.fixture
def files(here):
    """A working folder with the files of version 1.0.0."""
    shutil.unpack_archive(ARCHIVE, here)
    return here


def run(program, line):
    """Run a command line; it succeeds."""
    assert program.main(line.split()) == 0


@dataclass(frozen=True)
class Table:
    """Rows of a CSV file, as texts."""

    rows: list[dict[str, str]]

    @classmethod
    def read(cls, path):
        with Path(path).open(newline="", encoding="utf-8") as file:
            return cls(list(csv.DictReader(file)))

    @property
    def columns(self):
        return set(self.rows[0])

    def column(self, name):
        return [row[name] for row in self.rows]


@pytest.mark.parametrize(
    "line",
    [
        "info rows.h5",
        "info part.h5",
        "check rows.h5 --recompute 2",
        pytest.param("plot rows.h5 -o x.png", marks=pytest.mark.long),
    ],
)
def test_databases_are_read(files, line):
    """Rows that are computed again have the same surfaces."""
    before = (files / "rows.h5").read_bytes()
    run(gen, line)
    assert (files / "rows.h5").read_bytes() == before


def test_the_scene_is_that_of_its_database(files):
    """Its hash, and so its rows, are what they were."""
    with Reader(files / "rows.h5") as reader:
        stored = reader.attributes["scene_hash"]
        assert reader.attributes["physics"] == 12
    assert scene.load("scene.toml").fingerprint() == stored


def test_parts_are_merged(files):
    run(gen, "merge part.h5 rows.h5 -o merged.h5")
    with Reader(files / "merged.h5") as merged, Reader(files / "rows.h5") as rows:
        areas = [reader.column("area_percent") for reader in (merged, rows)]
    np.testing.assert_array_equal(*areas)


@pytest.mark.parametrize("name", ["rows.h5", "part.h5"])
def test_databases_are_not_continued_and_the_line_makes_them_anew(files, refused, name):
    before = (files / name).read_bytes()
    line = refused(gen, "run", "scene.toml", "-o", name)
    assert f"physics 12, this version computes physics {PHYSICS}; make it anew: " in line
    assert (files / name).read_bytes() == before
    command = line.partition("make it anew: ")[2].partition(",")[0]
    assert command.endswith(f"gen run {name} -o NEW.h5")
    run(gen, f"run {name} -o NEW.h5 --dry-run")


@pytest.mark.long
def test_surrogates_are_fitted_to_databases(files):
    fit = "fit rows.h5 --features dimensionless --load pressure --target area"
    run(learn, f"{fit} -o new.surrogate")


def test_surrogates_give_the_same_answers(files, capsys):
    """Libraries of other versions than the file's may refuse its models, with the fit to type."""
    code = learn.main(f"predict area.surrogate surface.npy {PREDICT} -o now.csv".split())
    if code == 2:
        assert "learn fit" in capsys.readouterr().err
        return
    assert code == 0
    before = Table.read("answers.csv")
    now = Table.read("now.csv")
    assert now.column("flag") == before.column("flag") == ["inside"] * 3
    for name in ("area_percent", "area_percent_low", "area_percent_high"):
        answers = np.array(now.column(name), float)
        np.testing.assert_allclose(
            answers, np.array(before.column(name), float), rtol=1e-9
        )


@pytest.mark.long
def test_comparisons_are_shown_and_continued(files):
    """A fit that is there stays."""
    there = files / "comparison" / "area" / "baseline" / "kernel-ridge.json"
    before = there.read_bytes()
    run(learn, "show comparison")
    compare = "compare rows.h5 -o comparison --features dimensionless --load pressure"
    run(learn, f"{compare} --model kernel-ridge --model decision-tree")
    assert there.read_bytes() == before
    assert there.with_name("decision-tree.json").exists()


def test_descriptions_are_read(files, capsys):
    """At a pressure, as this surrogate is asked for."""
    options = "--pressure 10 --e-star 2.3e5 --hardness 2000"
    run(learn, f"predict area.surrogate described.csv {options}")
    assert "area" in capsys.readouterr().out


def test_laws_keep_their_columns_and_keys(files):
    """For programs that read the tables of `gen law`."""
    run(gen, f"law surface.npy {LAW} --csv now.csv --json now.json")
    assert Table.read("law.csv").columns <= Table.read("now.csv").columns
    before = json.loads(Path("law.json").read_text(encoding="utf-8"))
    now = json.loads(Path("now.json").read_text(encoding="utf-8"))
    assert before.keys() <= now.keys()
