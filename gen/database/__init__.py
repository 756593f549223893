"""Databases: HDF5 files, readable as netCDF-4, in which a killed run resumes.

A file has one contiguous dataset per column of `gen.schema`, allocated and filled when the file is
created, so that writing rows changes no metadata: whenever a writer is killed, the file opens
again, and a row with status done is whole. (The order of writes guarantees this for killed
processes, not for a machine that loses power.) A part has the same columns for some rows of its
scene, and two attributes that say which rows.

HDF5's own file locks are not used: they fail on network file systems and would shut out readers.
`lock` keeps writers apart by name. A run writes only into the file that it has opened (`HeldFile`):
if that is replaced, moved or overwritten meanwhile, the run ends.

A `Writer` is one process, or all processes of an MPI run together, if h5py is built with MPI. Both
write the same file, and either continues the work of the other.
"""

from gen.database.creation import Opened, create, merge, open_or_create
from gen.database.reader import Counts, Reader, is_database
from gen.database.writer import Writer, coherent, parallel_hdf5
from gen.runtime.files import lock

__all__ = [
    "Counts",
    "Opened",
    "Reader",
    "Writer",
    "coherent",
    "create",
    "is_database",
    "lock",
    "merge",
    "open_or_create",
    "parallel_hdf5",
]
