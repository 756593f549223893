"""The house as the manual shows it: the rooms with their sizes, and the walks through them."""

import ast
import json
import subprocess
import sys
from functools import cache
from os.path import relpath
from pathlib import Path

from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "_build" / "walks"
COLOURS = {"asperity": "#8c6bb1", "bem": "#d95f0e", "gen": "#3182bd", "learn": "#31a354"}
ROW, STEP = 0.21, 0.3  # inches between modules, and from a module to those that it enters


def rooms(package: str, _: list[str], __: Path) -> str:
    """Return a table of a package's rooms: files, lines, and what they are for."""
    home = ROOT / package
    lines = ["| where | files | lines | what for |", "|---|---|---|---|"]
    for room in sorted(home.rglob("__init__.py")):
        folder, files = room.parent, list(room.parent.glob("*.py"))
        docstring = ast.get_docstring(ast.parse(room.read_text("utf-8"))) or ""
        about = " ".join(docstring.partition("\n\n")[0].split())
        count = sum(len(path.read_text("utf-8").splitlines()) for path in files)
        where = folder.name
        lines.append(f"| `{where}/` | {len(files)} | {count:,} | {about} |")
    return "\n".join(lines)


@cache
def walks() -> dict[str, list[tuple[str, str, int]]]:
    """Trace the walks anew: their modules with those that enter them, and their functions."""
    script = [sys.executable, str(ROOT / "docs" / "extensions" / "walks.py")]
    done = subprocess.run(script, capture_output=True, text=True, check=True)
    traced: dict[str, list[tuple[str, str, int]]] = json.loads(
        done.stdout.splitlines()[-1]
    )
    return traced


def walk(name: str, _: list[str], page: Path) -> str:
    """Draw a walk, and return what shows it on a page in a folder."""
    modules = walks()[name]
    PICTURES.mkdir(parents=True, exist_ok=True)
    picture = PICTURES / f"{name}.svg"
    drawn(modules).savefig(picture)
    functions = sum(number for _, _, number in modules)
    words = f"{len(modules)} modules, {functions} functions"
    return f"{words}:\n\n![{words}]({relpath(picture, page)})"


def drawn(modules: list[tuple[str, str, int]]) -> Figure:
    """Draw modules as a tree, each below the one that enters it first, with its functions."""
    order = _depth_first(modules, "", 0)
    figure = Figure((7, ROW * len(order) + 0.1), facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.1, 7), ylim=(-ROW * len(order), 0))
    axes.axis("off")
    places = {}
    for row, (module, level, by, functions) in enumerate(order):
        x, y = STEP * level, -ROW * (row + 0.5)
        places[module] = x, y
        if by:
            x_above, y_above = places[by]
            axes.plot(
                [x_above + 0.08, x_above + 0.08, x],
                [y_above - 0.07, y, y],
                color="0.7",
                lw=0.8,
            )
        colour = COLOURS[module.partition("/")[0]]
        axes.plot(x + 0.08, y, "s", color=colour, ms=5)
        axes.text(x + 0.2, y, module, va="center", size=8.5, color=colour)
        axes.text(6.9, y, str(functions), va="center", ha="right", size=8.5, color="0.4")
    return figure


def _depth_first(
    modules: list[tuple[str, str, int]], by: str, level: int
) -> list[tuple[str, int, str, int]]:
    """Return the modules that one enters, each followed by those that it enters itself."""
    found = []
    for module, parent, functions in modules:
        if parent == by:
            found.append((module, level, by, functions))
            found += _depth_first(modules, module, level + 1)
    return found
