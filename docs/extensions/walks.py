"""The modules that the main paths pass, in the order in which a path enters them.

`python docs/extensions/walks.py` prints them as JSON, with the number of functions that a path
passes in each; the manual draws them.
"""

import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import numpy as np

NAMES = ("heights", "scene", "fit", "predict", "law")
"""The walks; each uses what those before it have made."""

STEEL = ["--young", "210e3", "--poisson", "0.3"]
COMMANDS = {
    "scene": ["gen", "run", "tiny.toml", "-o", "tiny.h5"],
    "fit": ["learn", "fit", "tiny.h5", "--model", "kernel-ridge", "-o", "tiny.surrogate"],
    "predict": [
        *("learn", "predict", "tiny.surrogate", "surface.npy", "--side", "1000"),
        *("--delta", "5:25:5", *STEEL),
    ],
    "law": [
        *(
            "gen",
            "law",
            "surface.npy",
            "--side",
            "1000",
            "--despike",
            "7",
            "--level",
            "plane",
        ),
        *(
            "--fill",
            "--pressure",
            "1:1000:8:log",
            *STEEL,
            "--hardness",
            "2000",
            "-o",
            "law",
        ),
    ],
}
"""Arguments of `asperity`; heights are solved in Python."""

MADE = {"scene": "tiny.h5", "fit": "tiny.surrogate*", "law": "law*"}
"""Files that a walk makes."""

PACKAGES = ("asperity", "bem", "gen", "learn")
COROUTINE_OR_GENERATOR = 0x20
UNNAMED = {"<module>", "<genexpr>", "<listcomp>", "<dictcomp>", "<setcomp>", "<lambda>"}


class Passed(NamedTuple):
    """A module that a walk passes."""

    module: str
    entered_by: str  # the module that enters it first; "" for the first one
    functions: int  # number of its functions that the walk passes


def modules_of(walk: Callable[[], None]) -> list[Passed]:
    """Trace what a walk calls of ours, and return the modules in the order of their entry."""
    root = str(Path(__file__).parents[2]) + os.sep
    entered: dict[str, str] = {}
    functions: set[tuple[str, str]] = set()
    stack: list[str] = []

    def look(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event not in {"call", "return"} or not code.co_filename.startswith(root):
            return
        module = code.co_filename[len(root) :]
        hidden = code.co_name in UNNAMED or code.co_flags & COROUTINE_OR_GENERATOR
        if Path(module).parts[0] not in PACKAGES or hidden:
            return
        if event == "call":
            entered.setdefault(module, stack[-1] if stack else "")
            stack.append(module)
        elif stack:
            stack.pop()
        functions.add((module, getattr(code, "co_qualname", code.co_name)))

    sys.setprofile(look)
    try:
        walk()
    finally:
        sys.setprofile(None)
    passed = Counter(module for module, _ in functions)
    return [Passed(module, by, passed[module]) for module, by in entered.items()]


def run(name: str) -> None:
    """Do what a walk does, once, in the current folder."""
    import bem
    from asperity.command import main

    if name == "heights":
        bem.solve(np.load("surface.npy"), 1000.0, 19.0)
        return
    for old in Path().glob(MADE.get(name, "none")):
        old.unlink()
    sys.argv = ["asperity", *COMMANDS[name]]
    code = main()
    assert code == 0, f"{name}: exit code {code}"


def walk_all() -> dict[str, list[Passed]]:
    """Walk every path twice in the current folder, and trace the second time."""
    from gen.surface import generate

    heights = generate("diamond-square", 129, 0.7, 12.0, np.random.default_rng(0))
    np.save("surface.npy", heights)
    Path("tiny.toml").write_text("samples = 120\n[surface]\nnodes = 33\n")
    walks = {}
    for name in NAMES:
        run(name)
        walks[name] = modules_of(partial(run, name))
    return walks


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])
    with tempfile.TemporaryDirectory() as empty:
        os.chdir(empty)
        sys.stdout.write(json.dumps(walk_all()) + "\n")
