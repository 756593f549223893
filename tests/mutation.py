"""`python -m tests.mutation`: sixty small faults, put into the code one by one; are they caught?

Each is applied to a copy of the tree. The tests that mirror its module run first, then those of its
package, then the others of `make test` (with --all, all tests), until one fails.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from gen.runtime import command_line, farm

ROOT = Path(__file__).resolve().parents[1]

SLOW = 900
"""Seconds after which tests count as hanging, which catches a fault too."""

FAULTS: dict[str, tuple[tuple[str, str], ...]] = {
    "bem/influence.py": (
        ("total += sign_x * sign_y * corner", "total += sign_x * corner"),
        ("return total * (aspect / np.pi)", "return total / np.pi"),
        ("square_along = (x + node_x) ** 2", "square_along = (x + 0.5 * node_x) ** 2"),
        (
            "table[0, 0] = aspect / (np.pi * radius)",
            "table[0, 0] = aspect / (2 * radius)",
        ),
    ),
    "bem/contact.py": (
        (
            "along = wrapped[:, :-1]\n            across = wrapped[:-1]",
            "along = wrapped[:-1]\n            across = wrapped[:, :-1]",
        ),
        ("crossed_along_x * dy", "crossed_along_x * dx"),
        (
            "gap: Field = self.displacement - inter",
            "gap: Field = self.displacement + inter",
        ),
        ("np.maximum(interference - self", "np.maximum(interference + self"),
        (
            "np.flatnonzero((self.pressure > 0) & ~yielded)",
            "np.flatnonzero(self.pressure > 0)",
        ),
        ("return 2 * low / (1 + low / high)", "return low / (1 + low / high)"),
    ),
    "bem/solving.py": (
        (
            "cell_area = problem.spacing[0] * problem.spacing[1]",
            "cell_area = problem.spacing[0] ** 2",
        ),
        ("np.abs(contact.gap), -contact.gap)", "np.abs(contact.gap), contact.gap)"),
        ("not contact.residual <= problem.rtol", "contact.residual > problem.rtol"),
        (
            "equilibrium.length / problem.spacing[0]",
            "equilibrium.length / problem.spacing[1]",
        ),
    ),
    "bem/problem.py": (
        (
            'if boundary == "free" else side / nodes',
            'if boundary != "mirror" else side / nodes',
        ),
        ("* self.spacing[0] / length", "* self.spacing[1] / length"),
    ),
    "bem/active_set.py": (
        (
            "met = progress.largest <= iterate.tolerance",
            "met = progress.largest <= 100 * iterate.tolerance",
        ),
    ),
    "bem/analytic/persson.py": (
        ("shape = gamma + 3 * (1 - gamma)", "shape = gamma + 2 * (1 - gamma)"),
    ),
    "bem/analytic/indenters.py": (
        ("share = 2 * self.exponent /", "share = self.exponent /"),
    ),
    "gen/runtime/files.py": (
        ("        os.fsync(descriptor)\n", ""),
        (
            "if any(_is_same(path, file) for file in input_files):",
            "if path in input_files:",
        ),
        ("_is_same(path, other.path):", "path == other.path:"),
        ('if present_kind not in {kind, ""}:', 'if present_kind == "database":'),
        ("os.fchmod(descriptor, stat.S_IMODE(replaced.st_mode))", "pass"),
        ("fcntl.LOCK_EX | fcntl.LOCK_NB", "fcntl.LOCK_SH | fcntl.LOCK_NB"),
    ),
    "gen/database/writer.py": (
        ("self._held.sync()\n        for rows in unsynced:", "for rows in unsynced:"),
        (
            "status[inside - start] = Status.PENDING",
            "status[inside - start] = Status.DONE",
        ),
        ("(status == Status.DONE) | (status == Status.FAILED)", "status == Status.DONE"),
        (
            "        self.confirm()\n        status = arrays.pop",
            "        status = arrays.pop",
        ),
    ),
    "gen/generation/plan.py": (
        (
            "advance(self.before + offset * self.per_item)",
            "advance(self.before + offset)",
        ),
        (
            "min(stop, (chunk + 1) * self.chunk)",
            "min(stop, (chunk + 1) * self.chunk + 1)",
        ),
        ('borders, pairs[:, 0], side="right")', 'borders, pairs[:, 1], side="right")'),
    ),
    "gen/generation/sample.py": (
        ("    heights -= heights.min()\n    return heights\n", "    return heights\n"),
        ("if not np.isfinite(contact.force):", "if False:"),
    ),
    "gen/scene/tables.py": (("self.modulus / (1 - self.poisson**2)", "self.modulus"),),
    "gen/statistics.py": (
        ("peaks.curvatures.kurtosis - 3.0,", "peaks.curvatures.kurtosis,"),
        ("(dx / dy) ** 2", "dx / dy"),
    ),
    "gen/surface.py": (("2.0 ** (-hurst / 2.0)", "2.0 ** (-hurst)"),),
    "gen/self_affine.py": (("(-1 - self.hurst)", "(-0.5 - self.hurst)"),),
    "gen/maps/prepare.py": (
        ("<= high / spacing + ROUNDING", "<= high / spacing - 1 + ROUNDING"),
        (
            "(heights < below) | (heights > above)",
            "(heights < below) & (heights > above)",
        ),
    ),
    "gen/maps/outliers.py": (("scatter = TO_DEVIATION *", "scatter = 1.0 *"),),
    "gen/maps/library.py": (("if window.symmetry & TRANSPOSED:", "if False:"),),
    "gen/maps/read.py": (
        (
            "self.sides[0] / spacings_x, self.sides[1] / spacings_y",
            "self.sides[0] / spacings_y, self.sides[1] / spacings_x",
        ),
    ),
    "gen/material.py": (("(e / (1 - nu**2))", "(e / (1 + nu**2))"),),
    "gen/runtime/terminal.py": (
        ('character if character.isprintable() else "?"', "character"),
    ),
    "learn/split.py": (
        ("train = shuffled[cut:]", "train = shuffled[cut - 1 :]"),
        ("np.random.default_rng(seed)", "np.random.default_rng(0)"),
    ),
    "learn/metrics.py": (
        ("/ float(np.abs(true).max())", "/ magnitude(true)"),
        ("np.quantile(values, (1 + level) / 2)", "np.quantile(values, level)"),
    ),
    "learn/kernel_ridge.py": (("if reciprocal > EPSILON:", "if reciprocal > 0:"),),
    "learn/surrogate/interval.py": (
        ("/ (self.weights.sum() + 1)", "/ self.weights.sum()"),
        ("weights[order])", "weights)"),
    ),
    "learn/surrogate/learnt.py": (
        ("if hashlib.sha256(body).hexdigest() != head[2].decode():", "if False:"),
        (
            "io.loads(file.archive, trusted=list(REVIEWED))",
            "io.loads(file.archive, trusted=io.get_untrusted_types(data=file.archive))",
        ),
    ),
    "learn/features/surface.py": (
        ("self.first + (self.sizes - 1) / 2", "self.first + self.sizes / 2"),
    ),
    "learn/comparison/fits.py": (
        ("    *lines, _ = files.read_bytes(path)", "    lines = files.read_bytes(path)"),
        ("            self._file.flush()\n", ""),
    ),
    "learn/grow/accuracy.py": (
        ("math.sqrt(number / (number - 1) * squares)", "math.sqrt(squares)"),
    ),
    "learn/comparison/search.py": (
        (
            "means = self.means(self.grid.differing)\n        return max(",
            "means = self.means(self.grid.differing)\n        return min(",
        ),
    ),
}
"""Faults by the files of the code: what stands there once, and what stands there instead."""


class Fault(NamedTuple):
    """A small fault: in a file, some text in the place of another."""

    file: str
    old: str
    new: str


def faults() -> list[Fault]:
    """Return all faults, in the order of the table."""
    return [Fault(file, *pair) for file, pairs in FAULTS.items() for pair in pairs]


def stages(file: str, *, everything: bool) -> list[list[str]]:
    """Return arguments of pytest, for the tests that are run one after the other."""
    package, _, name = file.rpartition("/")
    root = package.partition("/")[0]
    mirror = Path("tests", package, f"test_{name}")
    kinds = "not slurm" if everything else "not long and not slurm and not campaign"
    rest = ["tests", f"--ignore=tests/{root}", "--ignore=tests/test_mutation.py"]
    near = [str(mirror)] if (ROOT / mirror).exists() else []
    return [[*each, "-m", kinds] for each in (near, [f"tests/{root}"], rest) if each]


def is_caught(tree: Path, fault: Fault, *, everything: bool, near: bool) -> bool:
    """Put a fault into a copy of the tree, say whether tests fail, and mend it again."""
    path = tree / fault.file
    sound = path.read_text(encoding="utf-8")
    path.write_text(sound.replace(fault.old, fault.new), encoding="utf-8")
    try:
        wanted = stages(fault.file, everything=everything)
        return any(fail(tree, tests) for tests in (wanted[:-1] if near else wanted))
    finally:
        path.write_text(sound, encoding="utf-8")


def fail(tree: Path, tests: Sequence[str]) -> bool:
    """Run tests in a tree until one fails; say whether one does."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        *tests,
    ]
    alone = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=tree, env=alone, capture_output=True, timeout=SLOW, check=False
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode not in {0, 5}  # 5: there are no such tests


app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def mutation(
    everything: Annotated[
        bool, typer.Option("--all", help="Run the long tests too.")
    ] = False,
    near: Annotated[
        bool, typer.Option(help="Run the tests of a fault's package alone.")
    ] = False,
    only: Annotated[
        str, typer.Option(metavar="TEXT", help="Files whose path holds it.")
    ] = "",
) -> int:
    """Put small faults into the code, one by one, and see whether the tests catch them.

    The exit code is 0 if all are caught, 1 otherwise.
    """
    missed, asked = 0, [fault for fault in faults() if only in fault.file]
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        unwanted = shutil.ignore_patterns(".*", "__pycache__", "build", "_build")
        shutil.copytree(ROOT, tree, ignore=unwanted)
        for number, fault in enumerate(asked, 1):
            began = time.monotonic()
            caught = is_caught(tree, fault, everything=everything, near=near)
            missed += not caught
            typer.echo(
                f"{number:2} {'caught' if caught else 'MISSED'} {time.monotonic() - began:5.0f} s"
                f"  {fault.file}: {' '.join(fault.new.split()) or 'without ' + fault.old.strip()}"
            )
    typer.echo(f"{len(asked) - missed} of {len(asked)} faults caught")
    return 1 if missed else 0


if __name__ == "__main__":
    with farm.process():
        code = command_line.main(app, sys.argv[1:], "mutation", single_process=True)
    sys.exit(code)
