"""The commands of `bench`: one for each report, as its TOML file says, and those of the page."""

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any

import typer

from bench.contents import cell
from bench.files import Row, markdown
from bench.report import PARTS, Part, Report, remark
from gen.runtime import command_line
from gen.runtime.errors import InputError
from gen.runtime.figure import new_figure
from gen.runtime.files import check_folder
from gen.runtime.terminal import echo

app = typer.Typer(add_completion=False, rich_markup_mode=None)

_output = typer.Option("--output", "-o", metavar="DIR", help="The folder to write into.")
Folder = Annotated[Path, _output]
Place = Annotated[Path | None, _output]
Database = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="A database of the paper preset, not generated anew."
    ),
]
Comparison = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="Folder of learn compare and tune; made if left out."
    ),
]
Full = Annotated[
    bool, typer.Option("--full", help="Everything: hours. Else ten minutes.")
]
Names = Annotated[list[str] | None, typer.Argument(metavar="NAME", help="All if none.")]

KEYWORD = inspect.Parameter.KEYWORD_ONLY
LONGEST = 60  # rows of a table that is printed


@app.callback()
def describe_program(*, version: command_line.Version = False) -> None:
    """Reports on exactness and speed, each as a table (CSV) and a picture (PNG)."""


def main(arguments: Sequence[str], name: str = "bench") -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, arguments, name, single_process=True)


@app.command()
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
    """Make all reports, or those named, and one page of them: DIR/index.html, without network.

    Every part runs as a command of its own, in DIR/PART. A part stays where the same command has
    made it from the same inputs, with the same code and packages: after Ctrl-C the same command
    goes on. A short run leaves alone what a full one has made. Exit code 1 if a check failed or a
    part could not be made.
    """
    from bench import run as running
    from bench.record import Inputs

    inputs, chosen = Inputs(output, database, comparison, full), names or ()
    if plan:
        _print(running.planned(inputs, chosen))
        return 0
    path, outcome = running.run(inputs, chosen)
    echo(str(path))
    if outcome.signal:
        remark("bench: interrupted; the same command goes on")
        return 128 + outcome.signal
    for name in outcome.failed:
        remark(f"bench: {name} failed, see {path} or {output / name}")
    return 1 if outcome.failed else 0


@app.command()
def page(
    folder: Annotated[Path, typer.Argument(help="Folder of `bench run`.")],
    *,
    full: Full = False,
    comparison: Comparison = None,
) -> None:
    """Write the page of what a folder holds anew, and make nothing."""
    from bench.page import write_page
    from bench.record import Inputs

    if not folder.is_dir():
        raise InputError(
            f"{folder} is not a folder; `python -m bench run -o {folder}` makes one"
        )
    echo(str(write_page(PARTS, Inputs(folder, None, comparison, full))))


@app.command()
def publish(
    folder: Annotated[Path, typer.Argument(help="Folder of `bench run --full`.")],
    target: Annotated[
        Path, typer.Argument(help="Folder of published results: bench/results.")
    ],
    *,
    comparison: Comparison = None,
) -> None:
    """Copy what a run has made into the folder of published results.

    Tables, pictures, words and records of all finished parts, large tables compressed; folders all
    of whose parts were made lose their earlier files. Parts that were not finished are refused.
    """
    from bench.publish import publish as copy
    from bench.record import Inputs

    for path in copy(PARTS, Inputs(folder, None, comparison, full=True), target):
        echo(str(path))


def add(part: Part) -> None:
    """Add the command of a report, with the options that its file declares."""

    def command(output: Path | None, **given: Any) -> int:
        asked = {
            name: _parsed(name, given[name], said) for name, said in part.options.items()
        }
        if output is not None:
            _require_place(output, part)
        if part.keeps:
            asked["folder"] = output
        found = resolve_name(part.measure)(**asked)
        report = found if isinstance(found, Report) else Report({part.name: found})
        _tell(part, report)
        for path in report.write(output, part.contents) if output is not None else ():
            echo(str(path))
        return 0 if report.passed or not part.judges else 1

    place = inspect.Parameter("output", KEYWORD, annotation=Folder)
    if not part.keeps:
        place = place.replace(annotation=Place, default=None)
    parameters = [place, *(_parameter(name, said) for name, said in part.options.items())]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in parameters}
    command.__doc__ = part.help
    app.command(part.name)(command)


def _parameter(name: str, said: Mapping[str, Any]) -> inspect.Parameter:
    """Return an option or an argument of a command; lists are texts with commas."""
    told = {key: said[key] for key in ("help", "metavar", "min", "max") if key in said}
    default = said.get("default")
    kind: Any = Path if "path" in said else type(default)
    if kind is list:
        kind, default = str, ",".join(map(str, said["default"]))
    if "argument" in said:
        kind, default = Annotated[kind, typer.Argument(**told)], inspect.Parameter.empty
    else:
        kind = Annotated[kind | None, typer.Option(**told)]
    return inspect.Parameter(name, KEYWORD, annotation=kind, default=default)


def _parsed(name: str, value: Any, said: Mapping[str, Any]) -> Any:
    """Return an option as its function takes it: what stood between commas as a list."""
    if not isinstance(said.get("default"), list):
        return value
    kind = resolve_name(f"builtins:{said.get('kind', 'int')}")
    try:
        return [kind(each) for each in value.split(",")] if value else []
    except ValueError:
        raise InputError(
            f"{name} {value!r}: give numbers with commas between them"
        ) from None


def _require_place(folder: Path, part: Part) -> None:
    """Refuse a folder, or pictures without matplotlib, before any work is done for a report."""
    names = [each.get("figure", each.get("table", "*")) for each in part.contents]
    if any(name.endswith(".png") for name in names):
        new_figure(1.0, 1.0)
    check_folder(folder, *(name for name in names if "*" not in name))


def _tell(part: Part, report: Report) -> None:
    """Print the tables that the report shows, unless they are long, and its text."""
    shown = {each["table"]: each for each in part.contents if "table" in each}
    for name, rows in report.tables.items():
        lines: list[Row] = list(rows)
        if f"{name}.csv" in shown and lines and len(lines) <= LONGEST:
            columns = shown[f"{name}.csv"].get("columns", list(lines[0]))
            texts = (
                [cell("" if r[c] is None else str(r[c])).text for c in columns]
                for r in lines
            )
            _print(f"{markdown(columns, texts)}\n\n")
    if report.text:
        _print(report.text)


def _print(text: str) -> None:
    """Print a text of several lines."""
    for line in text.splitlines():
        echo(line)


for _part in PARTS:
    if _part.measure:
        add(_part)
