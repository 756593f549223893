"""Numbers as users type them, and what memory they may ask for."""

from unittest import mock

import h5py
import numpy as np
import pytest
from databases import database_of

from gen import cli
from gen.runtime import memory
from gen.runtime.errors import InputError
from gen.runtime.numbers import MOST, values_from
from gen.schema import RUNTIME

HUGE = "9" * 5000


def test_values_are_those_of_linspace():
    assert values_from("5", "--delta", "") == [5.0]
    assert values_from("1,2:3:5,-7", "--delta", "") == [1.0, *np.linspace(2, 3, 5), -7.0]
    decades = values_from("0.1:100:4:log", "--delta", "")
    assert (decades[0], *decades[1:3], decades[3]) == (0.1, *map(pytest.approx, (1, 10)), 100)
    assert values_from("8:2:3:log,1", "--delta", "") == pytest.approx([8, 4, 2, 1])


@pytest.mark.parametrize(
    "text",
    [
        *("", "1:2", "1:2:1", "1:inf:3", "1,", ":" * 3000, "1:2:1_0", "1:2:٣"),
        *("0:1:3:log", "1:log", f"1:2:{HUGE}"),
    ],
)
def test_what_is_no_value_is_refused(text):
    with pytest.raises(InputError, match=r"^--delta .*: advice$"):
        values_from(text, "--delta", "advice")


@pytest.mark.parametrize("text", ["1:2:2000000000", f"1:2:{MOST},1:2:3", "1," * MOST + "1"])
def test_more_values_than_any_use_are_refused_before_they_take_memory(text):
    with pytest.raises(InputError, match="give 100,000 values at most"):
        values_from(text, "--delta", "advice")


def test_more_loads_than_memory_holds_are_refused_before_the_first(monkeypatch):
    monkeypatch.setattr(memory, "allowed", lambda: 100_000_000)
    memory.require_for_contacts(3, (257, 257))
    with pytest.raises(InputError, match=r"100 loads on 257 x 257 nodes need about 237.8 MB"):
        memory.require_for_contacts(100, (257, 257))


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
