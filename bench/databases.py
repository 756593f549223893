"""The databases that the reports rest on, generated or given."""

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

PAPER = "paper"  # preset that all surrogates of the reports are trained on
# Of databases to be tested on: the preset's own seed would give them the surfaces trained on.
OTHER_SEED = 2026


def generated(folder: Path, name: str, text: str) -> Path:
    """Return a complete database of a scene (TOML): generate the rows that the folder's file lacks.

    A KeyboardInterrupt is raised after a signal: the same command goes on.
    """
    scene, path = folder / f"{name}.toml", folder / f"{name}.h5"
    make_folder(folder)  # which files of maps start from
    # With the source of a function.
    wanted = completed(Scene.parse(text, str(scene), folder), folder)
    if path.exists():
        with Reader(path) as reader:
            if reader.scene.fingerprint() != wanted.fingerprint():
                raise InputError(
                    f"{path}: is a database of another scene; move it away:",
                    differences(reader.scene, wanted),
                )
            status = reader.column("status", 0, wanted.samples)
        if len(status) == wanted.samples and (status != Status.PENDING).all():
            return path
    write(scene, text)
    remark(f"generating {path}: {wanted.samples} rows")
    if generate_database(str(scene), path, World()).signal:
        remark(f"{path}: interrupted; the same command goes on")
        raise KeyboardInterrupt
    return path


def of_the_paper(given: Path | None, folder: Path, rows: int) -> Path:
    """Return the database to train on: the preset's first rows, or the one given.

    One of another scene is refused: its surrogates would be at home elsewhere.
    """
    if given is None:
        return generated(folder, PAPER, f"samples = {rows}\n")
    with Reader(given) as reader:
        preset = load(PAPER).model_copy(update={"store": reader.scene.store})
        different = differences(reader.scene, preset)
        whole = reader.rows == range(reader.scene.samples)
    if not whole:
        raise InputError(
            f"--database {given}: is a part; python -m gen merge makes it whole"
        )
    if different:
        raise InputError(
            f"--database {given}: give one of the paper preset ({different[0]})"
        )
    return given
