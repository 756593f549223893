"""Functions of the user's that scenes name: found by name, and known by their source.

No function is looked for, let alone run, unless the user says `--trust`. The source whose hash a
database records is the one that runs: it is compiled here, as Python's own import may take the
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
from pathlib import Path
from types import ModuleType
from typing import Any

from gen.runtime import memory
from gen.runtime.errors import SourceError
from gen.runtime.farm import Overtime

Function = Callable[..., Any]

TRUSTED: ContextVar[bool] = ContextVar("TRUSTED", default=False)
"""Whether the user trusts the functions that scenes and databases name: the option `--trust`."""

_compiled: dict[str, ModuleType] = {}  # modules that were compiled here, by their names


def source_hash(name: str) -> str:
    """Compute the SHA-256 of the source of a function's module, which `source_of` finds."""
    with source_errors(name):
        return hashlib.sha256(source_of(name).read_bytes()).hexdigest()


@functools.lru_cache(maxsize=16)
def load_function(name: str, source: str | None) -> Function:
    """Import a user's function "module:function" of a source with this SHA-256, or say why not."""
    if source is None:  # only a file that no run has made lacks it
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
    """Turn what a user's code raises, but for `passing` and a bound on time, into a SourceError.

    Memory that runs out in the user's code is named as such: the contact may need little.
    """
    elsewhere: tuple[type[Exception], ...] = (*passing, Overtime, SourceError)
    try:
        yield
    except elsewhere:
        raise
    except MemoryError as error:
        words = " ".join(str(error).split())[:200]
        allowed = memory.format_bytes(memory.allowed())
        raise SourceError(
            f"{place}: this code of your own has run out of memory{': ' if words else ''}{words};"
            f" {allowed} are allowed here, shared with all else"
        ) from error
    except (Exception, SystemExit, GeneratorExit) as error:
        words = " ".join(str(error).split())[:200]
        kind = type(error).__name__
        raise SourceError(f"{place}: {kind}{': ' if words else ''}{words}") from error


def source_of(name: str) -> Path:
    """Find the file of a function's module and import nothing; SourceError without trust."""
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
        # Not `importlib.util.find_spec`, which imports the packages of a dotted name.
        specs = (finder.find_spec(first, None) for finder in sys.meta_path)
        spec = next((spec for spec in specs if spec is not None), None)
    places = [] if spec is None else [Path(spec.origin or "")]
    if inner and spec is not None:
        stems = [Path(root, *inner) for root in spec.submodule_search_locations or ()]
        places = [
            path for stem in stems for path in (stem / "__init__.py", Path(f"{stem}.py"))
        ]
    for path in places:
        if path.suffix == ".py" and path.is_file():
            return path
    raise SourceError(
        f"{name}: no module {module} in {folder}, nor where Python finds modules"
    )


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
        with source_errors(f"{name}: importing {module} failed", passing=()):
            if made.__package__ not in {"", module}:
                importlib.import_module(str(made.__package__))
            exec(compile(content, str(path), "exec"), made.__dict__)
    except BaseException:
        del sys.modules[module], _compiled[module]
        raise
    return made
