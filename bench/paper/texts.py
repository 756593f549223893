"""Captions of the paper's report, and why ours differs: the texts of `texts.toml`, filled in."""

import math
from pathlib import Path
from typing import Any

from bench.contents import Figure, Table
from bench.files import read_toml
from bench.picture import save

DIGITS = 4  # significant digits of numbers in tables that people read

TEXTS = {
    kind: {name: " ".join(text.split()) for name, text in texts.items()}
    for kind, texts in read_toml("paper/texts").items()
}


def why(name: str, **values: Any) -> str:
    """Say why a number differs from the paper's."""
    return TEXTS["why"][name].format(**values)


def caption(name: str, **values: Any) -> str:
    """Return the caption of a picture or a table."""
    return TEXTS["captions"][name].format(**values)


def picture(
    folder: Path, name: str, drawn: Any, *data: Path, shows: str = "", **values: Any
) -> Figure:
    """Save a figure under a name; its caption is that of the name, or the one that it `shows`."""
    return Figure(save(drawn, folder / f"{name}.png"), caption(shows or name, **values), data=data)


def table(data: Path, shows: str = "", **values: Any) -> Table:
    """Show a table with the caption of its file's name, or another one."""
    return Table(data, caption(shows or data.stem, **values))


def ratio(ours: float, theirs: float) -> str:
    """Write our number over the paper's."""
    if not theirs or math.isnan(ours) or math.isnan(theirs):
        return ""
    times = ours / theirs
    return f"x {times:.3g}" if times >= 0.1 else f"1/{1 / times:,.0f}"
