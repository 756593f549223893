"""Groups of options: on the command line one by one, in a command one argument."""

import shlex
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints

import typer

from gen.runtime.invocation import to_type


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
    """Expand the arguments of a command that are groups of options, for Typer.

    Parameters
    ----------
    command : callable
        A command. An argument annotated with a NamedTuple is a group: its fields, with their
        annotations and defaults, are the options.

    Returns
    -------
    callable
        The command with the fields in the places of the groups.
    """
    kinds = get_type_hints(command, include_extras=True)
    groups = {name: kind for name, kind in kinds.items() if hasattr(kind, "_field_defaults")}
    parameters: list[Parameter] = []
    for parameter in signature(command).parameters.values():
        name, kind = parameter.name, kinds[parameter.name]
        own = parameter.replace(annotation=kind, kind=Parameter.KEYWORD_ONLY)
        parameters += _options(kind) if name in groups else [own]

    @wraps(command)
    def called(**given: Any) -> Any:
        for name, group in groups.items():
            given[name] = group(**{field: given.pop(field) for field in group._fields})
        return command(**given)

    called.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters}
    return called


def _options(group: Any) -> list[Parameter]:
    """Return the fields of a group as parameters of a function."""
    kinds = get_type_hints(group, include_extras=True)
    return [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kinds[name])
        for name, default in group._field_defaults.items()
    ]


def typed(context: typer.Context, program: str) -> str:
    """Return the command line of a command, for the record, without the defaults.

    Parameters
    ----------
    context : typer.Context
        Context of the command.
    program : str
        Package that the command belongs to.
    """
    words = [*to_type(program).split(), str(context.info_name)]
    for parameter in context.command.params:
        name = str(parameter.name)
        source = context.get_parameter_source(name)
        if source is None or source.name != "COMMANDLINE":
            continue
        given = context.params[name]
        values = given if isinstance(given, list | tuple) else [given]
        option = [] if parameter.param_type_name == "argument" else [parameter.opts[0]]
        for value in values:
            words += [*option, str(value)] if value is not True else option
    return shlex.join(words)
