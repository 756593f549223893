"""Packages, files and folders of others that have the names of Asperity's packages."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from asperity import neighbours

ROOT = Path(__file__).resolve().parents[2]


def test_ours_are_found_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert not neighbours.fault("bem", "gen", "learn", "bench")


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Start Python in a folder, in which `-m` and `-c` look for modules first."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


@pytest.mark.parametrize("stranger", ["gen.py", "gen/__init__.py"])
@pytest.mark.parametrize(
    "command", ["-m learn --version", "-m bench --version", "-m asperity gen info x"]
)
def test_a_foreign_gen_is_named_in_one_line(stranger, command, tmp_path):
    (tmp_path / "gen").mkdir()
    (tmp_path / stranger).write_text("raise SystemExit('this must not run')\n")
    ended = run(tmp_path, *command.split())
    assert (ended.returncode, ended.stdout) == (2, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"{command.split()[1]}: `import gen` finds {tmp_path / stranger} before")
    assert f"Asperity's package in {ROOT / 'gen'}: rename that gen" in line


def test_a_foreign_gen_is_an_import_error_of_a_script(tmp_path):
    (tmp_path / "gen.py").write_text("")
    ended = run(tmp_path, "-c", "from learn import Surrogate")
    assert ended.returncode == 1
    last = ended.stderr.splitlines()[-1]
    assert last.startswith(f"ImportError: learn: `import gen` finds {tmp_path / 'gen.py'} before")


def test_a_foreign_bench_ends_asperity_bench_alone(tmp_path):
    (tmp_path / "bench.py").write_text("")
    refused = run(tmp_path, "-m", "asperity", "bench", "--version")
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"asperity: `import bench` finds {tmp_path / 'bench.py'}")
    assert run(tmp_path, "-m", "asperity", "learn", "--version").returncode == 0


def test_folders_for_results_may_have_the_names_of_packages(tmp_path):
    for name in ("gen", "learn", "bench"):
        (tmp_path / name).mkdir()
    for command in ("-m asperity bench --version", "-m learn --version", "-m gen info --help"):
        assert run(tmp_path, *command.split()).returncode == 0


@pytest.fixture
def installed(tmp_path):
    """A folder that holds what a wheel installs, before all else that Python finds."""
    for package in ("asperity", "bem", "gen"):
        shutil.copytree(ROOT / package, tmp_path / package)
    return tmp_path


def test_a_package_that_was_written_over_is_found_out(installed):
    (installed / "gen" / "__init__.py").write_text('"""Genes."""\n')
    refused = run(installed, "-m", "asperity", "gen", "--version")
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line.startswith(f"asperity: {installed / 'gen' / '__init__.py'} is not Asperity's:")
    assert "environment of its own" in line


def test_a_package_that_is_missing_is_named(installed):
    shutil.rmtree(installed / "bem")
    refused = run(installed, "-m", "asperity", "gen", "--version")
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"asperity: the package bem is missing from {installed}")
