"""Databases: HDF5 files, readable as netCDF-4, in which a killed run resumes.

One contiguous dataset per column of `gen.schema`, allocated and filled when the file is created,
so that writing rows changes no metadata: whatever the moment at which a writer is killed, the
file opens again, and a row whose status says done is whole. (The order of writes that guarantees
it holds for killed processes, not for a machine that loses power.) A part has the same columns for
some rows of its scene only, and two more attributes that say which. HDF5's own file locks are not
used: they fail on network file systems and would shut out readers; `lock` keeps writers apart by
name, `HeldFile` by device and inode. What a run writes is the file that it has opened: one that is
replaced, moved or overwritten meanwhile ends the run, and is left as it is.

Two writers keep one contract. `Writer` is one process, `ParallelWriter` all processes of an MPI
run together, where h5py is built with MPI. They write the same file, and either goes on with what
the other has left.
"""

from gen.database.creation import Opened, create, extend, open_or_create
from gen.database.disk import coherent
from gen.database.merging import merge
from gen.database.opening import Counts
from gen.database.parallel import ParallelWriter, parallel_hdf5
from gen.database.reader import Reader, is_database
from gen.database.writer import Writer
from gen.runtime.lock import lock

__all__ = [
    "Counts",
    "Opened",
    "ParallelWriter",
    "Reader",
    "Writer",
    "coherent",
    "create",
    "extend",
    "is_database",
    "lock",
    "merge",
    "open_or_create",
    "parallel_hdf5",
]
