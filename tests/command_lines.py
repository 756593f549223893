"""Bad command lines for every command: each file that it names replaced by about ten bad ones."""

import itertools
import os
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

import h5py
import numpy as np
import typer

from bench.__main__ import app as bench
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

BAD_INPUTS = ["missing", "empty", "text", "noise", "truncated", "pipe", "loop", "socket", LONG]
"""What no command can read, by its name; folders and devices come in addition."""

BAD_FILES = ["folder", "missing/new", "text/new", "pipe", "loop", LONG, "/"]
BAD_FOLDERS = ["text", "text/new", "pipe", "loop", LONG]
BAD_OUTPUTS = {
    "file": [*BAD_FILES, "good.h5"],
    "folder": BAD_FOLDERS,
    "new-database": [*BAD_FILES, "text", "empty", "noise", "truncated", "/dev/zero"],
    "new-scene": [*BAD_FILES, "text", "good.h5", "good.toml", "missing/a.toml", f"{LONG}.toml"],
}
"""Where no command can write; what stands there already is not of the kind that it writes."""


class Case(NamedTuple):
    """One bad command line.

    Attributes
    ----------
    arguments : the command's name first
    word : what the line that refuses it has to hold
    """

    arguments: list[str]
    word: str


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


SELECTION = (
    ("--target nothing", "nothing"),
    ("--target area,area", "area,area"),
    ("--area-max -1", "--area-max"),
    ("--area-max 0", "--area-max"),
    ("--area-max nan", "--area-max"),
    ("--area-max 1e-9", "good.h5"),
    ("--features papers", "papers"),
    ("--normalise l3", "l3"),
    ("--train-rows 0", "--train-rows"),
    ("--train-rows -5", "--train-rows"),
    ("--seed -1", "--seed"),
)
COMPARED = (*SELECTION, ("--model forest", "forest"))
SURFACE = (
    ("--side 0", "--side"),
    ("--side 1,2,3", "--side"),
    ("--side nan", "--side"),
    ("--unit mile", "mile"),
    ("--level up", "up"),
    ("--crop 5", "--crop"),
    ("--young 0", "modulus"),
    ("--e-star -1", "--e-star"),
    ("--young 1 --e-star 1", "--e-star"),
    ("--poisson 2", "poisson"),
)
PREPARED = (
    ("--mask 5", "--mask"),
    ("--mask :", "--mask"),
    ("--mask a:b", "--mask"),
    ("--mask 3:1", "--mask"),
    ("--mask 500:600", "--mask 500:600"),
    ("--mask 1:", "missing"),
    ("--despike 0", "--despike"),
    ("--despike -7", "--despike"),
    ("--despike nan", "--despike"),
    ("--despike much", "--despike"),
    ("--form 0", "--form"),
    ("--form 9", "--form"),
    ("--form 21", "--form"),
    ("--form 2.5", "--form"),
    ("--form 2 --level plane", "--level plane and --form 2"),
    ("--filter 3", "--filter"),
    ("--filter :", "--filter"),
    ("--filter 8:5", "--filter"),
    ("--filter 0:5", "--filter"),
    ("--filter x:", "--filter"),
    ("--filter 1:", "S-filter"),
    ("--filter :99", "L-filter"),
    ("--downsample 1", "--downsample"),
    ("--downsample -2", "--downsample"),
    ("--downsample 5", "--downsample"),
    ("--downsample two", "--downsample"),
)
AGAINST = (
    ("--against missing", "missing"),
    ("--against text", "text"),
    ("--against empty", "empty"),
    ("--against folder", "folder"),
    ("--against good.npy --turned z", "--turned"),
    ("--against good.npy --turned xy", "--turned"),
    ("--against good.npy --shift 5", "--shift"),
    ("--against good.npy --shift a,b", "--shift"),
    ("--against good.npy --shift nan,0", "--shift"),
    ("--against good.npy --shift 0,99", "2 x 2"),
    ("--against good.npy --against-options --fill", "--side"),
    ("--against good.npy --against-options --plot=x.png", "--plot"),
    ("--against good.npy --against-options --nonsense", "--nonsense"),
    ("--against-options --fill", "--against"),
    ("--turned y", "--against"),
    ("--shift 1,1", "--against"),
)
DESCRIBED = (*SURFACE[:6], *PREPARED, *AGAINST)
ASKED = (*SURFACE, ("--delta deep", "deep"), ("--delta 1:2", "1:2"), ("--interval 2", "--interval"))

COMMANDS: dict[str, dict[str, Command]] = {
    "gen": {
        "run": Command(
            "<scene> -o >new-database",
            (
                ("--rows 3", "--rows"),
                ("--rows 9:3", "--rows"),
                ("--rows 0:99999", "--rows"),
                ("--rows -1:3", "--rows"),
                ("--sample-limit 0", "--sample-limit"),
                ("--sample-limit -1", "--sample-limit"),
                ("--sample-limit nan", "--sample-limit"),
                ("--sample-limit 1e10", "--sample-limit"),
                ("--writer both", "both"),
                ("--ranks 3", "--ranks"),
            ),
        ),
        "info": Command("<database>"),
        "contact": Command(
            "<surface> --side 9 --delta 1 --csv >file --plot >file.png",
            (
                *SURFACE,
                *PREPARED,
                *AGAINST,
                ("--delta nan", "delta"),
                ("--delta deep", "deep"),
                ("--delta 1:2:0", "1:2:0"),
                ("--force 1", "--force"),
                ("--kernel point", "point"),
                ("--far-field soft", "soft"),
                ("--boundary open", "open"),
                ("--boundary mirror --far-field compliant", "compliant"),
                ("--boundary periodic --kernel concentrated-force", "concentrated-force"),
                ("--boundary mirror --delta 99", "99"),
                ("--rtol 0", "rtol"),
                ("--max-iterations 0", "max_iterations"),
            ),
        ),
        "law": Command(
            "<surface> --side 9 --pressure 1 --csv >file --json >file.json --calculix >file.inp",
            (
                *SURFACE,
                ("--pressure high", "high"),
                ("--delta 1:2", "1:2"),
                ("--surfaces 1", "--surfaces"),
                ("--boundary open", "open"),
                ("--band 2", "--band"),
                ("--conductivity -1", "--conductivity"),
                ("--units inch", "inch"),
                *AGAINST,
            ),
        ),
        "describe": Command(
            "<surface> --side 9 --csv >file",
            (*DESCRIBED, ("--boundary open", "open"), ("--plot one.jpg", ".png")),
        ),
        "plot": Command("<database> -o >file.png"),
        "columns": Command(""),
        "check": Command(
            "<database>", (("--recompute -1", "--recompute"), ("--seed -1", "--seed"))
        ),
        "merge": Command("<database> <database> -o >new-database"),
        "export": Command(
            "<database> -o >folder",
            (
                ("--doi 12", "--doi"),
                ("--title a\x07b", "--title"),
                ("-o .", "no export"),
                ("-o good.h5", "good.h5"),
            ),
        ),
        "estimate": Command("<scene>", (("--ranks 0", "--ranks"), ("--ranks -3", "--ranks"))),
        "scene": Command(
            "<surface> -o >new-scene --side 9",
            (
                *(each for each in SURFACE if each[0].split()[0] not in {"--level", "--crop"}),
                ("--like good.npy", "--like"),
                ("--hardness 5", "--hardness 5"),
                ("--hardness 0 --young 1", "--hardness"),
                ("--hardness nan --young 1", "--hardness"),
                ("--young 1 --young 2 --poisson 0.3", "--poisson"),
                ("--channel 7", "channel"),
                ("--level plane", "--level"),
                ("missing/*.x3p", "missing"),
                ("[", "["),
            ),
        ),
    },
    "learn": {
        "fit": Command("<database> -o >file", (*COMPARED, ("--from missing", "missing"))),
        "grow": Command(
            "<scene> -o >file",
            (
                ("--nmae 0", "--nmae"),
                ("--nmae nan", "--nmae"),
                ("--budget soon", "soon"),
                ("--rows 3", "--rows"),
                ("--target nothing", "nothing"),
                ("--target area,area", "area,area"),
                ("--features papers", "papers"),
                ("--blocks 7", "7"),
                ("--features paper --blocks 65", "--blocks 65"),
                ("--model forest", "forest"),
                ("--seed -1", "--seed"),
                ("--young 1", "--young"),
                ("--e-star 0", "--e-star"),
                ("-o good.h5", "good.h5"),
            ),
        ),
        "card": Command("<surrogate>"),
        "predict": Command("<surrogate> <surface> --side 9 --delta 1 -o >file", ASKED),
        "law": Command(
            "<surrogate> <surface> --side 9 --delta 1:2:3 --csv >file --header >file.h",
            (
                *ASKED,
                ("--pressure high", "high"),
                ("--surfaces 1", "--surfaces"),
                ("--boundary open", "open"),
                ("--boundary mirror", "--boundary mirror"),
            ),
        ),
        "compare": Command("<database> -o >folder", COMPARED),
        "tune": Command("<database> -o >folder", (*COMPARED, ("--budget soon", "soon"))),
        "estimate": Command("<database> -o >folder", (*COMPARED, ("--budget -1h", "-1h"))),
        "show": Command("<comparison>"),
        "importance": Command("<database> -o >folder", COMPARED),
        "appendix": Command(
            "<database> -o >folder", tuple(each for each in SELECTION if "--target" not in each[0])
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


def cases(program: str) -> Iterator[Case]:
    """All bad command lines of a program."""
    yield Case([], "command")
    yield Case(["nonsense"], "nonsense")
    yield Case(["--nonsense"], "--nonsense")
    for name, command in COMMANDS[program].items():
        good = command.good.split()
        right = [_right(each) for each in good]
        yield Case([name, *right, "--nonsense"], "--nonsense")
        yield Case([name] if good else [name, "surplus"], "Missing" if good else "surplus")
        for place, each in enumerate(good):
            for bad in _wrong(each):
                arguments = [*right[:place], bad, *right[place + 1 :]]
                yield Case([name, *arguments], bad.split("/")[0][:50])
        for words, word in command.bad:
            yield Case([name, *right, *words.split()], word)
        for option in _numbers(program, name):
            yield Case([name, *right, option, "many"], option)


def _right(token: str) -> str:
    """A token of a good command line."""
    kind, dot, suffix = token[1:].partition(".")
    if token.startswith("<"):
        return INPUTS[kind.removesuffix(">")]
    return OUTPUTS[kind] + dot + suffix if token.startswith(">") else token


def _wrong(token: str) -> list[str]:
    """What must not stand in a token's place."""
    kind = token[1:].partition(".")[0].removesuffix(">")
    if token.startswith("<"):
        return [*BAD_INPUTS, "/dev/zero", "folder"]
    return BAD_OUTPUTS[kind] if token.startswith(">") else []


def _numbers(program: str, name: str) -> Iterator[str]:
    """Options of a command that take a number."""
    [function] = [
        each.callback
        for each in PROGRAMS[program].registered_commands
        if each.callback is not None and each.callback.__name__ == name
    ]
    kinds = get_type_hints(function)
    for option in commands(program)[name].params:
        kind = kinds.get(option.name)
        if {int, float} & {kind, *get_args(kind), *itertools.chain(*map(get_args, get_args(kind)))}:
            yield option.opts[0]
