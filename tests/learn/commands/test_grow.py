"""`learn grow`: as a user starts it, alone, on three ranks, and killed in its midst."""

import shutil

import pytest
from comparisons import numbers_of, run
from databases import deterministic_bytes
from launch import launch

from gen import cli as gen
from learn import cli

SCENE = "samples = 10\n[surface]\nnodes = 9\n"
GROW = ["grow", "scene.toml", "-o", "my.surrogate", "--features", "dimensionless"]
GROW += ["--target", "area", "--nmae", "35", "--model", "decision-tree"]


@pytest.fixture(scope="module")
def grown(tmp_path_factory):
    """A folder in which one process has grown a surrogate."""
    folder = tmp_path_factory.mktemp("grown")
    (folder / "scene.toml").write_text(SCENE)
    done = launch(0, *GROW, folder=folder, module="learn")
    assert done.returncode == 0, done.stderr
    return folder, done


def test_a_growth_ends_in_one_screen_and_a_picture(grown):
    folder, done = grown
    lines = done.stdout.splitlines()
    assert len(lines) <= 20
    assert "The mark is met" in done.stdout
    assert lines[-1] == "wrote my.surrogate, my.h5 and my.png"
    assert (folder / "my.png").stat().st_size > 30_000


def test_the_card_of_a_grown_surrogate_tells_its_growth(grown, capsys):
    folder, _ = grown
    assert run("card", folder / "my.surrogate") == 0
    assert "grown     to an nMAE of 35 %: met" in capsys.readouterr().out


@pytest.fixture(scope="module")
def continued(grown, tmp_path_factory):
    """A copy of the database of a growth with further rows."""
    folder, _ = grown
    longer = tmp_path_factory.mktemp("continued")
    (longer / "more.toml").write_text(SCENE.replace("10", "400"))
    shutil.copy(folder / "my.h5", longer / "copy.h5")
    run_scene = ["run", str(longer / "more.toml"), "-o", str(longer / "copy.h5")]
    assert gen.main(run_scene) == 0
    return longer / "copy.h5"


def test_a_grown_database_is_sound(grown):
    folder, _ = grown
    assert gen.main(["check", str(folder / "my.h5")]) == 0


def test_a_grown_database_has_the_rows_of_a_run(grown, continued):
    folder, _ = grown
    columns = deterministic_bytes(continued)
    for name, content in deterministic_bytes(folder / "my.h5").items():
        assert columns[name].startswith(content)


def test_a_surrogate_is_fitted_to_a_grown_database(continued, tmp_path):
    fit = ["fit", continued, "-o", tmp_path / "fitted.surrogate", "--target", "area"]
    assert run(*fit) == 0


@pytest.mark.long
@pytest.mark.mpi
def test_three_ranks_grow_what_one_process_grows(grown, tmp_path):
    folder, _ = grown
    (tmp_path / "scene.toml").write_text(SCENE)
    done = launch(3, *GROW, folder=tmp_path, module="learn")
    assert done.returncode == 0, done.stderr
    assert deterministic_bytes(tmp_path / "my.h5") == deterministic_bytes(
        folder / "my.h5"
    )
    assert numbers_of(tmp_path / "my.surrogate") == numbers_of(folder / "my.surrogate")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["nothing.toml", "-o", "my.surrogate"], "nothing.toml"),
        (["quick", "-o", "my.h5"], "--output my.h5"),
        (["quick", "-o", "my.surrogate", "--nmae", "0"], "--nmae 0"),
        (["empty", "-o", "my.surrogate"], "empty"),
        (["quick", "-o", "my.surrogate", "--target", "mean_gap"], "--target 'mean_gap'"),
    ],
)
def test_bad_input_is_refused_in_one_line_before_anything_is_made(
    arguments, word, here, refused
):
    (here / "empty").mkdir()
    assert word in refused(cli, "grow", *arguments)
    assert [path.name for path in here.iterdir()] == ["empty"]


@pytest.mark.parametrize(
    ("there", "missing"), [("my.surrogate", "my.h5"), ("my.png", "my.surrogate")]
)
def test_files_of_others_stay(there, missing, here, refused):
    """A surrogate without its database, or a picture without its surrogate, is not a growth's."""
    content = b"\x89PNG\r\n\x1a\n" if there.endswith("png") else b""
    (here / there).write_bytes(content)
    said = refused(cli, "grow", "quick", "-o", "my.surrogate")
    assert f"{there} is there already, but not {missing}" in said
    assert [(path.name, path.read_bytes()) for path in here.iterdir()] == [
        (there, content)
    ]
