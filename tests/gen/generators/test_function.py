"""Surfaces of a function of the user's: what it is called with, and everything that it may do."""

import pytest
import user_functions

from gen import cli
from gen.database import Reader, create
from gen.generation.functions import completed
from gen.generation.plan import parameters, surface_random
from gen.generation.sample import compute_rows, surface_of
from gen.runtime.errors import SourceError
from gen.scene import Scene
from gen.schema import Reason, Status

SCENE = "samples = 4\n" + user_functions.SURFACE


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, with the module and a scene; sys.path is as it was afterwards."""
    with user_functions.inside(tmp_path, monkeypatch, SCENE):
        yield tmp_path


def scene_with(folder, body):
    """The scene, its function with another body."""
    module = f"import numpy as np\ndef waves(shape, spacing, rng, amplitude, length):\n    {body}\n"
    (folder / "mine.py").write_text(module)
    return completed(Scene.parse(SCENE, "test"))


def test_a_function_gets_the_grid_its_random_numbers_and_its_parameters(here):
    body = "return amplitude + length * rng.random(shape) + 1e6 * (spacing[0] - spacing[1])"
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
        ("return np.zeros(shape + (1,))", r"surface 0: heights are of shape \(20, 24, 1\), not"),
        ("return None", "returned nothing, not heights"),
        ("return np.zeros(shape, complex)", "returned a ndarray, not heights"),
        ("return [[1], [1, 2]]", "surface 0: ValueError: "),
        ("return unknown", "surface 0: NameError: name 'unknown' is not defined"),
        ("raise KeyboardInterrupt if False else RuntimeError('a\\nb')", "RuntimeError: a b"),
    ],
)
def test_what_is_no_surface_ends_the_run_in_one_line(here, body, fault):
    scene = scene_with(here, body)
    with pytest.raises(SourceError, match=fault) as refused:
        compute_rows(scene, 0, 4)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "body",
    ["return np.full(shape, np.nan)", "return np.full(shape, np.inf)", "return 1 / 0"],
)
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
    "arguments", [["check", "a.h5"], ["plot", "a.h5", "-o", "a.png"]], ids=["check", "plot"]
)
@pytest.mark.parametrize("change", ["gone", "changed", "stranger"])
def test_databases_whose_function_is_not_there_say_so_in_one_line(here, capsys, arguments, change):
    """A stranger's database without a hash calls nothing, whatever function it names."""
    if change == "stranger":
        scene = Scene.parse(SCENE.replace("mine:waves", "os:abort"), "test")
        create(here / "a.h5", scene)
        from gen.database import Writer

        rows = compute_rows(completed(Scene.parse(SCENE, "test")), 0, 4)
        with Writer(here / "a.h5", scene) as writer:
            writer.write_block(0, 4, rows)
    else:
        assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
        module = here / "mine.py"
        module.unlink() if change == "gone" else module.write_text("# another\n")
    said = {"gone": "no module mine", "changed": "has changed", "stranger": "lacks the hash"}
    capsys.readouterr()
    from gen.runtime.user_code import load_function

    load_function.cache_clear()
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert said[change] in captured.err
    assert captured.err.count("\n") == 1
    assert cli.main(["info", "a.h5"]) == 0
    with Reader(here / "a.h5") as reader:
        assert reader.counts().done == 4
