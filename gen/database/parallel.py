"""The parallel writer: every process of an MPI run writes the rows that it has computed."""

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
    """Whether this h5py and its HDF5 are built with MPI; no wheel of the package index is."""
    return bool(h5py.get_config().mpi)


class ParallelWriter(Writer):
    """A database open for writing on all processes at once; the master holds `lock(path)`.

    Opening and closing are collective: every process of the communicator has to do both. Between
    them each process writes its own rows by itself, and nothing else changes in the file.

    Parameters
    ----------
    path : the database, from `open_or_create` on one process
    scene : what is being generated
    communicator : of mpi4py, the processes that write
    force : see `open_or_create`

    Raises
    ------
    InputError
        On every process alike, if one of them does not see the same file or it cannot be opened.
    """

    def __init__(self, path: Path, scene: Scene, communicator: Any, *, force: bool = False) -> None:
        self._communicator = communicator
        super().__init__(path, scene, force=force)

    def _hold(self, path: Path) -> HeldFile:
        """Lock the file on the master; refused on every process alike."""
        _require_one_file(path, self._communicator)
        held, refusal = None, ""
        try:
            held = HeldFile(path, locking=self._communicator.rank == 0)
        except InputError as error:
            refusal = str(error)
        refusals = [each for each in self._communicator.allgather(refusal) if each]
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
        if any(refusals):  # some have opened it and would wait for the others to close it
            raise RuntimeError("; ".join(filter(None, refusals)))
        return file

    def _abandon(self) -> None:
        """Do nothing: MPI has the file open, and closing it is collective."""

    def _flush(self) -> None:
        """Do nothing: HDF5's flush is collective, and it has nothing to hand over.

        With MPI-IO it buffers no data of contiguous datasets, and MPI-IO hands each contiguous
        piece to the kernel before the call returns. So the order of the writes is kept.
        """


def _require_one_file(path: Path, communicator: Any) -> None:
    """Refuse a path that leads to different files on different machines, or to none."""
    try:
        found = path.stat()
        seen = (found.st_ino, found.st_size) if os.access(path, os.R_OK | os.W_OK) else None
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
