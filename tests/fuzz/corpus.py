"""Sound files, made by the commands themselves, and what is done to them once they are damaged."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gen.runtime.errors import InputError
from tests.fuzz.child import run

SCENE = """title = "Sound"
samples = 60
samples_per_surface = 2
seed = 7
[surface]
nodes = 9
hurst = [0.5, 0.8]
sigma0 = [10.0, 15.0]
[delta]
pieces = [{ share = 1.0, range = [5.0, 45.0] }]
[contact]
kernel = "uniform-pressure"
max_iterations = 1000
[store]
mean_gap = true
"""

PATIENCE = 300.0
"""Seconds that a command may take while the sound files are made."""

Command = tuple[str, ...]


@dataclass(frozen=True)
class Kind:
    """Patterns of files to damage, commands for them (VICTIM), and what these need beside."""

    victims: tuple[str, ...]
    commands: tuple[Command, ...]
    beside: tuple[str, ...] = ()


LEARN = ("--model", "decision-tree", "--target", "area")
SURFACE = ("surface.npy", "--side", "100")

KINDS: dict[str, Kind] = {
    "scene": Kind(
        ("scene.toml",),
        (
            ("gen", "run", "VICTIM", "-o", "new.h5", "--dry-run"),
            ("gen", "run", "VICTIM", "-o", "new.h5", "--rows", "0:2"),
            ("gen", "run", "VICTIM", "-o", "rows.h5"),
            ("gen", "estimate", "VICTIM"),
        ),
        ("rows.h5",),
    ),
    "database": Kind(
        ("rows.h5", "fields.h5"),
        (
            ("gen", "info", "VICTIM"),
            ("gen", "check", "VICTIM", "--recompute", "2"),
            ("gen", "plot", "VICTIM", "-o", "new.png"),
            ("gen", "merge", "VICTIM", "-o", "new.h5"),
            ("gen", "run", "scene.toml", "-o", "VICTIM"),
            ("gen", "run", "scene.toml", "-o", "VICTIM", "--retry-failed"),
            ("gen", "run", "longer.toml", "-o", "VICTIM"),
            ("learn", "fit", "VICTIM", "-o", "new.surrogate", *LEARN),
            ("learn", "compare", "VICTIM", "-o", "new", *LEARN),
            ("learn", "law", "tree.surrogate", "VICTIM", "--delta", "5:10:3", "--surfaces", "2"),
        ),
        ("scene.toml", "longer.toml", "tree.surrogate"),
    ),
    "surrogate": Kind(
        ("tree.surrogate", "ridge.surrogate", "boosted.surrogate"),
        (
            ("learn", "card", "VICTIM"),
            ("learn", "predict", "VICTIM", *SURFACE, "--delta", "1,2", "-o", "new.csv"),
            ("learn", "law", "VICTIM", *SURFACE, "--delta", "1:9:3", "--header", "new.h"),
            ("learn", "fit", "rows.h5", "-o", "VICTIM", *LEARN),
        ),
        ("surface.npy", "rows.h5"),
    ),
    "surface": Kind(
        ("surface.npy", "surface.txt"),
        (
            ("gen", "describe", "VICTIM", "--side", "100"),
            ("gen", "contact", "VICTIM", "--side", "100", "--delta", "1", "--csv", "new.csv"),
            ("gen", "contact", "VICTIM", "--side", "100", "--pressure", "0:0.1:3", "--fill"),
            ("gen", "describe", "VICTIM", "--side", "100", "--against", "VICTIM", "--shift", "9,0"),
            ("learn", "predict", "tree.surrogate", "VICTIM", "--side", "100", "--delta", "1"),
        ),
        ("tree.surrogate",),
    ),
    "comparison": Kind(
        ("found/area/comparison.json", "found/area/*/*.json*", "found/area/*/*-tree.csv"),
        (
            ("learn", "show", "found", "--no-pictures"),
            ("learn", "show", "found"),
            ("learn", "fit", "rows.h5", "-o", "new.surrogate", "--from", "found", *LEARN),
            ("learn", "compare", "rows.h5", "-o", "found", *LEARN),
            ("learn", "tune", "rows.h5", "-o", "found", "--budget", "1s", *LEARN),
            ("learn", "importance", "rows.h5", "-o", "found", *LEARN),
        ),
        ("found", "rows.h5"),
    ),
    "page": Kind(
        ("page/hertz/*.json", "page/hertz/*.csv"),
        (("bench", "page", "page"),),
        ("page",),
    ),
}

MADE: tuple[Command, ...] = (
    ("gen", "run", "scene.toml", "-o", "rows.h5"),
    ("gen", "run", "fields.toml", "-o", "fields.h5", "--rows", "0:4"),
    ("learn", "fit", "rows.h5", "-o", "tree.surrogate", "--model", "decision-tree"),
    ("learn", "fit", "rows.h5", "-o", "ridge.surrogate", "--model", "kernel-ridge"),
    ("learn", "fit", "rows.h5", "-o", "boosted.surrogate", "--model", "xgboost"),
    ("learn", "compare", "rows.h5", "-o", "found", *LEARN),
    ("learn", "tune", "rows.h5", "-o", "found", "--budget", "2s", *LEARN),
    ("bench", "run", "hertz", "-o", "page"),
)
"""The commands that make the sound files, in this order."""


def make(folder: Path, kinds: tuple[str, ...] = tuple(KINDS)) -> None:
    """Write the sound files of some kinds into an empty folder, by the commands that make them."""
    fields = SCENE.replace("samples = 60", "samples = 6") + "heights = true\npressure = true\n"
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    (folder / "longer.toml").write_text(SCENE.replace("60", "64"), encoding="utf-8")
    (folder / "fields.toml").write_text(fields, encoding="utf-8")
    heights = np.random.default_rng(3).normal(size=(9, 9))
    np.save(folder / "surface.npy", heights)
    np.savetxt(folder / "surface.txt", heights, fmt="%.4f")
    needed = [name for kind in kinds for name in KINDS[kind].victims + KINDS[kind].beside]
    wanted = {"rows.h5", *(name.partition("/")[0] for name in needed)}
    for command in MADE:
        if command[command.index("-o") + 1] in wanted:
            ended = run(command, folder, PATIENCE, memory=None)
            if ended.code:
                raise InputError(f"{' '.join(command)} fails: {ended.errors.strip()}")
