"""Run a command so that it ends with one clear line and the same exit code on all ranks.

`grouped` lets commands share options, `main` runs a command line in a `gen.runtime.farm.process`.
"""

import os
import re
import shlex
import signal
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from functools import cache, partial, wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from gen.runtime import VERSION, farm, memory
from gen.runtime.errors import InputError, errno_of, file_of
from gen.runtime.terminal import LOST, command_to_type, drop, echo, put

CommandLineError: Any = typer.BadParameter.__mro__[2]
"""Base class of typer's errors about a command line; typer has moved it twice."""

LONGEST = 1200  # most characters of a message; the middle of longer ones is left out

MOST_DETAILS = 40  # most lines of a list below a message

EMPTY = re.compile(
    "|--[^=]*="
)  # an argument without a value, as of a shell variable that is unset

EXTRAS = {
    "aiohttp": "serve",
    "jinja2": "bench",
    "skops": "learn",
    "matplotlib": "plot",
    "mlcroissant": "export",
    "pandas": "bench",
    "pyarrow": "export",
    "pytest": "bench",
    "sklearn": "learn",
    "SurfaceTopography": "instruments",
    "tomli_w": "export",
    "xgboost": "learn",
}
"""Extra that installs a package, for packages that only some commands need."""


Version = Annotated[bool, typer.Option("--version", help="Print the version.")]


def take_version(*, version: Version = False) -> None:
    """Take the option of a program that stands before its commands; `main` answers it."""


def _trust(context: typer.Context, wanted: bool) -> bool:
    """Trust functions that files name until the command has ended."""
    if wanted:
        from gen.runtime.user_code import TRUSTED

        context.call_on_close(partial(TRUSTED.reset, TRUSTED.set(wanted)))
    return wanted


Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        callback=_trust,
        help="Run the functions that a scene or a database names; without it none is run.",
    ),
]


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
    """Expand the arguments of a command that are groups of options, for Typer.

    An argument annotated with a NamedTuple or a dataclass is a group: its fields are the options,
    those of a dataclass if its `KEYS` have words for the help.
    """
    kinds = get_type_hints(command, include_extras=True)
    groups = {
        name: kind
        for name, kind in kinds.items()
        if hasattr(kind, "_field_defaults") or is_dataclass(kind)
    }
    parameters: list[Parameter] = []
    for parameter in signature(command).parameters.values():
        name, kind = parameter.name, kinds[parameter.name]
        own = parameter.replace(annotation=kind, kind=Parameter.KEYWORD_ONLY)
        parameters += _options(kind) if name in groups else [own]

    @wraps(command)
    def called(**given: Any) -> Any:
        for name, group in groups.items():
            own = {each.name: given.pop(each.name) for each in _options(group)}
            given[name] = group(**own)
        return command(**given)

    called.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters}
    return called


@cache
def _options(group: Any) -> list[Parameter]:
    """Return the fields of a group as parameters of a function."""
    kinds = get_type_hints(group, include_extras=True)
    defaults = getattr(group, "_field_defaults", None)
    if defaults is None:
        defaults = {
            each.name: each.default for each in fields(group) if each.name in group.KEYS
        }
        for name in defaults:
            flag, said = f"--{name.replace('_', '-')}", group.KEYS[name]
            option = typer.Option(flag, metavar=said.metavar or None, help=said.help)
            kinds[name] = Annotated[kinds[name], option]
    return [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kinds[name])
        for name, default in defaults.items()
    ]


def recorded_command_line(context: typer.Context, program: str) -> str:
    """Return the command line of a program's command, for the record, without the defaults."""
    words = [*command_to_type(program).split(), str(context.info_name)]
    for parameter in context.command.params:
        name = str(parameter.name)
        source = context.get_parameter_source(name)
        if source is None or source.name != "COMMANDLINE":
            continue
        given = context.params[name]
        values = given if isinstance(given, list | tuple) else [given]
        option = [] if parameter.param_type_name == "argument" else [parameter.opts[0]]
        for value in values:
            if isinstance(value, bool):
                words += option if value else [parameter.secondary_opts[0]]
            else:
                words += [*option, str(value)]
    return shlex.join(words)


def main(
    app: typer.Typer,
    arguments: Sequence[str],
    name: str,
    *,
    collective: Collection[str] = (),
    single_process: bool = False,
) -> int:
    """Run a command on all its processes and return the same exit code on all of them.

    If the command ends on the master (bad input, a full disk, a missing package), it ends on the
    workers too, wherever they wait, and the master alone prints why. A bug ends all processes at
    once with its traceback. The workers take part in the commands named in `collective`; with
    `single_process` more than one process is refused, for programs that measure times.
    Commands that are not named there need no MPI: where it does not start, the first process works
    alone. Codes are those of docs/compatibility.md.
    """
    world = farm.World()
    LOST.clear()
    try:
        code, message = 0, ""
        details: tuple[str, ...] = ()
        with _interruptible(single_process):
            try:
                first = arguments[0] if arguments else ""
                joins = first in collective and "--help" not in arguments
                world = _world(needed=joins)
                _refuse(arguments, world.size if single_process else 1)
                code = _ended(app, arguments, name, world, joins=joins)
            except (Exception, SystemExit, KeyboardInterrupt) as error:
                code, message = _end_after(error, name)
                details = getattr(error, "details", ())
        if world.is_master and message:
            _complain(message, details)
        try:
            return world.end(code)
        except (
            RuntimeError
        ) as left:  # the command has failed on this worker alone: all end
            _complain(f"{message or left} (rank {world.rank})")
            world.abort(code)
    except farm.MasterLeft as left:
        return left.code
    except Exception:
        world.abort()


@contextmanager
def _interruptible(wanted: bool) -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt, if it is wanted: on one of several ranks it must not."""
    if not wanted:
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _world(*, needed: bool) -> farm.World:
    """Join the other processes; alone if that fails for a command that one process does."""
    try:
        return farm.this_world()
    except InputError:
        if needed:
            raise
        return farm.without_mpi()


def _ended(
    app: typer.Typer,
    arguments: Sequence[str],
    name: str,
    world: farm.World,
    *,
    joins: bool,
) -> int:
    """Run a command to its end, on a worker if it takes part, and return its exit code."""
    returned = None
    if list(arguments[:1]) == ["--version"] and world.is_master:
        echo(f"asperity {VERSION}")
    elif world.is_master or joins:
        with _built(app).make_context(name, list(arguments)) as context:
            memory.require_blas()
            returned = context.command.invoke(context)
    put("", sys.stdout, last=True)
    return returned if isinstance(returned, int) else 0


def _refuse(arguments: Sequence[str], processes: int) -> None:
    """Refuse more than one process, and values that are empty, as of a shell's unset variable."""
    if processes > 1:
        raise InputError(f"started as {processes} processes; start it as one")
    for place, argument in enumerate(arguments):
        if EMPTY.fullmatch(argument):
            after = f" after {arguments[place - 1]!r}" if place else ""
            raise InputError(
                f"{argument!r}{after} is empty: give a value, or leave it out"
            )


def run_script(script: Callable[[list[str]], object]) -> None:
    """Run the main function of a script; unusable input ends it with one line and exit code 2.

    Parameters
    ----------
    script : callable
        Takes the words of the command line after the script's name.

    Raises
    ------
    SystemExit
        If the input cannot be used, memory has run out or Ctrl-C was pressed.
    """
    try:
        script(sys.argv[1:])
    except (Exception, KeyboardInterrupt) as error:
        code, message = _end_after(error, Path(sys.argv[0]).name)
        if message:
            _complain(message)
        sys.exit(code)


def _end_after(error: BaseException, name: str) -> tuple[int, str]:
    """Return the exit code and the message to the user, or "", of an error; raise a bug again."""
    match error:
        case (
            typer.Exit() | SystemExit()
        ):  # --help, or a library; the other ranks have to end too
            code = error.exit_code if isinstance(error, typer.Exit) else error.code
            return code if isinstance(code, int) else 1, ""
        case KeyboardInterrupt() | typer.Abort():
            return 130, f"{name}: interrupted"
        case BrokenPipeError():  # the reader of our output, for example `head`, has ended
            drop(sys.stdout)
            return 141, ""
    return 2, f"{name}: {_refusal(error, name)}"


def _refusal(error: BaseException, name: str) -> str:
    """Return what input, machine or installation lack, in words; raise a bug again."""
    text = str(error)
    match error:
        case InputError():
            return str(error.args[0])
        case CommandLineError():
            context = getattr(error, "ctx", None)
            path = command_to_type(context.command_path if context else name)
            return f"{error.format_message()} (see {path} --help)"
        case _ if memory.is_shortage(error):
            last = text.splitlines()[-1] if text else "no more is given"
            return (
                f"this needs more memory than there is: {last};"
                f" {memory.format_bytes(memory.allowed())} are allowed here, shared with all else"
            )
        case _ if number := errno_of(error):  # a full device, a folder without rights
            place = file_of(error)
            reason = getattr(error, "strerror", None) or os.strerror(number)
            return f"{place}: {reason}" if place else str(reason)
        case OSError():
            return text
        case ModuleNotFoundError():
            package = (error.name or "").partition(".")[0]
            if package in EXTRAS:  # otherwise it is a module of our own
                from gen.runtime.installation import command_for

                return f"needs {package}, which is not installed: {command_for(EXTRAS[package])}"
    raise error


_built: Any = cache(
    typer.main.get_command
)  # the parser of an app, which takes long to build


def _complain(message: str, details: Sequence[str] = ()) -> None:
    """Write one line on standard error, and the list that belongs to it, if that is possible."""
    listed = [f"  {_one_line(detail)}" for detail in details[:MOST_DETAILS]]
    if len(details) > MOST_DETAILS:
        listed.append(f"  and {len(details) - MOST_DETAILS} more")
    with suppress(ValueError):
        for line in (_one_line(message), *listed):
            echo(line, err=True)


def _one_line(text: str) -> str:
    """Put a text into one line, and leave the middle of a long one out."""
    line = " ".join(text.split())
    if len(line) > LONGEST:  # holds a name or a number that nobody has typed by hand
        line = f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"
    return line
