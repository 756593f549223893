"""Find, check and import the users' functions that scenes name.

No function is looked for, let alone run, unless the user gives `--trust`. A database records the
hash of the source of a function, and only a source with this hash is run. It is compiled here,
because Python's import may take the compiled file of an earlier source, if the source was changed
within a second.
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

LONGEST_REASON = 200
"""Largest number of letters of an error's message that a SourceError repeats."""

TRUSTED: ContextVar[bool] = ContextVar("TRUSTED", default=False)
"""Whether the user trusts the functions that scenes and databases name: the option `--trust`."""

_compiled: dict[str, ModuleType] = {}
"""Modules that `_imported` has compiled and put into `sys.modules`, by their names."""


def source_hash(name: str) -> str:
    """Compute the SHA-256 of the source of a function's module, without importing it.

    Parameters
    ----------
    name : str
        Module and function, such as "module:function".

    Returns
    -------
    str
        64 hexadecimal digits.

    Raises
    ------
    SourceError
        If the user does not trust functions of files, or the source is not found or cannot be read.
    """
    with source_errors(name):
        return hashlib.sha256(source_of(name).read_bytes()).hexdigest()


@functools.lru_cache(maxsize=16)
def load_function(name: str, source: str | None) -> Function:
    """Import a user's function if its source has not changed since its hash was recorded.

    The module of the function is run, and stays imported.

    Parameters
    ----------
    name : str
        Module and function, such as "module:function".
    source : str or None
        SHA-256 of the module's source, as a database records it. None, from a scene that lacks it,
        is refused.

    Returns
    -------
    callable
        The function. Later calls with equal arguments return it from a cache, without checks.

    Raises
    ------
    SourceError
        If `source` is None, the user does not trust functions of files, the source is not found or
        has another hash, its import fails, or it has no such function.
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

    If memory has run out, the message says that the user's code took it, because otherwise the user
    would suspect the contact.

    Parameters
    ----------
    place : str
        Name of the function, and of the row if it is known; the message begins with it.
    passing : tuple of exception types
        Errors that are raised unchanged, besides Overtime, SourceError and KeyboardInterrupt.

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
    """Return "FAULT: MESSAGE" in one line, with the first `LONGEST_REASON` letters of the message.

    Of an error without a message, return the fault alone.
    """
    message = " ".join(str(error).split())
    reason = message[:LONGEST_REASON]
    if not reason:
        return fault
    return f"{fault}: {reason}"


def source_of(name: str) -> Path:
    """Find the file of a function's module without importing anything.

    The current folder is put first on Python's search path, unless it is there already.

    Parameters
    ----------
    name : str
        Module and function, such as "package.module:function".

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
    # Only the top package is looked up: `importlib.util.find_spec` would import the packages of a
    # dotted name.
    package, *inner_names = module.split(".")
    folder = str(Path.cwd())
    if folder not in sys.path and "" not in sys.path:  # "" is the current folder
        sys.path.insert(0, folder)
    importlib.invalidate_caches()  # a file may have been written since the last look-up
    with source_errors(name):
        spec = _top_spec(package)
    if spec is not None:
        for path in _candidates(spec, inner_names):
            if path.suffix == ".py" and path.is_file():
                return path
    raise SourceError(
        f"{name}: no module {module} in {folder}, nor where Python finds modules"
    )


def _top_spec(module: str) -> ModuleSpec | None:
    """Return Python's spec of a module without a dot in its name, None if there is no such module.

    Nothing is imported.
    """
    for finder in sys.meta_path:
        spec = finder.find_spec(module, None)
        if spec is not None:
            return spec
    return None


def _candidates(spec: ModuleSpec, inner_names: list[str]) -> list[Path]:
    """Return the paths that the file of a module may have; not all of them exist.

    `spec` is that of the top package. `inner_names` are the names that follow it in the dotted name
    of the module; the list is empty if the module is the top package itself.
    """
    if not inner_names:
        return [Path(spec.origin or "")]
    paths = []
    for root in spec.submodule_search_locations or ():
        stem = Path(root, *inner_names)
        paths += [stem / "__init__.py", Path(f"{stem}.py")]
    return paths


def _imported(name: str, module: str, path: Path, content: bytes) -> ModuleType:
    """Run the source `content` as a module, put it into `sys.modules`, and return it.

    If other code has imported the module already, its module is returned, and nothing is run. If
    the source fails, a SourceError with the name of the function is raised.
    """
    present_module = sys.modules.get(module)
    # A module that was compiled here is run anew, because its source may have changed.
    compiled_here = present_module is _compiled.get(module)
    if present_module is not None and not compiled_here:
        return present_module
    spec = importlib.util.spec_from_file_location(module, path)
    assert spec is not None
    new_module = importlib.util.module_from_spec(spec)
    sys.modules[module] = new_module
    _compiled[module] = new_module
    try:
        with source_errors(f"{name}: importing {module} failed", passing=()):
            package = str(new_module.__package__)
            if package not in {"", module}:  # a module inside a package
                importlib.import_module(package)
            exec(compile(content, str(path), "exec"), new_module.__dict__)
    except BaseException:
        del sys.modules[module], _compiled[module]
        raise
    return new_module
