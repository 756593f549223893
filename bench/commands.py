"""The commands of `bench`: `run`, `page` and `publish`, and one for each report.

The TOML file of a report declares the options of its command. `add` makes the command from them.
"""

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any

import typer

from bench.contents import cell
from bench.files import markdown
from bench.report import PARTS, Part, Report, remark
from gen.runtime import command_line
from gen.runtime.errors import InputError
from gen.runtime.figure import new_figure
from gen.runtime.files import check_folder
from gen.runtime.terminal import echo

app = typer.Typer(add_completion=False, rich_markup_mode=None)
"""The program `bench` with all of its commands."""

_output = typer.Option("--output", "-o", metavar="DIR", help="The folder to write into.")
"""The option `--output` of all commands that write into a folder."""

# The annotations of parameters that several commands share: type and option.
Folder = Annotated[Path, _output]
OptionalFolder = Annotated[Path | None, _output]
Database = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="A database of the paper preset; without it, one is generated.",
    ),
]
Comparison = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder of learn compare and tune; without it, `comparison` in the folder of the run.",
    ),
]
Full = Annotated[
    bool,
    typer.Option(
        "--full",
        help="Full runs of all parts, for hours; without it, short ones of ten minutes.",
    ),
]
Names = Annotated[
    list[str] | None,
    typer.Argument(metavar="NAME", help="Reports to make; all of them if none is named."),
]

KEYWORD = inspect.Parameter.KEYWORD_ONLY
"""Kind of all parameters of the functions of commands: they have no order."""

LONGEST = 60
"""Largest number of rows of a table that is printed; longer tables are only written."""


@app.callback()
def describe_program(*, version: command_line.Version = False) -> None:
    """Reports on exactness and speed, each as a table (CSV) and a picture (PNG)."""


def main(arguments: Sequence[str], name: str = "bench") -> int:
    """Run one command line.

    Parameters
    ----------
    arguments : sequence of str
        The words after the name of the program.
    name : str
        Name of the program in messages and help texts.

    Returns
    -------
    int
        The exit code; docs/compatibility.md lists the codes.
    """
    return command_line.main(app, arguments, name, single_process=True)


@app.command(cls=command_line.Command)
def run(
    output: Folder,
    names: Names = None,
    *,
    full: Full = False,
    database: Database = None,
    comparison: Comparison = None,
    plan: Annotated[
        bool,
        typer.Option("--plan", help="List the parts with their times, and make nothing."),
    ] = False,
) -> int:
    """Make all reports, or the named ones, and their page DIR/index.html, which needs no network.

    Reports that take hours, such as `nine-models`, are made only if they are named.

    Every part runs as a command of its own, in DIR/PART. A part stays if the same command has made
    it from the same inputs, with the same code and packages: after Ctrl-C the same command goes on.
    A short run keeps the parts that a full run has made. The exit code is 1 if a check failed or a
    part could not be made.
    """
    from bench import run as running
    from bench.record import Inputs

    inputs = Inputs(output=output, database=database, comparison=comparison, full=full)
    if plan:
        _print(running.planned(inputs, names or ()))
        return 0
    path, outcome = running.run(inputs, names or ())
    echo(str(path))
    if outcome.signal:
        remark("bench: interrupted; the same command goes on")
        return 128 + outcome.signal  # as a shell reports a signal
    for name in outcome.failed:
        remark(f"bench: {name} failed, see {path} or {output / name}")
    return 1 if outcome.failed else 0


@app.command(cls=command_line.Command)
def page(
    folder: Annotated[Path, typer.Argument(help="Folder of `bench run`.")],
    *,
    full: Full = False,
    comparison: Comparison = None,
) -> None:
    """Write the page of a folder's parts again, without making a part."""
    from bench.page import write_page
    from bench.record import Inputs

    if not folder.is_dir():
        raise InputError(
            f"{folder} is not a folder; `asperity bench run -o {folder}` makes one"
        )
    inputs = Inputs(output=folder, database=None, comparison=comparison, full=full)
    echo(str(write_page(PARTS, inputs)))


@app.command(cls=command_line.Command)
def publish(
    folder: Annotated[Path, typer.Argument(help="Folder of `bench run --full`.")],
    target: Annotated[
        Path, typer.Argument(help="Folder of published results: bench/results.")
    ],
    *,
    comparison: Comparison = None,
) -> None:
    """Copy the results of a run into the folder of published results.

    Tables, pictures, words and records of all finished parts are copied, large tables compressed.
    A folder whose parts were all made loses its earlier files. Parts that were not finished are
    refused.
    """
    from bench.publish import publish as publish_parts
    from bench.record import Inputs

    inputs = Inputs(output=folder, database=None, comparison=comparison, full=True)
    for path in publish_parts(PARTS, inputs, target):
        echo(str(path))


def add(part: Part) -> None:
    """Add the command of a report to `app`, with the options that its TOML file declares.

    The command calls the function of the report (`measure`), prints its tables, and writes its
    files if the user gives a folder. Its exit code is 1 if a check of the report failed.

    Parameters
    ----------
    part : Part
        The report. Its `measure` is not empty.
    """

    def command(output: Path | None, **values: Any) -> int:
        """Make the report with the values of its options, and return the exit code."""
        return _make_report(part, output, values)

    parameters = [_output_parameter(part)]
    for name, description in part.options.items():
        parameters.append(_parameter(name, description))
    # Typer reads the options of a command from its signature, annotations and docstring.
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {option.name: option.annotation for option in parameters}
    command.__doc__ = part.help
    app.command(part.name, cls=command_line.Command)(command)


def _make_report(part: Part, output: Path | None, values: Mapping[str, Any]) -> int:
    """Make a report with the values of its options, print and write it; return the exit code.

    `output` is None if the report is not written. The exit code is 1 if a check failed, else 0.
    """
    arguments = {
        name: _parsed(name, values[name], description)
        for name, description in part.options.items()
    }
    if output is not None:
        _require_place(output, part)
    if part.keeps:
        arguments["folder"] = output
    result = resolve_name(part.measure)(**arguments)
    report = result if isinstance(result, Report) else Report({part.name: result})
    _print_report(part, report)
    if output is not None:
        for path in report.write(output, part.contents):
            echo(str(path))
    return 1 if part.judges and not report.passed else 0


def _output_parameter(part: Part) -> inspect.Parameter:
    """Return the option of the folder, which is required if the report's function needs it."""
    if part.keeps:
        return inspect.Parameter("output", KEYWORD, annotation=Folder)
    return inspect.Parameter("output", KEYWORD, annotation=OptionalFolder, default=None)


def _parameter(name: str, description: Mapping[str, Any]) -> inspect.Parameter:
    """Return an option or argument of a command from its description; see `Part.options`.

    Its value is a path if the description has the key `path`, else it has the type of the default.
    A list is given as a text with commas, which `_parsed` splits.
    """
    settings = {
        key: description[key]
        for key in ("help", "metavar", "min", "max")
        if key in description
    }
    default = description.get("default")
    value_type: Any = Path if "path" in description else type(default)
    if value_type is list:
        value_type = str
        default = ",".join(map(str, description["default"]))
    if "argument" in description:
        argument: Any = Annotated[value_type, typer.Argument(**settings)]
        return inspect.Parameter(name, KEYWORD, annotation=argument)
    option: Any = Annotated[value_type | None, typer.Option(**settings)]
    return inspect.Parameter(name, KEYWORD, annotation=option, default=default)


def _parsed(name: str, value: Any, description: Mapping[str, Any]) -> Any:
    """Return the value of an option for the report's function.

    If the default is a list, the value is a text with commas, and becomes a list of numbers. Any
    other value is returned unchanged. Raises InputError if an entry is not a number.
    """
    if not isinstance(description.get("default"), list):
        return value
    if not value:
        return []
    number_type = resolve_name(f"builtins:{description.get('kind', 'int')}")
    try:
        return [number_type(text) for text in value.split(",")]
    except ValueError:
        raise InputError(
            f"{name} {value!r}: give numbers with commas between them"
        ) from None


def _require_place(folder: Path, part: Part) -> None:
    """Raise InputError, before any work, if the files of a report cannot be written.

    The folder must be usable, and matplotlib must be installed if the report has pictures.
    """
    if any("figure" in entry for entry in part.contents):
        new_figure(width=1.0, height=1.0)  # raises an error without matplotlib
    names = []
    for entry in part.contents:
        name = entry.get("figure", entry.get("table", ""))
        # Words are not written by the command. Names that a * matches are not known yet.
        if name and "*" not in name:
            names.append(name)
    check_folder(folder, *names)


def _print_report(part: Part, report: Report) -> None:
    """Print the tables that the TOML file of a report shows, then the text of the report.

    Tables without rows, or with more than `LONGEST` rows, are left out.
    """
    entries = {entry["table"]: entry for entry in part.contents if "table" in entry}
    for name, rows in report.tables.items():
        entry = entries.get(f"{name}.csv")
        if entry is None or not rows or len(rows) > LONGEST:
            continue
        columns = entry.get("columns", list(rows[0]))
        texts = [[_text(row[column]) for column in columns] for row in rows]
        _print(f"{markdown(columns, texts)}\n\n")
    if report.text:
        _print(report.text)


def _text(value: object) -> str:
    """Return a value of a table as it is printed; "" for None."""
    if value is None:
        return ""
    return cell(str(value)).text


def _print(text: str) -> None:
    """Print a text line by line."""
    for line in text.splitlines():
        echo(line)


for _part in PARTS:
    if _part.measure:
        add(_part)
