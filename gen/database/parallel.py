"""The parallel writer: every process of an MPI run writes its own rows."""

import os
import socket
from pathlib import Path
from typing import Any

import h5py

from gen.database.held import HeldFile
from gen.database.opening import open_file
from gen.database.writer import Writer
from gen.runtime.errors import InputError
from gen.scene import Scene


def parallel_hdf5() -> bool:
    """Tell whether h5py and its HDF5 are built with MPI; wheels of the package index are not."""
    return bool(h5py.get_config().mpi)


class ParallelWriter(Writer):
    """A database open for writing on all processes at once; the master holds `lock(path)`.

    Opening and closing are collective calls. In between, every process writes its own rows
    independently.

    Parameters
    ----------
    path : Path
        Database, from `open_or_create` on one process.
    scene : Scene
        Scene of the rows to be written.
    communicator : mpi4py.MPI.Comm
        Processes that write.
    force : bool
        Accept another physics number.

    Raises
    ------
    InputError
        On all processes, if one of them sees another file or cannot open it.
    """

    def __init__(self, path: Path, scene: Scene, communicator: Any, *, force: bool = False) -> None:
        self._communicator = communicator
        super().__init__(path, scene, force=force)

    def _hold(self, path: Path) -> HeldFile:
        """Hold the file; if one process refuses it, all do."""
        _require_one_file(path, self._communicator)
        held, refusal = None, ""
        try:
            held = HeldFile(path)
        except InputError as error:
            refusal = str(error)
        refusals = list(filter(None, self._communicator.allgather(refusal)))
        if held is None or refusals:
            if held is not None:
                held.close()
            raise InputError(refusals[0])
        return held

    def _open(self, path: Path) -> h5py.File:
        """Open the file together with the other processes."""
        file, refusal = None, ""
        try:
            file = open_file(path, writing=True, communicator=self._communicator)
        except InputError as error:
            refusal = str(error)
        refusals = self._communicator.allgather(refusal)
        if file is None and all(refusals):
            raise InputError(refusals[0])
        if any(refusals):  # the processes that have opened it would wait in its closing
            raise RuntimeError("; ".join(filter(None, refusals)))
        return file

    def _abandon(self) -> None:
        """Do nothing, since closing is a collective call of MPI."""

    def _flush(self) -> None:
        """Do nothing: HDF5's flush is a collective call, and there is nothing to flush.

        With MPI-IO, HDF5 buffers no data of contiguous datasets, and MPI-IO passes contiguous
        pieces to the kernel before the call returns, so that the order of writes is kept.
        """


def _require_one_file(path: Path, communicator: Any) -> None:
    """Refuse a path that leads to different files on different machines, or to none."""
    try:
        status = path.stat()
        seen = (status.st_ino, status.st_size) if os.access(path, os.R_OK | os.W_OK) else None
    except OSError:
        seen = None
    everywhere = communicator.allgather((seen, socket.gethostname()))
    for rank, (there, host) in enumerate(everywhere):
        if there is None or there != everywhere[0][0]:
            raise InputError(
                f"{path}: rank {rank} on {host} cannot write the file that rank 0 on "
                f"{everywhere[0][1]} has made; give a path that all machines share, or "
                "--writer single"
            )
