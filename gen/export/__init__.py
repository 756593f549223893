"""Export of databases to open formats, which anybody can read without this program."""

from pathlib import Path
from typing import NamedTuple

from gen.database import Reader
from gen.export import description, parquet_files
from gen.export.description import About
from gen.runtime.errors import InputError
from gen.runtime.files import check_folder, lock_folder, make_folder, write
from gen.runtime.terminal import RunProgress


class Exported(NamedTuple):
    """The outcome of an export: rows written and left out, and the size of all files [bytes]."""

    rows: int
    left_out: int
    size_bytes: int


def export(reader: Reader, folder: Path, about: About) -> Exported:
    """Write the done rows of a database as Parquet, with a card and Croissant's description.

    The folder is new, empty, or an export of the same database: an interrupted export goes on with
    the same call, and one of a database that has grown renews the files that have changed. Raise
    InputError if the database has no done rows, the folder holds something else, or the disk is
    full.
    """
    check_folder(folder)
    with lock_folder(folder):
        return _exported(reader, folder, about)


def _exported(reader: Reader, folder: Path, about: About) -> Exported:
    """Write the files of an export into a folder that this process has locked."""
    parquet_files.require_own_folder(folder, reader)
    done = parquet_files.done_rows(reader)
    if not done.any():
        raise InputError(f"{reader.path} has no done rows to export")
    pieces = parquet_files.pieces(reader)
    if parquet_files.fields(reader):
        make_folder(folder / parquet_files.FIELDS)
    with RunProgress(sum(len(piece.rows) for piece in pieces), "rows") as progress:
        for piece in pieces:
            parquet_files.write(piece, folder, reader, done, lambda rows: progress.advance(rows, 0))
    rows = int(done.sum())
    write(folder / description.SCENE_NAME, description.scene_text(reader))
    write(folder / description.CARD_NAME, description.card(reader, about, rows))
    croissant = description.describe(reader, about, description.words(reader), folder, pieces)
    write(folder / description.CROISSANT_NAME, croissant)
    size = sum(path.stat().st_size for path in folder.rglob("[!.]*") if path.is_file())
    return Exported(rows, len(done) - rows, size)
