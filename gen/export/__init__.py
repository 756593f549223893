"""Export of databases to open formats, which anybody can read without this program.

The columns become files of Parquet (`gen.export.rows`). A card in Markdown and Croissant's JSON-LD
for catalogues say what the dataset is (`gen.export.description`).
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

CARD_NAME = "README.md"  # name of the card in the folder of an export
SCENE_NAME = "scene.toml"  # name of the scene
CROISSANT_NAME = "croissant.json"  # name of Croissant's description


@dataclass(frozen=True)
class Exported:
    """What an export has written."""

    rows: int  # number of rows in it
    left_out: int  # number of rows of the database that are failed or pending
    size: int  # of all files in the folder [bytes]


def export(reader: Reader, folder: Path, about: About) -> Exported:
    """Write the done rows of a database as Parquet, with a card and Croissant's description.

    An export of the same database is continued, or renewed if the database has grown; its whole
    files are kept. The folder is locked meanwhile, and a line on standard error shows the progress.

    Parameters
    ----------
    reader : Reader
        The database, which a run may be writing.
    folder : Path
        A new or empty folder, or one with an export of this database.
    about : About
        Bibliographic data.

    Returns
    -------
    Exported
        Numbers of rows, and the size of the folder.

    Raises
    ------
    InputError
        If the folder holds something else or is at work, there are no done rows, or a file cannot
        be written.
    """
    with lock_folder(folder):
        _refuse_foreign(folder, reader)
        done = DoneRows.of(reader)
        if done.number == 0:
            raise InputError(f"{reader.path} has no done rows to export")
        files = pieces(reader)
        if len(files) > 1:
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
    """Refuse a folder with files unless they are an export of this database."""
    if all(path.name.startswith(".asperity") for path in folder.iterdir()):
        return
    origin = origin_of(folder / ROWS)
    if not origin:
        raise InputError(f"{folder} is not empty and no export: give a new folder")
    if not identity(reader).items() <= origin.items():
        raise InputError(
            f"{folder} holds the export of another database: give a new folder"
        )


def _size_of(folder: Path) -> int:
    """Return the size of all files in a folder but hidden ones [bytes]."""
    files = [path for path in folder.rglob("[!.]*") if path.is_file()]
    return sum(path.stat().st_size for path in files)
