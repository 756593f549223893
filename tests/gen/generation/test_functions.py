"""Outputs of a user's function: columns like all others, and one line for all that is wrong."""

import shutil
import sys

import h5py
import numpy as np
import pytest
import user_functions
from launch import python
from scipy import ndimage

from gen import cli
from gen.database import Reader, Writer, create
from gen.generation.completion import completed
from gen.generation.plan import parameters, surface_random
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.runtime.errors import SourceError
from gen.runtime.user_code import load_function
from gen.scene import Scene
from gen.schema import REASONS, Reason, Status

SCENE = (
    "samples = 7\nsamples_per_surface = 2\n"
    + user_functions.SURFACE
    + user_functions.STORE
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, with the module and a scene; sys.path is as it was afterwards."""
    with user_functions.inside(tmp_path, monkeypatch, SCENE):
        yield tmp_path


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A database with outputs, beside its scene and the module of the functions."""
    folder = tmp_path_factory.mktemp("solved")
    with (
        pytest.MonkeyPatch.context() as patch,
        user_functions.inside(folder, patch, SCENE),
    ):
        assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    return folder / "a.h5"


@pytest.fixture
def copied(solved, here):
    """A copy of the database in the current folder, whose functions are trusted."""
    return shutil.copy(solved, here / "a.h5")


def test_outputs_are_what_the_function_returns_for_the_contact(copied):
    with Reader(copied) as reader:
        plan = parameters(reader.scene, 0, 7)
        for row in range(7):
            heights = surface_of(reader.scene, plan, row)
            contact = solve_contact(reader.scene, heights, float(plan.load[row]))
            expected = ndimage.label(contact.pressure > 0)[1]
            assert reader.column("spots")[row] == expected
            assert reader.column("top")[row] == heights.max()


def test_outputs_are_columns_with_units_like_all_others(copied):
    with Reader(copied) as reader:
        units = {column.name: column.unit for column in reader.columns()}
    expected = {"spots": "1", "top": "um", "mean_pressure": "uN"}
    assert expected.items() <= units.items()
    with h5py.File(copied) as file:
        assert file["top"].attrs["units"] == b"um"
        assert file["top"].attrs["long_name"] == b"output of mine:spots"


@pytest.mark.usefixtures("copied")
def test_a_database_with_outputs_is_sound():
    assert cli.main(["check", "a.h5", "--recompute", "7"]) == 0


@pytest.mark.usefixtures("copied")
def test_info_lists_outputs(capsys):
    assert cli.main(["info", "a.h5"]) == 0
    assert "mean_pressure" in capsys.readouterr().out


@pytest.fixture
def without_function(copied):
    """The database, beside a module that ends the process which imports it."""
    copied.with_name("mine.py").write_text("raise SystemExit('this ran')\n")
    yield copied.parent
    sys.modules.pop("mine", None)


def test_other_programs_read_outputs_without_the_function(without_function):
    read = "import h5py; h5py.File('a.h5')['spots'][:]"
    assert python("-c", read, folder=without_function).returncode == 0


@pytest.mark.few(1)
@pytest.mark.parametrize("line", ["info a.h5", "merge a.h5 -o b.h5"])
def test_info_and_merge_need_no_function(without_function, line):
    ended = python("-m", "gen", *line.split(), folder=without_function)
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.usefixtures("without_function")
def test_a_check_that_computes_no_row_needs_no_function():
    assert cli.main(["check", "a.h5", "--recompute", "0"]) == 0


def test_a_changed_function_makes_another_scene(copied, here, refused):
    before = copied.read_bytes()
    user_functions.write(here, SCENE, user_functions.MODULE + "# a remark\n")
    said = refused(cli, "run", "mine.toml", "-o", "a.h5")
    assert "holds another scene" in said
    assert "store.source: the source of the function's module has changed" in said
    assert copied.read_bytes() == before


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("raise ValueError('no idea')", "mine:spots, row 0: ValueError: no idea"),
        (
            "raise MemoryError",
            "mine:spots, row 0: this code of your own has run out of memory; ",
        ),
        (
            "return {'a': 1 / 0}",
            "row 0: ZeroDivisionError, so its outputs are unknown; give store",
        ),
        ("return None", "returned a NoneType, not a dictionary"),
        ("return {5: 1.0}", "the name 5 is not a text"),
        ("return {'a': (1.0, 'u\\nm')}", "of 1 to 20 letters"),
        ("return {'a': 'three'}", "a is 'three', not a number"),
        (
            "return {'force': 1.0}",
            "store.outputs.force: force is the name of something else",
        ),
        (
            "contact.pressure[0, 0] = 5; return {'a': 1.0}",
            "ValueError: assignment destination",
        ),
    ],
)
def test_a_function_that_fails_is_one_line_and_leaves_no_database(
    here, refused, body, fault
):
    module = user_functions.MODULE.partition("def spots")[0]
    user_functions.write(here, SCENE, f"{module}def spots(contact):\n    {body}\n")
    assert fault in refused(cli, "run", "mine.toml", "-o", "a.h5")
    assert not (here / "a.h5").exists()


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


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("return {'b': 1} if late else {'a': 1}", "returned b; the database has a"),
        (
            "return {'a': (1, 'm')} if late else {'a': (1, 'um')}",
            "a is in 'm'; the database has",
        ),
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


@pytest.mark.few(1)
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


SURFACES = "samples = 4\n" + user_functions.SURFACE


def scene_with(folder, body):
    """The scene, its function with another body."""
    module = f"import numpy as np\ndef waves(shape, spacing, rng, amplitude, length):\n    {body}\n"
    (folder / "mine.py").write_text(module)
    return completed(Scene.parse(SURFACES, "test"))


def test_a_function_gets_the_grid_its_random_numbers_and_its_parameters(here):
    body = (
        "return amplitude + length * rng.random(shape) + 1e6 * (spacing[0] - spacing[1])"
    )
    scene = scene_with(here, body)
    plan = parameters(scene, 0, 4)
    for row in range(4):
        heights = surface_of(scene, plan, row)
        random = surface_random(scene, row).random((20, 24))
        expected = plan.drawn["length"][row] * (random - random.min())
        assert heights == pytest.approx(expected, rel=1e-4, abs=1e-9)
        assert heights.min() == 0.0
    assert scene.spacing == (200.0 / 19, 300.0 / 23)


def test_an_array_that_the_function_keeps_is_not_changed(here):
    body = "global kept; kept = globals().get('kept', np.eye(20, 24) + 5); return kept"
    rows = compute_rows(scene_with(here, body), 0, 4)
    assert rows["height_max"].tolist() == [1.0] * 4
    assert rows["height_mean"].tolist() == [20 / 480] * 4


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        (
            "return np.zeros(shape + (1,))",
            r"surface 0: heights are of shape \(20, 24, 1\), not",
        ),
        ("return [[1], [1, 2]]", "surface 0: ValueError: "),
        ("raise SystemExit(0)", "surface 0: SystemExit: 0"),
        (
            "raise KeyboardInterrupt if False else RuntimeError('a\\nb')",
            "RuntimeError: a b",
        ),
    ],
)
def test_what_is_no_surface_ends_the_run_in_one_line(here, body, fault):
    scene = scene_with(here, body)
    with pytest.raises(SourceError, match=fault) as refused:
        compute_rows(scene, 0, 4)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("body", ["return np.full(shape, np.nan)", "return 1 / 0"])
def test_numbers_that_are_not_finite_fail_their_rows(here, body):
    rows = compute_rows(scene_with(here, body), 0, 4)
    assert set(rows["status"].tolist()) == {Status.FAILED}
    assert set(rows["reason"].tolist()) == {Reason.ARITHMETIC}


def test_a_function_that_takes_too_long_leaves_its_rows_pending(here):
    body = "exec('while True: pass') if amplitude > 1.0 else 0; return rng.random(shape)"
    scene = scene_with(here, body)
    slow = parameters(scene, 0, 4).drawn["amplitude"] > 1.0
    assert slow.any()
    rows = compute_rows(scene, 0, 4, limit=0.5)
    assert (rows["status"][slow] == Status.PENDING).all()


@pytest.mark.parametrize(
    ("change", "said"), [("gone", "no module mine"), ("stranger", "lacks the hash")]
)
def test_databases_whose_function_is_not_there_say_so_in_one_line(
    here, refused, change, said
):
    """A stranger's database without a hash calls nothing, whatever function it names."""
    own = Scene.parse(SURFACES, "test")
    named = Scene.parse(SURFACES.replace("mine:waves", "os:abort"), "test")
    scene = completed(own) if change == "gone" else named
    create(here / "a.h5", scene)
    with Writer(here / "a.h5", scene) as writer:
        writer.write_block(0, 4, compute_rows(completed(own), 0, 4))
    (here / "mine.py").unlink()
    load_function.cache_clear()
    assert said in refused(cli, "check", "a.h5")
    assert cli.main(["info", "a.h5"]) == 0
