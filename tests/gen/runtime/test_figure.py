"""Pictures are drawn with our own settings, from no file of the folder or the user."""

import os
import sys

import numpy as np
import pytest
from databases import database_of
from launch import SECONDS, ended

pytest.importorskip("matplotlib", reason="needs the extra plot")

USETEX = "text.usetex: True\ntext.latex.preamble: \\input{none}\nfigure.facecolor: red\n"
LINES = {
    "describe": "gen describe map.npy --side 9 --plot new.png",
    "contact": "gen contact map.npy --side 9 --delta 1 --plot new.png",
    "plot": "gen plot rows.h5 -o new.png",
    "bench": "bench hertz -o .",
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A map and a database."""
    folder = tmp_path_factory.mktemp("inputs")
    np.save(folder / "map.npy", np.random.default_rng(1).normal(size=(9, 9)))
    database_of(folder, "samples = 60\n[surface]\nnodes = 17\n", "rows")
    return folder


def pictures(name, inputs, folder, variables):
    """Run a command that draws; return its pictures by their names."""
    for path in inputs.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    call = "import sys; from asperity.command import main; sys.exit(main())"
    words = [sys.executable, "-P", "-c", call, *LINES[name].split()]
    done = ended(["timeout", str(SECONDS), *words], folder, os.environ | variables)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.png")}


@pytest.mark.long
@pytest.mark.parametrize("name", LINES)
def test_no_settings_of_the_folder_the_user_or_the_environment_change_a_picture(
    name, inputs, tmp_path
):
    plain, settled = tmp_path / "plain", tmp_path / "settled"
    plain.mkdir()
    settled.mkdir()
    (settled / "matplotlibrc").write_text(USETEX)
    foreign = {"MPLBACKEND": "nonsense", "MATPLOTLIBRC": str(settled / "matplotlibrc")}
    expected = pictures(name, inputs, plain, {})
    assert expected
    assert pictures(name, inputs, settled, foreign) == expected


@pytest.mark.few(1)
@pytest.mark.parametrize("place", ["folder", "user"])
def test_settings_that_never_end_are_not_read(place, inputs, here):
    home = here / ".config" / "matplotlib"
    home.mkdir(parents=True)
    os.mkfifo({"folder": here, "user": home}[place] / "matplotlibrc")
    variables = {"MPLCONFIGDIR": str(home), "HOME": str(here)}
    assert pictures("describe", inputs, here, variables)
