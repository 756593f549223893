"""Run a command so that it ends with one clear line and the same exit code on all ranks.

`grouped` lets commands share groups of options. `main` runs a command line; its caller has entered
`gen.runtime.farm.process`.
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
from typer.core import TyperCommand

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
"""Base class of Typer's errors about a command line.

It is taken from a subclass, because releases of Typer have moved it to another module twice.
"""

LONGEST_LINE = 1200
"""Largest number of letters of a printed message. In a longer one, " ... " takes the place of the
middle; its letters are not counted."""

MOST_DETAILS = 40
"""Largest number of lines of a list below a message; further lines are only counted."""

EMPTY = re.compile("|--[^=]*=")
"""An empty argument, or an option with an empty value.

A shell makes such an argument from a variable that is not set.
"""

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
"""Extra of pyproject.toml that installs a module which only some commands need, by its name."""


Version = Annotated[bool, typer.Option("--version", help="Print the version.")]


def take_version(*, version: Version = False) -> None:
    """Do nothing, so that Typer lists the option --version in the help of a program.

    `main` answers the option before Typer parses the command line.

    Parameters
    ----------
    version : bool
        Whether the option is given.
    """


class Command(TyperCommand):
    """A command that warns of an option with one value that is given twice: the last one counts."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of a command line, as the method of Typer does, and warn first.

        `args` are the words after the command's name, `ctx` is its context.
        """
        is_worker = ctx.obj is not None and not ctx.obj.is_master
        if not (ctx.resilient_parsing or is_worker or "--help" in args):
            _, _, parameters = self.make_parser(ctx).parse_args(list(args))
            _warn_of_repeated(parameters)
        return super().parse_args(ctx, args)


def _warn_of_repeated(parameters: Sequence[Any]) -> None:
    """Warn of options with one value among parameters of Typer, in the order of a command line."""
    for parameter in dict.fromkeys(parameters):
        number = parameters.count(parameter)
        if number > 1 and _has_one_value(parameter):
            option = parameter.opts[0]
            echo(
                f"warning: {option} was given {number} times: the last one counts",
                err=True,
            )


def _has_one_value(parameter: Any) -> bool:
    """Return whether a parameter of Typer is an option that takes a single value."""
    is_option: bool = parameter.param_type_name == "option"
    return is_option and not (parameter.multiple or parameter.is_flag or parameter.count)


def _trust(context: typer.Context, trusted: bool) -> bool:
    """Set `TRUSTED` until the command has ended if --trust is given, and return `trusted`.

    This is the callback that Typer calls with the value of the option.
    """
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
    """Replace the arguments of a command that are groups of options by single options, for Typer.

    Parameters
    ----------
    command : callable
        Function of a command. An argument that is annotated with a NamedTuple or a dataclass is a
        group. Of a NamedTuple, every field becomes an option, as its annotation describes it to
        Typer. Of a dataclass, the fields in its dictionary `KEYS` become options; an entry there
        has the attributes `metavar` and `help`.

    Returns
    -------
    callable
        Function that takes every option by name and calls the command with the groups.
    """
    annotations = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {}  # classes of the groups, by the names of their arguments
    parameters: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        annotation = annotations[name]
        is_named_tuple = hasattr(annotation, "_field_defaults")
        if is_named_tuple or is_dataclass(annotation):
            groups[name] = annotation
            parameters += _options(annotation)
        else:
            parameters.append(
                parameter.replace(annotation=annotation, kind=Parameter.KEYWORD_ONLY)
            )

    @wraps(command)
    def with_options(**values: Any) -> Any:
        """Call the command with a group in place of the values of its options."""
        for name, group in groups.items():
            option_names = [option.name for option in _options(group)]
            fields_of_group = {option: values.pop(option) for option in option_names}
            values[name] = group(**fields_of_group)
        return command(**values)

    # Typer reads the options from these attributes.
    with_options.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {
        parameter.name: parameter.annotation for parameter in parameters
    }
    return with_options


@cache
def _options(group: Any) -> list[Parameter]:
    """Return the options of a group, a NamedTuple or a dataclass, as parameters of a function."""
    annotations = get_type_hints(group, include_extras=True)
    if hasattr(group, "_field_defaults"):
        # The annotations of a NamedTuple describe the options already.
        defaults = group._field_defaults
    else:
        defaults = {
            field.name: field.default
            for field in fields(group)
            if field.name in group.KEYS
        }
        # The annotations of a dataclass are mere types; its `KEYS` describe the options.
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
    """Return the line that starts the running command again, for the record in a file.

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
        the arguments and options that the user gave. Options with default values are left out.
    """
    words = [*command_to_type(program).split(), str(context.info_name)]
    for parameter in context.command.params:
        name = str(parameter.name)
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            words += _words(parameter, context.params[name])
    return shlex.join(words)


def _words(parameter: Any, value: Any) -> list[str]:
    """Return the words of a command line that give a parameter of Typer this value.

    The value of an argument or option that may be repeated is a list or tuple of values.
    """
    if isinstance(value, bool):  # --flag or --no-flag, without a value
        return [parameter.opts[0] if value else parameter.secondary_opts[0]]
    values = value if isinstance(value, list | tuple) else [value]
    if parameter.param_type_name == "argument":
        return [str(single) for single in values]
    words = []
    for single in values:
        words += [parameter.opts[0], str(single)]
    return words


def warn_deprecated(option: str, instead: str) -> None:
    """Warn on standard error that version 2.0 will not have an option.

    Parameters
    ----------
    option : str
        The option that the user gave, such as "--solver".
    instead : str
        Imperative clause that says how to do without the option.
    """
    echo(f"warning: {option} leaves with version 2.0: {instead}", err=True)


@dataclass(frozen=True)
class _Ending:
    """How a command has ended on this process."""

    code: int  # exit code
    message: str = ""  # line for the user; "" prints nothing
    details: tuple[str, ...] = ()  # lines of the list below the message


def main(
    app: typer.Typer,
    arguments: Sequence[str],
    name: str,
    *,
    collective: Collection[str] = (),
    single_process: bool = False,
) -> int:
    """Run a command line of a program on all processes of this run; a collective call.

    If the command fails on the master (bad input, a full disk, a missing package), it ends on the
    workers too, wherever they wait, and only the master prints the reason. `OUTPUT_ERRORS` is
    emptied first. A bug prints its traceback and ends all processes at once.

    Parameters
    ----------
    app : typer.Typer
        The program.
    arguments : sequence of str
        Words of the command line after the name of the program.
    name : str
        Name of the program, with which messages begin.
    collective : collection of str
        Names of the commands in which workers take part. The master runs any other command alone,
        and such a command works even if MPI does not start.
    single_process : bool
        Whether to refuse more than one process, as programs that measure times do. Ctrl-C then
        interrupts the command.

    Returns
    -------
    int
        Exit code, the same on all processes. docs/compatibility.md lists the codes.
    """
    world = farm.World()  # of this process alone, until it has joined the other ones
    OUTPUT_ERRORS.clear()
    try:
        with _interruptible(single_process):
            try:
                is_collective = bool(arguments) and arguments[0] in collective
                if "--help" in arguments:  # the master alone prints the help
                    is_collective = False
                world = _world(needs_mpi=is_collective)
                if single_process:
                    _refuse_several(world)
                _refuse_empty(arguments)
                takes_part = world.is_master or is_collective
                code = _exit_code(app, arguments, name, world, takes_part=takes_part)
                ending = _Ending(code=code)
            except (Exception, SystemExit, KeyboardInterrupt) as error:
                ending = _ending_by(error, name)
        return _end(world, ending)
    except farm.MasterLeft as error:
        return error.code
    except Exception:  # a bug
        world.abort()


def _end(world: farm.World, ending: _Ending) -> int:
    """Print on the master why a command has ended, and return the master's exit code.

    This is a collective call. If the command has failed on this worker but not on the master, the
    worker prints the reason and ends all processes.
    """
    if world.is_master and ending.message:
        _complain(ending.message, ending.details)
    try:
        return world.end(ending.code)
    except RuntimeError as error:  # the master is still running the command
        _complain(f"{ending.message or error} (rank {world.rank})")
        world.abort(ending.code)


@contextmanager
def _interruptible(single_process: bool) -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt in the block if the program runs as a single process.

    If it may run as several processes, the handling of Ctrl-C is left as it is.
    """
    if not single_process:
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _world(*, needs_mpi: bool) -> farm.World:
    """Join the other processes of this run, and return all of them.

    If MPI does not start, raise InputError for a command that needs MPI, and otherwise return the
    world of a single process.
    """
    try:
        return farm.this_world()
    except InputError:
        if needs_mpi:
            raise
        return farm.without_mpi()


def _exit_code(
    app: typer.Typer,
    arguments: Sequence[str],
    name: str,
    world: farm.World,
    *,
    takes_part: bool,
) -> int:
    """Run a command line if this process takes part in it, and return its exit code.

    A command whose function returns no number has the exit code 0. The option --version is answered
    here.
    """
    returned = None
    if list(arguments[:1]) == ["--version"]:
        if world.is_master:
            echo(f"asperity {VERSION}")
    elif takes_part:
        with _parser(app).make_context(name, list(arguments), obj=world) as context:
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
    """Refuse an empty argument and an option with an empty value, as "--output="."""
    place = ""  # of the argument in the message
    for argument in arguments:
        if EMPTY.fullmatch(argument):
            raise InputError(
                f"{argument!r}{place} is empty: give a value, or leave it out"
            )
        place = f" after {argument!r}"


def run_script(script: Callable[[list[str]], object]) -> None:
    """Run the main function of a script, and print one line instead of a traceback if it fails.

    Input that cannot be used has the exit code 2, Ctrl-C 130.

    Parameters
    ----------
    script : callable
        Main function, which takes the words of the command line after the script's name.

    Raises
    ------
    SystemExit
        If the input cannot be used, memory has run out, Ctrl-C was pressed, or the reader of the
        output has ended. Any other error of the script is a bug and is raised unchanged.
    """
    try:
        script(sys.argv[1:])
    except (Exception, KeyboardInterrupt) as error:
        ending = _ending_by(error, Path(sys.argv[0]).name)
        if ending.message:
            _complain(ending.message)
        sys.exit(ending.code)


def _ending_by(error: BaseException, name: str) -> _Ending:
    """Return how an error ends a command of the program `name`.

    If the error is a bug, it is raised again.
    If the reader of standard output has ended, the text that is still to be written there is
    discarded.
    """
    match error:
        case typer.Exit():  # after --help
            return _Ending(code=error.exit_code)
        case SystemExit():  # raised by a library
            return _Ending(code=error.code if isinstance(error.code, int) else 1)
        case KeyboardInterrupt() | typer.Abort():
            # Exit codes above 128 are those that shells give: 128 plus the number of the signal.
            return _Ending(code=130, message=f"{name}: interrupted")
        case BrokenPipeError():  # the reader of our output, for example `head`, has ended
            discard_pending(sys.stdout)
            return _Ending(code=141)
    details = error.details if isinstance(error, InputError) else ()
    message = f"{name}: {_refusal(error, name)}"
    return _Ending(code=2, message=message, details=details)


def _refusal(error: BaseException, name: str) -> str:
    """Say what is wrong with the input, the machine or the installation, after an error.

    Any other error is a bug of the program `name`, and is raised again.
    """
    match error:
        case InputError():
            return str(error.args[0])
        case CommandLineError():
            context = getattr(error, "ctx", None)
            words = context.command_path if context else name  # as "gen contact"
            return f"{error.format_message()} (see {command_to_type(words)} --help)"
        case _ if memory.is_shortage(error):
            return _shortage(error)
        # an error of the system: a full device, a folder without rights
        case _ if number := errno_of(error):
            reason = str(getattr(error, "strerror", None) or os.strerror(number))
            path = file_of(error)
            if path:
                reason = f"{path}: {reason}"
            return reason
        case OSError():  # a library has raised it without a number
            return str(error)
        case ModuleNotFoundError():
            package = (error.name or "").partition(".")[0]
            if package in EXTRAS:  # a missing module of this program is a bug
                from gen.runtime.installation import command_for

                return f"needs {package}, which is not installed: {command_for(EXTRAS[package])}"
    raise error


def _shortage(error: BaseException) -> str:
    """Return the message for the user after an error of running out of memory.

    It contains the last line of the error's own text, and the memory that is allowed.
    """
    lines = str(error).splitlines()
    reason = lines[-1] if lines else "the system gives no more"
    allowed = memory.format_bytes(memory.allowed())
    return (
        f"this needs more memory than there is: {reason}; {allowed} are allowed here,"
        " shared with all else"
    )


@cache
def _parser(app: typer.Typer) -> Any:
    """Return the parser of a program. It takes long to build, so it is kept for the next call."""
    return typer.main.get_command(app)


def _complain(message: str, details: Sequence[str] = ()) -> None:
    """Print a message as one line on standard error, and the list of its details below it.

    If standard error is closed, nothing is printed.
    """
    lines = [_one_line(message)]
    lines += [f"  {_one_line(detail)}" for detail in details[:MOST_DETAILS]]
    if len(details) > MOST_DETAILS:
        lines.append(f"  and {len(details) - MOST_DETAILS} more")
    with suppress(ValueError):  # standard error has been closed
        for line in lines:
            echo(line, err=True)


def _one_line(text: str) -> str:
    """Return a text as one line, with single blanks between its words.

    If it is longer than `LONGEST_LINE`, its middle is left out: only a long name or number of the
    user's input makes a message as long as that.
    """
    line = " ".join(text.split())
    if len(line) <= LONGEST_LINE:
        return line
    half = LONGEST_LINE // 2
    return f"{line[:half]} ... {line[-half:]}"
