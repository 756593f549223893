"""The databases that the reports rest on, generated or given, and what optional outputs cost."""

import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from bench.report import remark
from gen import database
from gen.database import Reader
from gen.generation.run import generate_database
from gen.generation.sample import compute_rows
from gen.runtime.errors import InputError
from gen.runtime.farm import World
from gen.runtime.files import make_folder, write
from gen.scene import Scene, Store, differences, flags, load
from gen.scene.columns import row_bytes
from gen.schema import Status

PAPER = "paper"  # preset that all surrogates of the reports are trained on
# Of databases to be tested on: the preset's own seed would give them the surfaces trained on.
OTHER_SEED = 2026
SAMPLES = 64  # rows that are computed with and without an optional output

CONCENTRATED = 'samples = 15878\n[contact]\nkernel = "concentrated-force"\n'
"""Scene of the paper's database with the influence coefficients of MIRCO."""


def generated(folder: Path, name: str, text: str) -> Path:
    """Return a complete database of a scene (TOML): generate the rows that the folder's file lacks.

    A KeyboardInterrupt is raised after a signal: the same command goes on.
    """
    scene, path = folder / f"{name}.toml", folder / f"{name}.h5"
    wanted = Scene.parse(text, str(scene))
    if _complete(path, wanted):
        return path
    make_folder(folder)
    write(scene, text)
    remark(f"generating {path}: {wanted.samples} rows")
    if generate_database(str(scene), path, World()).signal:
        remark(f"{path}: interrupted; the same command goes on")
        raise KeyboardInterrupt
    return path


def _complete(path: Path, wanted: Scene) -> bool:
    """Say whether a database of this scene has all the rows that are wanted."""
    if not path.exists():
        return False
    with Reader(path) as reader:
        if reader.scene.fingerprint() != wanted.fingerprint():
            (first, *_) = differences(reader.scene, wanted)
            raise InputError(f"{path}: is a database of another scene ({first}): move it away")
        status = reader.column("status", 0, wanted.samples)
    return bool(len(status) == wanted.samples and (status != Status.PENDING).all())


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
        raise InputError(f"--database {given}: is a part; python -m gen merge makes it whole")
    if different:
        raise InputError(f"--database {given}: give one of the paper preset ({different[0]})")
    return given


def outputs(scene: str, rounds: int) -> list[dict[str, Any]]:
    """Compute and write the first rows of a scene with and without each optional output, in turn.

    Returns
    -------
    list of dict
        For each output of the scene's table [store]: the median of the additional processor time
        [ms per sample], smallest, middle and largest ratio of the times, additional bytes.
    """
    plain = load(scene)
    compute_rows(plain, 0, 8)  # plans and tables are made before the clock starts
    costs = []
    for name in flags():
        asked = plain.model_copy(update={"store": Store.model_validate({name: True})})
        pairs = [(_seconds(plain), _seconds(asked)) for _ in range(rounds)]
        ratios = [with_it / without for without, with_it in pairs]
        costs.append(
            {
                "column": name,
                "more_ms": 1e3 * median(b - a for a, b in pairs) / SAMPLES,
                "ratio": median(ratios),
                "ratio_low": min(ratios),
                "ratio_high": max(ratios),
                "bytes": row_bytes(asked) - row_bytes(plain),
            }
        )
    return costs


def _seconds(scene: Scene) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "outputs.h5"
        database.create(path, scene.model_copy(update={"samples": SAMPLES}))
        with database.Writer(path, scene) as writer:
            began = time.process_time()
            writer.write_block(0, SAMPLES, compute_rows(scene, 0, SAMPLES))
            return time.process_time() - began
