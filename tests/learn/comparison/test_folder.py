"""Comparison folders: results belong together, and folders of other choices are refused."""

import os

import h5py
from comparisons import run

from learn.comparison import folder


def test_databases_whose_names_are_no_text_leave_folders_that_can_be_read(work):
    name = os.fsdecode(b"data\xff.h5")
    (work / "database.h5").rename(name)
    for _ in range(2):
        assert run("compare", name, "-o", "out", "--model", "decision-tree") == 0
    assert folder.Folder(work / "out/area").record()["database"].endswith("data?.h5")


def test_a_folder_of_other_choices_is_refused(work, capsys):
    arguments = ["database.h5", "-o", "out", "--model", "decision-tree"]
    assert run("compare", *arguments) == 0
    capsys.readouterr()
    for more, word in (
        (["--seed", "1"], "seed 0, not 1"),
        (["--area-max", "60"], "area_max None, not 60.0"),
        (["--normalise", "none"], "normalisation 'l2', not 'none'"),
    ):
        assert run("tune", *arguments, *more) == 2
        said = capsys.readouterr().err
        assert word in said
        assert said.count("\n") == 1
    with h5py.File("database.h5", "r+") as file:
        file["delta"][0] += 1
    assert run("tune", *arguments) == 2
    assert "database_sha256" in capsys.readouterr().err
