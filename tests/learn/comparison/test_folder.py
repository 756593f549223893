"""Comparison folders: those of other choices, and those that were edited, cut or sent by strangers.

Each is refused in one line, never by a traceback.
"""

import json
import os
import re
import shutil
from pathlib import Path

import h5py
import pytest
from comparisons import run
from databases import database_of

from learn import cli
from learn.comparison import folder as folders

SCENE = "samples = 60\nsamples_per_surface = 2\n[surface]\nnodes = 9\n"
RESULT = "area/tuned/decision-tree.json"
RECORD = "area/comparison.json"
TRIALS = "area/trials/decision-tree.jsonl"


def test_databases_whose_names_are_no_text_leave_folders_that_can_be_read(work):
    name = os.fsdecode(b"data\xff.h5")
    (work / "database.h5").rename(name)
    for _ in range(2):
        assert run("compare", name, "-o", "out", "--model", "decision-tree") == 0
    assert folders.Folder(work / "out/area").record().database.endswith("data?.h5")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    database = database_of(folder, SCENE)
    assert run("tune", database, "-o", folder / "found", "--model", "decision-tree") == 0
    assert (folder / "found" / RESULT).exists()
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "found"


def refusal(capsys, *arguments):
    """The one line with which a command refuses a damaged file."""
    assert cli.main(list(arguments)) == 2
    (said,) = re.findall("^learn: .*", capsys.readouterr().err, flags=re.MULTILINE)
    return str(said)


SHOW = ("show", "found", "--no-pictures")
FIT = (
    "fit",
    "rows.h5",
    "--model",
    "decision-tree",
    "--from",
    "found",
    "--target",
    "area",
)
FIT = (*FIT, "-o", "a.surrogate")
TUNE = ("tune", "rows.h5", "-o", "found", "--model", "decision-tree")


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("more", "word"),
    [
        (["--seed", "1"], "seed 0, not 1"),
        (["--area-max", "60"], "area_max None, not 60.0"),
        (["--normalise", "none"], "normalisation 'l2', not 'none'"),
    ],
)
def test_a_folder_of_other_choices_is_refused(folder, more, word, capsys):
    assert word in refusal(capsys, *TUNE, *more)


def test_a_folder_of_another_database_is_refused(folder, capsys):
    with h5py.File("rows.h5", "r+") as file:
        file["delta"][0] += 1
    assert "database_sha256" in refusal(capsys, *TUNE)


DAMAGE = {
    "no-object": (RECORD, b"[1, 2]", SHOW),
    "empty": (RESULT, b"", SHOW),
    "nested": (RESULT, b"[" * 100_000, SHOW),
    "trials": (TRIALS, b"{}\n[]\n", TUNE),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_what_is_no_document_is_refused(name, folder, capsys):
    file, content, command = DAMAGE[name]
    (folder / file).write_bytes(content)
    assert str(Path("found", file)) in refusal(capsys, *command)


CHANGES = {
    "missing": (RECORD, "unit", None, SHOW),
    "area-nan": (RECORD, "conditions.area_max", float("nan"), SHOW),
    "score-nan": (RESULT, "test.r2", float("nan"), SHOW),
    "times-nan": (RESULT, "times.fit", float("nan"), SHOW),
    "setting-huge": (RESULT, "settings.max_depth", 10**9, FIT),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_damaged_value_is_named(name, folder, capsys):
    file, key, value, command = CHANGES[name]
    found = json.loads((folder / file).read_text())
    *parents, last = key.split(".")
    inner = found
    for parent in parents:
        inner = inner[parent]
    inner[last] = value
    if value is None:
        del inner[last]
    (folder / file).write_text(json.dumps(found))
    said = refusal(capsys, *command)
    assert last[:6] in said
    assert len(said) < 600


@pytest.mark.parametrize(("key", "value"), [("fold", 9), ("r2", "x"), ("seconds", -1.0)])
def test_a_damaged_trial_is_named_by_its_line(key, value, folder, capsys):
    lines = (folder / TRIALS).read_text().splitlines()
    lines[2] = json.dumps({**json.loads(lines[2]), key: value})
    (folder / TRIALS).write_text("\n".join(lines) + "\n")
    said = refusal(capsys, *TUNE)
    assert "decision-tree.jsonl, line 3" in said
    assert key in said


def test_whole_numbers_in_place_of_others_are_those(folder, capsys):
    """Found by the fuzzer: matplotlib takes no whole number of more than 64 bits."""
    found = json.loads((folder / RESULT).read_text())
    found["test"]["nmse"] = 10**25
    (folder / RESULT).write_text(json.dumps(found))
    assert cli.main(["show", "found"]) == 0, capsys.readouterr().err


def test_predictions_that_are_no_numbers_are_refused(folder, capsys):
    table = folder / "area/tuned/decision-tree.csv"
    whole = table.read_text()
    for damaged in ("", whole + "7,nan,1\n", whole + "7\n", whole + "a,b,c\n"):
        table.write_text(damaged)
        assert "decision-tree.csv" in refusal(capsys, "show", "found")
