"""Write TOML with a comment above each key."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable
from typing import NamedTuple

from gen.runtime.errors import InputError
from gen.scene.words import one_line

WIDTH = 96
"""Largest length of a line of comments."""


class Key(NamedTuple):
    """A key of a scene, or a comment alone.

    Attributes
    ----------
    comment : str
        Why the key has its value.
    name : str
        Name of the key, [name] of a table, or "" of a comment alone.
    value : str
        Value in TOML's notation; tables have none.
    """

    comment: str
    name: str = ""
    value: str = ""


def document(keys: Iterable[Key]) -> str:
    """Write keys with their comments, an empty line before each comment and each table."""
    lines: list[str] = []
    for key in keys:
        comments = [
            f"# {line}".rstrip()
            for paragraph in key.comment.splitlines()
            for line in _wrapped(one_line(paragraph))
        ]
        opens = key.name.startswith("[")
        if lines and (opens or (comments and not lines[-1].startswith("["))):
            lines.append("")
        lines += comments
        if key.name:
            lines.append(key.name if opens else f"{key.name} = {key.value}")
    return "\n".join(lines) + "\n"


def _wrapped(paragraph: str) -> list[str]:
    """Wrap a paragraph, but not a command, which is indented."""
    if paragraph.startswith("    "):
        return [paragraph]
    return textwrap.wrap(paragraph, WIDTH, break_long_words=False)


def quoted(text: str) -> str:
    """Write a text in TOML's notation.

    Raises
    ------
    InputError
        If the text holds bytes that are no UTF-8, as some names of files do.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{text!r}: a scene is UTF-8, in which this name cannot be written; rename the file"
        ) from None
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def number(value: float) -> str:
    """Write a number in TOML's notation, with all its digits."""
    return repr(float(value))


def span(low: float, high: float) -> str:
    """Write a range in TOML's notation."""
    return f"[{number(low)}, {number(high)}]"


def rounded(value: float, digits: int = 2) -> float:
    """Round a number to some significant digits."""
    return float(f"{value:.{digits}g}")
