"""How every command of the project ends: one clear line and exit code 2 for bad input."""

import sys
from collections.abc import Sequence
from typing import Any

import typer

from gen.errors import InputError
from gen.terminal import printable

# The base class of what typer raises for a wrong command line; its own home has moved twice.
CommandLineError: Any = typer.BadParameter.__mro__[2]

EXTRAS = {
    "jinja2": "bench",
    "mapie": "learn",
    "matplotlib": "plot",
    "pytest": "bench",
    "sklearn": "learn",
    "skops": "learn",
    "SurfaceTopography": "instruments",
    "xgboost": "learn",
}
"""Packages that only some commands need, and the extra that brings each."""


def call(app: typer.Typer, name: str, arguments: Sequence[str], *, speaking: bool = True) -> int:
    """Run a command and return the process's exit code.

    Parameters
    ----------
    app : the commands
    name : what the user typed before the arguments
    arguments : the command line
    speaking : False on all ranks but one, so that an error is printed once

    Returns
    -------
    0 for success, 2 for input that cannot be used, 130 after Ctrl-C, or what the command exits with
    """
    try:
        code = app(list(arguments), prog_name=name, standalone_mode=False)
    except CommandLineError as error:
        context = getattr(error, "ctx", None)
        path = context.command_path if context else name
        message = f"{name}: {error.format_message()} (see python -m {path} --help)"
        _complain(message, speaking=speaking)
        return 2
    except (InputError, ModuleNotFoundError) as error:
        _complain(f"{name}: {_in_words(error)}", speaking=speaking)
        return 2
    except (KeyboardInterrupt, typer.Abort):
        _complain(f"{name}: interrupted", speaking=speaking)
        return 130
    except BrokenPipeError:  # the reader of our output, `head` say, has had enough
        sys.stderr.close()
        return 141
    except OSError as error:  # a name too long, a full device, a folder without rights
        _complain(f"{name}: {error}", speaking=speaking)
        return 2
    return code if isinstance(code, int) else 0


def _in_words(error: InputError | ModuleNotFoundError) -> str:
    """What to tell; a module of our own that is missing is a bug, and is raised again."""
    if isinstance(error, InputError):
        return str(error)
    package = (error.name or "").partition(".")[0]
    if package not in EXTRAS:
        raise error
    return f"needs {package}, which is not installed: pip install -e '.[{EXTRAS[package]}]'"


def _complain(message: str, *, speaking: bool) -> None:
    if speaking:
        sys.stderr.write(printable(" ".join(message.split())) + "\n")
        sys.stderr.flush()
