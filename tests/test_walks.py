"""How many modules and functions of ours the main paths pass, and how deep.

`python tests/test_walks.py` prints the counts of today. Lower `MOST` whenever they go down.
"""

import json
import os
import subprocess
import sys
import tempfile
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
    "heights": Counts(11, 94, 9),  # heights to the pressure on a free patch
    "scene": Counts(46, 341, 27),  # a scene to the rows of a database
    "fit": Counts(43, 242, 24),  # a database to a surrogate
    "predict": Counts(30, 170, 18),  # a surrogate and a map to a prediction
    "law": Counts(47, 327, 25),  # a map to its contact law
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


class Walk:
    """Counts what is called inside a `with` block."""

    def __enter__(self) -> "Walk":
        self._root = str(Path(__file__).parents[1]) + os.sep
        self._modules: set[str] = set()
        self._functions: set[tuple[str, str]] = set()
        self._on_stack = self._depth = 0
        sys.setprofile(self._look)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)

    def _look(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event not in {"call", "return"} or not code.co_filename.startswith(self._root):
            return
        module = code.co_filename[len(self._root) :]
        hidden = code.co_name in UNNAMED or code.co_flags & COROUTINE_OR_GENERATOR
        if Path(module).parts[0] not in PACKAGES or hidden:
            return
        if event == "return":
            self._on_stack = max(0, self._on_stack - 1)
            return
        self._on_stack += 1
        self._depth = max(self._depth, self._on_stack)
        self._modules.add(module)
        self._functions.add((module, getattr(code, "co_qualname", code.co_name)))

    @property
    def counts(self) -> Counts:
        """What was counted."""
        return Counts(len(self._modules), len(self._functions), self._depth)


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


def walk_all() -> dict[str, Counts]:
    """Walk every path twice in the current folder, and count the second time."""
    from gen.surface import generate

    heights = generate("diamond-square", 129, 0.7, 12.0, np.random.default_rng(0))
    np.save("surface.npy", heights)
    Path("tiny.toml").write_text("samples = 120\n[surface]\nnodes = 33\n")
    found = {}
    for name in MOST:
        run(name)
        with Walk() as walk:
            run(name)
        found[name] = walk.counts
    return found


@pytest.fixture(scope="module")
def counted() -> Any:
    """Counts of a fresh process, whose caches no other test has filled."""
    pytest.importorskip("sklearn")
    done = subprocess.run(
        [sys.executable, __file__],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", MOST)
def test_a_main_path_passes_few_rooms(counted: Any, name: str) -> None:
    counts = Counts(*counted[name])
    over = [each for each in Counts._fields if getattr(counts, each) > getattr(MOST[name], each)]
    assert not over, f"{name}: {counts}, and at most {MOST[name]}"


if __name__ == "__main__":
    sys.path[0] = str(
        Path(__file__).parents[1]
    )  # not tests/, whose folders have our packages' names
    with tempfile.TemporaryDirectory() as empty:
        os.chdir(empty)
        walked = walk_all()
    sys.stdout.write(json.dumps(walked) + "\n")
    sys.stdout.flush()
