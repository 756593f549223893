"""Fits that are too large for the machine, or for what others leave of it."""

import os
import tempfile

from comparisons import run

from gen.runtime.memory import free
from learn import memory


def test_too_little_memory_is_refused_with_the_numbers(solved, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: memory.PROCESS + 50_000)
    assert run("compare", solved, "-o", tmp_path / "out", "--model", "gaussian-process") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "GiB for 72 training rows" in said
    assert "--train-rows" in said


def test_a_fit_asks_the_system_and_no_file_that_others_could_make(
    solved, tmp_path, monkeypatch, capsys
):
    """A FIFO of the name that fits once shared has held them up for ever."""
    os.mkfifo(tmp_path / f"asperity-memory-{os.getuid()}")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    line = ["compare", solved, "-o", tmp_path / "out", "--model", "decision-tree"]
    monkeypatch.setattr(memory, "free", lambda: 10 * memory.MIB)
    assert run(*line) == 2
    assert "this machine has 0.0 to give" in capsys.readouterr().err
    monkeypatch.undo()
    assert run(*line) == 0
    assert 0 < free() <= os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
