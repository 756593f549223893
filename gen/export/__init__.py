"""Export of databases to open formats, which anybody can read without this program.

The columns become Parquet files (`gen.export.rows`). A card in Markdown for readers and Croissant's
JSON-LD for catalogues describe the dataset (`gen.export.description`).
"""

from dataclasses import dataclass
from pathlib import Path

from gen.database import Reader
from gen.export.description import About as About
from gen.export.description import card, croissant, scene_text
from gen.export.rows import (
    FIELDS,
    ROWS,
    DoneRows,
    identity,
    origin_of,
    pieces,
    write_piece,
)
from gen.runtime.errors import InputError
from gen.runtime.files import inside, lock_folder, make_folder, write
from gen.runtime.terminal import RunProgress

# names of files in the folder of an export
CARD_NAME = "README.md"
SCENE_NAME = "scene.toml"
CROISSANT_NAME = "croissant.json"


@dataclass(frozen=True)
class Exported:
    """Numbers about an export that has been written."""

    rows: int  # number of exported rows
    left_out: int  # number of other rows of the database, which are failed or pending
    size: int  # size of all files in the folder, without hidden ones [bytes]


def export(reader: Reader, folder: Path, about: About) -> Exported:
    """Write the done rows of a database as Parquet, with its scene, a card and a Croissant file.

    If the folder holds an export of this database, only Parquet files that are missing, incomplete
    or out of date are written. The folder is locked meanwhile, and a line on standard error shows
    the progress.

    Parameters
    ----------
    reader : Reader
        The database. A run may be adding rows to it.
    folder : Path
        A new or empty folder, or a folder with an export of this database.
    about : About
        Bibliographic data.

    Returns
    -------
    Exported
        Numbers of rows, and the size of the folder.

    Raises
    ------
    InputError
        If the folder holds other files, another process has locked it, the database has no done
        rows, or a file cannot be written.
    """
    with lock_folder(folder):
        _refuse_foreign(folder, reader)
        done = DoneRows.of(reader)
        if done.number == 0:
            raise InputError(f"{reader.path} has no done rows to export")
        files = pieces(reader)
        if len(files) > 1:  # There are fields, besides the table of all rows.
            make_folder(inside(folder, FIELDS))
        with RunProgress(sum(len(piece.rows) for piece in files), "rows") as progress:
            for piece in files:
                write_piece(piece, folder, reader, done, progress)
        write(inside(folder, SCENE_NAME), scene_text(reader))
        write(inside(folder, CARD_NAME), card(reader, about, done))
        write(inside(folder, CROISSANT_NAME), croissant(reader, about, folder, files))
        return Exported(
            rows=done.number,
            left_out=done.is_done.size - done.number,
            size=_size_of(folder),
        )


def _refuse_foreign(folder: Path, reader: Reader) -> None:
    """Raise InputError unless a folder is empty or holds an export of this database."""
    if all(path.name.startswith(".asperity") for path in folder.iterdir()):
        return  # The folder is empty, apart from its lock and unfinished files.
    origin = origin_of(folder / ROWS)
    if not origin:
        raise InputError(f"{folder} is not empty and no export: give a new folder")
    if not identity(reader).items() <= origin.items():
        raise InputError(
            f"{folder} holds the export of another database: give a new folder"
        )


def _size_of(folder: Path) -> int:
    """Return the size of all files in a folder and its folders, without hidden ones [bytes]."""
    files = [path for path in folder.rglob("[!.]*") if path.is_file()]
    return sum(path.stat().st_size for path in files)
