"""Functions of the user's that scenes name: found by name, and known by their source.

No function is looked for, let alone run, unless the user gives `--trust`. The source whose hash a
database records is the one that runs: it is compiled here, because Python's own import may take the
compiled file of an earlier source that was changed within the same second.
"""

import functools
import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

from gen.runtime import memory
from gen.runtime.errors import SourceError
from gen.runtime.farm import Overtime

Function = Callable[..., Any]

LONGEST_REASON = 200  # letters of an error's message that are repeated

TRUSTED: ContextVar[bool] = ContextVar("TRUSTED", default=False)
"""Whether the user trusts the functions that scenes and databases name: the option `--trust`."""

_compiled: dict[str, ModuleType] = {}
"""Modules that were compiled here, by their names."""


def source_hash(name: str) -> str:
    """Compute the SHA-256 of the source of a function's module; nothing is imported.

    Parameters
    ----------
    name : str
        The function, such as "module:function".

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    SourceError
        If `source_of` finds no source, or it cannot be read.
    """
    with source_errors(name):
        return hashlib.sha256(source_of(name).read_bytes()).hexdigest()


@functools.lru_cache(maxsize=16)
def load_function(name: str, source: str | None) -> Function:
    """Import a user's function whose source has not changed since its hash was recorded.

    Parameters
    ----------
    name : str
        The function, such as "module:function".
    source : str or None
        SHA-256 of the module's source, as a database records it. None, from a file that no run has
        made, is refused.

    Returns
    -------
    callable
        The function, which is kept for the next call.

    Raises
    ------
    SourceError
        If the source is not found or has another hash, if its import fails, or if it has no such
        function.
    """
    if source is None:
        raise SourceError(f"{name}: the scene lacks the hash of its source")
    with source_errors(name):
        path = source_of(name)
        content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != source:
        raise SourceError(f"{name}: {path} has changed since the database was made")
    module, _, attribute = name.partition(":")
    function = getattr(_imported(name, module, path, content), attribute, None)
    if not callable(function):
        raise SourceError(f"{name}: {path} has no function {attribute}")
    return function  # type: ignore[no-any-return]


@contextmanager
def source_errors(
    place: str, passing: tuple[type[Exception], ...] = (ArithmeticError,)
) -> Iterator[None]:
    """Turn an error of a user's code in the block into a SourceError of one line.

    If the code ran out of memory, the message says so, because the contact itself may need little.

    Parameters
    ----------
    place : str
        Function and row that the code belongs to; the message begins with it.
    passing : tuple of exception types
        Errors that pass unchanged, besides Overtime, SourceError and KeyboardInterrupt.

    Yields
    ------
    None

    Raises
    ------
    SourceError
        In place of any other error, SystemExit included.
    """
    unchanged: tuple[type[Exception], ...] = (*passing, Overtime, SourceError)
    try:
        yield
    except unchanged:
        raise
    except MemoryError as error:
        allowed = memory.format_bytes(memory.allowed())
        fault = _with_reason("this code of your own has run out of memory", error)
        raise SourceError(
            f"{place}: {fault}; {allowed} are allowed here, shared with all else"
        ) from error
    except (Exception, SystemExit, GeneratorExit) as error:
        fault = _with_reason(type(error).__name__, error)
        raise SourceError(f"{place}: {fault}") from error


def _with_reason(fault: str, error: BaseException) -> str:
    """Return a fault and after a colon the beginning of the error's message, if it has one."""
    reason = " ".join(str(error).split())[:LONGEST_REASON]
    if not reason:
        return fault
    return f"{fault}: {reason}"


def source_of(name: str) -> Path:
    """Find the file of a function's module without importing anything.

    The current folder is put first on Python's search path, unless it is on it.

    Parameters
    ----------
    name : str
        The function, such as "package.module:function".

    Returns
    -------
    Path
        A Python file.

    Raises
    ------
    SourceError
        If the user does not trust functions of files, or Python finds no such module.
    """
    if not TRUSTED.get():
        raise SourceError(
            f"{name}: is code that a scene or a database names, which runs only with --trust; read"
            " it first"
        )
    module = name.partition(":")[0]
    first, *inner = module.split(".")
    folder = str(Path.cwd())
    if folder not in sys.path and "" not in sys.path:
        sys.path.insert(0, folder)
    importlib.invalidate_caches()
    with source_errors(name):
        spec = _top_spec(first)
    if spec is not None:
        for path in _candidates(spec, inner):
            if path.suffix == ".py" and path.is_file():
                return path
    raise SourceError(
        f"{name}: no module {module} in {folder}, nor where Python finds modules"
    )


def _top_spec(module: str) -> ModuleSpec | None:
    """Return where Python finds a module without a dot in its name, None if nowhere.

    `importlib.util.find_spec` would import the packages of a dotted name.
    """
    for finder in sys.meta_path:
        spec = finder.find_spec(module, None)
        if spec is not None:
            return spec
    return None


def _candidates(spec: ModuleSpec, inner: list[str]) -> list[Path]:
    """Return the files that a module may have, from the spec of its package and the inner names."""
    if not inner:
        return [Path(spec.origin or "")]
    paths = []
    for root in spec.submodule_search_locations or ():
        stem = Path(root, *inner)
        paths += [stem / "__init__.py", Path(f"{stem}.py")]
    return paths


def _imported(name: str, module: str, path: Path, content: bytes) -> ModuleType:
    """Run a source as a module and return it, or return the module that other code has imported.

    The module is put into `sys.modules`. A SourceError has the function's name if the source fails.
    """
    present = sys.modules.get(module)
    if present is not None and present is not _compiled.get(module):
        return present
    spec = importlib.util.spec_from_file_location(module, path)
    assert spec is not None
    new = importlib.util.module_from_spec(spec)
    sys.modules[module] = new
    _compiled[module] = new
    try:
        with source_errors(f"{name}: importing {module} failed", passing=()):
            if new.__package__ not in {"", module}:
                importlib.import_module(str(new.__package__))
            exec(compile(content, str(path), "exec"), new.__dict__)
    except BaseException:
        del sys.modules[module], _compiled[module]
        raise
    return new
