"""What is read from a database, what is left out, and what cannot be used."""

import h5py
import numpy as np
import pytest
from learnt_rows import read

from gen.database import Reader
from gen.runtime.errors import InputError
from learn import dataset
from learn.dataset import Request
from learn.stored import INPUTS, results


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
    assert first.source["database_sha256"] == second.source["database_sha256"]
    change("delta", [0], 7.0)
    assert read(database).source["database_sha256"] != first.source["database_sha256"]


@pytest.fixture(scope="module")
def undefined(tmp_path_factory):
    """The path of a database of 60 surfaces of 5 x 5 nodes, many of which have no asperity."""
    from gen import cli

    folder = tmp_path_factory.mktemp("undefined")
    (folder / "s.toml").write_text("samples = 120\nsamples_per_surface = 2\n[surface]\nnodes = 5\n")
    assert cli.main(["run", str(folder / "s.toml"), "-o", str(folder / "s.h5")]) == 0
    return folder / "s.h5"


def lacking(path):
    """Rows whose surfaces do not define all statistics, all of them done."""
    with h5py.File(path) as file:
        assert set(file["status"][:]) == {1}
        return np.flatnonzero(file["reason"][:])


def test_rows_that_lack_a_statistic_which_the_features_need_are_left_out(undefined, tmp_path):
    rows = lacking(undefined)
    assert 10 < rows.size < 100
    found = read(undefined)
    why = "paper features need statistics that the surface does not define"
    assert found.dropped == {why: rows.size}
    assert f"left out {rows.size} rows: {why}" in dataset.remarks(found, "l2")
    assert set(found.rows.tolist()) == set(range(120)) - set(rows.tolist())
    assert np.isfinite(found.inputs).all()


@pytest.mark.parametrize(
    ("column", "rows", "value", "said"),
    [
        ("status", slice(None), 2, "0 usable rows, 10 at least are needed (left out: 90 failed"),
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


def test_the_user_is_told_of_what_is_odd(database, change, solved):
    assert dataset.remarks(read(solved), "l2") == []
    change("asperity_density", slice(None), 0.1)
    change("height_max", slice(None), 1e12)
    with h5py.File(database, "r+") as file:
        for name in (*INPUTS, "area_percent"):
            file[name][1] = file[name][0]
    text = "\n".join(dataset.remarks(read(database), "l2"))
    assert "constant over all rows, so of no use to a model: asperity_density, height_max" in text
    assert "1 rows repeat others exactly" in text
    assert "height_max is " in text
    assert "--normalise standard" in text
    assert "standard" not in "\n".join(dataset.remarks(read(database), "standard"))


def test_targets_that_are_read_together_are_those_that_are_read_alone(change):
    path = change("force", [3], np.nan)
    together = dataset.read(Request((path,), targets=("area", "force"), area_max=40.0))
    assert [len(rows.rows) for rows in together] == [together[0].size, together[0].size - 1]
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
