"""Memory that contacts need: what does not fit is refused, and says what it needs."""

from unittest import mock

import h5py
import numpy as np
from databases import database_of

from gen import cli
from gen.schema import RUNTIME


def test_what_is_out_of_memory_says_what_it_needs_and_fails_no_row(here, monkeypatch, capsys):
    np.save("surface.npy", np.arange(81.0).reshape(9, 9))
    text = "samples = 3\n[surface]\nnodes = 9\n"
    (here / "rows.toml").write_text(text)
    with monkeypatch.context() as full:
        for name in ("solve", "ladder"):
            full.setattr(f"bem.{name}", mock.Mock(side_effect=MemoryError))
        for line, needs in (
            ("contact surface.npy --side 9 --delta 1", ": it needs about 32.4 kB"),
            ("run rows.toml -o rows.h5", ""),
        ):
            assert cli.main(line.split()) == 2
            said = capsys.readouterr().err.splitlines()[-1]
            assert f"9 x 9 nodes does not fit into memory{needs}" in said
    database_of(here, text)
    assert "3 rows done, 0 failed" in capsys.readouterr().out


def test_a_picture_needs_no_times(here, capsys):
    database_of(here, "samples = 4\n[surface]\nnodes = 9\n")
    for rows in (slice(0, 1), slice(None)):
        with h5py.File("rows.h5", "r+") as file:
            file[RUNTIME]["solve_seconds"][rows] = np.nan
        assert cli.main(["plot", "rows.h5", "-o", "rows.png"]) == 0, capsys.readouterr().err
