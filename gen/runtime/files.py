"""Files that users name: read if regular, refused before any work, written whole, and locked.

One rule holds for every output of every command: it is never an input, never another output, and it
replaces only a file of its own kind. docs/compatibility.md lists the promises.
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
"""Kinds of output besides databases; `arrays` are NumPy's zip archives, `maps` prepared maps."""

Present = Literal["replace", "keep", "refuse"]
"""What a new file does to a file that already has its name."""

LARGEST = 64 * 2**20
"""Size up to which a file is read whole; files of ours have some thousand bytes [bytes]."""

BEGINNING = 4096  # length of the beginning of a file that decides its kind [bytes]

TEXT = bytes({7, 8, 9, 10, 12, 13, 27} | set(range(32, 256)))
"""Bytes of texts; the beginnings of nearly all binary files have bytes beyond these."""

SURROGATE = b"asperity surrogate\n"  # first bytes of a surrogate
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
"""Kind of the files that begin with these bytes."""

LOCK_CONTENT = re.compile(rb"host .+, process [0-9]+(, job .+)?, since .+\n?")
"""Content of a lock's file, which names the process that holds the lock."""

LONGEST_LOCK = 500  # size up to which the content of a lock's file is read [bytes]


def require_file(path: Path) -> Path:
    """Refuse a pipe, a socket or a device, which could block its reader for ever.

    Every reader of a user's file calls this first. Folders and missing files pass, because opening
    them raises a clearer error.

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
        If the path leads to neither a regular file nor a folder.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # ValueError: a null character in the path
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
        Size up to which the file is read [bytes].

    Returns
    -------
    bytes
        Its content.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    InputError
        If the file is larger than `largest`, is no regular file or cannot be read.
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
    """A file that a command is going to write."""

    path: Path | None  # None if the user gave no name
    option: str  # option that gave the name, such as "--csv", for messages
    kind: Kind = "text"


def check_outputs(outputs: Iterable[Output], inputs: Iterable[Path | str] = ()) -> None:
    """Refuse outputs before any work is done for them, without changing existing files.

    Parameters
    ----------
    outputs : iterable of Output
        Files that the command is going to write.
    inputs : iterable of Path or str
        Files and folders that the command reads; all files of a folder count as inputs.

    Raises
    ------
    InputError
        If an output cannot be written, is an input or an earlier output under any name, or if a
        file of another kind has its name.
    """
    read = _files_of(inputs)
    earlier: list[Output] = []
    for output in outputs:
        if output.path is None:
            continue
        _refuse_same(output, output.path, read, earlier)
        try:
            _output_place(output.path, output.kind)
        except InputError as error:
            raise InputError(f"{output.option} {error}") from None
        earlier.append(output)


def _files_of(inputs: Iterable[Path | str]) -> list[Path]:
    """Return the paths of inputs, with the content of a folder in the folder's place."""
    files: list[Path] = []
    for path in map(Path, inputs):
        if path.is_dir():
            files.extend(path.iterdir())
        else:
            files.append(path)
    return files


def _refuse_same(
    output: Output, path: Path, read: Sequence[Path], earlier: Sequence[Output]
) -> None:
    """Refuse an output whose path leads to a file that is read, or to an earlier output."""
    if any(_is_same(path, file) for file in read):
        raise InputError(f"{output.option} {path}: is an input: not replaced")
    for other in earlier:
        if other.path is not None and _is_same(path, other.path):
            raise InputError(
                f"{output.option} {path}: is what {other.option} writes too;"
                " give another name"
            )


def check_folder(folder: Path, *names: str) -> None:
    """Refuse a folder that cannot be made or written to, or a file in it that may not be replaced.

    Nothing is changed.

    Parameters
    ----------
    folder : Path
        Folder that a command is going to write to, and makes if there is none.
    *names : str
        Names of files that it will write there: pictures, which end in ".png", or texts.

    Raises
    ------
    InputError
        If the command would fail.
    """
    real = place_of(folder, folder=True)
    nearest = next(parent for parent in (real, *real.parents) if parent.exists())
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{folder} cannot be written: no file can be made in {nearest}")
    if not real.is_dir():
        return
    for name in names:
        kind: Kind = "picture" if name.endswith(".png") else "text"
        _output_place(folder / name, kind)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, unless they exist; a link stays a link to its target.

    Parameters
    ----------
    folder : Path
        The folder, or a link to it.

    Raises
    ------
    InputError
        If the folder cannot be made, or a file has its name.
    """
    with _in_words(folder, "cannot be written to"):
        place_of(folder, folder=True).mkdir(parents=True, exist_ok=True)


def followed(path: Path) -> Path:
    """Follow all links of a path, whose target may not exist.

    `Path.resolve` returns a part of a loop of links in Python 3.13, and raises RuntimeError before.

    Parameters
    ----------
    path : Path
        Any path.

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
    """Return the path of a file in an output folder, and refuse a link that leads out of it.

    Parameters
    ----------
    folder : Path
        Folder that a user named.
    name : str
        Name in the folder, which this program chose; it may have "/" in it.

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
    with suppress(OSError):  # a loop of links
        if followed(path).is_relative_to(followed(folder)):
            return path
    raise InputError(
        f"{path}: leads out of {folder} by a link: not written; remove the link"
    )


def write(path: Path, content: str | bytes, kind: Kind = "text") -> None:
    """Write a whole file, which has its old content or the new one at any time.

    Parameters
    ----------
    path : Path
        The file; a link stays a link.
    content : str or bytes
        New content. Text is written as UTF-8; letters that UTF-8 cannot hold become "?".
    kind : Kind
        Kind of the content. An existing file is replaced only if it is empty or of this kind.

    Raises
    ------
    InputError
        If the file cannot be written, or is of another kind. It is unchanged then.
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

    Parameters
    ----------
    path : Path
        Final name; a link stays a link.
    kind : Kind
        Kind of the content. An existing file is replaced only if it is empty or of this kind.
    replace : bool
        Whether a file is replaced that another process makes under the name during the block.
        If not, that file stays, and the new one is lost.

    Yields
    ------
    binary file
        Temporary file in the same folder, open for writing.

    Raises
    ------
    InputError
        If the file cannot be written, or is of another kind. It is unchanged then.
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

    All files, databases among them, are written in this one way. The file that stands at the target
    stays whole until the new file is on the disk, and passes on its mode, owner and group. The new
    file is removed if the block fails.

    Parameters
    ----------
    real : Path
        The target, from `place_of`, so that no link is replaced.
    present : {"replace", "keep", "refuse"}
        What happens to a file that has the target's name when the block ends: it is replaced, or
        kept and the new one lost, or it raises an error.
    signature : bytes
        First bytes of the new file. If they are given, files beside the target are removed that
        begin with them and that an earlier process left under the same name when it was killed;
        the caller holds the target's `lock`.

    Yields
    ------
    Path
        The new file, which is empty.

    Raises
    ------
    FileExistsError
        If there is a file with the target's name when the block ends, and `present` is "refuse".
    """
    letters = os.urandom(8).hex()
    if signature:
        _remove_remains(real, signature)
        temporary = real.with_name(f"{real.name}.{letters}.part")
    else:
        temporary = real.with_name(f".asperity-{letters}")
    replaced = None
    mode = 0o666
    if real.exists():
        replaced = real.stat()
        mode = 0o600  # until the new file has the rights of the old one
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
    """Remove the unfinished files of a target that begin with a signature or are empty."""
    remains = re.compile(re.escape(real.name) + r"\.[0-9a-f]{16}\.part")
    for path in real.parent.iterdir():
        if not remains.fullmatch(path.name) or not stat.S_ISREG(path.lstat().st_mode):
            continue
        with suppress(PermissionError), path.open("rb") as file:
            if file.read(len(signature)) in {signature, b""}:
                path.unlink()


def _pass_on_rights(descriptor: int, replaced: os.stat_result) -> None:
    """Give an open file the mode and, if this user may, the owner and group of another file."""
    with suppress(PermissionError):
        os.fchown(descriptor, replaced.st_uid, -1)
    with suppress(PermissionError):
        os.fchown(descriptor, -1, replaced.st_gid)
    os.fchmod(descriptor, stat.S_IMODE(replaced.st_mode))


def _give_name(temporary: Path, real: Path, present: Present) -> None:
    """Give a finished file its name; an existing file is replaced, kept, or a FileExistsError."""
    if present == "replace":
        temporary.replace(real)
        return
    try:
        real.hardlink_to(temporary)
    except FileExistsError:
        if present == "refuse":
            raise
    except OSError:  # the file system has no hard links
        temporary.replace(real)


def place_of(path: Path, *, folder: bool = False) -> Path:
    """Follow all links to the place of an output, which may not exist yet.

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
        If links form a loop, a folder has the file's name or a file the folder's, or the folder
        that the file is to be in does not exist.
    """
    try:
        real = followed(path)
    except OSError as error:  # a loop of links
        raise InputError(f"{path}: {error.strerror or error}") from None
    with _in_words(path, "cannot be written"):
        if folder:
            if real.exists() and not real.is_dir():
                raise InputError(f"{path} is a file: give a folder")
            return real
        if not real.name or real.is_dir():
            raise InputError(f"{path}: is a folder; give a file in a folder that exists")
        if not real.parent.is_dir():
            missing = real.parent if path.is_symlink() else path.parent
            raise InputError(
                f"{path}: there is no folder {missing}; give a file in a folder that exists"
            )
    return real


def require_writable(path: Path) -> None:
    """Refuse an existing file that may not be written.

    A file without any write permission is refused also for the superuser, whom the system would
    let write it.

    Parameters
    ----------
    path : Path
        The file, which is not changed.

    Raises
    ------
    InputError
        If the file may not be written.
    """
    with _in_words(path, "cannot be written"):
        if not path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
            raise InputError(f"{path} is read-only; give another name, or chmod u+w it")
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC))


def _output_place(path: Path, kind: Kind) -> Path:
    """Return the place of a file that is going to be written, without links, or raise InputError.

    Refused are folders, devices, files of another kind, read-only files, and files in a folder
    where none can be made. A full disk shows only on writing.
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
        present = kind_of(path)
    if present not in {kind, ""}:
        raise InputError(f"{path}: is of the kind {present}, not {kind}: not replaced")
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
        A `Kind`, "database", "binary" for any other file that is no text, or "" for an empty file.

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
    if b"<svg" in start:
        return "picture"
    if start.startswith(b"PK") and _holds_arrays(path):
        return "arrays"
    if start.translate(None, TEXT):
        return "binary"
    return "text"


def _holds_arrays(path: Path) -> bool:
    """Tell whether a file is a zip archive of NumPy's arrays alone."""
    with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        return all(name.endswith(".npy") for name in archive.namelist())
    return False


def _is_same(first: Path, second: Path) -> bool:
    """Tell whether two paths lead, or would lead, to the same file through links of either kind."""
    with suppress(OSError):  # one path does not exist yet, or is a loop of links
        if first.exists():
            return first.samefile(second)
        return followed(first) == followed(second)
    return False


@contextmanager
def _in_words(path: Path, trouble: str) -> Iterator[None]:
    """Turn an OSError of the block into an InputError: path, trouble and the system's reason."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} {trouble}: {error.strerror or error}") from None


@contextmanager
def lock(path: Path) -> Iterator[None]:
    """Hold the lock of a database while the block creates or writes it.

    The kernel keeps the lock on the file `<path>.lock`, which names the holder, and drops the lock
    when the process ends. Links to one file share its lock. With `HDF5_USE_FILE_LOCKING=FALSE`, as
    is usual on file systems without locks, the block runs although there is no lock.

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
        If another process holds the lock, or no lock can be had.
    """
    real = place_of(path)
    with _held(path, real.with_name(f"{real.name}.lock")):
        yield


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder while the block reads and writes it.

    A missing folder is made, with those above it; they are removed after the block if they are
    empty.

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
        with suppress(OSError):  # a folder is not empty
            for new in missing:
                new.resolve().rmdir()


@contextmanager
def _held(path: Path, lock_path: Path) -> Iterator[None]:
    """Hold the lock of an output, kept on the file `lock_path`, or raise InputError."""
    descriptor = _locked_file(path, lock_path)
    with suppress(OSError):  # a full disk: the text is missing, the lock holds
        os.ftruncate(descriptor, 0)
        os.write(descriptor, _holder().encode())
    try:
        yield
    finally:
        # Unlinked while the lock is held: nobody can lock a name that is about to vanish,
        # because everybody checks that the name still leads to what they have locked.
        if _leads_to(lock_path, descriptor):
            lock_path.unlink(missing_ok=True)
        os.close(descriptor)


def _locked_file(path: Path, lock_path: Path) -> int:
    """Open and lock a lock's file, and return its descriptor; InputError if that fails."""
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    trouble = f"cannot be written, as {lock_path} is there or cannot be made"
    while True:
        with _in_words(path, trouble):
            descriptor = os.open(lock_path, flags, 0o666)
        fault = _lock(descriptor, lock_path)
        # The holder before us may have unlinked the file between our open and our lock.
        if not fault and _leads_to(lock_path, descriptor):
            return descriptor
        os.close(descriptor)
        if fault:
            raise InputError(f"{path} {fault}")


def _lock(descriptor: int, lock_path: Path) -> str:
    """Lock an open file; return why it cannot be locked, "" if it is locked or locks are waived."""
    content = b"no lock"
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        content = os.pread(descriptor, LONGEST_LOCK + 1, 0)
    if content and not LOCK_CONTENT.fullmatch(content):
        return (
            f"cannot be written: {lock_path} is there and no lock of ours; move it away"
        )
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = content.decode(errors="replace").strip() or "another process"
        return f"is being written by {holder}; wait until it ends"
    except OSError as error:
        if os.environ.get("HDF5_USE_FILE_LOCKING", "").upper() not in {"FALSE", "0"}:
            return (
                f"is on a file system without locks ({error.strerror}); set"
                " HDF5_USE_FILE_LOCKING=FALSE and let only one run write it"
            )
    return ""


def _holder() -> str:
    """Return the content of a lock's file that names this process."""
    job = ""
    if "SLURM_JOB_ID" in os.environ:
        job = f", job {os.environ['SLURM_JOB_ID']}"
    now = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", time.gmtime())
    return f"host {os.uname().nodename}, process {os.getpid()}{job}, since {now}\n"


def _leads_to(path: Path, descriptor: int) -> bool:
    """Tell whether a name leads to an open file, and not through a link."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    return False
