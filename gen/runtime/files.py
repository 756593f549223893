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
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Literal, NamedTuple

from gen.runtime.errors import InputError

Kind = Literal["text", "picture", "surrogate", "heights", "arrays", "maps", "parquet"]
"""Kinds of output besides databases; `arrays` are NumPy's zip archives, `maps` prepared maps."""

Present = Literal[
    "replace", "keep", "refuse"
]  # what a new file does to one that has its name
LARGEST = 64 * 2**20  # most bytes of a file that is read whole; ours have some thousands
BEGINNING = 4096  # bytes at the beginning of a file that decide its kind

TEXT = bytes({7, 8, 9, 10, 12, 13, 27} | set(range(32, 256)))
"""Bytes of texts; the beginnings of nearly all binary files have further ones."""

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

OURS = re.compile(rb"host .+, process [0-9]+(, job .+)?, since .+\n?")  # a lock's content

LONGEST_HOLDER = 500  # most bytes of that line


def require_file(path: Path) -> Path:
    """Refuse pipes, sockets and devices, which could block their reader for ever.

    Every reader of a user's file calls this first. Folders and missing files pass: it says more.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # a null character in the path
        return path
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(
            f"{path} is a pipe or a device; give a file on a disk, to be read twice"
        )
    return path


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Read a whole regular file of `largest` bytes at most.

    Raise FileNotFoundError if there is none, otherwise InputError if it cannot be read.
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
    """Compute the SHA-256 of a file's content, in hexadecimal digits."""
    with _in_words(path, "cannot be read"), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class Output(NamedTuple):
    """A file that a command is going to write."""

    path: Path | None  # None if the user named none
    option: str  # that named it
    kind: Kind = "text"


def check_outputs(outputs: Iterable[Output], inputs: Iterable[Path | str] = ()) -> None:
    """Refuse outputs before any work is done for them, without changing existing files.

    Of folders among the inputs all files count. Raise InputError if a file cannot be written, is an
    input or another output by any name, or holds another kind of content.
    """
    wanted = [
        (output.path, output.option, output.kind) for output in outputs if output.path
    ]
    read: list[Path] = []
    for given in map(Path, inputs):
        read += given.iterdir() if given.is_dir() else [given]
    for number, (path, option, kind) in enumerate(wanted):
        if any(_is_same(path, file) for file in read):
            raise InputError(f"{option} {path}: is an input: not replaced")
        for other, name, _ in wanted[:number]:
            if _is_same(path, other):
                raise InputError(
                    f"{option} {path}: is what {name} writes too; give another name"
                )
        try:
            _place(path, kind)
        except InputError as error:
            raise InputError(f"{option} {error}") from None


def check_folder(folder: Path, *names: str) -> None:
    """Refuse an output folder that cannot be had, or names in it, pictures (.png) or texts."""
    real = place_of(folder, folder=True)
    home = next(each for each in (real, *real.parents) if each.exists())
    if not os.access(home, os.W_OK | os.X_OK):
        raise InputError(f"{folder} cannot be written: no file can be made in {home}")
    for name in names if real.is_dir() else ():
        _place(folder / name, "picture" if name.endswith(".png") else "text")


def make_folder(folder: Path) -> None:
    """Make a folder, or the one that a link leads to, and those above it, unless they exist."""
    with _in_words(folder, "cannot be written to"):
        place_of(folder, folder=True).mkdir(parents=True, exist_ok=True)


def followed(path: Path) -> Path:
    """Follow all links of a path, whose target may not exist; an OSError if they form a loop.

    `Path.resolve` returns a part of a loop in Python 3.13, and raises RuntimeError before.
    """
    real = Path(os.path.realpath(path))
    try:
        real.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise
    return real


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file that we name in a folder, unless a link leads out of the folder."""
    path = folder / name
    with suppress(OSError):  # a loop of links
        if followed(path).is_relative_to(followed(folder)):
            return path
    raise InputError(
        f"{path}: leads out of {folder} by a link: not written; remove the link"
    )


def write(path: Path, content: str | bytes, kind: Kind = "text") -> None:
    """Write a file as `atomic` does; letters that UTF-8 cannot hold become question marks."""
    with atomic(path, kind) as file:
        file.write(
            content.encode(errors="replace") if isinstance(content, str) else content
        )


@contextmanager
def atomic(
    path: Path, kind: Kind = "text", *, replace: bool = True
) -> Iterator[IO[bytes]]:
    """Open a temporary file that is renamed to its final name once the block has succeeded.

    A link stays a link. Without `replace` a file that another process has made meanwhile stays.
    Raise InputError if the file cannot be written, or is of another kind; it is unchanged then.
    """
    real = _place(path, kind)
    with _in_words(path, "cannot be written"):
        present: Present = "replace" if replace else "keep"
        with unfinished(real, present) as temporary, temporary.open("wb") as file:
            yield file


@contextmanager
def unfinished(
    real: Path, present: Present = "replace", signature: bytes = b""
) -> Iterator[Path]:
    """Make an empty file beside a target, and give it the target's name once the block succeeds.

    This is the one way in which files, databases among them, come into being: what stands at the
    target, from `place_of`, stays whole until the new file is on the disk, and passes on mode,
    owner and group. A file that has come meanwhile is replaced, kept, or refused by
    FileExistsError. The next attempt removes what a kill has left of a file that begins with
    `signature`, under a lock.
    """
    own = os.urandom(8).hex()
    temporary = real.with_name(
        f"{real.name}.{own}.part" if signature else f".asperity-{own}"
    )
    left = re.compile(re.escape(real.name) + r"\.[0-9a-f]{16}\.part")
    for path in real.parent.iterdir() if signature else ():
        if left.fullmatch(path.name) and stat.S_ISREG(path.lstat().st_mode):
            with suppress(PermissionError), path.open("rb") as file:
                if file.read(len(signature)) in {signature, b""}:
                    path.unlink()
    old = real.stat() if real.exists() else None
    mode = 0o666 if old is None else 0o600
    descriptor = os.open(
        temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode
    )
    try:
        if old is not None:
            for owner, group in ((old.st_uid, -1), (-1, old.st_gid)):
                with suppress(PermissionError):
                    os.fchown(descriptor, owner, group)
            os.fchmod(descriptor, stat.S_IMODE(old.st_mode))
        yield temporary
        os.fsync(descriptor)
        if present == "replace":
            temporary.replace(real)
            return
        try:
            real.hardlink_to(temporary)
        except FileExistsError:
            if present == "refuse":
                raise
        except OSError:  # no links on this file system
            temporary.replace(real)
    finally:
        os.close(descriptor)
        temporary.unlink(missing_ok=True)


def place_of(path: Path, *, folder: bool = False) -> Path:
    """Follow all links to the place of a file or folder, which may not exist; else InputError."""
    try:
        real = followed(path)
    except OSError as error:  # a loop of links
        raise InputError(f"{path}: {error.strerror or error}") from None
    with _in_words(path, "cannot be written"):
        if folder and real.exists() and not real.is_dir():
            raise InputError(f"{path} is a file: give a folder")
        if not folder and (not real.name or real.is_dir()):
            raise InputError(f"{path}: is a folder; give a file in a folder that exists")
        if not folder and not real.parent.is_dir():
            missing = real.parent if path.is_symlink() else path.parent
            raise InputError(
                f"{path}: there is no folder {missing}; give a file in a folder that exists"
            )
    return real


def require_writable(path: Path) -> None:
    """Refuse an existing file that may not be written; its mode counts for the superuser too."""
    with _in_words(path, "cannot be written"):
        if not path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
            raise InputError(f"{path} is read-only; give another name, or chmod u+w it")
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC))


def _place(path: Path, kind: Kind) -> Path:
    """Return the place of a file; refuse what is no regular file, of another kind, or read-only.

    So is a folder where no file can be made; a full disk shows only on writing.
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
    """Return a file's `Kind`, "database" or "binary", by its beginning; "" for an empty file."""
    with path.open("rb") as file:
        start = file.read(BEGINNING)
    for signature, kind in SIGNATURES.items():
        if start.startswith(signature):
            return kind
    if b"<svg" in start:
        return "picture"
    if start.startswith(b"PK"):
        with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
            if all(name.endswith(".npy") for name in archive.namelist()):
                return "arrays"
    if start.translate(None, TEXT):
        return "binary"
    return "text" if start else ""


def _is_same(one: Path, other: Path) -> bool:
    """Tell whether two paths lead, or would lead, to the same file through links of either kind."""
    with suppress(OSError):  # one path does not exist yet, or is a loop of links
        return one.samefile(other) if one.exists() else followed(one) == followed(other)
    return False


@contextmanager
def _in_words(path: Path, trouble: str) -> Iterator[None]:
    """Turn an error of the system into one line for the user."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} {trouble}: {error.strerror or error}") from None


@contextmanager
def lock(path: Path) -> Iterator[None]:
    """Hold the lock of a database, which need not exist yet, while the block creates or writes it.

    The kernel keeps the lock on the file `<path>.lock`, which names the holder, and drops it when
    the process ends. With `HDF5_USE_FILE_LOCKING=FALSE`, as usual on file systems without locks,
    missing locks are accepted. Raise InputError if another process writes, or no lock can be had.
    """
    real = place_of(path)  # one lock for all links to a file
    with _held(path, real.with_name(f"{real.name}.lock")):
        yield


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Make a folder if there is none, and hold its lock while the block reads and writes it.

    A folder that has been made for the block and is empty behind it is removed.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    make_folder(folder)
    try:
        with _held(folder, folder / ".asperity.lock"):
            yield
    finally:
        with suppress(OSError):  # something is in it
            for each in made:
                each.resolve().rmdir()


@contextmanager
def _held(path: Path, lock_path: Path) -> Iterator[None]:
    """Hold the lock of a path, which is that of a file; a link or a user's own file is refused."""
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    fault, held = "", False
    while not held:
        with _in_words(
            path, f"cannot be written, as {lock_path} is there or cannot be made"
        ):
            descriptor = os.open(lock_path, flags, 0o666)
        regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
        holder = os.pread(descriptor, LONGEST_HOLDER + 1, 0) if regular else b"no lock"
        if holder and not OURS.fullmatch(holder):
            fault = f"cannot be written: {lock_path} is there and no lock of ours; move it away"
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            told = holder.decode(errors="replace").strip() or "another process"
            fault = fault or f"is being written by {told}; wait until it ends"
        except OSError as error:
            if os.environ.get("HDF5_USE_FILE_LOCKING", "").upper() not in {"FALSE", "0"}:
                fault = fault or (
                    f"is on a file system without locks ({error.strerror}); set"
                    " HDF5_USE_FILE_LOCKING=FALSE and let only one run write it"
                )
        # The holder before us may have unlinked the file between our open and our lock.
        held = not fault and _leads_to(lock_path, descriptor)
        if not held:
            os.close(descriptor)
        if fault:
            raise InputError(f"{path} {fault}")
    job = f", job {os.environ['SLURM_JOB_ID']}" if "SLURM_JOB_ID" in os.environ else ""
    now = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", time.gmtime())
    with suppress(OSError):  # a full disk: the text is missing, the lock holds
        os.ftruncate(descriptor, 0)
        os.write(
            descriptor,
            f"host {os.uname().nodename}, process {os.getpid()}{job}, since {now}\n".encode(),
        )
    try:
        yield
    finally:
        # Unlinked while the lock is held: nobody can lock a name that is about to vanish,
        # because everybody checks that the name still leads to what they have locked.
        if _leads_to(lock_path, descriptor):
            lock_path.unlink(missing_ok=True)
        os.close(descriptor)


def _leads_to(path: Path, descriptor: int) -> bool:
    """Tell whether a name leads to an open file."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    return False
