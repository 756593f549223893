"""Walk many command lines on the same ranks, which start once and import everything once."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from launch import launch

SECONDS = 20
"""Seconds after which a command line counts as hanging; each one here takes a second or two."""

WALK = """
import contextlib, faulthandler, io, json
from mpi4py import MPI
from bench import __main__ as bench
from gen import cli as gen
from learn import cli as learn
PROGRAMS = {"gen": gen.main, "learn": learn.main, "bench": bench.main}
world = MPI.COMM_WORLD
for program, arguments, seconds in json.load(open("walk.json")):
    faulthandler.dump_traceback_later(seconds, exit=True)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = PROGRAMS[program](arguments)
    ends = world.gather((code, err.getvalue(), out.getvalue()))
    faulthandler.cancel_dump_traceback_later()
    if world.rank == 0:
        print(json.dumps(ends), flush=True)
"""


class End(NamedTuple):
    """How a command line ended on one rank.

    Attributes
    ----------
    code : exit code
    errors : standard error
    output : standard output
    """

    code: int
    errors: str
    output: str


def walk(ranks: int, lines: Iterable[Sequence[str]], folder: Path) -> list[list[End]]:
    """Run command lines one after the other on the same ranks.

    Parameters
    ----------
    ranks : number of ranks
    lines : command lines, the program's name (gen, learn or bench) first
    folder : where they run; the script is written into it

    Returns
    -------
    For each command line its end on every rank
    """
    listed = [(program, arguments, SECONDS) for program, *arguments in lines]
    (folder / "walk.json").write_text(json.dumps(listed))
    (folder / "walking.py").write_text(WALK)
    done = launch(ranks, folder=folder, module="walking")
    assert done.returncode == 0, f"{done.stdout[-500:]} {done.stderr[-3000:]}"
    return [[End(*end) for end in json.loads(said)] for said in done.stdout.splitlines()]
