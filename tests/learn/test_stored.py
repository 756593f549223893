"""Several databases in one fit: what goes together, and which rows no split may divide."""

import numpy as np
import pytest
from learnt_rows import read

from gen import cli
from gen.runtime.errors import InputError
from learn import dataset
from learn.dataset import Request
from learn.features.sets import NODES

SCENES = {
    "coarse": "samples = 60\nsamples_per_surface = 2\n[surface]\nnodes = 17\n",
    "fine": "samples = 24\n[surface]\nnodes = 33\n",
    "stranger": 'samples = 20\nseed = 7\n[surface]\nnodes = 33\ngenerator = "midpoint"\n',
    "spectral": """
        samples = 20
        seed = 8
        [surface]
        generator = "spectral"
        nodes = 17
        side = 300.0
        roll_off = 200.0
        cut_off = 90.0
        rms_height = 5.0
        [contact]
        modulus = 2.0
    """,
    "mirror": 'samples = 20\n[surface]\nnodes = 17\n[contact]\nboundary = "mirror"\n',
    "soft": "samples = 20\n[surface]\nnodes = 17\n[contact]\nhardness_ratio = 0.1\n",
    "oblong": """
        samples = 20
        [surface]
        generator = "spectral"
        nodes = 17
        side = [300.0, 200.0]
        roll_off = 200.0
        cut_off = 90.0
        rms_height = 5.0
    """,
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The paths of small databases by the names of their scenes."""
    folder = tmp_path_factory.mktemp("several")
    for name, text in SCENES.items():
        (folder / f"{name}.toml").write_text(text)
        assert (
            cli.main(["run", str(folder / f"{name}.toml"), "-o", str(folder / f"{name}.h5")]) == 0
        )
    return {name: folder / f"{name}.h5" for name in SCENES}


def together(made, *names, features="dimensionless"):
    paths = [made[name] for name in names]
    (rows,) = dataset.read(Request(tuple(paths), features=features))
    return rows


def test_rows_are_those_of_each_database_and_nodes_are_a_feature(made):
    rows = together(made, "coarse", "stranger", "spectral")
    assert rows.features.columns[-1] == NODES
    for number, name in enumerate(("coarse", "stranger", "spectral")):
        alone = read(made[name], features="dimensionless")
        here = rows.at(np.flatnonzero(rows.database == number))
        np.testing.assert_array_equal(here.inputs[:, :-1], alone.inputs)
        np.testing.assert_array_equal(here.target, alone.target)
        np.testing.assert_array_equal(here.rows, alone.rows)
        np.testing.assert_allclose(here.inputs[:, -1], np.log2(33 if name == "stranger" else 17))
        assert rows.origins[number].sha256 == alone.source["database_sha256"]
        assert rows.origins[number].rows == alone.size
    assert np.unique(rows.keys).size == rows.size


def test_surfaces_of_one_seed_and_number_are_one_group_on_every_grid(made):
    rows = together(made, "coarse", "fine")
    coarse, fine = (rows.groups[rows.database == number] for number in (0, 1))
    np.testing.assert_array_equal(coarse[::2], coarse[1::2])
    np.testing.assert_array_equal(coarse[::2][:24], fine)
    assert np.unique(rows.groups).size == 30
    strangers = together(made, "coarse", "stranger")
    assert np.unique(strangers.groups).size == 30 + 20


def test_populations_of_windows_are_their_maps(populations):
    rows = read(populations / "scans.h5")
    assert len(rows.populations) == 2
    assert {each.generator for each in rows.populations} == {"scans"}
    for number in (0, 1):  # no tile is in two maps
        mine, others = (rows.groups[(rows.population == number) == own] for own in (True, False))
        assert not set(mine) & set(others)


@pytest.fixture(scope="module")
def other_windows(populations, tmp_path_factory):
    """The path of a database of larger windows of the maps of the populations."""
    folder = tmp_path_factory.mktemp("windows")
    text = (populations / "scans.toml").read_text().replace("[20, 17]", "[40, 34]")
    scene = folder / "larger.toml"
    scene.write_text(text.replace('"maps"', f'"{(populations / "maps").as_posix()}"'))
    assert cli.main(["run", str(scene), "-o", str(folder / "larger.h5")]) == 0
    return folder / "larger.h5"


def test_windows_of_other_sizes_of_one_map_are_one_group(populations, other_windows):
    paths = populations / "scans.h5", other_windows
    (rows,) = dataset.read(Request(paths, features="dimensionless"))
    maps = [each.map for each in rows.populations]
    of_map = np.array([maps[number] for number in rows.population])
    assert np.unique(rows.groups).size == np.unique(of_map).size == 2
    for group in np.unique(rows.groups):
        assert np.unique(of_map[rows.groups == group]).size == 1
        assert np.unique(rows.database[rows.groups == group]).size == 2


@pytest.mark.parametrize(
    ("other", "features", "message"),
    [
        (
            "mirror",
            "dimensionless",
            r"mirror\.h5: contact\.boundary is 'mirror', 'free' in .*coarse",
        ),
        ("soft", "paper", r"soft\.h5: contact\.hardness is 'given', 'none' in .*coarse"),
        ("spectral", "paper", r"spectral\.h5: surface\.side is 300\.0, 1000\.0 in .*coarse"),
    ],
)
def test_databases_that_differ_are_refused_by_file_and_key(made, other, features, message):
    with pytest.raises(InputError, match=message):
        together(made, "coarse", other, features=features)


def test_a_database_given_twice_is_refused(made):
    with pytest.raises(InputError, match=r"coarse\.h5: is given twice"):
        together(made, "coarse", "fine", "coarse")
