"""How many modules and functions of ours the main paths pass, and how deep.

`python tests/test_walks.py` prints the counts of today, and the modules in the order in which a
path enters them, which the manual draws. Lower `MOST` whenever counts go down.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
import pytest

pytestmark = pytest.mark.long


class Counts(NamedTuple):
    """What a walk passes: modules, functions, and frames of ours on the stack at most."""

    modules: int
    functions: int
    depth: int


MOST = {
    "heights": Counts(8, 49, 8),  # heights to the pressure on a free patch
    "scene": Counts(29, 178, 18),  # a scene to the rows of a database
    "fit": Counts(26, 125, 15),  # a database to a surrogate
    "predict": Counts(15, 60, 9),  # a surrogate and a map to a prediction
    "law": Counts(32, 180, 18),  # a map to its contact law, with the error of its area
}
"""Most of each that a walk may pass."""

STEEL = ["--young", "210e3", "--poisson", "0.3"]
COMMANDS = {
    "scene": ["gen", "run", "tiny.toml", "-o", "tiny.h5"],
    "fit": ["learn", "fit", "tiny.h5", "--model", "kernel-ridge", "-o", "tiny.surrogate"],
    "predict": [
        *("learn", "predict", "tiny.surrogate", "surface.npy", "--side", "1000"),
        *("--delta", "5:25:5", *STEEL),
    ],
    "law": [
        *("gen", "law", "surface.npy", "--side", "1000", "--despike", "7", "--level", "plane"),
        *("--fill", "--pressure", "1:1000:8:log", *STEEL, "--hardness", "2000", "-o", "law"),
    ],
}
"""Arguments of `asperity`; each walk uses what those before it have made."""

MADE = {"scene": "tiny.h5", "fit": "tiny.surrogate*", "law": "law*"}
"""Files that a walk makes."""

PACKAGES = ("asperity", "bem", "gen", "learn")
COROUTINE_OR_GENERATOR = 0x20
UNNAMED = {"<module>", "<genexpr>", "<listcomp>", "<dictcomp>", "<setcomp>", "<lambda>"}


class Walk(NamedTuple):
    """What a walk passes."""

    counts: Counts
    modules: list[tuple[str, str, int]]  # each with the one that enters it, and its functions


def walked_through(walk: Callable[[], None]) -> Walk:
    """Trace what a walk calls of ours."""
    root = str(Path(__file__).parents[1]) + os.sep
    entered, functions, stack, depth = {}, set(), [], 0

    def look(frame: FrameType, event: str, _: object) -> None:
        nonlocal depth
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
            depth = max(depth, len(stack))
        elif stack:
            stack.pop()
        functions.add((module, getattr(code, "co_qualname", code.co_name)))

    sys.setprofile(look)
    try:
        walk()
    finally:
        sys.setprofile(None)
    passed = Counter(module for module, _ in functions)
    rooms = [(module, by, passed[module]) for module, by in entered.items()]
    return Walk(Counts(len(rooms), len(functions), depth), rooms)


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


def walk_all() -> dict[str, Walk]:
    """Walk every path twice in the current folder, and trace the second time."""
    from gen.surface import generate

    heights = generate("diamond-square", 129, 0.7, 12.0, np.random.default_rng(0))
    np.save("surface.npy", heights)
    Path("tiny.toml").write_text("samples = 120\n[surface]\nnodes = 33\n")
    found = {}
    for name in MOST:
        run(name)
        found[name] = walked_through(partial(run, name))
    return found


@pytest.fixture(scope="module")
def walked() -> Any:
    """Walks of a fresh process, whose caches no other test has filled."""
    pytest.importorskip("sklearn")
    command = [sys.executable, __file__]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", MOST)
def test_a_main_path_passes_few_rooms(walked, name):
    counts = Counts(*Walk(*walked[name]).counts)
    over = [each for each in Counts._fields if getattr(counts, each) > getattr(MOST[name], each)]
    assert not over, f"{name}: {counts}, and at most {MOST[name]}"


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])  # tests/ has folders of our packages' names
    with tempfile.TemporaryDirectory() as empty:
        os.chdir(empty)
        sys.stdout.write(json.dumps(walk_all()) + "\n")
