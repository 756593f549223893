"""How every command of the project ends: one clear line, and one exit code on all ranks."""

import os
import sys
import time
from collections.abc import Collection, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import typer

from gen.runtime import farm, memory, startup
from gen.runtime.errors import InputError
from gen.runtime.terminal import printable

# The base class of what typer raises for a wrong command line; its own home has moved twice.
CommandLineError: Any = typer.BadParameter.__mro__[2]

LONGEST = 1200
"""Characters of a line of complaint at most: what is wrong stands at both ends."""

EXTRAS = {
    "jinja2": "bench",
    "mapie": "learn",
    "matplotlib": "plot",
    "pytest": "bench",
    "sklearn": "learn",
    "SurfaceTopography": "instruments",
    "xgboost": "learn",
}
"""Packages that only some commands need, and the extra that brings each."""

FORWARDING = 0.5
"""Time that a launcher has for passing on a last line [s]: what it holds when it hears of the abort
is lost."""


def main(
    app: typer.Typer,
    name: str,
    arguments: Sequence[str],
    *,
    together: Collection[str] = (),
    alone: bool = False,
) -> int:
    """Run a command on the processes that it needs; return the exit code, the same on all of them.

    Whatever ends the command on the master ends it on the workers too, wherever they wait: bad
    input, a disk that is full, a package that is missing. The master alone tells why. A bug ends
    all processes at once, with its traceback.

    Parameters
    ----------
    app : the commands
    name : what the user typed before the arguments
    arguments : the command line
    together : names of the commands that the workers take part in; the others are the master's
    alone : True for commands that refuse to be more than one process: they measure times

    Returns
    -------
    0 for success, 2 for input that cannot be used, 130 after Ctrl-C, or what the command exits with
    """
    world = farm.World()
    try:
        world = farm.this_world()
        joins = arguments[:1] and arguments[0] in together and "--help" not in arguments
        code, message = 0, ""
        if alone and world.size > 1:
            code, message = 2, f"{name}: started as {world.size} processes; start it as one"
        elif world.is_master or joins:
            code, message = _run(app, name, arguments)
        if world.is_master and message:
            _complain(message)
        return _ended(world, code, message)
    except farm.MasterLeft as left:
        return left.code
    except InputError as error:  # there is no world to agree with
        _complain(f"{name}: {error}")
        return 2
    except Exception:
        world.abort()


def _ended(world: farm.World, code: int, message: str) -> int:
    """Agree on the master's exit code; what ends one worker alone ends all processes."""
    try:
        return world.end(code)
    except RuntimeError:
        if not message:
            raise
        _complain(f"{message} (rank {world.rank})")
        time.sleep(FORWARDING)
        world.communicator.Abort(code)
        sys.exit(code)


def _run(app: typer.Typer, name: str, arguments: Sequence[str]) -> tuple[int, str]:
    """Run a command on this process.

    Returns
    -------
    (code, message) : the exit code, and what to tell the user, "" for nothing
    """
    try:
        code = _invoke(app, name, arguments)
    except typer.Exit as left:  # --help
        code = left.exit_code
    except farm.MasterLeft:
        raise
    except SystemExit as left:  # of a library: the other ranks have to hear of it
        code = left.code if isinstance(left.code, int) else 1
    except (KeyboardInterrupt, typer.Abort):
        return 130, f"{name}: interrupted"
    except BrokenPipeError:  # the reader of our output, `head` say, has had enough
        _drop_output()
        return 141, ""
    except (CommandLineError, InputError, ModuleNotFoundError, OSError) as error:
        if isinstance(error, OSError) and error.filename == startup.OUTPUT:
            _drop_output()
        return 2, _in_words(name, error)
    except MemoryError as error:
        allowed = memory.size(memory.allowed())
        fault = f"{str(error) or 'no more is given'}; {allowed} are allowed here"
        return 2, f"{name}: this needs more memory than there is: {fault}, shared with all else"
    return code, ""


def _invoke(app: typer.Typer, name: str, arguments: Sequence[str]) -> int:
    """Run a command; raise what it raises, and what its output's device does."""
    command = _built(app)
    with command.make_context(name, list(arguments)) as context:
        code = command.invoke(context)
    if sys.stdout is not None:
        sys.stdout.flush()
    return code if isinstance(code, int) else 0


@cache
def _built(app: typer.Typer) -> Any:
    """Return what parses a command line; to build it takes longer than to refuse one."""
    return typer.main.get_command(app)


def _in_words(name: str, error: Exception) -> str:
    """What to tell; a module of our own that is missing is a bug, and is raised again."""
    if isinstance(error, CommandLineError):
        context = getattr(error, "ctx", None)
        path = context.command_path if context else name
        return f"{name}: {error.format_message()} (see python -m {path} --help)"
    if isinstance(error, OSError):  # a name too long, a full device, a folder without rights
        return f"{name}: {_place(error)}{error.strerror or error}"
    if isinstance(error, ModuleNotFoundError):
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise error
        extra = EXTRAS[package]
        return f"{name}: needs {package}, which is not installed: pip install -e '.[{extra}]'"
    return f"{name}: {error}"


def _place(error: OSError) -> str:
    """Name what an error of the system is about, as far as it says."""
    if isinstance(error.filename, str | bytes):
        return f"{os.fsdecode(error.filename)}: "
    try:
        Path.cwd()
    except OSError:
        return "the working folder: "
    return ""


def _complain(message: str) -> None:
    """Say one line on standard error, if that can be written to."""
    with suppress(OSError, ValueError, AttributeError):
        line = printable(" ".join(message.split()))
        if len(line) > LONGEST:  # of a name or a number that nobody has typed by hand
            line = f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"
        sys.stderr.write(line + "\n")
        sys.stderr.flush()


def _drop_output() -> None:
    """Drop what standard output still holds: Python would try again, and complain, as it exits."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
