"""The databases of the reports, which are generated unless the user gives one."""

from importlib.resources import files
from pathlib import Path

from bench.report import remark
from gen.database import Reader
from gen.generation.completion import completed
from gen.generation.run import generate_database
from gen.runtime.errors import InputError
from gen.runtime.farm import World
from gen.runtime.files import make_folder, write
from gen.scene import Scene, differences, load
from gen.schema import Status

PAPER = "paper"
"""Name of the paper preset."""

OTHER_SEED = 2026
"""Seed of databases that test surrogates. With the preset's own seed, surrogates would be tested on
the surfaces that trained them."""


def generated(folder: Path, name: str, text: str) -> Path:
    """Return the complete database of a scene; generate the rows that are missing.

    The scene is written beside the database. Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the scene (NAME.toml) and of the database (NAME.h5). It is made if it is missing.
        Paths in the scene are relative to it.
    name : str
        Name of both files without ending.
    text : str
        The scene (TOML).

    Returns
    -------
    Path
        The database. Rows may have failed, but none is pending.

    Raises
    ------
    InputError
        If the file is a database of another scene.
    KeyboardInterrupt
        If a signal interrupted the generation. The next call continues it.
    """
    scene_path = folder / f"{name}.toml"
    path = folder / f"{name}.h5"
    make_folder(folder)
    scene = completed(Scene.parse(text, str(scene_path), folder), folder)
    if path.exists() and _is_complete(path, scene):
        return path
    write(scene_path, text)
    remark(f"generating {path}: {scene.samples} rows")
    if generate_database(str(scene_path), path, World()).signal:
        remark(f"{path}: interrupted; the same command goes on")
        raise KeyboardInterrupt
    return path


def _is_complete(path: Path, scene: Scene) -> bool:
    """Return whether no row of a database is pending.

    Raises InputError if it is a database of another scene.
    """
    with Reader(path) as reader:
        if reader.scene.fingerprint() != scene.fingerprint():
            raise InputError(
                f"{path}: is a database of another scene; move it away:",
                differences(reader.scene, scene),
            )
        status = reader.column("status", 0, scene.samples)
    return len(status) == scene.samples and bool((status != Status.PENDING).all())


def preset_text(name: str) -> str:
    """Read the scene of a preset, without its title and its numbers of rows.

    Parameters
    ----------
    name : str
        Name of the preset.

    Returns
    -------
    str
        Text of the scene (TOML), to which a line with `samples` can be prepended.
    """
    path = files("gen") / "scenes" / f"{name}.toml"
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith(("title", "samples")))


def of_the_paper(database: Path | None, folder: Path, rows: int) -> Path:
    """Return the database of the paper preset that trains the surrogates of a report.

    Parameters
    ----------
    database : Path or None
        The database that the user gave; None to generate one.
    folder : Path
        Folder of a generated database.
    rows : int
        Number of the preset's first rows that are generated. It does not limit a given database.

    Returns
    -------
    Path
        The given or the generated database.

    Raises
    ------
    InputError
        If the given database is not of the paper preset, or is only a part of a database.
    KeyboardInterrupt
        If a signal interrupted the generation.
    """
    if database is None:
        return generated(folder, PAPER, f"samples = {rows}\n")
    with Reader(database) as reader:
        # Fields that are stored besides the results of rows make no difference.
        preset = load(PAPER).model_copy(update={"store": reader.scene.store})
        different = differences(reader.scene, preset)
        is_whole = reader.rows == range(reader.scene.samples)
    if not is_whole:
        raise InputError(
            f"--database {database}: is a part; asperity gen merge makes it whole"
        )
    if different:
        raise InputError(
            f"--database {database}: give one of the paper preset ({different[0]})"
        )
    return database
