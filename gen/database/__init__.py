"""Databases: HDF5 files, readable as netCDF-4, in which a killed run resumes.

A file has one contiguous dataset per column, allocated and filled at once, so that writing rows
changes no metadata: whenever a writer is killed, or the power is cut, the file opens again, and a
row with status done is whole. A checksum for each row shows what a disk has changed since. HDF5's
own locks are not used, as they fail on network file systems: `lock` keeps writers apart by name,
and a run writes only into the file that it has opened (`HeldFile`). A `Writer` is one process, or
all processes of an MPI run together; either continues the work of the other.
"""

from gen.database.creation import create as create
from gen.database.creation import file_bytes as file_bytes
from gen.database.creation import merge as merge
from gen.database.creation import open_or_create as open_or_create
from gen.database.reader import Counts as Counts
from gen.database.reader import Reader as Reader
from gen.database.writer import Writer as Writer
from gen.database.writer import coherent as coherent
from gen.database.writer import parallel_hdf5 as parallel_hdf5
from gen.runtime.files import lock as lock
