"""`gen check` finds what was spoilt, and nothing in a sound file."""

import shutil

import h5py
import numpy as np
import pytest
from databases import database_of, deterministic_bytes, seal, without_checksums

from gen import cli
from gen.database import lock
from gen.generation.check import faults
from gen.schema import PHYSICS, Status

SCENE = "samples = 20\nsamples_per_surface = 3\n[surface]\nnodes = 17\n[store]\npressure = true\n"
SCENE += "[contact]\nhardness = [0.01, 0.05]\n"


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A database of the scene, computed once."""
    return database_of(tmp_path_factory.mktemp("solved"), SCENE)


@pytest.fixture
def database(solved, here):
    """A copy that a test may spoil."""
    return shutil.copy(solved, here / "rows.h5")


def spoil(path, column, row, value):
    """Change a value, and the row's checksum with it, so that other checks have to find it."""
    with h5py.File(path, "r+") as file:
        file[column][row] = value
    seal(path)


def lines(path, recompute):
    """The faults of a database in words."""
    return [str(fault) for fault in faults(path, recompute)]


def test_a_sound_database_has_no_faults(database, capsys):
    assert list(faults(database, recompute=20)) == []
    assert cli.main(["check", "rows.h5"]) == 0
    assert "sound" in capsys.readouterr().out


EARLIER = f"made by an earlier solver (physics 4, this version computes {PHYSICS})"


@pytest.fixture
def of_earlier_solver(database):
    """A database whose surfaces are those of today; what the solver found differs."""
    with h5py.File(database, "r+") as file:
        file.attrs.modify("physics", 4)
        file["force"][:] *= 1 + 1e-12
        file["iterations"][:] += 1
    seal(database)
    return database


@pytest.mark.usefixtures("of_earlier_solver")
def test_rows_of_an_earlier_solver_are_compared_by_their_surfaces(capsys):
    assert cli.main(["check", "rows.h5", "--recompute", "20"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert EARLIER in first
    assert "20 of them computed again, with the same surfaces" in second


@pytest.mark.usefixtures("of_earlier_solver")
def test_info_says_once_that_an_earlier_solver_made_a_database(capsys):
    assert cli.main(["info", "rows.h5"]) == 0
    assert capsys.readouterr().out.count("an earlier solver") == 1


def test_another_surface_is_a_fault_of_rows_of_an_earlier_solver(
    of_earlier_solver, capsys
):
    with h5py.File(of_earlier_solver, "r+") as file:
        file["peak_mean"][4] *= 1 + 1e-12
    seal(of_earlier_solver)
    assert cli.main(["check", "rows.h5", "--recompute", "20"]) == 1
    assert "row 4: peak_mean is not what" in capsys.readouterr().out


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("column", "value", "fault"),
    [
        ("status", 7, "status"),
        ("hurst", 0.51, "hurst"),
        ("peak_mean", np.nan, "peak_mean is not finite"),
        ("area_percent", 100.5, "area"),
        ("force", 0.0, "force"),
        ("residual", 0.5, "residual"),
        ("yielded_percent", 99.0, "more nodes have yielded than are in contact"),
        ("force", 1e9, "force above what the hardness bears"),
    ],
)
def test_a_spoilt_value_is_found_without_recomputing(
    database, capsys, column, value, fault
):
    spoil(database, column, 4, value)
    found = lines(database, recompute=0)
    assert found
    assert all(line.startswith("row 4") for line in found)
    assert any(fault in line for line in found)
    assert cli.main(["check", "rows.h5"]) == 1
    assert fault in capsys.readouterr().out


FLAT = "samples = 3\n[surface]\nnodes = 9\nsigma0 = [0.0, 0.0]\n"


@pytest.fixture
def undefined(here):
    """A database of flat surfaces, which have no asperity."""
    return database_of(here, FLAT, "flat")


def test_statistics_that_a_surface_does_not_define_are_no_faults(undefined, capsys):
    assert list(faults(undefined, recompute=3)) == []
    assert cli.main(["info", "flat.h5"]) == 0
    shown = capsys.readouterr().out
    assert "3 done, 0 failed" in shown
    assert "3 done: statistics undefined on this surface" in shown


@pytest.mark.parametrize(
    ("column", "value", "fault"),
    [
        ("reason", 0, "peak_mean is not finite"),
        ("delta", np.nan, "delta is not the plan's"),
    ],
)
def test_only_statistics_with_their_reason_may_be_undefined(
    undefined, column, value, fault
):
    spoil(undefined, column, 1, value)
    assert any(f"row 1: {fault}" in line for line in lines(undefined, recompute=0))


def test_rows_that_failed_for_their_statistics_are_valid_and_mended(undefined, capsys):
    spoil(undefined, "status", slice(None), Status.FAILED)  # as files had it before
    assert list(faults(undefined, recompute=3)) == []
    assert cli.main(["run", "flat.toml", "-o", "flat.h5", "--retry-failed"]) == 0
    assert "3 rows done, 0 failed" in capsys.readouterr().out
    assert list(faults(undefined, recompute=3)) == []


@pytest.mark.parametrize("column", ["iterations", "pressure"])
def test_a_changed_bit_is_found_by_its_checksum_and_by_recomputing(database, column):
    with h5py.File(database, "r+") as file:
        value = file[column][4]
        file[column][4] = (
            value + 1 if column == "iterations" else np.nextafter(value, np.inf)
        )
    assert lines(database, recompute=0) == [
        "row 4: checksum is not that of the row's bytes"
    ]
    seal(database)
    assert lines(database, recompute=0) == []
    (found,) = lines(database, recompute=20)
    assert column in found


LOADED = """samples = 4
[surface]
generator = "spectral"
nodes = [16, 20]
side = [100.0, 90.0]
roll_off = 60.0
cut_off = 20.0
rms_height = 1.0
[load]
quantity = "{}"
range = {}
"""


@pytest.mark.parametrize(
    ("quantity", "span", "fault"),
    [
        ("delta/height_rms", "[0.1, 1.0]", "delta is not that of the load"),
        ("pressure/(E* slope_rms)", "[1e-3, 1e-2]", "load is not the plan's"),
        ("force", "{ log_uniform = [1.0, 30.0] }", "force is not that of the load"),
    ],
)
def test_rows_have_the_loads_of_their_plan(tmp_path, quantity, span, fault):
    path = database_of(tmp_path, LOADED.format(quantity, span))
    assert list(faults(path, recompute=4)) == []
    spoilt = fault.partition(" ")[0]
    with h5py.File(path) as file:
        value = float(file[spoilt][2])
    spoil(path, spoilt, 2, value * (1 + 1e-6))
    assert lines(path, recompute=0) == [f"row 2: {fault}"]


ZEROED = range(5, 11)  # rows that lose their bytes


def zero(path):
    """Have rows lose all their bytes but the status, as a power cut can."""
    with h5py.File(path, "r+") as file:
        for name, dataset in file.items():
            if isinstance(dataset, h5py.Dataset) and "long_name" in dataset.attrs:
                dataset[ZEROED.start : ZEROED.stop] = 1 if name == "status" else 0


def lose_bytes(path):
    """Zero some rows, and change a force of another row as no bound and no plan can tell."""
    zero(path)
    with h5py.File(path, "r+") as file:
        file["force"][15] *= 1 - 2**-10


@pytest.fixture
def lost(database, solved):
    """A copy whose rows 5 to 10 and 15 have lost bytes, beside its scene."""
    lose_bytes(database)
    shutil.copy(solved.with_name("rows.toml"), "rows.toml")
    return database


@pytest.mark.usefixtures("lost")
def test_rows_that_lost_their_bytes_are_named(capsys):
    assert cli.main(["check", "rows.h5", "--recompute", "0"]) == 1
    line = "rows.h5: row 5 and 6 more rows: checksum is not that of the row's bytes"
    assert line in capsys.readouterr().out.splitlines()


@pytest.mark.usefixtures("lost")
def test_rows_that_lost_their_bytes_are_repaired(capsys):
    assert cli.main(["check", "rows.h5", "--recompute", "0", "--repair"]) == 0
    assert "7 rows are pending now" in capsys.readouterr().out


def test_repaired_rows_are_computed_again(lost, solved, capsys):
    assert cli.main(["check", "rows.h5", "--recompute", "0", "--repair"]) == 0
    assert cli.main(["run", "rows.toml", "-o", "rows.h5"]) == 0
    assert "7 to do" in capsys.readouterr().err
    assert deterministic_bytes(lost) == deterministic_bytes(solved)


def test_a_repair_of_a_sound_database_changes_nothing(database, capsys):
    before = database.read_bytes()
    assert cli.main(["check", "rows.h5", "--repair"]) == 0
    assert "sound" in capsys.readouterr().out
    assert database.read_bytes() == before


def test_zeroed_rows_without_checksums_are_repaired_too(here, monkeypatch, capsys):
    without_checksums(monkeypatch)
    path = database_of(here, SCENE)
    monkeypatch.undo()
    whole = deterministic_bytes(path)
    assert "checksum" not in whole
    lose_bytes(path)
    # Without checksums only a row that is computed again shows a slightly wrong force.
    assert cli.main(["check", str(path), "--recompute", "20", "--repair"]) == 0
    assert "7 rows are pending now" in capsys.readouterr().out
    assert cli.main(["run", str(here / "rows.toml"), "-o", str(path)]) == 0
    assert deterministic_bytes(path) == whole


def test_rows_of_another_physics_number_are_named_and_not_repaired(lost, capsys):
    with h5py.File(lost, "r+") as file:
        file.attrs.modify("physics", PHYSICS - 1)
    before = lost.read_bytes()
    assert cli.main(["check", "rows.h5", "--recompute", "0", "--repair"]) == 1
    lines = capsys.readouterr().out
    assert "row 5 and 6 more rows: checksum" in lines
    reason = f"made by an earlier solver (physics {PHYSICS - 1}"
    assert f"7 rows are left as before: {reason}" in lines
    assert lost.read_bytes() == before


def test_other_bits_of_another_machine_are_no_damage(database, capsys):
    spoil(database, "iterations", 4, 99)
    before = database.read_bytes()
    assert cli.main(["check", "rows.h5", "--recompute", "20", "--repair"]) == 1
    shown = capsys.readouterr().out
    assert "1 row is left as before: the bytes are those that were written" in shown
    assert database.read_bytes() == before


def test_a_repair_waits_for_no_writer(lost, refused):
    before = lost.read_bytes()
    with lock(lost):
        assert "is being written" in refused(cli, "check", "rows.h5", "--repair")
    assert lost.read_bytes() == before


def test_a_repair_writes_no_read_only_file(lost, refused):
    before = lost.read_bytes()
    lost.chmod(0o444)
    assert "read-only" in refused(cli, "check", "rows.h5", "--repair")
    assert lost.read_bytes() == before


@pytest.mark.parametrize(
    "command",
    [
        "info rows.h5",
        "run rows.toml -o rows.h5",
        "export rows.h5 -o out",
        "merge rows.h5 -o all.h5",
    ],
)
@pytest.mark.usefixtures("lost")
def test_commands_that_take_damaged_rows_say_so(capsys, command):
    if command.startswith("export"):
        pytest.importorskip("mlcroissant")
    assert cli.main(command.split()) == 0
    streams = capsys.readouterr()
    (line,) = [
        line for line in (streams.out + streams.err).splitlines() if "warning" in line
    ]
    assert "row 5 and 6 more rows have other bytes than were written" in line
    assert "--repair makes them pending" in line
