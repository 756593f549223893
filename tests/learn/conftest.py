"""Databases for the tests of learn: solved once, then copied and spoilt as a test needs."""

import contextlib
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from databases import database_of
from small_populations import KIND_SCENES, KINDS, POPULATIONS

from gen import cli
from gen.surface import generate
from learn import cli as learn_cli

SCENE = "samples = 90\n[surface]\nnodes = 33\n"


@pytest.fixture(scope="session")
def solved(tmp_path_factory):
    """The path of a database of 90 samples, one a surface."""
    return database_of(tmp_path_factory.mktemp("database"), SCENE, "solved")


@pytest.fixture(scope="session")
def yielding(tmp_path_factory):
    """The path of a database of 90 samples, each with a hardness of its own."""
    text = f"{SCENE}[contact]\nhardness_ratio = [0.003, 0.1]\n"
    return database_of(tmp_path_factory.mktemp("yielding"), text, "yielding")


@pytest.fixture(scope="session")
def mirrored(tmp_path_factory):
    """The path of a database of 60 samples on 32 x 32 cells, patches between mirror images."""
    text = SCENE.replace("90", "60") + "[contact]\nboundary = 'mirror'\n"
    text += "[delta]\npieces = [{ share = 1.0, range = [0.5, 6.0] }]\n"
    return database_of(tmp_path_factory.mktemp("mirrored"), text, "mirrored")


@pytest.fixture(scope="session")
def kinds(tmp_path_factory):
    """A folder with databases of three scenes, whose columns are `KINDS`; NaN in some rows."""
    folder = tmp_path_factory.mktemp("kinds")
    values = ", ".join(f"'{name}': {text}" for name, text in KINDS.items())
    function = f"def outputs(contact):\n    area = contact.area_percent\n    return {{{values}}}\n"
    (folder / "kinds.py").write_text(function)
    units = ", ".join(f"{name} = '1'" for name in KINDS)
    store = f"[store]\nfunction = 'kinds:outputs'\noutputs = {{ {units} }}\n"
    with contextlib.chdir(folder):
        for name, text in KIND_SCENES.items():
            database_of(Path(), f"{SCENE}{text}{store}", name, "--trust")
            with h5py.File(f"{name}.h5", "r+") as file:
                file["spoilt"][::3] = np.nan
    sys.modules.pop("kinds", None)
    return folder


@pytest.fixture(params=POPULATIONS)
def population(request, populations):
    """The path of the database of each population in turn."""
    return populations / f"{request.param}.h5"


@pytest.fixture(scope="session")
def made(solved, tmp_path_factory):
    """A folder with a database, surrogates of it, surfaces and a table of statistics."""
    folder = tmp_path_factory.mktemp("made")
    shutil.copy(solved, folder / "database.h5")
    (folder / "many").mkdir()
    for seed in range(3):
        heights = generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(seed))
        np.save(folder / f"many/s{seed}.npy", heights)
    (folder / "many/notes.md").write_text("no surface")
    for features in ("hybrid", "dimensionless", "paper"):
        arguments = ["fit", folder / "database.h5", "--features", features]
        arguments += ["-o", folder / f"{features}.surrogate"]
        assert learn_cli.main([str(argument) for argument in arguments]) == 0
    whole = np.load(folder / "many/s0.npy")
    (folder / "bare").mkdir()
    (folder / "empty.h5").touch()
    np.save(folder / "complex.npy", whole + 1j)
    np.save(folder / "cube.npy", np.zeros((3, 4, 5)))
    np.save(folder / "single.npy", whole.astype(np.float32))
    np.save(folder / "oblong.npy", whole[:, :20])
    whole[3:5, 4] = np.nan
    np.save(folder / "holes.npy", whole)
    shutil.copy(solved, folder / "unfinished.h5")
    with h5py.File(folder / "unfinished.h5", "r+") as file:
        file["status"][5:] = 0
    described = ["describe", str(folder / "many/s0.npy"), "--side", "1000"]
    assert cli.main([*described, "--csv", str(folder / "table.csv")]) == 0
    return folder


@pytest.fixture
def work(made, monkeypatch, tmp_path):
    for path in made.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def database(solved, tmp_path):
    """A copy that a test may change, also where `work` links to the one of all tests."""
    copy = tmp_path / "database.h5"
    copy.unlink(missing_ok=True)
    return shutil.copy(solved, copy)


@pytest.fixture
def change(database):
    """Overwrite rows of a column of the copy: change(column, rows, values)."""

    def write(column, rows, values):
        with h5py.File(database, "r+") as file:
            content = file[column][:]
            content[rows] = values
            file[column][:] = content
        return database

    return write


@pytest.fixture(scope="session")
def samples():
    """Inputs (80, 6) and a smooth positive target (80,)."""
    inputs = np.random.default_rng(3).uniform(0.2, 1.0, (80, 6))
    return inputs, 1 + inputs[:, 0] ** 2 + np.sin(3 * inputs[:, 1]) * inputs[:, 2]
