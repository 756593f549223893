"""The command `asperity`, alone and under mpiexec: what it runs, refuses, completes."""

import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from launch import ended, environment, launch, mpiexec, python

import asperity
from asperity import command
from gen.runtime import VERSION

ALONE = [
    ("", "asperity: Missing command. (see asperity --help)"),
    ("gne", "asperity: No such command 'gne'. Did you mean 'gen'? (see asperity --help)"),
    ("gen info", "asperity gen: Missing argument 'FILE'. (see asperity gen info --help)"),
    ("bench hertz --bogus", "asperity bench: No such option: --bogus"),
]
"""Command lines that are refused, and how the line begins."""


@pytest.fixture
def typed(tmp_path, monkeypatch, capfd):
    """Run a command line in this process; return code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gen.runtime.command_line.start", lambda **_: None)
    monkeypatch.setattr("gen.runtime.farm.leave", lambda: None)  # later tests may need MPI

    def run(line):
        monkeypatch.setattr(sys, "argv", ["asperity", *line.split()])
        code = command.main()
        return (code, *capfd.readouterr())

    return run


@pytest.mark.parametrize(("line", "refusal"), ALONE)
def test_what_cannot_be_run_is_one_line(typed, line, refusal):
    code, output, errors = typed(line)
    assert (code, output, errors.count("\n")) == (2, "", 1)
    assert errors.startswith(refusal)


@pytest.mark.parametrize("program", ["", "gen ", "learn ", "bench "])
def test_every_program_says_the_version(typed, program):
    assert typed(f"{program}--version") == (0, f"asperity {VERSION}\n", "")
    assert asperity.__version__ == VERSION


def test_the_help_lists_every_program(typed):
    code, output, _ = typed("--help")
    assert code == 0
    for name in command.PROGRAMS:
        assert f"\n  {name} " in output


def test_messages_name_commands_as_they_were_typed(typed, tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 3\n[surface]\nnodes = 9\n")
    assert typed("gen run scene.toml -o rows.h5")[0] == 0
    _, _, errors = typed("learn predict rows.h5 rows.npy --side 9 --delta 1")
    assert "it is a database: asperity learn fit makes" in errors


def installed(*words):
    """The command as it is installed beside Python; without an installation, the module."""
    script = Path(sys.executable).with_name("asperity")
    return [*([str(script)] if script.exists() else [sys.executable, "-m", "asperity"]), *words]


@pytest.mark.parametrize(
    ("words", "expected"), [("", ["gen", "learn", "bench", "serve"]), ("gen run --ro", ["--rows"])]
)
def test_words_are_completed(words, expected, tmp_path):
    line = f"asperity {words}"
    asked = {"_ASPERITY_COMPLETE": "complete_bash", "COMP_WORDS": line}
    asked["COMP_CWORD"] = str(line.count(" "))
    ended = python("-c", "from asperity.command import main; main()", folder=tmp_path, **asked)
    assert ended.stdout.split() == expected


def on_three_ranks(folder, *words):
    return ended([str(mpiexec()), "-n", "3", *words], folder, environment())


@pytest.mark.mpi
def test_three_ranks_make_the_same_database_as_one_module(tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 12\n[surface]\nnodes = 9\n")
    ended = on_three_ranks(tmp_path, *installed("gen", "run", "scene.toml", "-o", "rows.h5"))
    assert ended.returncode == 0, ended.stderr
    assert "rows.h5: 12 rows done, 0 failed, 0 pending" in ended.stdout
    assert "2 workers" in ended.stderr
    assert launch(0, "check", "rows.h5", folder=tmp_path).returncode == 0


BUG = """
import sys
from mpi4py import MPI
from gen.generation import run
if MPI.COMM_WORLD.rank == 1:
    {broken}
sys.argv[1:] = ["gen", "run", "scene.toml", "-o", "rows.h5"]
from asperity.command import main
sys.exit(main())
"""


@pytest.mark.mpi
@pytest.mark.skipif(find_spec("mpi4py") is None, reason="no mpi4py")
@pytest.mark.parametrize(
    "broken", ["run.generate_database = None", "from gen import cli; cli.main = None"]
)
def test_a_bug_on_one_rank_ends_all(broken, tmp_path):
    """Inside the command, and outside of all that runs commands."""
    (tmp_path / "scene.toml").write_text("samples = 2000\n[surface]\nnodes = 33\n")
    (tmp_path / "bug.py").write_text(BUG.format(broken=broken))
    ended = on_three_ranks(tmp_path, sys.executable, "bug.py")
    assert ended.returncode != 0
    assert ended.stderr.count("TypeError: 'NoneType' object is not callable") == 1
