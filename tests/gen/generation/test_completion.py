"""What a run completes before its first row: outputs of a user's function, and their powers."""

import json
import signal
import subprocess
import sys
import time

import h5py
import pytest
import user_functions

from gen import cli
from gen.database import Reader
from gen.generation.completion import completed, measured_powers
from gen.runtime.errors import InputError
from gen.scene import Scene

MODULE = """
import numpy as np

def spots(contact):
    problem = contact.problem
    return {
        "own_force": (contact.force, "uN"),
        "own_gap": (contact.mean_gap, "um"),
        "own_edge": (contact.perimeter, "um"),
        "own_peak": (-contact.largest_pressure, "MPa"),
        "own_count": contact.contact_nodes,
        "own_energy": (contact.force * contact.delta, "pJ"),
        "beyond_3_um": (contact.delta + 3.0, "um"),
        "root": (float(np.sqrt(contact.force)), "uN^0.5"),
        "nothing": 0.0,
        "not_a_number": float("nan") if problem.modulus > 1e300 else 1.0,
    }
"""
EXPECTED = {
    "own_force": (1, 1, 1),
    "own_gap": (1, 0, 0),
    "own_edge": (0, 1, 0),
    "own_peak": (1, -1, 1),
    "own_count": (0, 0, 0),
    "own_energy": (2, 1, 1),
    "not_a_number": (0, 0, 0),
}
SURFACE = "samples = 4\n[surface]\nnodes = 17\n[contact]\nmodulus = 5.0\n"
STORE = user_functions.STORE
LOADS = {
    "delta": "[delta]\npieces = [{ share = 1.0, range = [0.0, 12.0] }]\n",
    "pressure": '[load]\nquantity = "pressure"\nrange = [0.001, 0.05]\n',
    "relative": '[load]\nquantity = "delta/height_rms"\nrange = [0.1, 2.0]\n',
    "force": '[load]\nquantity = "force"\nrange = [100.0, 3000.0]\n',
}
BODIES = {
    "free": "",
    "mirror": 'boundary = "mirror"\n',
    "yielding": "hardness = 0.1\n",
    "drawn": "hardness_ratio = [0.01, 0.05]\n",
}


@pytest.fixture
def inside(tmp_path, monkeypatch):
    """The current folder, with a module whose function is trusted."""
    with user_functions.inside(tmp_path, monkeypatch, ""):
        (tmp_path / "mine.py").write_text(MODULE)
        yield tmp_path


@pytest.mark.few(5)
@pytest.mark.parametrize("bodies", BODIES)
@pytest.mark.parametrize("load", LOADS)
def test_outputs_of_a_function_get_the_powers_that_they_scale_with(inside, load, bodies):
    text = SURFACE + BODIES[bodies] + LOADS[load] + STORE
    scene = completed(Scene.parse(text, "test"), rehearsed=True)
    assert {name: tuple(each) for name, each in scene.store.powers.items()} == EXPECTED


def test_loads_beyond_full_contact_are_halved_for_the_trial(inside):
    text = (
        SURFACE
        + BODIES["mirror"]
        + "[load]\nquantity = 'delta'\nrange = [0.5, 60.0]\n"
        + STORE
    )
    assert measured_powers(completed(Scene.parse(text, "test")))["own_force"] == (1, 1, 1)


def test_powers_stand_in_the_file_beside_the_unit(inside):
    (inside / "mine.toml").write_text(SURFACE + STORE)
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    with h5py.File("a.h5") as file:
        assert file["own_force"].attrs["powers"].tolist() == [1, 1, 1]
        assert "powers" not in file["beyond_3_um"].attrs
        assert "powers" not in file["force"].attrs
    with Reader(inside / "a.h5") as reader:
        powers = {column.name: column.powers for column in reader.columns()}
        assert (powers["own_peak"], powers["root"]) == ((1, -1, 1), None)


def test_a_scene_without_a_function_is_not_tried(inside, monkeypatch):
    monkeypatch.setattr("gen.generation.completion.first_problem", None)
    assert completed(Scene.parse(SURFACE, "test"), rehearsed=True).store.powers is None


def without_powers(path):
    """Write a file as an earlier version did, which knew no powers."""
    with h5py.File(path, "r+") as file:
        content = json.loads(file.attrs["scene"])
        del content["store"]["powers"]
        text = json.dumps(content, sort_keys=True).encode()
        del file.attrs["scene"]
        file.attrs.create("scene", text, dtype=h5py.string_dtype("utf-8", len(text)))


def test_a_database_of_before_goes_on_without_powers(inside):
    (inside / "mine.toml").write_text(SURFACE + STORE)
    assert cli.main(["run", "mine.toml", "-o", "a.h5", "--rows", "0:2"]) == 0
    without_powers(inside / "a.h5")
    assert cli.main(["run", "mine.toml", "-o", "a.h5"]) == 0
    with Reader(inside / "a.h5") as reader:
        assert reader.counts().done == 4
        assert reader.scene.store.powers is None


def test_parts_that_disagree_about_powers_are_not_merged(inside, capsys):
    (inside / "mine.toml").write_text(SURFACE + STORE)
    for rows in ("0:2", "2:4"):
        assert cli.main(["run", "mine.toml", "-o", f"{rows[0]}.h5", "--rows", rows]) == 0
    assert cli.main(["merge", "0.h5", "2.h5", "-o", "whole.h5"]) == 0
    without_powers(inside / "2.h5")
    capsys.readouterr()
    assert cli.main(["merge", "0.h5", "2.h5", "-o", "again.h5"]) == 2
    assert "store.powers.not_a_number: (0, 0, 0) and nothing" in capsys.readouterr().err
    assert not (inside / "again.h5").exists()


SLOW = "import time\ndef spots(contact):\n    time.sleep(30)\n    return {'a': 1.0}\n"


def test_the_sample_limit_bounds_the_trial_of_a_function(inside, capsys):
    (inside / "mine.py").write_text(SLOW)
    (inside / "mine.toml").write_text(SURFACE + STORE)
    began = time.monotonic()
    assert cli.main(["run", "mine.toml", "-o", "a.h5", "--sample-limit", "0.5"]) == 2
    assert time.monotonic() - began < 20
    assert (
        "longer than --sample-limit 0.5 s, so its outputs are" in capsys.readouterr().err
    )
    assert not (inside / "a.h5").exists()


def test_the_trial_of_a_function_is_announced_and_ends_with_a_signal(inside):
    (inside / "mine.py").write_text(SLOW.replace("30", "1000"))
    (inside / "mine.toml").write_text(SURFACE + STORE)
    command = [sys.executable, "-m", "gen", "run", "mine.toml", "-o", "a.h5", "--trust"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
        assert (
            "a.h5: tries mine:spots on contacts of the scene first"
            in run.stderr.readline()
        )
        run.send_signal(signal.SIGTERM)
        assert run.wait(timeout=60) == -signal.SIGTERM


def test_outputs_that_no_row_shows_are_asked_for(inside):
    failing = MODULE.replace("def spots(contact):", "def spots(contact):\n    1 / 0")
    (inside / "mine.py").write_text(failing)
    with pytest.raises(
        InputError, match=r"row 0: ZeroDivisionError, .* give store\.outputs"
    ):
        completed(Scene.parse(SURFACE + STORE, "test"))
