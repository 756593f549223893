"""Export of databases to open formats, which anybody can read without this program."""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gen.database import Reader
from gen.export import description, parquet_files
from gen.export.description import About
from gen.runtime.errors import InputError
from gen.runtime.files import lock_folder, make_folder, write
from gen.runtime.terminal import RunProgress
from gen.schema import Status


class Exported(NamedTuple):
    """The outcome of an export: rows written and left out, and the size of all files [bytes]."""

    rows: int
    left_out: int
    size_bytes: int


def export(reader: Reader, folder: Path, about: About) -> Exported:
    """Write the done rows of a database as Parquet, with a card and Croissant's description.

    The folder is new, empty, or an export of this database, which is continued or renewed. Raise
    InputError if it holds something else, there are no done rows, or the disk is full.
    """
    with lock_folder(folder):
        parquet_files.require_own_folder(folder, reader)
        done = np.asarray(reader.column("status") == Status.DONE)  # a run may go on meanwhile
        if not done.any():
            raise InputError(f"{reader.path} has no done rows to export")
        pieces = parquet_files.pieces(reader)
        if len(pieces) > 1:
            make_folder(folder / parquet_files.FIELDS)
        with RunProgress(sum(len(piece.rows) for piece in pieces), "rows") as progress:
            for piece in pieces:
                advance = partial(progress.advance, failed=0)
                parquet_files.write(piece, folder, reader, done, advance)
        write(folder / description.SCENE_NAME, description.scene_text(reader))
        write(folder / description.CARD_NAME, description.card(reader, about, done))
        croissant = description.describe(reader, about, folder, pieces)
        write(folder / description.CROISSANT_NAME, croissant)
        size = sum(path.stat().st_size for path in folder.rglob("[!.]*") if path.is_file())
        return Exported(int(done.sum()), int((~done).sum()), size)
