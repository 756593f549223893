"""The benchmark of the writers: it writes what it says and reports what this h5py can."""

import h5py
import numpy as np
import pytest
from launch import mpiexec

from bench import writers
from gen.generation.run import blocks_of
from gen.runtime import farm
from gen.runtime.errors import InputError


def test_a_table_has_the_medians_of_the_rounds():
    spec = writers.Spec(rows=100, nodes=65)
    size = spec.megabytes
    table = writers.markdown_table(
        spec, [(4, {"single": [1.0, 4.0, 2.0], "parallel": [0.5, 1.0, 2.0]})]
    )
    single, parallel, ratio = table.splitlines()[-1].split(" | ")[1:]
    assert single == f"{size / 2:,.0f} ({size / 4:,.0f} to {size:,.0f})"
    assert parallel == f"{size:,.0f} ({size / 2:,.0f} to {2 * size:,.0f})"
    assert float(ratio.rstrip("| ")) == 2.0


def test_rows_out_of_place_are_found(tmp_path):
    spec = writers.Spec(rows=30, nodes=9, rounds=1)
    path = tmp_path / "rows.h5"
    assert writers.time_writers(spec, path, farm.World()).keys() >= {"single"}
    with h5py.File(path, "r+") as file:
        file["pressure"][29] = np.zeros((9, 9))
    blocks = list(blocks_of(spec.scene, [(0, 30)], workers=1))
    template = writers.template_of(spec.scene, blocks)
    writers.require_rows(path, blocks[:-1], template)
    with pytest.raises(ValueError, match="row 29"):
        writers.require_rows(path, blocks, template)


@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_both_writers_are_measured_where_h5py_has_mpi():
    spec = writers.Spec(rows=40, nodes=17, rounds=2)
    ((ranks, seconds),) = writers.measure(spec, [3])
    assert ranks == 3
    assert seconds.keys() == {"single"} | ({"parallel"} if h5py.get_config().mpi else set())
    assert all(len(times) == 2 and min(times) > 0 for times in seconds.values())
    assert ("no MPI" in writers.markdown_table(spec, [(3, seconds)])) != h5py.get_config().mpi


def test_a_measurement_that_fails_is_one_line(monkeypatch):
    monkeypatch.setattr("bench.scale.launch._mpiexec", lambda: "false")
    with pytest.raises(InputError, match="fails"):
        writers.measure(writers.Spec(rows=1, nodes=9), [2])
