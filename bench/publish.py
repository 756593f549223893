"""`asperity bench publish`: copy the results of a run into the folder that the repository keeps.

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
"""Size from which a table is compressed [byte]."""

KINDS = frozenset({".csv", ".json", ".jsonl", ".toml", ".txt"})
"""Suffixes of the files that are published, besides the pictures that a report shows."""

LEFT_OUT = frozenset({*FOLDERS_OF_RESULTS, "databases", "decks", "maps", "predictions"})
"""Names of folders inside the folder of a part that are not published."""


@dataclass(frozen=True)
class PartsOfFolder:
    """The parts that share a folder."""

    folder: Path  # the folder in the run, or that of the comparison
    published: Path  # the same folder among the published results
    parts: list[Part]
    finished: list[Part]  # the parts of this list that were made and finished


def publish(parts: Sequence[Part], inputs: Inputs, target: Path) -> list[Path]:
    """Copy the results of a run into the folder of published results.

    Earlier files are deleted in each published folder whose parts were all made. In other folders,
    earlier files of the same name are replaced.

    Parameters
    ----------
    parts : sequence of Part
        All parts. Parts that were not made are skipped.
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
                f"{inputs.output} holds no finished part: `asperity bench run` makes it"
            )
        for path in _earlier_files(folders) - files.keys():
            path.unlink()
        _write_files(files)
        return sorted(files)


def _require_apart(folders: Sequence[Path], target: Path) -> None:
    """Raise InputError if the target contains a folder that is read, or is inside one of them."""
    published = target.resolve()
    for folder in folders:
        source = folder.resolve()
        if source.is_relative_to(published) or published.is_relative_to(source):
            raise InputError(f"{target}: {folder} is read, give a folder apart from it")


def _parts_of_folder(
    folder: Path, parts: list[Part], inputs: Inputs, target: Path
) -> PartsOfFolder:
    """Return the parts of a folder and of them the finished ones.

    Raises InputError if one of them was made but not finished.
    """
    return PartsOfFolder(
        folder=folder,
        published=target / (parts[0].folder or parts[0].name),
        parts=parts,
        finished=[part for part in parts if _is_finished(part, inputs)],
    )


def _is_finished(part: Part, inputs: Inputs) -> bool:
    """Return whether a part was made.

    Raises InputError if it was made but not finished.
    """
    path = inputs.path(part)
    record = read(path)
    if record is None:
        return False
    if not record.finished:
        raise InputError(f"{path}: {part.name} was not finished (code {record.code})")
    return True


def _earlier_files(folders: Sequence[PartsOfFolder]) -> set[Path]:
    """Return the published files in all folders whose parts were all made."""
    earlier: set[Path] = set()
    for folder in folders:
        if len(folder.finished) == len(folder.parts):
            earlier |= {path for path in folder.published.rglob("*") if path.is_file()}
    return earlier


def _write_files(files: Mapping[Path, bytes]) -> None:
    """Write files with their contents; make their folders if these are missing."""
    for path, content in files.items():
        make_folder(path.parent)
        if path.suffix == COMPRESSED:
            # `write` would refuse to replace a file that is not text.
            path.unlink(missing_ok=True)
        write(path, content, kind="picture" if path.suffix == ".png" else "text")


def _files_to_publish(folder: PartsOfFolder) -> Iterator[tuple[Path, bytes]]:
    """Yield the files of a folder's finished parts: the published path, and the content.

    Tables from `LARGE` bytes and lines of JSON (.jsonl) are compressed. In other files "report"
    replaces the absolute path of the run's folder, which is of no use to readers.
    """
    run_folder = bytes(folder.folder.resolve().parent)
    for path in _paths_to_publish(folder):
        published = folder.published / path.relative_to(folder.folder)
        content = path.read_bytes()
        is_large_table = path.suffix == ".csv" and len(content) >= LARGE
        if path.suffix == ".jsonl" or is_large_table:
            compressed = published.with_name(published.name + COMPRESSED)
            yield compressed, lzma.compress(content)
        else:
            yield published, content.replace(run_folder, b"report")


def _paths_to_publish(folder: PartsOfFolder) -> Iterator[Path]:
    """Yield the tables, words, records and shown pictures of a folder, sorted by their paths.

    Nothing is yielded if none of its parts was made.
    """
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
    """Return whether a file is a table, words or a record of a part.

    The printed output of a command is not a result, nor is the list of the rows of a comparison.
    """
    is_list_of_rows = path.parts[-2:] == ("area", "rows.csv")
    if path.suffix not in KINDS or is_list_of_rows:
        return False
    is_record = path.name.endswith(RECORD)
    is_output = path.name.endswith(NOT_READ) and not is_record
    return not is_output
