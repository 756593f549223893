"""One Slurm for all tests here, which are skipped where there is none."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from databases import database_of
from launch import mpiexec

from tests.slurm.cluster import Cluster, environment_with_python, missing

SLURM = Path(__file__).resolve().parents[2] / "slurm"
SCENE = "samples = {}\nsamples_per_surface = 2\n[surface]\nnodes = 33\n"
SHORT, LONG = 60, 600


@pytest.fixture(scope="session")
def cluster() -> Iterator[Cluster]:
    if mpiexec() is None:
        pytest.skip("no mpiexec: install the extra 'mpich'")
    if absent := missing():
        pytest.skip(f"no Slurm ({', '.join(absent)}): make slurm installs it, as root")
    short = tempfile.TemporaryDirectory(prefix="slurm-", ignore_cleanup_errors=True)
    with short as folder, Cluster(Path(folder)) as running:
        yield running


@pytest.fixture(scope="session")
def overrunning(cluster, tmp_path_factory) -> tuple[str, Path]:
    """A job, and its folder, that heeds no warning: it needs its minute beside other tests."""
    folder = tmp_path_factory.mktemp("overrunning")
    venv = environment_with_python(
        folder,
        """case "$*" in
            *"-m gen"*) [ -e once ] || { touch once; trap "" USR1; sleep 300; } ;;
            *) echo "world $SLURM_NTASKS" ;;
        esac""",
    )
    options = ("--ntasks=1", "--time=1")
    parameters = {"VENV": venv, "LAUNCHER": "env", "RETRIES": 1}
    job = cluster.sbatch(
        *options, SLURM / "generate.sbatch", folder=folder, parameters=parameters
    )
    return job, folder


@pytest.fixture(scope="session")
def serial(tmp_path_factory) -> Path:
    """A folder with short.toml and long.toml, and what a serial run makes of them."""
    folder = tmp_path_factory.mktemp("serial")
    for name, samples in (("short", SHORT), ("long", LONG)):
        database_of(folder, SCENE.format(samples), name)
    return folder
