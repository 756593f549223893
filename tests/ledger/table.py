"""The entries of the ledger: reading, writing, and comparing them with new counts."""

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from gen.runtime.errors import InputError
from gen.runtime.files import require_file, write

LEDGER = Path(__file__).with_name("counts.csv")

RISE = 0.02
"""Largest rise of a count of work, relative to the ledger."""

CHANGE = 0.001
"""Largest change of a count of results, relative to the ledger."""

WORK = frozenset({"iterations", "convolutions", "fits", "bytes", "bytes per row"})
"""Counts of work; all further ones are results."""

HEADER = ("item", "count", "value", "reason")


class Key(NamedTuple):
    """The name of an entry: of a calculation, and of what is counted in it."""

    item: str
    quantity: str

    def __str__(self) -> str:
        """Name the entry in messages."""
        return f"{self.item}, {self.quantity}"


class Entry(NamedTuple):
    """A line of the ledger: the count, and the reason of its last change."""

    value: int
    reason: str


Counts = Mapping[Key, int]


def read(path: Path = LEDGER) -> dict[Key, Entry]:
    """Read the ledger, in the order of the file; no entries if there is no file."""
    if not path.exists():
        return {}
    rows = list(csv.reader(io.StringIO(require_file(path).read_text(encoding="utf-8"))))
    try:
        entries = {Key(row[0], row[1]): Entry(int(row[2]), row[3]) for row in rows[1:]}
    except (ValueError, IndexError):
        entries = {}
    if rows[:1] != [list(HEADER)] or not entries:
        raise InputError(f"{path} is no ledger: give lines of {', '.join(HEADER)}")
    return entries


def updated(entries: Mapping[Key, Entry], counts: Counts, reason: str) -> dict[Key, Entry]:
    """Return the entries of new counts; those that have changed get a new reason."""
    return {
        key: entries[key]
        if key in entries and entries[key].value == value
        else Entry(value, reason)
        for key, value in counts.items()
    }


def write_entries(entries: Mapping[Key, Entry], path: Path = LEDGER) -> None:
    """Write the ledger."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows((*key, *entry) for key, entry in entries.items())
    write(path, text.getvalue())


def faults(entries: Mapping[Key, Entry], counts: Counts) -> Iterator[str]:
    """Yield one line for each count that is out of its bound, missing, or unknown."""
    for key in sorted(entries.keys() - counts.keys()):
        yield f"{key}: is in the ledger but was not counted"
    for key, value in counts.items():
        if key not in entries:
            yield f"{key}: {value} is not in the ledger"
            continue
        was = entries[key].value
        change = (value - was) / max(was, 1)
        if key.quantity in WORK and change > RISE:
            yield f"{key}: rises from {was} to {value} ({change:+.1%}, at most {RISE:+.0%})"
        if key.quantity not in WORK and abs(change) > CHANGE:
            yield f"{key}: changes from {was} to {value} (at most {CHANGE:.1%} either way)"


def text_table(entries: Mapping[Key, Entry], counts: Counts) -> str:
    """Return a table of all counts beside those of the ledger."""
    lines = [f"{'item':45}{'count':>30}{'ledger':>9}{'now':>9}{'change':>8}"]
    for key, value in counts.items():
        was = entries[key].value if key in entries else None
        change = "" if was in {None, value} else f"{value / max(was or 1, 1) - 1:+.1%}"
        told = "-" if was is None else was
        lines.append(f"{key.item:45}{key.quantity:>30}{told:>9}{value:>9}{change:>8}".rstrip())
    return "\n".join(lines)
