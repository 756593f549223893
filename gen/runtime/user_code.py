"""Functions of the user's that scenes name: found by name, and known by their source.

The source whose hash a database records is the one that runs: it is compiled here, as Python's own
import may take the compiled file of an earlier source that was changed within the same second.
"""

import functools
import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from gen.runtime.errors import SourceError
from gen.runtime.overtime import Overtime

Function = Callable[..., Any]

_compiled: dict[str, ModuleType] = {}
"""Modules that were compiled here, by their names."""


def source_hash(name: str) -> str:
    """Compute the SHA-256 of the source of the module that has a function, without running it.

    Only the folders of a dotted name, which are packages, are imported.

    Parameters
    ----------
    name : str
        "module:function"; the module stands in the current folder or where Python finds modules.

    Returns
    -------
    str
        The hash in hexadecimal digits.

    Raises
    ------
    SourceError
        If there is no such module, or it has no source.
    """
    return hashlib.sha256(_read(name, source_of(name))).hexdigest()


@functools.lru_cache(maxsize=16)
def load_function(name: str, source: str) -> Function:
    """Import a function of the user's, whose module's code runs.

    Parameters
    ----------
    name : str
        "module:function"; the module stands in the current folder or where Python finds modules.
    source : str
        SHA-256 that the module's source needs to have.

    Returns
    -------
    callable
        The function.

    Raises
    ------
    SourceError
        If there is no such function, its module cannot be imported, or its source has changed.
    """
    path = source_of(name)
    content = _read(name, path)
    if hashlib.sha256(content).hexdigest() != source:
        raise SourceError(f"{name}: {path} has changed since the database was made")
    module, _, attribute = name.partition(":")
    function = getattr(_imported(name, module, path, content), attribute, None)
    if not callable(function):
        raise SourceError(f"{name}: {path} has no function {attribute}")
    return function  # type: ignore[no-any-return]


@contextmanager
def faults_of(
    place: str, passing: tuple[type[Exception], ...] = (ArithmeticError, MemoryError)
) -> Iterator[None]:
    """Turn what a user's code raises into an error of one line.

    A bound on the time passes through, as do the exceptions in `passing`.

    Parameters
    ----------
    place : str
        The function, and what it was called for.
    passing : tuple of type
        Exceptions that are handled elsewhere: a surface or a row may fail by its numbers.

    Raises
    ------
    SourceError
        For every other exception, also those that would end the program.
    """
    elsewhere: tuple[type[Exception], ...] = (*passing, Overtime, SourceError)
    try:
        yield
    except elsewhere:
        raise
    except (Exception, SystemExit, GeneratorExit) as error:
        raise SourceError(f"{place}: {_described(error)}") from error


def source_of(name: str) -> Path:
    """Find the file of the module that has a function.

    Parameters
    ----------
    name : str
        "module:function".

    Raises
    ------
    SourceError
        If there is no such module, or it has no source.
    """
    module = name.partition(":")[0]
    folder = str(Path.cwd())
    if folder not in sys.path and "" not in sys.path:
        sys.path.insert(0, folder)
    importlib.invalidate_caches()
    with _forgotten(module), faults_of(name):
        spec = importlib.util.find_spec(module)
    if spec is None or not spec.has_location or not (spec.origin or "").endswith(".py"):
        raise SourceError(f"{name}: no module {module} in {folder}, nor where Python finds modules")
    return Path(str(spec.origin))


@contextmanager
def _forgotten(module: str) -> Iterator[None]:
    """Let Python look for a module anew that was compiled here, perhaps from another folder."""
    ours = _compiled.get(module)
    present = ours is not None and sys.modules.get(module) is ours
    if present:
        del sys.modules[module]
    try:
        yield
    finally:
        if present and ours is not None:
            sys.modules[module] = ours


def _read(name: str, path: Path) -> bytes:
    """Read a source; a file that cannot be read has no function."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise SourceError(f"{name}: {path}: {error.strerror or error}") from None


def _imported(name: str, module: str, path: Path, content: bytes) -> ModuleType:
    """Run a source as a module, unless other code has imported the module already."""
    present = sys.modules.get(module)
    if present is not None and present is not _compiled.get(module):
        return present
    spec = importlib.util.spec_from_file_location(module, path)
    assert spec is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[module] = _compiled[module] = made
    try:
        with faults_of(f"{name}: importing {module} failed", passing=(MemoryError,)):
            exec(compile(content, str(path), "exec"), made.__dict__)
    except BaseException:
        del sys.modules[module], _compiled[module]
        raise
    return made


def _described(error: BaseException) -> str:
    """Return an exception's type and message in one line."""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' if words else ''}{words[:200]}"
