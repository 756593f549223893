"""Small databases: scenes, blocks of rows, processes of their own, and looks with h5py alone."""

import textwrap
from pathlib import Path

import h5py
import numpy as np
from launch import python

from gen import cli, database, schema
from gen.database import Writer, create
from gen.database.reader import checksums_of
from gen.scene import Scene, columns_for
from gen.schema import Reason, Status
from gen.surface import DisplacedSurface


def deterministic_bytes(path: Path) -> dict[str, bytes]:
    """Bytes of every column that the scene alone decides: all but the group of times."""
    with h5py.File(path, "r", locking=False) as file:
        return {
            name: dataset[:].tobytes()
            for name, dataset in file.items()
            if isinstance(dataset, h5py.Dataset) and "long_name" in dataset.attrs
        }


def status(path: Path) -> np.ndarray:
    """The status of every row."""
    with h5py.File(path, "r", locking=False) as file:
        return file["status"][:]


def has_begun(path: Path) -> bool:
    """Whether a run that is under way has finished a row; look again if not.

    HDF5 checks the sums of the headers it reads, and a writer may be rewriting one of them.
    """
    try:
        return bool((status(path) != 0).any())
    except (
        OSError
    ):  # not there yet, or met in the midst of a write: the caller looks again
        return False


NO_ROOM = """
    import resource, signal, sys
    from pathlib import Path
    import numpy as np
    from gen.runtime.errors import InputError
    from gen.database import *
    from gen.scene import Scene
    def forbid_growth_beyond(size):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    path = Path(sys.argv[1])
    try:
        {action}
    except InputError as error:
        print(error)
"""


def without_checksums(monkeypatch):
    """Have databases made as older versions made them."""
    monkeypatch.setattr(
        database.creation, "stored_columns", lambda scene, **_: columns_for(scene)
    )


def seal(path):
    """Give all rows of a database the checksums of the bytes that they have now."""
    with h5py.File(path, "r+", locking=False) as file:
        columns = {
            name: dataset[:]
            for name, dataset in file.items()
            if isinstance(dataset, h5py.Dataset) and "long_name" in dataset.attrs
        }
        del columns["checksum"]
        file["checksum"][:] = checksums_of(columns)


PHYSICS = schema.PHYSICS  # before a test raises it


def run(script, *arguments):
    """Run a script in a process of its own."""
    return python("-c", textwrap.dedent(script), *arguments)


def small(samples=10, **keys):
    return Scene(samples=samples, surface=DisplacedSurface(nodes=5), **keys)


def block(scene, start, stop, status=Status.DONE):
    """Values that tell the row and the column; any scene's."""
    values = {}
    for number, column in enumerate(columns_for(scene)):
        rows = np.arange(start, stop) * 100.0 + number
        shape = column.shape(stop - start, scene.shape)
        field = np.broadcast_to(rows.reshape(-1, *[1] * (len(shape) - 1)), shape)
        values[column.name] = field.astype(column.dtype)
    values["status"] = np.full(stop - start, status, dtype="u1")
    values["reason"] = np.full(
        stop - start, Reason.NOT_CONVERGED if status == Status.FAILED else 0, dtype="u1"
    )
    return values


def filled(path, scene, *runs):
    """Create a database with finished rows: (start, stop, status)."""
    create(path, scene)
    with Writer(path, scene) as writer:
        for start, stop, status in runs:
            writer.write_block(start, stop, block(scene, start, stop, status))
    return path


def database_of(folder: Path, text: str, name: str = "rows", *options: str) -> Path:
    """Run a scene, by its text, in a folder; return the path of the database."""
    (folder / f"{name}.toml").write_text(textwrap.dedent(text), encoding="utf-8")
    path = folder / f"{name}.h5"
    assert cli.main(["run", str(folder / f"{name}.toml"), "-o", str(path), *options]) == 0
    return path


def raise_physics(monkeypatch):
    """Have a version of the code that computes other results."""
    for module in (database.creation, database.layout, database.opening):
        monkeypatch.setattr(module, "PHYSICS", PHYSICS + 1)
