"""Entries of the ledger: what passes, what fails, and with which line."""

import pytest

from bem import active_set, iterate, progress
from gen.runtime.errors import InputError
from tests.ledger import __main__ as program
from tests.ledger.constants import largest_change, multiply_constant
from tests.ledger.counts import LEDGER, Entry, Key, faults, read, write_entries

CONVOLUTIONS = Key("given force", "convolutions")
NODES = Key("given force", "contact nodes")
ENTRIES = {CONVOLUTIONS: Entry(500, "first"), NODES: Entry(2000, "first")}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({CONVOLUTIONS: 510, NODES: 2002}, []),
        ({CONVOLUTIONS: 300, NODES: 1998}, []),
        (
            {CONVOLUTIONS: 511},
            ["given force, convolutions: rises from 500 to 511 (+2.2%, at most +2%)"],
        ),
        (
            {NODES: 1997},
            [
                "given force, contact nodes: changes from 2000 to 1997 (at most 0.1% either way)"
            ],
        ),
        ({Key("new", "fits"): 3}, ["new, fits: 3 is not in the ledger"]),
    ],
)
def test_work_may_fall_and_results_may_not_change(changes, expected):
    counts = {CONVOLUTIONS: 500, NODES: 2000} | changes
    assert list(faults(ENTRIES, counts)) == expected


def test_the_file_holds_its_entries(tmp_path):
    path = tmp_path / "counts.csv"
    assert read(path) == {}
    write_entries(ENTRIES, path)
    assert read(path) == ENTRIES
    for spoilt in ("", "item,count\n", "item,count,value,reason\na,b,many,c\n"):
        path.write_text(spoilt)
        with pytest.raises(InputError, match="is no ledger"):
            read(path)


def test_the_committed_ledger_has_reasons_and_plenty_of_counts():
    entries = read(LEDGER)
    assert len({key.item for key in entries}) > 20
    assert all(entry.reason for entry in entries.values())


def test_the_command_names_faults_and_updates(tmp_path, monkeypatch, capsys):
    path = tmp_path / "counts.csv"
    monkeypatch.setattr(program, "LEDGER", path)
    monkeypatch.setattr(program, "read", lambda: read(path))
    monkeypatch.setattr(
        program, "write_entries", lambda entries: write_entries(entries, path)
    )
    monkeypatch.setattr(program, "solve_counts", lambda: {CONVOLUTIONS: 600})
    monkeypatch.setattr(program, "job_counts", lambda: {NODES: 2000})
    write_entries(ENTRIES, path)
    assert program.ledger() == 1
    assert capsys.readouterr().out.splitlines()[-2:] == [
        "ledger: given force, convolutions: rises from 500 to 600 (+20.0%, at most +2%)",
        "if wanted: python -m tests.ledger --update 'the reason'",
    ]
    with pytest.raises(InputError, match="reason"):
        program.ledger(" ")
    assert program.ledger("harder surfaces") == 0
    assert read(path)[CONVOLUTIONS] == Entry(600, "harder surfaces")
    assert program.ledger() == 0


def test_counts_with_a_halved_constant_are_shown_beside_the_ledger(
    tmp_path, monkeypatch, capsys
):
    path = tmp_path / "counts.csv"
    write_entries(ENTRIES, path)
    monkeypatch.setattr(program, "read", lambda: read(path))
    monkeypatch.setattr(program, "solve_counts", lambda: {CONVOLUTIONS: 600, NODES: 2000})
    monkeypatch.setattr(active_set, "ADVANCE", 0.5)  # put back afterwards
    assert program.ledger(halved="bem.active_set.ADVANCE") == 0
    assert capsys.readouterr().out.splitlines()[-2:] == [
        "bem.active_set.ADVANCE = 0.25 instead of 0.5",
        "largest change: +20.0% (given force, convolutions)",
    ]
    with pytest.raises(InputError, match="one of"):
        program.ledger("reason", halved="bem.active_set.ADVANCE")


def test_a_constant_changes_wherever_it_is_read(monkeypatch):
    monkeypatch.setattr(iterate, "CERTAIN", iterate.CERTAIN)
    monkeypatch.setattr(active_set, "CERTAIN", active_set.CERTAIN)
    multiply_constant("bem.iterate.CERTAIN", 2.0)
    assert active_set.CERTAIN == iterate.CERTAIN == 0.02


def test_whole_numbers_stay_whole_and_above_zero(monkeypatch):
    monkeypatch.setattr(progress, "IDLE", 1)
    multiply_constant("bem.progress.IDLE", 0.5)
    assert progress.IDLE == 1


@pytest.mark.parametrize("name", ["bem.active_set.NONE", "ADVANCE", "gen.scene.SIDE"])
def test_a_name_that_is_no_constant_of_bem_is_refused(name):
    with pytest.raises(InputError, match="no number of bem"):
        multiply_constant(name, 2.0)


def test_the_largest_change_goes_either_way():
    assert largest_change(ENTRIES, {CONVOLUTIONS: 400, NODES: 2001}).startswith(
        "largest change: -20.0%"
    )
