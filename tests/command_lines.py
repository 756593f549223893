"""Bad command lines for every command: bad files in the places of good ones, and bad options.

Further options that are refused stand in the tests of the modules that take them, on one process.
"""

import os
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import typer

from bench.commands import app as bench
from gen.cli import app as gen
from learn.cli import app as learn

PROGRAMS = {"gen": gen, "learn": learn, "bench": bench}

INPUTS = {
    "scene": "good.toml",
    "database": "good.h5",
    "surface": "good.npy",
    "surrogate": "good.s",
    "comparison": "comparison",
}
"""A good file of each kind that commands read."""

OUTPUTS = {
    "file": "new",
    "folder": "new-folder",
    "new-database": "new.h5",
    "new-scene": "new.toml",
}
"""A good place for each kind of output."""

LONG = "n" * 300
"""Longer than any file system takes."""

TEXT = "once upon a time\nthere were two surfaces\n"

BAD_INPUTS = [
    "missing",
    "empty",
    "text",
    "noise",
    "truncated",
    "pipe",
    "loop",
    "socket",
    LONG,
]
BAD_INPUTS += ["/dev/zero", "folder"]
"""What no command can read, by its name."""

OTHERS = ("missing", "text", "pipe", "folder")
"""Those of them that commands get which share their reader with one above in the table."""

BAD_FILES = ["folder", "missing/new", "text/new", "pipe", "loop", LONG, "/"]
BAD_OUTPUTS = {
    "file": [*BAD_FILES, "good.h5"],
    "folder": ["text", "text/new", "pipe", "loop", LONG],
    "new-database": [*BAD_FILES, "text", "empty", "noise", "truncated", "/dev/zero"],
    "new-scene": [*BAD_FILES, "text", "good.h5", "good.toml"],
}
"""Where no command can write; what stands there already is not of the kind that it writes."""


@dataclass(frozen=True)
class Command:
    """How a command is called.

    Attributes
    ----------
    good : its arguments; <kind> stands for an input, >kind for an output
    bad : further arguments, each wrong, and a word of the line that refuses them
    """

    good: str
    bad: tuple[tuple[str, str], ...] = ()


COMMANDS: dict[str, dict[str, Command]] = {
    "gen": {
        "run": Command(
            "<scene> -o >new-database",
            (("--rows 9:3", "--rows"), ("--sample-limit 1e10", "--sample-limit")),
        ),
        "info": Command("<database>"),
        "contact": Command(
            "<surface> --side 9 --delta 1 --csv >file --plot >file.png",
            (
                ("--unit mile", "mile"),
                ("--young 0", "modulus"),
                ("--mask 500:600", "--mask 500:600"),
                ("--against missing", "missing"),
                ("--boundary mirror --delta 99", "99"),
                ("--far-field compliant --delta 99", "Delta*"),
                ("--force 1", "give one of --delta, --force and --pressure"),
            ),
        ),
        "law": Command(
            "<surface> --side 9 --pressure 1 --csv >file --json >file.json --calculix >file.inp",
            (("--pressure high", "high"), ("--conductivity -1", "--conductivity")),
        ),
        "describe": Command(
            "<surface> --side 9 --csv >file",
            (
                ("--plot one.jpg", ".png"),
                ("--side 0", "give the scan length"),
                ("--crop 5", "give x0:x1,y0:y1"),
                ("--against-options --fill", "needs --against"),
                (
                    "--against good.npy --shift 0,99",
                    "fewer than 2 x 2 nodes lie on both maps",
                ),
            ),
        ),
        "plot": Command("<database> -o >file.png"),
        "columns": Command(""),
        "check": Command("<database>", (("--recompute -1", "--recompute"),)),
        "merge": Command("<database> <database> -o >new-database"),
        "export": Command(
            "<database> -o >folder",
            (("--doi 12", "--doi"), ("--title a\x07b", "--title")),
        ),
        "estimate": Command("<scene>", (("--ranks 0", "--ranks"),)),
        "scene": Command(
            "<surface> -o >new-scene --side 9",
            (("--like good.npy", "--like"), ("missing/*.x3p", "missing")),
        ),
    },
    "learn": {
        "fit": Command("<database> -o >file", (("--area-max 1e-9", "good.h5"),)),
        "grow": Command(
            "<scene> -o >file", (("--budget soon", "soon"), ("-o good.h5", "good.h5"))
        ),
        "card": Command("<surrogate>"),
        "predict": Command(
            "<surrogate> <surface> --side 9 --delta 1 -o >file", (("--delta 1:2", "1:2"),)
        ),
        "law": Command(
            "<surrogate> <surface> --side 9 --delta 1:2:3 --csv >file --header >file.h",
            (("--boundary mirror", "--boundary mirror"),),
        ),
        "compare": Command("<database> -o >folder", (("--model forest", "forest"),)),
        "tune": Command(
            "<database> -o >folder",
            (
                ("--budget soon", "soon"),
                ("--candidates 9", "--candidates"),
                ("--candidates 10 --budget 2h", "only one of them"),
            ),
        ),
        "show": Command("<comparison>"),
        "importance": Command(
            "<database> -o >folder", (("--target nothing", "nothing"),)
        ),
    },
}
"""Every command that runs on several ranks; those of bench refuse to."""


def prepare(folder: Path) -> None:
    """Make all files that the cases name, but those that the good commands make."""
    (folder / "good.toml").write_text("samples = 80\n[surface]\nnodes = 17\n")
    np.save(folder / "good.npy", np.random.default_rng(1).normal(size=(9, 9)))
    (folder / "empty").touch()
    (folder / "text").write_text(TEXT)
    (folder / "noise").write_bytes(np.random.default_rng(2).bytes(5000))
    (folder / "folder").mkdir()
    with h5py.File(folder / "truncated", "w") as file:
        file["heights"] = np.zeros(1000)
    os.truncate(folder / "truncated", 4000)
    os.mkfifo(folder / "pipe")
    (folder / "loop").symlink_to("loop")
    here = Path.cwd()
    os.chdir(folder)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
    os.chdir(here)


def commands(program: str) -> dict[str, Any]:
    """Every command of a program, from its own app."""
    group: Any = typer.main.get_command(PROGRAMS[program])
    return dict(group.commands)


def good(program: str) -> dict[str, list[str]]:
    """The good command line of every command of a program."""
    known = COMMANDS[program].items()
    return {name: [name, *map(_right, command.good.split())] for name, command in known}


def cases(program: str) -> Iterator[tuple[list[str], str]]:
    """All bad command lines of a program, and a word that the line which refuses them has to hold.

    The first command with a kind of file gets all that is no such file, the others `OTHERS`.
    """
    yield [], "command"
    yield ["nonsense"], "nonsense"
    yield ["--nonsense"], "--nonsense"
    known = set()
    for name, command in COMMANDS[program].items():
        good = command.good.split()
        right = [_right(each) for each in good]
        yield [name, *right, "--nonsense"], "--nonsense"
        yield [name] if good else [name, "surplus"], "Missing" if good else "surplus"
        for place, each in enumerate(good):
            kind = each.partition(".")[0]
            for bad in _wrong(kind):
                if kind not in known or bad in OTHERS:
                    arguments = [*right[:place], bad, *right[place + 1 :]]
                    yield [name, *arguments], bad.split("/")[0][:50]
            known.add(kind)
        for words, word in command.bad:
            yield [name, *right, *words.split()], word


def _right(token: str) -> str:
    """A token of a good command line."""
    kind, dot, suffix = token[1:].partition(".")
    if token.startswith("<"):
        return INPUTS[kind.removesuffix(">")]
    return OUTPUTS[kind] + dot + suffix if token.startswith(">") else token


def _wrong(kind: str) -> list[str]:
    """What must not stand in the place of a kind of file."""
    if kind.startswith("<"):
        return BAD_INPUTS
    return BAD_OUTPUTS[kind[1:]] if kind.startswith(">") else []
