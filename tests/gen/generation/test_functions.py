"""Outputs of a user's function: columns like all others, and one line for all that is wrong."""

import subprocess
import sys

import h5py
import numpy as np
import pytest
import user_functions
from scipy import ndimage

from gen import cli
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import solve_contact, surface_of
from gen.schema import REASONS, Reason, Status

SCENE = "samples = 7\nsamples_per_surface = 2\n" + user_functions.SURFACE + user_functions.STORE


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, with the module and a scene; sys.path is as it was afterwards."""
    with user_functions.inside(tmp_path, monkeypatch, SCENE):
        yield tmp_path


def refused(capsys, *arguments):
    """The one line with which a command is refused."""
    capsys.readouterr()
    assert cli.main(list(arguments)) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    return captured.err


def test_outputs_are_columns_like_all_others(here, capsys):
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    assert cli.main(["check", "a.h5", "--recompute", "7"]) == 0
    assert cli.main(["info", "a.h5"]) == 0
    assert "mean_pressure" in capsys.readouterr().out
    with Reader(here / "a.h5") as reader:
        units = {column.name: column.unit for column in reader.columns()}
        plan = parameters(reader.scene, 0, 7)
        for row in range(7):
            heights = surface_of(reader.scene, plan, row)
            contact = solve_contact(reader.scene, heights, float(plan.delta[row]))
            expected = ndimage.label(contact.pressure > 0)[1]
            assert reader.column("spots")[row] == expected
            assert reader.column("top")[row] == heights.max()
    assert [units[name] for name in ("spots", "top", "mean_pressure")] == ["1", "um", "uN"]
    with h5py.File(here / "a.h5", "r") as file:
        assert file["top"].attrs["units"] == b"um"
        assert file["top"].attrs["long_name"] == b"output of mine:spots"


def test_nothing_but_runs_and_checks_needs_the_function(here, capsys):
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    (here / "mine.py").write_text("raise SystemExit('this ran')\n")
    read = "import h5py; h5py.File('a.h5')['spots'][:]"
    subprocess.run([sys.executable, "-c", read], cwd=here, check=True, timeout=60)
    for arguments in (["info", "a.h5"], ["merge", "a.h5", "-o", "b.h5"]):
        command = [sys.executable, "-m", "gen", *arguments]
        ended = subprocess.run(
            command, cwd=here, capture_output=True, text=True, timeout=60, check=False
        )
        assert (ended.returncode, ended.stderr) == (0, "")
    assert cli.main(["check", "a.h5", "--recompute", "0"]) == 0
    sys.modules.pop("mine", None)


def test_a_changed_function_makes_another_scene(here, capsys):
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    before = (here / "a.h5").read_bytes()
    user_functions.write(here, SCENE, user_functions.MODULE + "# a remark\n")
    said = refused(capsys, "run", "mine.toml", "-o", "a.h5")
    assert "holds another scene" in said
    assert "store.source: the source of the function's module has changed" in said
    assert (here / "a.h5").read_bytes() == before


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("raise ValueError('no idea')", "mine:spots, row 0: ValueError: no idea"),
        ("raise SystemExit(5)", "mine:spots, row 0: SystemExit: 5"),
        ("return {'a': 1 / 0}", "row 0: ZeroDivisionError, so its outputs are unknown; give store"),
        ("return None", "returned a NoneType, not a dictionary"),
        ("return {'a': 'three'}", "a is 'three', not a number"),
        ("return {'a': (1.0, 2.0)}", "a is '(1.0, 2.0)', not a number"),
        ("return {5: 1.0}", "the name 5 is not a text"),
        ("return {'two words': 1.0}", "'two words': a name has"),
        ("return {}", "0 outputs: give 1 to 1000"),
        ("return {'a': (1.0, 'u\\nm')}", "a unit is a text"),
        ("return {'force': 1.0}", "store.outputs.force: force is the name of something else"),
        ("contact.pressure[0, 0] = 5; return {'a': 1.0}", "ValueError: assignment destination"),
    ],
)
def test_a_function_that_fails_is_one_line_and_leaves_no_database(here, capsys, body, fault):
    module = user_functions.MODULE.partition("def spots")[0]
    user_functions.write(here, SCENE, f"{module}def spots(contact):\n    {body}\n")
    assert fault in refused(capsys, "run", "mine.toml", "-o", "a.h5")
    assert not (here / "a.h5").exists()


@pytest.mark.parametrize("key", ["outputs = { a = '1' }", "source = '" + 64 * "0" + "'"])
def test_outputs_need_a_function(here, capsys, key):
    (here / "mine.toml").write_text(f"samples = 3\n[store]\n{key}\n")
    assert "needs function, which gives them" in refused(capsys, "run", "mine.toml", "-o", "a.h5")


LATER = """
def spots(contact):
    late = contact.delta > {delta}
    {body}
"""


def late(here, body):
    """Write a function that does something from a middling displacement on."""
    scene = SCENE.replace(user_functions.STORE, "")
    user_functions.write(here, scene)
    assert cli.main(["run", "mine.toml", "-o", "plain.h5"]) == 0
    with Reader(here / "plain.h5") as reader:
        delta = reader.column("delta")
    middle = float(delta[0]) + 1e-9
    assert (delta > middle).any()
    module = user_functions.MODULE.partition("def spots")[0]
    user_functions.write(here, SCENE, module + LATER.format(delta=middle, body=body))
    return delta > middle


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("return {'b': 1} if late else {'a': 1}", "returned b; the database has a"),
        ("return {'a': (1, 'm')} if late else {'a': (1, 'um')}", "a is in 'm'; the database has"),
        ("return {'a': [][0] if late else 1.0}", "IndexError: list index out of range"),
    ],
)
def test_a_later_row_names_itself(here, capsys, body, fault):
    """The rows before it can be computed."""
    first = int(np.flatnonzero(late(here, body))[0])
    capsys.readouterr()
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 2
    *_, said = capsys.readouterr().err.splitlines()
    assert f"mine:spots, row {first}: " in said
    assert fault in said
    assert cli.main(["run", "mine.toml", "-o", "a.h5", "--rows", f"0:{first}"]) == 0
    with Reader(here / "a.h5") as reader:
        assert reader.counts().done == first


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("return {'a': float('nan') if late else 1.0}", Reason.NOT_FINITE),
        ("return {'a': 10**400 if late else 1.0}", Reason.NOT_FINITE),
        ("return {'a': 1 / (not late)}", Reason.ARITHMETIC),
    ],
)
def test_an_output_that_is_no_number_fails_its_row(here, capsys, body, reason):
    """A run of a million rows must not end at one of them: its function could not be changed."""
    late_rows = late(here, body)
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    with Reader(here / "a.h5") as reader:
        status = np.where(late_rows, Status.FAILED, Status.DONE)
        assert reader.column("status").tolist() == status.tolist()
        assert set(reader.column("reason")[late_rows].tolist()) == {int(reason)}
    assert cli.main(["check", "a.h5", "--recompute", "7"]) == 0
    capsys.readouterr()
    assert cli.main(["info", "a.h5"]) == 0
    assert REASONS[reason] in capsys.readouterr().out
