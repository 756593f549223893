"""Databases: HDF5 files, readable as netCDF-4, in which a run that was killed can be continued.

A file has one contiguous dataset for each column. All datasets are allocated and filled when the
file is made, so that writing rows changes no metadata. If a writer is killed or the power is cut,
the file can still be opened, and every row with the status "done" is whole. A checksum for each row
shows later changes of its bytes, for example by a disk.

HDF5's own locks fail on network file systems and are not used. `lock` keeps other writers away from
a path, and a run writes only into the file that it has opened (`HeldFile` in
`gen.database.disk`). A database is written by one process, or by all processes of an MPI run
together. Each of these two kinds of run can continue the work of the other.
"""

from gen.database.creation import create as create
from gen.database.creation import file_bytes as file_bytes
from gen.database.creation import merge as merge
from gen.database.creation import open_or_create as open_or_create
from gen.database.disk import coherent as coherent
from gen.database.reader import Counts as Counts
from gen.database.reader import Reader as Reader
from gen.database.writer import Writer as Writer
from gen.database.writer import parallel_hdf5 as parallel_hdf5
from gen.runtime.files import lock as lock
