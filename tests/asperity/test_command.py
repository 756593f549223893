"""The command `asperity`, alone and under mpiexec: what it runs, refuses, completes."""

import contextlib
import io
import shutil
import signal
import sys
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path

import command_lines
import numpy as np
import pytest
from launch import ended, environment, launch, mpiexec, python

import asperity
from asperity import command, programs
from bench import commands as bench
from gen import cli as gen
from gen.runtime import VERSION
from gen.surface import generate
from learn import cli as learn

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
    # This process goes on, and later tests may need MPI.
    monkeypatch.setattr("gen.runtime.farm.process", nullcontext)
    interrupt = signal.getsignal(signal.SIGINT)

    def run(line):
        monkeypatch.setattr(sys, "argv", ["asperity", *line.split()])
        code = command.main()
        return (code, *capfd.readouterr())

    yield run
    signal.signal(signal.SIGINT, interrupt)


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
    for name in programs.PROGRAMS:
        assert f"\n  {name} " in output


def test_messages_name_commands_as_they_were_typed(typed, tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 3\n[surface]\nnodes = 9\n")
    assert typed("gen run scene.toml -o rows.h5")[0] == 0
    _, _, errors = typed("learn predict rows.h5 rows.npy --side 9 --delta 1")
    assert "it is a database: asperity learn fit makes" in errors


PROGRAMS = {"gen": gen, "learn": learn, "bench": bench}
BRIEF = {
    "compare": "--model decision-tree",
    "tune": "--model kernel-ridge --budget 30s",
    "importance": "--model decision-tree",
    "grow": "--nmae 900 --rows 60",
}
"""Options with which commands take a second or two."""

LINES = {
    f"{program}-{name}": f"{program} {' '.join(line)} {BRIEF.get(name, '')}"
    for program in command_lines.COMMANDS
    for name, line in command_lines.good(program).items()
}
LINES |= {
    "gen-scene": "gen scene map.npy --side 500 -o new.toml",
    "learn-law": "learn law good.s good.npy --side 9 --delta 1:2:3 --csv new",
    "bench-hertz": "bench hertz -o new-folder",
}


class Unread(io.StringIO):
    """A stream whose reader has ended."""

    def write(self, text):
        if text:
            raise BrokenPipeError(32, "Broken pipe")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with a good file of each kind."""
    folder = tmp_path_factory.mktemp("inputs")
    command_lines.prepare(folder)
    (folder / "pipe").unlink()
    (folder / "socket").unlink()
    np.save(
        folder / "map.npy", generate("midpoint", 129, 0.7, 5.0, np.random.default_rng(0))
    )
    names = {"new": "good.s", "new-folder": "comparison", "new.h5": "good.h5"}
    with contextlib.chdir(folder):
        for name in ("gen-run", "learn-fit", "learn-compare"):
            program, *line = (names.get(word, word) for word in LINES[name].split())
            assert PROGRAMS[program].main(line) == 0
    return folder


@pytest.mark.few(2)
@pytest.mark.parametrize("name", LINES)
def test_a_command_whose_reader_has_ended_writes_all_its_files(
    inputs, name, tmp_path, monkeypatch, capsys
):
    """As in `asperity gen describe map.npy --csv table.csv | head -1`, which lost the table."""
    program, *line = LINES[name].split()
    files = {}
    for output in (sys.stdout, Unread()):
        folder = shutil.copytree(inputs, tmp_path / str(len(files)), symlinks=True)
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "stdout", output)
        assert PROGRAMS[program].main(line) == (141 if files else 0), (
            capsys.readouterr().err
        )
        files[folder.name] = {each.relative_to(folder) for each in folder.rglob("*")}
    assert files["0"] == files["1"]


def installed(*words):
    """The command as it is installed beside Python; without an installation, the module."""
    script = Path(sys.executable).with_name("asperity")
    return [
        *([str(script)] if script.exists() else [sys.executable, "-m", "asperity"]),
        *words,
    ]


@pytest.mark.parametrize(
    ("words", "expected"),
    [("", ["gen", "learn", "bench", "serve"]), ("gen run --ro", ["--rows"])],
)
def test_words_are_completed(words, expected, tmp_path):
    line = f"asperity {words}"
    asked = {"_ASPERITY_COMPLETE": "complete_bash", "COMP_WORDS": line}
    asked["COMP_CWORD"] = str(line.count(" "))
    ended = python(
        "-c", "from asperity.command import main; main()", folder=tmp_path, **asked
    )
    assert ended.stdout.split() == expected


def on_three_ranks(folder, *words):
    return ended([str(mpiexec()), "-n", "3", *words], folder, environment())


@pytest.mark.mpi
def test_three_ranks_make_the_same_database_as_one_module(tmp_path):
    (tmp_path / "scene.toml").write_text("samples = 12\n[surface]\nnodes = 9\n")
    ended = on_three_ranks(
        tmp_path, *installed("gen", "run", "scene.toml", "-o", "rows.h5")
    )
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


@pytest.mark.few(1)
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
