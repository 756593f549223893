"""slurm/bench.sbatch on a Slurm of our own: its parts, their verdicts, what a restart repeats."""

import sys
from pathlib import Path

import pytest
from launch import launch

from tests.slurm.cluster import environment_with_python

pytestmark = pytest.mark.slurm

SCRIPT = Path(__file__).resolve().parents[2] / "slurm" / "bench.sbatch"

# `stability` finds something, `solver` crashes at first, all else is well.
PYTHON = """echo "${@:2:2}" "${@:4}" >> calls
case $3 in
    stability) exit 1 ;;
    solver) [ -e once ] || { touch once; kill -KILL $$; } ;;
esac"""


def test_a_restart_goes_on_with_the_part_it_was_at_and_keeps_verdicts(cluster, tmp_path):
    venv = environment_with_python(tmp_path, PYTHON)
    parameters = {"VENV": venv, "SOLVER": "quick"}
    job = cluster.sbatch(SCRIPT, folder=tmp_path, parameters=parameters)
    ended = cluster.wait(job)
    assert (ended["ExitCode"], ended["Restarts"]) == ("1:0", "1")
    assert (tmp_path / "calls").read_text().splitlines() == [
        "gen info paper.h5",
        "learn show comparison",
        "bench stability -o report",
        "bench solver -o report --quick",
        "bench solver -o report --quick",
    ]
    assert not list(tmp_path.glob("*.state"))


def test_parts_write_into_the_report_and_a_missing_one_is_bad_input(cluster, tmp_path, serial):
    parameters = {
        "VENV": sys.prefix,
        "PARTS": "weather database",
        "DATABASE": serial / "short.h5",
    }
    job = cluster.sbatch(SCRIPT, folder=tmp_path, parameters=parameters)
    ended = cluster.wait(job)
    log = (tmp_path / f"asperity-{job}.log").read_text()
    assert (ended["ExitCode"], ended["Restarts"]) == ("2:0", "0"), log
    assert "PARTS: there is no 'weather'" in log
    info = launch(0, "info", serial / "short.h5", folder=tmp_path).stdout
    assert (tmp_path / "report/database.txt").read_text().split() == info.split()
