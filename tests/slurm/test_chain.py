"""slurm/chain.sh and slurm/tune.sbatch on a Slurm of our own: in order, none after a failure."""

import json
import re
import shutil
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from launch import launch, mpiexec

from tests.slurm.cluster import environment_with_python

pytestmark = [pytest.mark.mpi, pytest.mark.slurm]

SLURM = Path(__file__).resolve().parents[2] / "slurm"
PARAMETERS = {
    "VENV": sys.prefix,
    "LAUNCHER": f"{mpiexec()} -n 3",
    "SCENE": "short.toml",
    "MODELS": "decision-tree",
    "DATABASE_OPTIONS": "--ntasks=3",
    "SEARCH_OPTIONS": "--ntasks=3",
    "PARTS": "database comparison",
}


def queue_chain(cluster, folder, **parameters):
    """Start the chain; return the numbers of its three jobs."""
    answer = cluster.ask(
        SLURM / "chain.sh", folder=folder, parameters=PARAMETERS | parameters
    )
    return re.findall(r"job (\d+)$", answer, re.MULTILINE)


def finished_fits(folder):
    """What the search has kept, whole lines only; the first one says what all have in common."""
    text = "".join(
        path.read_text() for path in folder.glob("comparison/*/trials/*.jsonl")
    )
    return text.splitlines()[1 : text.count("\n")]


def test_links_follow_each_other_and_wait_for_one_that_queues_again(
    cluster, tmp_path, serial
):
    shutil.copy(serial / "short.toml", tmp_path)
    jobs = queue_chain(cluster, tmp_path)
    assert [cluster.job(job)["JobState"] for job in jobs[1:]] == ["PENDING", "PENDING"]
    cluster.wait_until(lambda: len(finished_fits(tmp_path)) > 20, "some fits", every=0.02)
    cluster.ask("scancel", "--batch", "--signal=USR1", jobs[1])
    cluster.wait_until(lambda: cluster.job(jobs[1])["Restarts"] == "1", "a restart")
    kept = finished_fits(tmp_path)
    ended = [cluster.wait(job) for job in jobs]
    logs = [(tmp_path / f"asperity-{job}.log").read_text() for job in jobs]
    assert [job["ExitCode"] for job in ended] == ["0:0"] * 3, logs
    for before, after in pairwise(ended):
        assert before["EndTime"] <= after["StartTime"]
    fits = finished_fits(tmp_path)
    assert 20 < len(kept) < len(fits)
    assert fits[: len(kept)] == kept
    places = [(fit["candidate"], fit["fold"]) for fit in map(json.loads, fits)]
    assert len(set(places)) == len(places), "a fit was done twice"
    assert "60 rows" in (tmp_path / "report/database.txt").read_text()
    assert "Decision Tree" in (tmp_path / "report/comparison.txt").read_text()


def test_a_link_that_fails_cancels_those_behind_it(cluster, tmp_path):
    jobs = queue_chain(cluster, tmp_path, SCENE="nosuch.toml")
    ended = [cluster.wait(job) for job in jobs]
    assert [job["JobState"] for job in ended] == ["FAILED", "CANCELLED", "CANCELLED"]
    assert ended[0]["ExitCode"] == "2:0"
    assert not (tmp_path / "report").exists()


def test_a_link_that_slurm_refuses_leaves_none_queued(cluster, tmp_path):
    with pytest.raises(
        AssertionError, match="nothing is queued: sbatch refuses the search"
    ):
        queue_chain(cluster, tmp_path, SCENE="quick", SEARCH_OPTIONS="--partition=nosuch")
    cluster.wait_until(
        lambda: (
            "main" not in cluster.ask("squeue", "--noheader", "--name=asperity-generate")
        ),
        "an empty queue",
    )


SCRIPT = SLURM / "bench.sbatch"

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


def test_parts_write_into_the_report_and_a_missing_one_is_bad_input(
    cluster, tmp_path, serial
):
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
