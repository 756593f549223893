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
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, partial, wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from gen.runtime import VERSION, farm, memory
from gen.runtime.errors import InputError, errno_of, file_of
from gen.runtime.terminal import (
    OUTPUT_ERRORS,
    command_to_type,
    discard_pending,
    echo,
    finish_output,
)

CommandLineError: Any = typer.BadParameter.__mro__[2]
"""Base class of typer's errors about a command line; typer has moved it twice."""

LONGEST_LINE = 1200
"""Letters of a message; the middle of a longer one is left out."""

MOST_DETAILS = 40
"""Lines of a list below a message. The further lines of a longer list are only counted."""

EMPTY = re.compile("|--[^=]*=")
"""An argument without a value, which a shell makes of a variable that is not set."""

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
"""For each module that only some commands need, the extra that installs it."""


Version = Annotated[bool, typer.Option("--version", help="Print the version.")]


def take_version(*, version: Version = False) -> None:
    """Take the option that stands before the commands of a program; `main` answers it.

    Parameters
    ----------
    version : bool
        Whether the option is given.
    """


def _trust(context: typer.Context, trusted: bool) -> bool:
    """Trust functions that files name until the command has ended, if the user does."""
    if trusted:
        from gen.runtime.user_code import TRUSTED

        token = TRUSTED.set(True)
        context.call_on_close(partial(TRUSTED.reset, token))
    return trusted


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

    Parameters
    ----------
    command : callable
        Function of a command. An argument that is annotated with a NamedTuple or a dataclass is a
        group: each of its fields becomes an option. A NamedTuple annotates its fields with Typer's
        options; a dataclass has a `KEYS`, whose entries have a `metavar` and a `help`, and only
        fields with an entry become options.

    Returns
    -------
    callable
        Function that takes all options by name and calls the command with the groups.
    """
    annotations = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {}
    parameters: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        annotation = annotations[name]
        if hasattr(annotation, "_field_defaults") or is_dataclass(annotation):
            groups[name] = annotation
            parameters += _options(annotation)
        else:
            parameters.append(
                parameter.replace(annotation=annotation, kind=Parameter.KEYWORD_ONLY)
            )

    @wraps(command)
    def with_options(**values: Any) -> Any:
        for name, group in groups.items():
            names = [option.name for option in _options(group)]
            values[name] = group(**{option: values.pop(option) for option in names})
        return command(**values)

    with_options.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {
        parameter.name: parameter.annotation for parameter in parameters
    }
    return with_options


@cache
def _options(group: Any) -> list[Parameter]:
    """Return the options of a group as parameters of a function."""
    annotations = get_type_hints(group, include_extras=True)
    if hasattr(group, "_field_defaults"):
        defaults = group._field_defaults
    else:
        defaults = {
            field.name: field.default
            for field in fields(group)
            if field.name in group.KEYS
        }
        for name in defaults:
            key = group.KEYS[name]
            flag = f"--{name.replace('_', '-')}"
            option = typer.Option(flag, metavar=key.metavar or None, help=key.help)
            annotations[name] = Annotated[annotations[name], option]
    parameters = []
    for name, default in defaults.items():
        parameter = Parameter(
            name, Parameter.KEYWORD_ONLY, default=default, annotation=annotations[name]
        )
        parameters.append(parameter)
    return parameters


def recorded_command_line(context: typer.Context, program: str) -> str:
    """Return the command line of the running command, as files record it.

    Parameters
    ----------
    context : typer.Context
        Context of the command.
    program : str
        Name of its program, such as "gen".

    Returns
    -------
    str
        A line that a shell can run: the program as `command_to_type` writes it, the command, and
        the values that the user gave. Defaults are left out.
    """
    words = [*command_to_type(program).split(), str(context.info_name)]
    for parameter in context.command.params:
        name = str(parameter.name)
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            words += _words(parameter, context.params[name])
    return shlex.join(words)


def _words(parameter: Any, value: Any) -> list[str]:
    """Return the words of a command line that give a parameter of Typer its value or values."""
    if isinstance(value, bool):
        return [parameter.opts[0] if value else parameter.secondary_opts[0]]
    values = value if isinstance(value, list | tuple) else [value]
    if parameter.param_type_name == "argument":
        return [str(word) for word in values]
    words = []
    for word in values:
        words += [parameter.opts[0], str(word)]
    return words


def warn_deprecated(option: str, instead: str) -> None:
    """Print on standard error that an option leaves with version 2.0.

    Parameters
    ----------
    option : str
        The option that the user gave, such as "--solver".
    instead : str
        What to do in its place.
    """
    echo(f"warning: {option} leaves with version 2.0: {instead}", err=True)


@dataclass(frozen=True)
class _Ending:
    """How a command has ended on this process."""

    code: int  # exit code
    message: str = ""  # line for the user; empty without any
    details: tuple[str, ...] = ()  # list below the message


def main(
    app: typer.Typer,
    arguments: Sequence[str],
    name: str,
    *,
    collective: Collection[str] = (),
    single_process: bool = False,
) -> int:
    """Run a command on all its processes; a collective call.

    If the command ends on the master (bad input, a full disk, a missing package), it ends on the
    workers too, wherever they wait, and the master alone prints why. A bug ends all processes at
    once with its traceback.

    Parameters
    ----------
    app : typer.Typer
        The program.
    arguments : sequence of str
        Words of the command line after the program.
    name : str
        Name of the program, with which messages begin.
    collective : collection of str
        Commands in which the workers take part. Any other command is done by the master alone. It
        needs no MPI: where MPI does not start, the first process runs it.
    single_process : bool
        Whether more than one process is refused, for programs that measure times.

    Returns
    -------
    int
        Exit code, the same on all processes: one of docs/compatibility.md.
    """
    world = farm.World()
    OUTPUT_ERRORS.clear()
    try:
        with _interruptible(single_process):
            try:
                joins = bool(arguments) and arguments[0] in collective
                if "--help" in arguments:
                    joins = False
                world = _world(needed=joins)
                if single_process:
                    _refuse_several(world)
                _refuse_empty(arguments)
                takes_part = world.is_master or joins
                ending = _Ending(_exit_code(app, arguments, name, world, takes_part))
            except (Exception, SystemExit, KeyboardInterrupt) as error:
                ending = _ending_by(error, name)
        return _end(world, ending)
    except farm.MasterLeft as error:
        return error.code
    except Exception:
        world.abort()


def _end(world: farm.World, ending: _Ending) -> int:
    """Print on the master why a command has ended, and return its exit code on all processes.

    If the command has failed on this worker alone, the worker prints why, and all processes end.
    """
    if world.is_master and ending.message:
        _complain(ending.message, ending.details)
    try:
        return world.end(ending.code)
    except RuntimeError as error:
        _complain(f"{ending.message or error} (rank {world.rank})")
        world.abort(ending.code)


@contextmanager
def _interruptible(single_process: bool) -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in a single process; one of several must go on."""
    if not single_process:
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _world(*, needed: bool) -> farm.World:
    """Join the other processes; if MPI does not start and is not needed, work without it."""
    try:
        return farm.this_world()
    except InputError:
        if needed:
            raise
        return farm.without_mpi()


def _exit_code(
    app: typer.Typer,
    arguments: Sequence[str],
    name: str,
    world: farm.World,
    takes_part: bool,
) -> int:
    """Run a command if this process takes part in it, and return its exit code."""
    returned = None
    if list(arguments[:1]) == ["--version"]:
        if world.is_master:
            echo(f"asperity {VERSION}")
    elif takes_part:
        with _parser(app).make_context(name, list(arguments)) as context:
            memory.require_blas()
            returned = context.command.invoke(context)
    finish_output()
    if isinstance(returned, int):
        return returned
    return 0


def _refuse_several(world: farm.World) -> None:
    """Refuse more than one process."""
    if world.size > 1:
        raise InputError(f"started as {world.size} processes; start it as one")


def _refuse_empty(arguments: Sequence[str]) -> None:
    """Refuse arguments without a value."""
    after = ""
    for argument in arguments:
        if EMPTY.fullmatch(argument):
            raise InputError(
                f"{argument!r}{after} is empty: give a value, or leave it out"
            )
        after = f" after {argument!r}"


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
        ending = _ending_by(error, Path(sys.argv[0]).name)
        if ending.message:
            _complain(ending.message)
        sys.exit(ending.code)


def _ending_by(error: BaseException, name: str) -> _Ending:
    """Return how an error ends a command of the program `name`; raise a bug again."""
    match error:
        case typer.Exit():  # --help; the other ranks have to end too
            return _Ending(error.exit_code)
        case SystemExit():  # a library
            return _Ending(error.code if isinstance(error.code, int) else 1)
        case KeyboardInterrupt() | typer.Abort():
            return _Ending(130, f"{name}: interrupted")
        case BrokenPipeError():  # the reader of our output, for example `head`, has ended
            discard_pending(sys.stdout)
            return _Ending(141)
    details = error.details if isinstance(error, InputError) else ()
    return _Ending(2, f"{name}: {_refusal(error, name)}", details)


def _refusal(error: BaseException, name: str) -> str:
    """Return why input, machine or installation stop a command; raise a bug again."""
    match error:
        case InputError():
            return str(error.args[0])
        case CommandLineError():
            context = getattr(error, "ctx", None)
            path = command_to_type(context.command_path if context else name)
            return f"{error.format_message()} (see {path} --help)"
        case _ if memory.is_shortage(error):
            return _shortage(error)
        case _ if number := errno_of(error):  # a full device, a folder without rights
            reason = str(getattr(error, "strerror", None) or os.strerror(number))
            place = file_of(error)
            if place:
                reason = f"{place}: {reason}"
            return reason
        case OSError():
            return str(error)
        case ModuleNotFoundError():
            package = (error.name or "").partition(".")[0]
            if package in EXTRAS:  # otherwise it is a module of our own
                from gen.runtime.installation import command_for

                return f"needs {package}, which is not installed: {command_for(EXTRAS[package])}"
    raise error


def _shortage(error: BaseException) -> str:
    """Return the words for memory that has run out, with the last line of the error's message."""
    lines = str(error).splitlines()
    reason = lines[-1] if lines else "no more is given"
    allowed = memory.format_bytes(memory.allowed())
    return (
        f"this needs more memory than there is: {reason}; {allowed} are allowed here,"
        " shared with all else"
    )


@cache
def _parser(app: typer.Typer) -> Any:
    """Return the parser of a program, which takes long to build."""
    return typer.main.get_command(app)


def _complain(message: str, details: Sequence[str] = ()) -> None:
    """Print a message as one line on standard error, if that is possible, and its list below it."""
    lines = [_one_line(message)]
    lines += [f"  {_one_line(detail)}" for detail in details[:MOST_DETAILS]]
    if len(details) > MOST_DETAILS:
        lines.append(f"  and {len(details) - MOST_DETAILS} more")
    with suppress(ValueError):  # standard error has been closed
        for line in lines:
            echo(line, err=True)


def _one_line(text: str) -> str:
    """Return a text as one line, without the middle if it is longer than `LONGEST_LINE`.

    Such a text has a name or a number in it that nobody has typed by hand.
    """
    line = " ".join(text.split())
    if len(line) <= LONGEST_LINE:
        return line
    half = LONGEST_LINE // 2
    return f"{line[:half]} ... {line[-half:]}"
