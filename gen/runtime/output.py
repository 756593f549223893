"""Files that commands write: refused before the work, and then written whole or not at all.

One rule for every file that a user names, whatever the command: it is never an input, never
another output, and it replaces only a file of its own kind. Databases, which runs continue and
extend, have rules of their own in `gen.database`; what is here about places holds for them too.
"""

import os
import secrets
import stat
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Literal, NamedTuple

from gen.runtime.errors import InputError

Kind = Literal["text", "picture", "surrogate", "arrays"]
"""What commands write besides databases; `arrays` are NumPy's zip archives."""

WORDS: dict[str, str] = {
    "text": "text",
    "picture": "a picture",
    "surrogate": "a surrogate",
    "arrays": "an archive of arrays",
    "database": "HDF5",
    "binary": "something binary",
}
"""Names of all kinds of content in messages."""

BEGINNING = 4096
"""Bytes by which the kinds are told apart."""

TEXT = bytes({7, 8, 9, 10, 12, 13, 27} | set(range(32, 256)))
"""Bytes that texts are made of; nearly all other files have one of the rest at their beginning."""


SURROGATE = b"asperity surrogate\n"
"""How the files of surrogates begin; before format 3 they were zip archives."""

SIGNATURES = {
    b"\x89PNG\r\n": "picture",
    b"%PDF-": "picture",
    b"\x89HDF\r\n": "database",
    SURROGATE: "surrogate",
}
"""How the files of other kinds begin, where all of a kind do."""


class Output(NamedTuple):
    """A file that a command is going to write.

    Attributes
    ----------
    path : the file, None if nothing is to be written
    option : how the user named it, in messages
    kind : what will be written
    """

    path: Path | None
    option: str
    kind: Kind = "text"


def check_outputs(outputs: Iterable[Output], inputs: Iterable[Path | str] = ()) -> None:
    """Refuse outputs before any work is done for them; what is there is left as it is.

    Parameters
    ----------
    outputs : all files that the command will write
    inputs : files that it reads; of a folder, all files but tables (.csv)

    Raises
    ------
    InputError
        If a file cannot be written, is an input or another output, also by another name, or holds
        something of another kind.
    """
    wanted = [(each.path, each.option, each.kind) for each in outputs if each.path is not None]
    read = list(_files_of(inputs))
    for number, (path, option, kind) in enumerate(wanted):
        if any(_is_same(path, each) for each in read):
            raise InputError(f"{option} {path}: is an input: not replaced")
        for other, name, _ in wanted[:number]:
            if _is_same(path, other):
                raise InputError(f"{option} {path}: is what {name} writes too; give another name")
        try:
            _try(path, kind)
        except InputError as error:
            raise InputError(f"{option} {error}") from None


def check_folder(folder: Path, *names: str) -> None:
    """Refuse a folder before any work is done for it, whether it is there or has to be made.

    Parameters
    ----------
    folder : where the command will write
    names : files that it will write there: pictures (.png) and texts

    Raises
    ------
    InputError
        If it is no folder, files cannot be written there, or one of them cannot be replaced.
    """
    if folder.is_dir():
        with _in_words(folder, "cannot be written to"):
            _try_beside(folder / "any")
        for name in names:
            _try(folder / name, "picture" if name.endswith(".png") else "text")
        return
    if os.path.lexists(folder):
        raise InputError(f"{folder} is a file: give a folder")
    with _in_words(folder, "cannot be written to"):
        existing = next(each for each in folder.absolute().parents if os.path.lexists(each))
        _try_beside(existing / "any")


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, where they are not there yet.

    Raises
    ------
    InputError
        If that is not possible.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a folder")
    with _in_words(folder, "cannot be written to"):
        folder.mkdir(parents=True, exist_ok=True)


def write(path: Path, content: str | bytes, kind: Kind = "text") -> None:
    """Write a file whole or not at all; see `whole`."""
    with whole(path, kind) as file:
        file.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def whole(path: Path, kind: Kind = "text") -> Iterator[IO[bytes]]:
    """Open a file in the making, which takes its place once the block has succeeded.

    A link stays a link, and a file that is replaced hands on its mode and, where the system lets
    it, its owner and group.

    Parameters
    ----------
    path : the file
    kind : what is written; a file of another kind is not replaced

    Raises
    ------
    InputError
        If the file cannot be written; what was there is there still.
    """
    real = place_of(path)
    if real.exists():
        _require_replaceable(path, kind)
    with _in_words(path, "cannot be written"):
        unfinished = real.with_name(f".asperity-{secrets.token_hex(8)}")
        descriptor = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            with os.fdopen(descriptor, "wb") as file:
                if real.exists():
                    hand_on(real.stat(), descriptor)
                yield file
                file.flush()
                os.fsync(descriptor)
            unfinished.replace(real)
        finally:
            unfinished.unlink(missing_ok=True)


def place_of(path: Path) -> Path:
    """Where a file really is: scratch folders are often reached by links.

    Raises
    ------
    InputError
        If the path is no file's: a loop of links, a folder, the root.
    """
    try:
        real = path.resolve()
        if not real.name or real.is_dir():
            raise InputError(f"{path}: is a folder; give a file in a folder that exists")
        if not real.parent.is_dir():
            raise InputError(
                f"{path}: there is no folder {path.parent}; give a file in a folder that exists"
            )
        if real.is_symlink():
            raise InputError(f"{path}: its links lead nowhere")
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    return real


def require_writable(path: Path) -> None:
    """Refuse a file that may not be written; its mode counts for the superuser too.

    Raises
    ------
    InputError
        If nobody may write it, this user may not, or the system does not let it happen.
    """
    if not path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
        raise InputError(f"{path} is read-only; give another name, or chmod u+w it")
    with _in_words(path, "cannot be written"):
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC))


def hand_on(old: os.stat_result, descriptor: int) -> None:
    """Give an open file owner and group, as far as this user may, and mode of the one it replaces.

    Parameters
    ----------
    old : of the file that will be replaced
    descriptor : of the one that takes its place
    """
    for owner, group in ((old.st_uid, -1), (-1, old.st_gid)):
        with suppress(PermissionError):
            os.fchown(descriptor, owner, group)
    os.fchmod(descriptor, stat.S_IMODE(old.st_mode))


def _try(path: Path, kind: Kind) -> None:
    """Find out whether a file can be written, without changing what is there."""
    real = place_of(path)
    if real.exists():
        _require_replaceable(path, kind)
    with _in_words(path, "cannot be written"):
        _try_beside(real)


def _require_replaceable(path: Path, kind: Kind) -> None:
    """Refuse to replace what is no regular file, of another kind, or may not be written."""
    if not path.is_file():
        raise InputError(f"{path}: is no regular file: not replaced")
    require_writable(path)
    with _in_words(path, "cannot be read"):
        found = kind_of(path)
    if found not in {kind, ""}:
        raise InputError(f"{path}: holds {WORDS[found]}, not {WORDS[kind]}: not replaced")


def kind_of(path: Path) -> str:
    """What a file holds, as far as its beginning tells; "" if it is empty."""
    with path.open("rb") as file:
        start = file.read(BEGINNING)
    for signature, kind in SIGNATURES.items():
        if start.startswith(signature):
            return kind
    if b"<svg" in start:
        return "picture"
    if start.startswith(b"PK"):
        with suppress(OSError, zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            if "schema.json" in names:
                return "surrogate"
            if all(name.endswith(".npy") for name in names):
                return "arrays"
    if start.translate(None, TEXT):
        return "binary"
    return "text" if start else ""


def _try_beside(path: Path) -> None:
    """Make a file in a file's folder, and remove it."""
    trial = path.with_name(f".asperity-{secrets.token_hex(8)}")
    os.close(os.open(trial, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
    trial.unlink()


def _files_of(inputs: Iterable[Path | str]) -> Iterator[Path]:
    """Files among the inputs, and those in folders among them."""
    for each in map(Path, inputs):
        with suppress(OSError):
            if each.is_dir():
                yield from (file for file in each.iterdir() if file.suffix.lower() != ".csv")
            else:
                yield each


def _is_same(one: Path, other: Path) -> bool:
    """Whether two names lead, or would lead, to one file: links of both kinds count."""
    with suppress(OSError, RuntimeError):  # one of them is not there yet, or a loop of links
        return one.samefile(other) if one.exists() else one.resolve() == other.resolve()
    return False


@contextmanager
def _in_words(path: Path, trouble: str) -> Iterator[None]:
    """Turn a system error into one line for the user."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} {trouble}: {error.strerror or error}") from None
