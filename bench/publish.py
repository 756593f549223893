"""`python -m bench publish`: copy the results of a run into the folder that the repository keeps.

Tables, words, records and shown pictures of all finished parts are copied, large tables compressed.
Databases, surrogates and the output of the commands are left out.
"""

import lzma
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.contents import Figure
from bench.files import COMPRESSED
from bench.record import NOT_READ, RECORD, Inputs, read
from bench.report import Part
from gen.runtime.errors import InputError
from gen.runtime.files import lock_folder, make_folder, write
from learn.comparison.folder import KINDS as FOLDERS_OF_RESULTS

LARGE = 200_000
"""Size of the smallest table that is compressed [byte]."""

KINDS = frozenset({".csv", ".json", ".jsonl", ".toml", ".txt"})
"""Endings of the names of files that are published, besides pictures that are shown."""

LEFT_OUT = frozenset({*FOLDERS_OF_RESULTS, "databases", "decks", "maps", "predictions"})
"""Names of folders inside the folder of a part that are not published."""


@dataclass(frozen=True)
class PartsOfFolder:
    """The parts that share a folder."""

    folder: Path  # of the run
    home: Path  # the same folder among the published results
    parts: list[Part]
    finished: list[Part]  # the parts among them that were made


def publish(parts: Sequence[Part], inputs: Inputs, target: Path) -> list[Path]:
    """Copy the results of a run into the folder of published results.

    A folder whose parts were all made loses its earlier files.

    Parameters
    ----------
    parts : sequence of Part
        The parts to publish, those that were not made included.
    inputs : Inputs
        The folders of the run.
    target : Path
        The folder of published results, which is locked meanwhile.

    Returns
    -------
    list of Path
        The written files, sorted.

    Raises
    ------
    InputError
        If no part was made, a part was not finished, the folders overlap, or another process
        writes the target. Nothing is changed then.
    """
    groups: dict[Path, list[Part]] = {}
    for part in parts:
        groups.setdefault(inputs.folder(part), []).append(part)
    _require_apart([inputs.output, *groups], target)
    with lock_folder(target):
        folders = [
            _parts_of_folder(folder, group, inputs, target)
            for folder, group in groups.items()
        ]
        files: dict[Path, bytes] = {}
        for folder in folders:
            files |= dict(_files_to_publish(folder))
        if not files:
            raise InputError(
                f"{inputs.output} holds no finished part: `python -m bench run` makes it"
            )
        for path in _replaced(folders) - files.keys():
            path.unlink()
        _write_files(files)
        return sorted(files)


def _require_apart(folders: Sequence[Path], target: Path) -> None:
    """Raise InputError if a folder that is read is inside the target, or the target inside it."""
    published = target.resolve()
    for folder in folders:
        source = folder.resolve()
        if source.is_relative_to(published) or published.is_relative_to(source):
            raise InputError(f"{target}: {folder} is read, give a folder apart from it")


def _parts_of_folder(
    folder: Path, parts: list[Part], inputs: Inputs, target: Path
) -> PartsOfFolder:
    """Return the parts of a folder; raise InputError if one of them was not finished."""
    return PartsOfFolder(
        folder=folder,
        home=target / (parts[0].folder or parts[0].name),
        parts=parts,
        finished=[part for part in parts if _is_finished(part, inputs)],
    )


def _is_finished(part: Part, inputs: Inputs) -> bool:
    """Say whether a part was made; raise InputError if it was begun and not finished."""
    path = inputs.path(part)
    record = read(path)
    if record is None:
        return False
    if not record.finished:
        raise InputError(f"{path}: {part.name} was not finished (code {record.code})")
    return True


def _replaced(folders: Sequence[PartsOfFolder]) -> set[Path]:
    """Return the published files of all folders whose parts were all made."""
    replaced: set[Path] = set()
    for folder in folders:
        if len(folder.finished) == len(folder.parts):
            replaced |= {path for path in folder.home.rglob("*") if path.is_file()}
    return replaced


def _write_files(files: Mapping[Path, bytes]) -> None:
    """Write files with their contents into folders, which are made if need be."""
    for path, content in files.items():
        make_folder(path.parent)
        if path.suffix == COMPRESSED:
            path.unlink(missing_ok=True)
        write(path, content, "picture" if path.suffix == ".png" else "text")


def _files_to_publish(folder: PartsOfFolder) -> Iterator[tuple[Path, bytes]]:
    """Yield the files of a folder's finished parts: the published path, and the content.

    Large tables and lines of JSON are compressed. In other files "report" replaces the absolute
    path of the run's folder, which is of no use to readers.
    """
    run_folder = bytes(folder.folder.resolve().parent)
    for path in _paths_to_publish(folder):
        published = folder.home / path.relative_to(folder.folder)
        content = path.read_bytes()
        is_large_table = path.suffix == ".csv" and len(content) >= LARGE
        if path.suffix == ".jsonl" or is_large_table:
            compressed = published.with_name(published.name + COMPRESSED)
            yield compressed, lzma.compress(content)
        else:
            yield published, content.replace(run_folder, b"report")


def _paths_to_publish(folder: PartsOfFolder) -> Iterator[Path]:
    """Yield the tables, words, records and shown pictures of a folder's finished parts, sorted."""
    if not folder.finished:
        return
    pictures = _shown_pictures(folder)
    for path in sorted(folder.folder.rglob("*")):
        folders_inside = path.relative_to(folder.folder).parts[:-1]
        if not path.is_file() or LEFT_OUT.intersection(folders_inside):
            continue
        if path in pictures or _is_result(path):
            yield path


def _shown_pictures(folder: PartsOfFolder) -> set[Path]:
    """Return the pictures that the finished parts of a folder show."""
    contents = [
        content for part in folder.finished for content in part.show(folder.folder)
    ]
    return {content.picture for content in contents if isinstance(content, Figure)}


def _is_result(path: Path) -> bool:
    """Say whether a file is a table, words or a record of a part.

    The output of a command is none, and neither is the list of a comparison's rows.
    """
    if path.suffix not in KINDS or path.parts[-2:] == ("area", "rows.csv"):
        return False
    return path.name.endswith(RECORD) or not path.name.endswith(NOT_READ)
