"""Look at databases with h5py alone, as any reader of the file could."""

from pathlib import Path

import h5py
import numpy as np


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
    except OSError:  # not there yet, or met in the midst of a write: the caller looks again
        return False
