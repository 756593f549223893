"""The farm's measurements: medians of rounds, rows as written."""

import h5py
import numpy as np
import pytest
from launch import mpiexec

from bench import farm as farms
from gen.generation.run import blocks_of
from gen.runtime import farm
from gen.runtime.errors import InputError


def test_rows_out_of_place_are_found(tmp_path):
    spec = farms.Spec(rows=30, nodes=9, rounds=1)
    path = tmp_path / "rows.h5"
    assert farms.time_writers(spec, path, farm.World()).keys() >= {"single"}
    with h5py.File(path, "r+") as file:
        file["pressure"][29] = np.zeros((9, 9))
    blocks = list(blocks_of(spec.scene, [range(30)], workers=1))
    template = farms.template_of(spec.scene, blocks)
    farms.require_rows(path, blocks[:-1], template)
    with pytest.raises(ValueError, match="row 29"):
        farms.require_rows(path, blocks, template)


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_both_writers_are_measured_where_h5py_has_mpi():
    rows = farms.writers([3], 40, 2, None)
    wanted = {"single"} | ({"parallel"} if h5py.get_config().mpi else set())
    assert {row["writer"] for row in rows} == wanted
    for row in rows:
        assert row["ranks"] == 3
        assert 0 < row["lowest_MB_s"] <= row["rate_MB_s"] <= row["highest_MB_s"]


def test_a_measurement_that_fails_is_one_line(monkeypatch):
    monkeypatch.setattr("bench.farm._mpiexec", lambda: "false")
    with pytest.raises(InputError, match="fails"):
        farms.writers([2], 1, 1, None)
    with pytest.raises(InputError, match="ranks 1: give 2 or more"):
        farms.writers([1, 2], 1, 1, None)
