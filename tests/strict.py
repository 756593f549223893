"""Readers that are stricter than most: numbers are finite, JSON is that of RFC 8259."""

import csv
import json
import math
import re
from pathlib import Path

NO_NUMBERS = {"nan", "inf", "-inf", "infinity", "-infinity", "none"}


def json_of(path):
    """Content of a JSON file, whose numbers are all finite and whose names differ."""

    def refuse(text):
        raise AssertionError(f"{path}: {text} is no JSON")

    def unique(pairs):
        names = [name for name, _ in pairs]
        assert len(set(names)) == len(names), f"{path}: {names}"
        return dict(pairs)

    def number(text):
        assert math.isfinite(float(text)), f"{path}: {text}"
        return float(text)

    text = Path(path).read_text(encoding="utf-8")
    found = json.loads(
        text, parse_constant=refuse, object_pairs_hook=unique, parse_float=number
    )
    json.dumps(found, ensure_ascii=False).encode()  # fails for halves of characters
    return found


def rows_of(path):
    """Rows of a CSV file: as many cells in each, names that differ, no word for no number."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        names, *rows = csv.reader(file, strict=True)
    assert len(set(names)) == len(names), f"{path}: {names}"
    assert all(names)
    for row in rows:
        assert len(row) == len(names), f"{path}: {row}"
        assert not NO_NUMBERS & {cell.lower() for cell in row}, f"{path}: {row}"
    return [dict(zip(names, row, strict=True)) for row in rows]


def markdown_of(path):
    """Text of a Markdown file without raw HTML outside code, and without control characters."""
    text = Path(path).read_text(encoding="utf-8")
    plain = re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)
    assert not re.search(r"<(?!https?://)[A-Za-z/!?]", plain), path
    assert not set(text) & {chr(code) for code in range(32)} - {"\n"}, path
    return text
