"""`python -m bench publish`: the results of a run in the form in which they are in the repository.

The tables, words, records and shown pictures of all finished parts are copied, large tables
compressed. Databases, surrogates and what the commands printed stay behind.
"""

import lzma
from collections.abc import Iterator, Sequence
from pathlib import Path

from bench.contents import Figure
from bench.files import COMPRESSED
from bench.record import NOT_READ, RECORD, Inputs, read
from bench.report import Part
from gen.runtime.errors import InputError
from gen.runtime.files import lock_folder, make_folder, write
from learn.comparison.folder import KINDS as OF_EACH_ROW

LARGE = 200_000  # bytes from which on a table is compressed
KINDS = frozenset({".csv", ".json", ".jsonl", ".toml", ".txt"})
# Folders inside of a part's that are not published.
INSIDE = frozenset({*OF_EACH_ROW, "databases", "decks", "maps", "predictions"})


def publish(parts: Sequence[Part], inputs: Inputs, target: Path) -> list[Path]:
    """Copy what a run has made into the folder of published results; return the files written.

    A folder all of whose parts were made loses its earlier files.

    An InputError is raised if there is nothing to publish, the folders are not apart, a part was
    not finished, or another process writes the folder. Then nothing is changed.
    """
    folders: dict[Path, list[Part]] = {}
    for part in parts:
        folders.setdefault(inputs.folder(part), []).append(part)
    for folder in (inputs.output, *folders):
        source, goal = folder.resolve(), target.resolve()
        if source.is_relative_to(goal) or goal.is_relative_to(source):
            raise InputError(f"{target}: {folder} is read, give a folder apart from it")
    with lock_folder(target):
        new: dict[Path, bytes] = {}
        gone: set[Path] = set()
        for folder, those in folders.items():
            made = [part for part in those if _finished(part, inputs)]
            home = target / (those[0].folder or those[0].name)
            new |= {home / name: content for name, content in _published(made, folder)}
            if len(made) == len(those):
                gone |= {path for path in home.rglob("*") if path.is_file()}
        if not new:
            raise InputError(
                f"{inputs.output} holds no finished part: `python -m bench run` makes it"
            )
        for path in gone - new.keys():
            path.unlink()
        for path, content in new.items():
            make_folder(path.parent)
            if path.suffix == COMPRESSED:
                path.unlink(missing_ok=True)
            write(path, content, "picture" if path.suffix == ".png" else "text")
        return sorted(new)


def _finished(part: Part, inputs: Inputs) -> bool:
    """Say whether a part was made; one that was not finished is refused."""
    path = inputs.path(part)
    record = read(path)
    if record is not None and not record.finished:
        raise InputError(f"{path}: {part.name} was not finished (code {record.code})")
    return record is not None


def _published(made: Sequence[Part], folder: Path) -> Iterator[tuple[Path, bytes]]:
    """Yield the names, from a part's folder on, and contents of the files to publish."""
    shown = [content for part in made for content in part.show(folder)]
    pictures = {content.picture for content in shown if isinstance(content, Figure)}
    for path in sorted(folder.rglob("*")) if made else ():
        name = path.relative_to(folder)
        own = f"{path.parent.name}/{path.name}" != "area/rows.csv" and not (
            path.name.endswith(NOT_READ) and not path.name.endswith(RECORD)
        )
        wanted = path in pictures or (path.suffix in KINDS and own)
        if path.is_file() and wanted and not INSIDE.intersection(name.parts[:-1]):
            content = path.read_bytes()
            if path.suffix == ".jsonl" or (
                path.suffix == ".csv" and len(content) >= LARGE
            ):
                yield name.with_name(name.name + COMPRESSED), lzma.compress(content)
            else:  # where the folder lay tells readers nothing
                yield name, content.replace(bytes(folder.resolve().parent), b"report")
