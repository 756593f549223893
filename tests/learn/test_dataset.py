"""What is read, what is left out, what goes together, and which rows no split may divide."""

import re

import h5py
import numpy as np
import pytest
from databases import database_of
from learnt_rows import read

from gen.database import Reader
from gen.runtime.errors import InputError
from gen.scene import columns_for
from gen.schema import COLUMNS, TABLE_1, Reason, Status
from learn import dataset
from learn.dataset import Request, results, unknown_target
from learn.features.columns import NODES
from learn.features.sets import SETS


def test_rows_are_left_out_and_counted_by_reason(database, change):
    change("status", [0, 1], 0)
    change("status", [2, 3, 4], 2)
    change("reason", [2, 3, 4], [1, 1, 4])
    change("force", [5], np.nan)
    change("height_max", [6], np.inf)
    change("height_rms", [7], 1e200)
    found = read(database, "force", area_max=20.0)
    with h5py.File(database) as file:
        beyond = np.flatnonzero(file["area_percent"][:] > 20.0)
    large = set(beyond.tolist()) - set(range(8))
    assert found.dropped == {
        "not computed yet": 2,
        "failed: not converged within the iteration bound": 2,
        "failed: the sample raised an arithmetic or value error": 1,
        "target not finite": 1,
        "input not finite, or too large to be squared": 2,
        "area above 20 %": len(large),
    }
    assert found.size == 90 - sum(found.dropped.values())
    assert set(found.rows.tolist()) == set(range(8, 90)) - large
    assert found.unit == "uN"


def test_times_and_hosts_do_not_change_the_fingerprint(solved, database, change):
    change("runtime/solve_seconds", slice(None), 1.0)
    first, second = read(solved), read(database)
    assert first.sha256 == second.sha256
    change("delta", [0], 7.0)
    assert read(database).sha256 != first.sha256


def test_damaged_rows_are_learnt_and_a_warning_names_them(solved, database, change):
    change("force", [5], 1.0)
    found = read(database)
    (warning,) = [line for line in dataset.remarks(found, "l2") if "bytes" in line]
    assert f"{database}: row 5 has other bytes than were written" in warning
    assert found.size == read(solved).size
    assert not dataset.damage_of(read(solved))


@pytest.fixture(scope="module")
def undefined(tmp_path_factory):
    """The path of a database of 60 surfaces of 5 x 5 nodes, many of which have no asperity."""
    text = "samples = 120\nsamples_per_surface = 2\n[surface]\nnodes = 5\n"
    return database_of(tmp_path_factory.mktemp("undefined"), text)


def lacking(path):
    """Rows whose surfaces do not define all statistics, all of them done."""
    with h5py.File(path) as file:
        assert set(file["status"][:]) == {1}
        return np.flatnonzero(file["reason"][:])


WITHOUT_STATISTICS = "paper features need statistics that the surface does not define"


def test_rows_that_lack_a_statistic_which_the_features_need_are_left_out(undefined):
    rows = lacking(undefined)
    assert 10 < rows.size < 100
    found = read(undefined)
    assert set(found.rows.tolist()) == set(range(120)) - set(rows.tolist())
    assert np.isfinite(found.inputs).all()


def test_rows_that_lack_a_statistic_are_counted_in_a_remark(undefined):
    number = lacking(undefined).size
    found = read(undefined)
    assert found.dropped == {WITHOUT_STATISTICS: number}
    remark = f"left out {number} rows: {WITHOUT_STATISTICS}"
    assert remark in dataset.remarks(found, "l2")


@pytest.mark.parametrize(
    ("column", "rows", "value", "said"),
    [
        (
            "status",
            slice(None),
            2,
            "0 usable rows, 10 at least are needed (left out: 90 failed",
        ),
        ("status", slice(None), 7, "90 status unknown"),
        ("area_percent", slice(None), 3.5, "area_percent is 3.5 in all 90 usable rows"),
    ],
)
def test_what_nothing_can_be_learnt_from_is_refused(change, column, rows, value, said):
    with pytest.raises(InputError) as caught:
        read(change(column, rows, value))
    assert said in str(caught.value)


@pytest.mark.parametrize("target", ["mean_gap", "areas", "delta", "status", "host"])
def test_a_target_that_is_not_stored_is_refused_with_those_that_are(solved, target):
    with pytest.raises(InputError, match=r"stores area, force, contact_nodes"):
        read(solved, target)


@pytest.mark.parametrize(
    ("target", "load", "words"),
    [
        ("delta", "delta", "it is a target under --load pressure"),
        ("force", "pressure", "the force is the load, or follows from it"),
        ("areas", "delta", "'areas': database.h5 stores area$"),
    ],
)
def test_a_load_is_no_target_and_the_line_says_so(target, load, words):
    columns = {each.name: each for each in COLUMNS if each.name == "area_percent"}
    assert re.search(words, unknown_target(target, "database.h5", columns, load))


def test_usual_rows_have_no_remarks(solved):
    assert dataset.remarks(read(solved), "l2") == []


@pytest.fixture
def odd(database, change):
    """Rows with two constant inputs, one of them huge, and a row that repeats another one."""
    change("asperity_density", slice(None), 0.1)
    change("height_max", slice(None), 1e12)
    with h5py.File(database, "r+") as file:
        for name in (*SETS["paper"].columns, "area_percent"):
            file[name][1] = file[name][0]
    return read(database)


def test_constant_inputs_and_repeated_rows_are_named(odd):
    text = "\n".join(dataset.remarks(odd, "standard"))
    constant = (
        "constant over all rows, so of no use to a model: asperity_density, height_max"
    )
    assert constant in text
    assert "1 rows repeat others exactly" in text


def test_an_input_that_hides_the_others_is_named_for_rows_of_unit_length_alone(odd):
    text = "\n".join(dataset.remarks(odd, "l2"))
    assert "height_max is " in text
    assert "--normalise standard" in text
    assert "standard" not in "\n".join(dataset.remarks(odd, "standard"))


def test_targets_that_are_read_together_are_those_that_are_read_alone(change):
    path = change("force", [3], np.nan)
    together = dataset.read(Request((path,), targets=("area", "force"), area_max=40.0))
    assert [len(rows.rows) for rows in together] == [
        together[0].size,
        together[0].size - 1,
    ]
    for rows, target in zip(together, ("area", "force"), strict=True):
        alone = read(path, target, area_max=40.0)
        for name, values in vars(alone).items():
            np.testing.assert_equal(vars(rows)[name], values, err_msg=name)


def test_rows_of_every_population_have_the_displacement_that_was_solved(population):
    found = read(population, "force", features="dimensionless")
    with h5py.File(population) as file:
        deltas, force = file["delta"][:], file["force"][:]
    assert found.size > 50
    np.testing.assert_array_equal(found.described[:, 0], deltas[found.rows])
    with Reader(population) as reader:
        length = np.sqrt(np.prod(reader.scene.sides))
    np.testing.assert_allclose(found.scale, length * deltas[found.rows], rtol=1e-12)
    np.testing.assert_allclose(found.target * found.scale, force[found.rows], rtol=1e-12)


def test_every_stored_column_of_a_population_is_filled_where_its_row_is_done(population):
    """Surfaces that do not define all statistics are done, and lack these statistics alone."""
    statistics = {column.name for column in TABLE_1}
    with Reader(population) as reader:
        done = reader.column("status") == Status.DONE
        described = done & (reader.column("reason") != Reason.NO_STATISTICS)
        assert described.any()
        for column in columns_for(reader.scene):
            values = reader.column(column.name)
            rows = described if column.name in statistics else done
            if values.dtype.kind == "f":
                assert np.isfinite(values[rows]).all(), column.name
            if values.dtype.kind == "S":
                assert (values[rows] != b"").all(), column.name


def test_targets_are_results_and_no_parameters(populations):
    found = {}
    for name in ("spectral", "python", "relative"):
        with Reader(populations / f"{name}.h5") as reader:
            found[name] = list(results(reader.scene))
    always = ["area_percent", "force", "contact_nodes"]
    assert found["relative"] == always
    assert found["spectral"] == [*always, "mean_gap"]
    assert found["python"] == [*always, "yielded_percent"]
    for target in ("amplitude", "count", "load", "residual", "height_rms"):
        with pytest.raises(
            InputError, match=r"stores area, force, contact_nodes, yielded_percent$"
        ):
            read(populations / "python.h5", target)


def test_windows_of_one_tile_are_one_group(populations):
    found = read(populations / "scans.h5")
    with Reader(populations / "scans.h5") as reader:
        tiles = reader.column("tile")[found.rows]
    assert found.by_tile
    pairs = set(zip(tiles.tolist(), found.groups.tolist(), strict=True))
    assert len(pairs) == np.unique(tiles).size == np.unique(found.groups).size > 3


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
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The paths of small databases by the names of their scenes."""
    folder = tmp_path_factory.mktemp("several")
    return {name: database_of(folder, text, name) for name, text in SCENES.items()}


def together(made, *names, features="dimensionless"):
    paths = [made[name] for name in names]
    (rows,) = dataset.read(Request(tuple(paths), features=features))
    return rows


JOINT = ("coarse", "stranger", "spectral")


@pytest.fixture(scope="module")
def joint(made):
    """Rows of three databases on two grids, with their number of nodes as the last input."""
    return together(made, *JOINT)


@pytest.mark.few(2)
@pytest.mark.parametrize("number", range(len(JOINT)))
def test_joint_rows_are_those_of_each_database(made, joint, number):
    alone = read(made[JOINT[number]], features="dimensionless")
    rows = joint.at(np.flatnonzero(joint.database == number))
    np.testing.assert_array_equal(rows.inputs[:, :-1], alone.inputs)
    np.testing.assert_array_equal(rows.target, alone.target)
    np.testing.assert_array_equal(rows.rows, alone.rows)


def test_databases_on_different_grids_have_the_number_of_nodes_as_a_feature(joint):
    assert joint.features.columns[-1] == NODES
    nodes = np.where(joint.database == JOINT.index("stranger"), 33, 17)
    np.testing.assert_allclose(joint.inputs[:, -1], np.log2(nodes))


@pytest.mark.parametrize("number", range(len(JOINT)))
def test_joint_rows_name_each_database_as_it_is_alone(made, joint, number):
    (alone,) = read(made[JOINT[number]], features="dimensionless").origins
    assert joint.origins[number].sha256 == alone.sha256
    assert joint.origins[number].rows == alone.rows


def test_surfaces_of_one_seed_and_number_are_one_group_on_every_grid(made):
    rows = together(made, "coarse", "fine")
    coarse, fine = (rows.groups[rows.database == number] for number in (0, 1))
    np.testing.assert_array_equal(coarse[::2], coarse[1::2])
    np.testing.assert_array_equal(coarse[::2][:24], fine)
    assert np.unique(rows.groups).size == 30
    strangers = together(made, "coarse", "stranger")
    assert np.unique(strangers.groups).size == 30 + 20


@pytest.fixture(scope="module")
def other_windows(populations, tmp_path_factory):
    """The path of a database of larger windows of the maps of the populations."""
    text = (populations / "scans.toml").read_text().replace("[20, 17]", "[40, 34]")
    text = text.replace('"maps"', f'"{(populations / "maps").as_posix()}"')
    return database_of(tmp_path_factory.mktemp("windows"), text, "larger")


def test_windows_of_other_sizes_of_one_map_are_one_group(populations, other_windows):
    paths = populations / "scans.h5", other_windows
    (rows,) = dataset.read(Request(paths, features="dimensionless"))
    assert np.unique(rows.groups).size == np.unique(rows.population).size == 2
    for group in np.unique(rows.groups):
        assert np.unique(rows.population[rows.groups == group]).size == 1
        assert np.unique(rows.database[rows.groups == group]).size == 2


@pytest.mark.parametrize(
    ("other", "features", "message"),
    [
        (
            "mirror",
            "dimensionless",
            r"mirror\.h5: contact\.boundary is 'mirror', 'free' in .*coa",
        ),
        ("soft", "paper", r"soft\.h5: contact\.hardness is 'given', 'none' in .*coarse"),
        (
            "spectral",
            "paper",
            r"spectral\.h5: surface\.side is 300\.0, 1000\.0 in .*coarse",
        ),
    ],
)
def test_databases_that_differ_are_refused_by_file_and_key(
    made, other, features, message
):
    with pytest.raises(InputError, match=message):
        together(made, "coarse", other, features=features)


def test_a_database_given_twice_is_refused(made):
    with pytest.raises(InputError, match=r"coarse\.h5: is given twice"):
        together(made, "coarse", "fine", "coarse")
