"""All the bad input of tests/bad_input.py on three ranks, in one launch."""

import json

import bad_input
import pytest
from launch import launch, mpiexec

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

ALL_CASES = """
import json, sys
from gen import cli
from mpi4py import MPI
cases = json.load(open("cases.json"))
for number, arguments in enumerate(cases):
    MPI.COMM_WORLD.Barrier()
    codes = MPI.COMM_WORLD.gather(cli.main(arguments))
    if MPI.COMM_WORLD.rank == 0:
        sys.stderr.flush()
        print(json.dumps([number, codes]), flush=True)
"""


def test_bad_input_ends_alike_on_all_ranks_and_is_said_once(tmp_path):
    bad_input.prepare(tmp_path)
    (tmp_path / "cases.json").write_text(json.dumps([case for case, _ in bad_input.CASES]))
    (tmp_path / "all_cases.py").write_text(ALL_CASES)
    before = {path.name for path in tmp_path.iterdir()}
    done = launch(3, folder=tmp_path, module="all_cases")
    assert done.returncode == 0, done.stderr
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    for number, (arguments, _) in enumerate(bad_input.CASES):
        assert answers[number][1] == [2, 2, 2], arguments
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == len(bad_input.CASES)
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == before
