"""Read, check, write and lock the files that users name.

Only regular files are read. Outputs that cannot be written are refused before any work is done, and
a file is written whole or not at all. One rule holds for every output of every command: it is never
an input, never another output, and it replaces only a file of its own kind. docs/compatibility.md
lists the promises.
"""

import errno
import fcntl
import hashlib
import os
import re
import stat
import time
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal

from gen.runtime.errors import InputError

Kind = Literal["text", "picture", "surrogate", "heights", "arrays", "maps", "parquet"]
"""Kinds of output besides databases.

"heights" is a NumPy array (.npy), "arrays" a zip archive of NumPy arrays (.npz), "maps" a file of
prepared maps.
"""

Present = Literal["replace", "keep", "refuse"]
"""What happens to a file that already has the name of a new file; see `unfinished`."""

LARGEST = 64 * 2**20
"""Largest size of a file that is read whole [bytes]; files of this program have some kB."""

BEGINNING = 4096
"""Number of first bytes of a file in which its kind is looked for [bytes]."""

TEXT = bytes({7, 8, 9, 10, 12, 13, 27} | set(range(32, 256)))
"""Bytes that texts consist of: some control characters, and all bytes above them.

Nearly every binary file has other bytes in its beginning.
"""

SURROGATE = b"asperity surrogate\n"  # first bytes of a surrogate's file
MAPS = b"asperity prepared maps\n"  # first bytes of a file of prepared maps

SIGNATURES = {
    b"\x89PNG\r\n": "picture",
    b"%PDF-": "picture",
    b"\x89HDF\r\n": "database",
    SURROGATE: "surrogate",
    MAPS: "maps",
    b"\x93NUMPY": "heights",
    b"PAR1": "parquet",
}
"""Kind of a file by its first bytes."""

LOCK_CONTENT = re.compile(rb"host .+, process [0-9]+(, job .+)?, since .+\n?")
"""Content of a lock's file, as `_holder` writes it: it names the process that holds the lock."""

LONGEST_LOCK = 500
"""Largest size of a lock's file [bytes]; a longer file is not a lock of this program."""


def require_file(path: Path) -> Path:
    """Refuse a pipe, a socket or a device, which could block its reader forever.

    Every reader of a user's file calls this first. Folders and missing files are accepted here,
    because opening them raises a clearer error.

    Parameters
    ----------
    path : Path
        Path that a user named.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    InputError
        If something exists under the path that is neither a regular file nor a folder.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # ValueError: the path has a null character
        return path
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(
            f"{path} is a pipe or a device; give a file on a disk, to be read twice"
        )
    return path


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Read a whole regular file.

    Parameters
    ----------
    path : Path
        The file.
    largest : int
        Largest size of a file that is read [bytes].

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    InputError
        If the file is larger than `largest`, is not a regular file, or cannot be read.
    """
    try:
        size = require_file(path).stat().st_size
        if size <= largest:
            return path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    raise InputError(f"{path} has {size} bytes; at most {largest} are read")


def digest(path: Path) -> str:
    """Compute the SHA-256 of a file's content.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    with _in_words(path, "cannot be read"), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class Output:
    """A file that a command is going to write, or an option for one that the user left out."""

    path: Path | None  # None if the user left the option out
    option: str  # option that names the file, such as "--csv", for messages
    kind: Kind = "text"


def check_outputs(outputs: Iterable[Output], inputs: Iterable[Path | str] = ()) -> None:
    """Refuse outputs that cannot be written, before any work is done for them.

    No file is changed. Outputs without a path are skipped.

    Parameters
    ----------
    outputs : iterable of Output
        Files that the command is going to write.
    inputs : iterable of Path or str
        Files and folders that the command reads. All files directly in a folder count as inputs.

    Raises
    ------
    InputError
        If an output cannot be written; if its path or a link leads to an input or to an earlier
        output; or if its path already has a file of another kind.
    """
    input_files = _files_of(inputs)
    earlier: list[Output] = []
    for output in outputs:
        if output.path is None:
            continue
        _refuse_same(output, output.path, input_files, earlier)
        try:
            _output_place(output.path, output.kind)  # called for its errors alone
        except InputError as error:
            raise InputError(f"{output.option} {error}") from None
        earlier.append(output)


def _files_of(inputs: Iterable[Path | str]) -> list[Path]:
    """Return the paths of inputs, where each folder is replaced by the paths directly in it."""
    files: list[Path] = []
    for path in map(Path, inputs):
        if path.is_dir():
            files.extend(path.iterdir())
        else:
            files.append(path)
    return files


def _refuse_same(
    output: Output, path: Path, input_files: Sequence[Path], earlier: Sequence[Output]
) -> None:
    """Refuse an output whose path leads to one of the inputs or to an earlier output.

    `path` is `output.path`, which is not None.
    """
    if any(_is_same(path, file) for file in input_files):
        raise InputError(f"{output.option} {path}: is an input: not replaced")
    for other in earlier:
        if other.path is not None and _is_same(path, other.path):
            raise InputError(
                f"{output.option} {path}: is what {other.option} writes too;"
                " give another name"
            )


def check_folder(folder: Path, *names: str) -> None:
    """Refuse an output folder in which a command could not write its files.

    Neither the folder nor a file is changed.

    Parameters
    ----------
    folder : Path
        Folder that the command is going to write to. The command makes it if there is none.
    *names : str
        Names of the files that the command is going to write there. A name that ends in ".png" is
        that of a picture, any other name that of a text.

    Raises
    ------
    InputError
        If the folder cannot be made or written to, or if a file in it has one of the names and may
        not be replaced.
    """
    real = place_of(folder, folder=True)
    # The folder itself if it exists, otherwise the lowest folder above it that exists.
    nearest = next(parent for parent in (real, *real.parents) if parent.exists())
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{folder} cannot be written: no file can be made in {nearest}")
    if not real.is_dir():
        return
    for name in names:
        kind: Kind = "picture" if name.endswith(".png") else "text"
        _output_place(folder / name, kind)  # called for its errors alone


def make_folder(folder: Path) -> None:
    """Make a folder, and the folders above it, unless they exist.

    Parameters
    ----------
    folder : Path
        The folder. If it is a link, the link stays, and the folder that it leads to is made.

    Raises
    ------
    InputError
        If the folder cannot be made, or a file has its name.
    """
    with _in_words(folder, "cannot be written to"):
        place_of(folder, folder=True).mkdir(parents=True, exist_ok=True)


def followed(path: Path) -> Path:
    """Follow all links of a path.

    `Path.resolve` would not do for a loop of links: in Python 3.13 it returns a path inside the
    loop, and earlier versions raise RuntimeError.

    Parameters
    ----------
    path : Path
        Any path, also one under which nothing exists.

    Returns
    -------
    Path
        Absolute path without links.

    Raises
    ------
    OSError
        If the links form a loop.
    """
    real = Path(os.path.realpath(path))
    try:
        real.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise
    return real


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file in an output folder, unless a link leads out of the folder.

    Parameters
    ----------
    folder : Path
        Folder that a user named.
    name : str
        Name in the folder, chosen by this program. It may be a path such as "data/rows.parquet".

    Returns
    -------
    Path
        `folder / name`.

    Raises
    ------
    InputError
        If the path leads out of the folder, or links form a loop.
    """
    path = folder / name
    with suppress(OSError):  # links form a loop
        if followed(path).is_relative_to(followed(folder)):
            return path
    raise InputError(
        f"{path}: leads out of {folder} by a link: not written; remove the link"
    )


def write(path: Path, content: str | bytes, kind: Kind = "text") -> None:
    """Write a whole file; at any time, the file has either its old content or the new one.

    Parameters
    ----------
    path : Path
        The file. If it is a link, the link stays, and the file that it leads to is written.
    content : str or bytes
        New content. Text is written as UTF-8; letters that UTF-8 cannot hold become "?".
    kind : Kind
        Kind of the content. An existing file is replaced only if it is empty or of this kind.

    Raises
    ------
    InputError
        If the file cannot be written, or an existing file is of another kind. An existing file is
        then unchanged.
    """
    if isinstance(content, str):
        content = content.encode(errors="replace")
    with atomic(path, kind) as file:
        file.write(content)


@contextmanager
def atomic(
    path: Path, kind: Kind = "text", *, replace: bool = True
) -> Iterator[IO[bytes]]:
    """Open a temporary file that takes its final name once the block has succeeded.

    If the block fails, the temporary file is removed.

    Parameters
    ----------
    path : Path
        Final name. If it is a link, the link stays, and the file that it leads to is written.
    kind : Kind
        Kind of the content. An existing file is replaced only if it is empty or of this kind.
    replace : bool
        Whether a file that has the final name when the block ends is replaced. If False, that file
        stays, and the new one is discarded.

    Yields
    ------
    binary file
        Temporary file in the same folder, open for writing.

    Raises
    ------
    InputError
        If the file cannot be written, or an existing file is of another kind. An existing file is
        then unchanged.
    """
    real = _output_place(path, kind)
    present: Present = "replace" if replace else "keep"
    with (
        _in_words(path, "cannot be written"),
        unfinished(real, present) as temporary,
        temporary.open("wb") as file,
    ):
        yield file


@contextmanager
def unfinished(
    real: Path, present: Present = "replace", signature: bytes = b""
) -> Iterator[Path]:
    """Make an empty file beside a target, and give it the target's name once the block succeeds.

    All files, databases among them, are written in this one way. An existing target stays whole
    until the new file is on the disk. The new file gets the target's mode and, if this user may set
    them, its owner and group. If the block fails, the new file is removed.

    Parameters
    ----------
    real : Path
        The target, from `place_of`, so that no link is replaced.
    present : {"replace", "keep", "refuse"}
        What happens if there is a file with the target's name when the block ends. "replace"
        replaces that file, "keep" keeps it and discards the new one, "refuse" raises
        FileExistsError.
    signature : bytes
        First bytes of the new file; b"" if the file is no database. If they are given, unfinished
        files of the same target are removed first, which an earlier process left when it was
        killed. The caller must then hold the target's `lock`.

    Yields
    ------
    Path
        The new file, which is empty.

    Raises
    ------
    FileExistsError
        If there is a file with the target's name when the block ends, and `present` is "refuse".
    OSError
        If the new file cannot be made or written.
    """
    random_name = os.urandom(8).hex()
    if signature:
        _remove_remains(real, signature)
        temporary = real.with_name(f"{real.name}.{random_name}.part")
    else:
        temporary = real.with_name(f".asperity-{random_name}")
    replaced = None
    mode = 0o666
    if real.exists():
        replaced = real.stat()
        # No other user may read the new file before it has the rights of the target.
        mode = 0o600
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    descriptor = os.open(temporary, flags, mode)
    try:
        if replaced is not None:
            _pass_on_rights(descriptor, replaced)
        yield temporary
        os.fsync(descriptor)
        _give_name(temporary, real, present)
    finally:
        os.close(descriptor)
        temporary.unlink(missing_ok=True)


def _remove_remains(real: Path, signature: bytes) -> None:
    """Remove the unfinished files of a target that are empty or begin with a signature.

    Files that this user may not read or remove are left.
    """
    name_of_unfinished = re.compile(re.escape(real.name) + r"\.[0-9a-f]{16}\.part")
    for path in real.parent.iterdir():
        if not name_of_unfinished.fullmatch(path.name):
            continue
        if not stat.S_ISREG(path.lstat().st_mode):
            continue
        with suppress(PermissionError), path.open("rb") as file:
            if file.read(len(signature)) in {signature, b""}:
                path.unlink()


def _pass_on_rights(descriptor: int, replaced: os.stat_result) -> None:
    """Give an open file the mode of the file that it replaces, and its owner and group.

    The owner or the group stays as it is if this user may not change it.
    """
    with suppress(PermissionError):
        os.fchown(descriptor, replaced.st_uid, -1)
    with suppress(PermissionError):
        os.fchown(descriptor, -1, replaced.st_gid)
    os.fchmod(descriptor, stat.S_IMODE(replaced.st_mode))


def _give_name(temporary: Path, real: Path, present: Present) -> None:
    """Give a finished file the name `real`.

    If there is a file with this name, "replace" replaces it, "keep" leaves it and does not use the
    finished file, and "refuse" raises FileExistsError. The file may keep the name `temporary` as
    well, which the caller removes.
    """
    if present == "replace":
        temporary.replace(real)
        return
    try:
        real.hardlink_to(temporary)  # unlike renaming, it never replaces a file
    except FileExistsError:
        if present == "refuse":
            raise
    except OSError:
        # The file system has no hard links. A file that was there would have raised
        # FileExistsError, so only a file made this instant could be lost.
        temporary.replace(real)


def place_of(path: Path, *, folder: bool = False) -> Path:
    """Follow all links of an output's path to the place where it is or will be.

    Parameters
    ----------
    path : Path
        Path that a user named.
    folder : bool
        Whether the output is a folder rather than a file.

    Returns
    -------
    Path
        Absolute path without links.

    Raises
    ------
    InputError
        If links form a loop. For a file, also if a folder has its name, or the folder above it does
        not exist. For a folder, also if a file has its name.
    """
    try:
        real = followed(path)
    except OSError as error:  # links form a loop
        raise InputError(f"{path}: {error.strerror or error}") from None
    with _in_words(path, "cannot be written"):
        if folder:
            if real.exists() and not real.is_dir():
                raise InputError(f"{path} is a file: give a folder")
            return real
        if not real.name or real.is_dir():
            raise InputError(f"{path}: is a folder; give a file in a folder that exists")
        if not real.parent.is_dir():
            # The user knows the folder by the path that was given, unless a link leads elsewhere.
            missing = real.parent if path.is_symlink() else path.parent
            raise InputError(
                f"{path}: there is no folder {missing}; give a file in a folder that exists"
            )
    return real


def require_writable(path: Path) -> None:
    """Refuse an existing file that may not be written.

    A file without any write permission is refused even if the superuser runs the command, although
    the system would let the superuser write it.

    Parameters
    ----------
    path : Path
        The file, which is not changed.

    Raises
    ------
    InputError
        If the file may not be written, or does not exist.
    """
    with _in_words(path, "cannot be written"):
        if not path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
            raise InputError(f"{path} is read-only; give another name, or chmod u+w it")
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC))


def _output_place(path: Path, kind: Kind) -> Path:
    """Return the place of a file that is going to be written, as an absolute path without links.

    Raises InputError for a folder, a device, a file of another kind, a read-only file, and a file
    in a folder where no file can be made. A full disk is noticed only when the file is written.
    """
    real = place_of(path)
    if not os.access(real.parent, os.W_OK | os.X_OK):
        raise InputError(
            f"{path} cannot be written: no file can be made in {real.parent}"
        )
    if not real.exists():
        return real
    if not path.is_file():
        raise InputError(f"{path}: is no regular file: not replaced")
    require_writable(path)
    with _in_words(path, "cannot be read"):
        present_kind = kind_of(path)
    if present_kind not in {kind, ""}:  # an empty file has the kind ""
        raise InputError(
            f"{path}: is of the kind {present_kind}, not {kind}: not replaced"
        )
    return real


def kind_of(path: Path) -> str:
    """Tell the kind of a file by its beginning.

    Parameters
    ----------
    path : Path
        A regular file.

    Returns
    -------
    str
        A `Kind`, or "database". "binary" for a file of no known kind with bytes that texts do not
        have, and "" for an empty file.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        start = file.read(BEGINNING)
    if not start:
        return ""
    for signature, kind in SIGNATURES.items():
        if start.startswith(signature):
            return kind
    if b"<svg" in start:  # an SVG may begin with comments of any length
        return "picture"
    # Every zip archive begins with PK.
    if start.startswith(b"PK") and _holds_arrays(path):
        return "arrays"
    bytes_beyond_text = start.translate(None, TEXT)
    if bytes_beyond_text:
        return "binary"
    return "text"


def _holds_arrays(path: Path) -> bool:
    """Tell whether a file is a zip archive of NumPy arrays and nothing else."""
    with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        return all(name.endswith(".npy") for name in archive.namelist())
    return False


def _is_same(first: Path, second: Path) -> bool:
    """Tell whether two paths lead to the same file, directly or through symbolic or hard links.

    If nothing exists under either path, tell whether both lead to the same place. The result is
    False if a path leads into a loop of links.
    """
    # `second` does not exist although `first` does, or links form a loop.
    with suppress(OSError):
        if first.exists():
            return first.samefile(second)
        return followed(first) == followed(second)
    return False


@contextmanager
def _in_words(path: Path, trouble: str) -> Iterator[None]:
    """Turn an OSError of the block into an InputError "PATH TROUBLE: REASON OF THE SYSTEM".

    `trouble` is a verb such as "cannot be read".
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} {trouble}: {error.strerror or error}") from None


@contextmanager
def lock(path: Path) -> Iterator[None]:
    """Hold the lock of a database while the block creates or writes it.

    The lock is a lock of the kernel on the file `<path>.lock`, whose text names the holder. The
    kernel releases it when the process ends. If links lead to a database, the lock is beside the
    database, and all links share it. On a file system without locks, the block runs unlocked if
    the user has set `HDF5_USE_FILE_LOCKING=FALSE`, as is usual there.

    Parameters
    ----------
    path : Path
        The database, which need not exist yet.

    Yields
    ------
    None

    Raises
    ------
    InputError
        If another process holds the lock, or the lock cannot be made.
    """
    real = place_of(path)
    with _held(path, real.with_name(f"{real.name}.lock")):
        yield


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder while the block reads and writes it.

    If the folder is missing, it is made, with the missing folders above it. The folders made here
    are removed after the block if they are empty.

    Parameters
    ----------
    folder : Path
        The folder.

    Yields
    ------
    None

    Raises
    ------
    InputError
        If another process holds the lock, or the folder or its lock cannot be made.
    """
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    make_folder(folder)
    try:
        with _held(folder, folder / ".asperity.lock"):
            yield
    finally:
        # A folder that is not empty stays, and so do the folders above it.
        with suppress(OSError):
            for made_folder in missing:
                made_folder.resolve().rmdir()


@contextmanager
def _held(path: Path, lock_path: Path) -> Iterator[None]:
    """Hold a lock on the file `lock_path` during the block; InputError if that fails.

    `path` is the database or folder that is locked, for messages. The text of `_holder` is written
    into the file, which is removed after the block.
    """
    descriptor = _locked_file(path, lock_path)
    with suppress(OSError):  # on a full disk the text is missing, but the lock holds
        os.ftruncate(descriptor, 0)
        os.write(descriptor, _holder().encode())
    try:
        yield
    finally:
        # The file is removed while it is still locked. A process that has opened it meanwhile
        # notices in `_locked_file` that the name is gone, and makes a new file.
        if _leads_to(lock_path, descriptor):
            lock_path.unlink(missing_ok=True)
        os.close(descriptor)


def _locked_file(path: Path, lock_path: Path) -> int:
    """Open and lock the file `lock_path`, and return its descriptor; InputError if that fails.

    `path` is the database or folder that is locked, for messages.
    """
    # O_NONBLOCK: a FIFO with this name must not block the opening.
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    trouble = f"cannot be written, as {lock_path} is there or cannot be made"
    while True:
        with _in_words(path, trouble):
            descriptor = os.open(lock_path, flags, 0o666)
        fault = _lock(descriptor, lock_path)
        if not fault and _leads_to(lock_path, descriptor):
            return descriptor
        os.close(descriptor)
        if fault:
            raise InputError(f"{path} {fault}")
        # The previous holder removed the file between our open and our lock: try again.


def _lock(descriptor: int, lock_path: Path) -> str:
    """Lock the open file of a lock, without waiting.

    Returns "" if the file is locked now, or if the file system has no locks and the user has
    allowed to go on without one. Otherwise returns the reason, which continues a message that
    begins with the path of the output, as "is being written by ...; wait until it ends".
    """
    is_regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
    content = os.pread(descriptor, LONGEST_LOCK + 1, 0) if is_regular else b""
    is_new = is_regular and not content
    # A file of somebody else that happens to have the name of a lock is never overwritten.
    if not is_new and not LOCK_CONTENT.fullmatch(content):
        return (
            f"cannot be written: {lock_path} is there and no lock of ours; move it away"
        )
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        # The text is empty while the holder is writing it, or after the disk was full.
        holder = content.decode(errors="replace").strip() or "another process"
        return f"is being written by {holder}; wait until it ends"
    except OSError as error:  # the file system has no locks
        if os.environ.get("HDF5_USE_FILE_LOCKING", "").upper() not in {"FALSE", "0"}:
            return (
                f"is on a file system without locks ({error.strerror}); set"
                " HDF5_USE_FILE_LOCKING=FALSE and let only one run write it"
            )
    return ""


def _holder() -> str:
    """Return the text of a lock's file: host, process, job of Slurm if any, and the time (UTC)."""
    job = ""
    if "SLURM_JOB_ID" in os.environ:
        job = f", job {os.environ['SLURM_JOB_ID']}"
    now = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", time.gmtime())
    return f"host {os.uname().nodename}, process {os.getpid()}{job}, since {now}\n"


def _leads_to(path: Path, descriptor: int) -> bool:
    """Tell whether a path is the name of an open file itself, not of a symbolic link to it."""
    with suppress(OSError):  # there is no file with this name
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    return False
