"""What a folder of `python -m bench paper` holds, in the paper's order.

Each part of the report leaves its captions in `paper.json`, beside the files that they are about:
what a page shows is what was made.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.files import is_there
from bench.page.content import Absent, Content, Figure, Table, Words
from gen.runtime.errors import InputError
from gen.runtime.output import write

RECORD = "paper.json"

ORDER: Mapping[str, tuple[str, str]] = {
    "numbers": ("numbers in the text", "any of the options of python -m bench paper"),
    "levels": ("random midpoint displacement", "python -m bench paper"),
    "profile": ("a profile and its statistics", "python -m bench paper"),
    "topographies": ("topography against contact pressure", "python -m bench paper"),
    "hertz": ("Hertz", "python -m bench paper"),
    "solve-times": ("solve times", "python -m bench paper"),
    "distributions": ("the database's distributions", "python -m bench paper"),
    "table-1": ("Table 1", "python -m bench paper"),
    "table-2": ("Table 2", "python -m bench paper"),
    "table-3": (
        "Table 3",
        "python -m learn tune, its folder as --comparison of python -m bench paper",
    ),
    "baselines": (
        "predictions and scores of the baselines",
        "python -m learn compare, its folder as --comparison of python -m bench paper",
    ),
    "tuned": (
        "predictions of the tuned models",
        "python -m learn tune, its folder as --comparison of python -m bench paper",
    ),
    "table-4": (
        "Table 4",
        "python -m learn compare, its folder as --comparison of python -m bench paper",
    ),
    "fine": ("the finer grid and Table 5", "python -m bench paper"),
    "cost": (
        "total cost and break-even point",
        "python -m bench cost, its folder as --cost of python -m bench paper",
    ),
    "appendix": ("Appendix A", "python -m bench paper"),
}
"""The parts in the paper's order: what each is about, and how to get it where it is missing."""

PATHS = {"picture", "data"}


def contents(folder: Path) -> list[Content]:
    """List what a folder holds.

    Parameters
    ----------
    folder : `-o` of `python -m bench paper`

    Returns
    -------
    For each part, in the paper's order, what it shows, or that it is absent

    Raises
    ------
    InputError
        If the folder's record cannot be read.
    """
    made = record(folder)
    found: list[Content] = []
    for name, (what, how) in ORDER.items():
        shown = whole(folder, made.get(name))
        found += shown if shown else [Absent(what, how)]
    return found


def record(folder: Path) -> dict[str, dict[str, Any]]:
    """Read what the parts have left, by name; nothing for a new folder."""
    path = folder / RECORD
    try:
        made = json.loads(path.read_text(encoding="utf-8"))
        return {name: made[name] for name in ORDER if name in made}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path} cannot be read: {error}: delete it, all is made anew") from None


def keep(folder: Path, name: str, key: str, shown: list[Content]) -> None:
    """Remember what a part shows, and what it was made of."""
    made = record(folder)
    made[name] = {"key": key, "contents": [_packed(folder, each) for each in shown]}
    write(folder / RECORD, json.dumps(made, indent=1) + "\n")


def whole(folder: Path, part: dict[str, Any] | None) -> list[Content]:
    """What a part shows; nothing unless all of its files are there."""
    shown = [_unpacked(folder, each) for each in (part or {}).get("contents", [])]
    return shown if all(is_there(path) for each in shown for path in files_of(each)) else []


def files_of(content: Content) -> list[Path]:
    """Pictures and tables of a content."""
    if isinstance(content, Figure):
        return [content.picture, *content.data]
    return [content.data] if isinstance(content, Table) else []


KINDS = {kind.__name__: kind for kind in (Figure, Table, Words, Absent)}


def _packed(folder: Path, content: Content) -> dict[str, Any]:
    """A content as JSON has it, its files relative to the folder."""

    def plain(value: Any) -> Any:
        if isinstance(value, Path):
            return value.relative_to(folder).as_posix()
        return [plain(each) for each in value] if isinstance(value, tuple) else value

    return {"kind": type(content).__name__} | {k: plain(v) for k, v in vars(content).items()}


def _unpacked(folder: Path, packed: dict[str, Any]) -> Content:
    """The content that `_packed` was given."""
    values = {name: value for name, value in packed.items() if name != "kind"}
    for name, value in values.items():
        if isinstance(value, list):
            values[name] = tuple(folder / each if name in PATHS else each for each in value)
        elif name in PATHS:
            values[name] = folder / value
    content: Content = KINDS[packed["kind"]](**values)
    return content
