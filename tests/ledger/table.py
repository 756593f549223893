"""The entries of the ledger: reading, writing, and comparing them with new counts."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
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
    """The name of an entry.

    Attributes
    ----------
    item : str
        Name of the calculation.
    quantity : str
        Name of the count.
    """

    item: str
    quantity: str

    def __str__(self) -> str:
        """Name the entry in messages."""
        return f"{self.item}, {self.quantity}"


Counts = Mapping[Key, int]


@dataclass(frozen=True)
class Entry:
    """A line of the ledger.

    Attributes
    ----------
    value : int
        The count.
    reason : str
        Why it has this value: the reason of its last change.
    """

    value: int
    reason: str


def read(path: Path = LEDGER) -> dict[Key, Entry]:
    """Read the ledger.

    Parameters
    ----------
    path : Path
        File of the ledger.

    Returns
    -------
    dict of Entry
        Entries in the order of the file; none if there is no file.

    Raises
    ------
    InputError
        If the file is no ledger.
    """
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
    """Return the entries of new counts; those that have changed get a new reason.

    Parameters
    ----------
    entries : mapping of Entry
        The ledger so far.
    counts : mapping of int
        New counts.
    reason : str
        Why they differ.
    """
    result = {}
    for key, value in counts.items():
        entry = entries.get(key, Entry(value - 1, ""))
        result[key] = entry if entry.value == value else replace(entry, value=value, reason=reason)
    return result


def write_entries(entries: Mapping[Key, Entry], path: Path = LEDGER) -> None:
    """Write the ledger.

    Parameters
    ----------
    entries : mapping of Entry
        All entries.
    path : Path
        File to write.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows((*key, entry.value, entry.reason) for key, entry in entries.items())
    write(path, text.getvalue())


def faults(entries: Mapping[Key, Entry], counts: Counts) -> Iterator[str]:
    """Yield one line for each count that is out of its bound, missing, or unknown.

    Parameters
    ----------
    entries : mapping of Entry
        The ledger.
    counts : mapping of int
        New counts.
    """
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
    """Return a table of all counts beside those of the ledger.

    Parameters
    ----------
    entries : mapping of Entry
        The ledger.
    counts : mapping of int
        New counts.
    """
    rows: list[Sequence[str]] = [("item", "count", "ledger", "now", "change")]
    for key, value in counts.items():
        was = entries[key].value if key in entries else None
        change = "" if was in {None, value} else f"{value / max(was or 1, 1) - 1:+.1%}"
        rows.append((*key, "-" if was is None else str(was), str(value), change))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if place < 2 else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    )
