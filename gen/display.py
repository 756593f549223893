"""Print databases, contacts and statistics as tables for people."""

from __future__ import annotations

import json
import signal
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from gen.measured.areal import PARAMETERS
from gen.measured.outcome import Wanted, answers
from gen.measured.single import border_remark, contact_warnings
from gen.runtime.console import console as new_console
from gen.runtime.invocation import to_type
from gen.runtime.memory import size
from gen.runtime.progress import RunProgress
from gen.scene.load import UNITS
from gen.schema import REASONS, RUNTIME, Column, Status, changes_since, statistics_columns

if TYPE_CHECKING:  # statistics are printed without the solver, contacts without HDF5
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from rich.console import Console

    from bem import Contact
    from gen.arrays import Heights
    from gen.database import Reader
    from gen.generation.forecast import Estimate, Plan
    from gen.generation.run import RunResult
    from gen.measured.self_affine import SelfAffineFit
    from gen.measured.topography import Topography
    from gen.scene import Scene
    from gen.statistics import Description

MAPS = {"found": "map", "against_found": "the second body's map"}
"""Keys of a scene's surfaces whose maps are shown in lines of their own, and words for a map."""


def print_result(path: Path, result: RunResult) -> None:
    """Say how a run ended, and how to continue it.

    Parameters
    ----------
    path : Path
        Database.
    result : RunResult
        Counts of rows and the signal that ended the run, if any.
    """
    console = _console()
    pending, done, failed = result.counts
    console.print(f"{path}: {done} rows done, {failed} failed, {pending} pending")
    if failed:
        console.print(f"warning: {failed} rows failed; why: {to_type(f'gen info {path}')}")
    if result.overdue:
        console.print(
            f"warning: {result.overdue} rows took longer than --sample-limit and are pending; the"
            " same command with a larger one, or without, goes on with them"
        )
    if pending and result.signal:
        name = signal.Signals(result.signal).name
        console.print(f"stopped by {name}; the same command goes on with the rows that are pending")


def print_database(reader: Reader) -> None:
    """Print a summary of a database: rows, times, scene, versions, ranges of all columns.

    Parameters
    ----------
    reader : gen.database.Reader
        Open database.
    """
    console = _console()
    counts = reader.counts()
    attributes = reader.attributes
    console.print(f"{reader.path}: {attributes['title']}")
    part = ""
    if len(reader.rows) < reader.scene.samples:
        part = f": {reader.rows.start} to {reader.rows.stop - 1} of {reader.scene.samples}, a part"
    console.print(f"  size      {size(reader.size_bytes)}, {sum(counts)} rows{part}")
    console.print(
        f"  rows      {counts.done} done, {counts.failed} failed, {counts.pending} pending"
    )
    for status in (Status.DONE, Status.FAILED):
        for code, number in reader.reasons(status).items():
            reason = REASONS.get(code, f"reason {code}")
            console.print(f"            {number} {status.name.lower()}: {reason}")
    console.print(f"  times     {_times(reader)}")
    for line in _scene_lines(json.loads(reader.scene.text())):
        console.print(f"  scene     {line}")
    versions = json.loads(str(attributes["versions"]))
    console.print("  versions  " + ", ".join(f"{name} {value}" for name, value in versions.items()))
    console.print(
        f"  made      {attributes['created']}, commit {attributes['git_commit'] or 'unknown'},"
        f" layout {attributes['schema']}, physics {attributes['physics']}"
    )
    for line in _changes_since(int(attributes["physics"]), reader.scene):
        console.print(f"            {line}")
    if counts.done:
        console.print(_ranges_table(reader))
        console.print(
            "paper: its Table 1, whose bandwidth is defined otherwise and areas end early"
        )


def print_plan(plan: Plan, path: Path | None = None) -> None:
    """Print the numbers of samples, surfaces and nodes of a plan, its loads and the file's size.

    Parameters
    ----------
    plan : Plan
        Plan of a scene, from `gen.generation.forecast.plan_of`.
    path : Path, optional
        Database that would be written.
    """
    console = _console()
    low, mean, high = plan.load
    console.print(
        f"{plan.samples} samples on {plan.surfaces} surfaces of"
        f" {plan.shape[0]} x {plan.shape[1]} nodes"
        f"{'' if plan.boundary == 'free' else f', {plan.boundary} boundary'}"
        f"{', each against another rough one' if plan.two_rough else ''}"
    )
    name = "Delta" if plan.quantity == "delta" else plan.quantity
    unit = UNITS[plan.quantity]
    measure = "" if unit == "1" else f" {unit}"
    console.print(f"  {name:<9} {low:.4g} to {high:.4g}{measure}, {mean:.4g}{measure} on average")
    if plan.hardness is not None:
        least, most = plan.hardness
        drawn = "" if least == most else f" to {most:.4g}"
        console.print(f"  hardness  {least:.4g}{drawn} MPa")
    console.print(f"  file      {size(plan.file_bytes)}")
    if path is not None:
        state = "exists" if path.exists() else "does not exist yet"
        console.print(f"  output    {path} {state}; nothing was written")


def print_estimate(plan: Plan, estimate: Estimate) -> None:
    """Print the time and the memory that a run is going to need.

    Parameters
    ----------
    plan : Plan
        Plan of a scene, from `gen.generation.forecast.plan_of`.
    estimate : Estimate
        Its costs, from `gen.generation.forecast.estimate`.
    """
    print_plan(plan)
    console = _console()
    hours, rest = divmod(round(estimate.seconds), 3600)
    console.print(
        f"  time      {hours}:{rest // 60:02}:{rest % 60:02} h on {estimate.workers} workers:"
        f" {estimate.milliseconds:.2f} ms a sample, mean of {estimate.measured} measured here"
    )
    console.print(f"  memory    {size(estimate.memory_bytes)} on all ranks")


def print_contact(contact: Contact, seconds: float, wanted: Wanted) -> None:
    """Print the solution of one contact problem.

    Parameters
    ----------
    contact : bem.Contact
        Solution.
    seconds : float
        Time that the solution took [s].
    wanted : Wanted
        Answers to print beside area, force and gap.
    """
    problem = contact.problem
    nodes = contact.pressure.shape
    cell = problem.spacing[0] * problem.spacing[1]
    # A_e is a share of nodes, so the patch counts as the cells of all its nodes.
    nominal = contact.pressure.size * cell
    touching = contact.contact_nodes * cell
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value, unit in (
        ("effective contact area", f"{contact.area_percent:.6g}", "%"),
        ("contact nodes", f"{contact.contact_nodes}", f"of {nodes[0]} x {nodes[1]}"),
        ("spacing", f"{problem.spacing[0]:.6g} x {problem.spacing[1]:.6g}", "um"),
        *_boundary_lines(contact),
        ("modulus E*", f"{problem.modulus:.6g}", "MPa"),
        ("force", f"{contact.force:.8g}", "uN"),
        ("nominal pressure", f"{contact.force / nominal:.6g}", "MPa, force over the whole patch"),
        (
            "contact pressure",
            f"{contact.force / (touching or 1):.6g}",
            "MPa, mean where in contact",
        ),
        ("largest pressure", f"{contact.largest_pressure:.6g}", "MPa"),
        *_yielding_lines(contact),
        *((each.label, each.shown, each.unit) for each in answers(contact, wanted)),
        ("mean gap", f"{contact.mean_gap:.6g}", "um"),
        ("contact perimeter", f"{contact.perimeter:.6g}", "um"),
        ("displacement Delta", f"{contact.delta:.10g}", "um"),
        ("far-field displacement", f"{contact.approach:.10g}", "um, with what the far field gives"),
        ("residual", f"{contact.residual:.2e}", "of Delta"),
        ("iterations", f"{contact.iterations}", f"({contact.convolutions} convolutions)"),
        ("time", f"{1e3 * seconds:.1f}", "ms, the set-up of a first solve included"),
    ):
        table.add_row(name, value, unit)
    _console().print(table)


def _boundary_lines(contact: Contact) -> list[tuple[str, str, str]]:
    """Return the line about a patch without edges: name, value and unit; none for a free one."""
    boundary = contact.problem.boundary
    return [] if boundary == "free" else [("boundary", boundary, "")]


def _yielding_lines(contact: Contact) -> list[tuple[str, str, str]]:
    """Return the lines about yielding: name, value and unit; none for elastic bodies."""
    if contact.problem.hardness is None:
        return []
    return [
        ("hardness", f"{contact.problem.hardness:.6g}", "MPa"),
        ("yielded nodes", f"{contact.yielded_percent:.6g}", "% of all nodes"),
        ("largest yielded depth", f"{contact.yielded_depth.max():.6g}", "um"),
    ]


def print_preparation(topography: Topography, warnings: list[str]) -> None:
    """Print the steps from a file to a surface, and the warnings about it on standard error.

    Parameters
    ----------
    topography : Topography
        Surface.
    warnings : list of str
        One line for each warning.
    """
    console = _console()
    for step in topography.steps:
        console.print(f"{topography.name}: {step}")
    for warning in warnings:
        new_console(stderr=True, markup=False, highlight=False, soft_wrap=True).print(
            f"warning: {warning}"
        )


def follow_contacts(
    topography: Topography,
    warnings: list[str],
    solutions: Iterable[tuple[Contact, float]],
    count: int,
    *,
    wanted: Wanted,
    material: bool,
) -> tuple[list[Contact], list[str]]:
    """Collect the contacts of a surface with a progress bar, then print surface and contacts.

    A single contact is printed in full, several as one table. Nothing is printed before the first
    contact is solved, since its load may be refused.

    Parameters
    ----------
    topography : Topography
        Surface.
    warnings : list of str
        Warnings about the surface.
    solutions : iterable of (bem.Contact, float)
        Contacts of the surface and the time of each [s].
    count : int
        Number of solutions.
    wanted : Wanted
        Answers to compute beside area, force and gap.
    material : bool
        Whether the user gave a modulus.

    Returns
    -------
    contacts : list of bem.Contact
        All contacts.
    warnings : list of str
        Warnings about the surface and about its contacts.
    """
    contacts = []
    seconds = 0.0
    if count == 1:
        [(contact, seconds)] = solutions
        contacts.append(contact)
    else:
        with RunProgress(count, noun="loads") as progress:
            for contact, _ in solutions:
                contacts.append(contact)
                answers(contact, wanted)  # computed under the bar, and kept by the contact
                progress.advance(1, 0)
    warnings = warnings + contact_warnings(topography, contacts, material=material)
    print_preparation(topography, warnings)
    if count == 1:
        print_contact(contacts[0], seconds, wanted)
    else:
        print_law(contacts, wanted)
    if remark := border_remark(topography, contacts):
        _console().print(f"{topography.name}: {remark}")
    return contacts, warnings


def print_law(contacts: Sequence[Contact], wanted: Wanted) -> None:
    """Print contacts of one surface as a table with a line for each load.

    Parameters
    ----------
    contacts : sequence of bem.Contact
        Contacts of the surface.
    wanted : Wanted
        Answers to print beside area, force and gap.
    """
    table = Table(box=None, pad_edge=False)
    titles = ["Delta um", "force uN", "pressure MPa", "area %", "largest MPa", "mean gap um"]
    yielding = contacts[0].problem.hardness is not None
    if yielding:
        titles += ["yielded %", "depth um"]
    titles += [each.column for each in answers(contacts[0], wanted)]
    for title in titles:
        table.add_column(title, justify="right")
    for contact in contacts:
        cells = contact.pressure.size * contact.problem.spacing[0] * contact.problem.spacing[1]
        numbers = [
            contact.delta,
            contact.force,
            contact.force / cells,
            contact.area_percent,
            contact.largest_pressure,
            contact.mean_gap,
        ]
        if yielding:
            numbers += [contact.yielded_percent, float(contact.yielded_depth.max())]
        more = [each.shown for each in answers(contact, wanted)]
        table.add_row(*(f"{number:.6g}" for number in numbers), *more)
    _console().print(table)


def print_statistics(
    heights: Heights,
    spacing: tuple[float, float],
    tilt: tuple[float, float] | None,
    description: Description,
) -> None:
    """Print the 22 roughness statistics of a surface.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights without holes [um].
    spacing : tuple of float
        Distance of the nodes along x and y [um].
    tilt : tuple of float or None
        Slopes of the least-squares plane of the surface as measured, along x and y [1]; None for a
        composite surface.
    description : gen.statistics.Description
        Statistics of the heights.
    """
    console = _console()
    console.print(
        f"{heights.shape[0]} x {heights.shape[1]} nodes, spacing {spacing[0]:.6g} x"
        f" {spacing[1]:.6g} um, heights {heights.min():.6g} to {heights.max():.6g} um"
        + (f", tilt as measured {tilt[0]:.4g} along x, {tilt[1]:.4g} along y" if tilt else "")
    )
    table = Table(box=None, pad_edge=False)
    for title in ("statistic", "value", "unit", "meaning"):
        table.add_column(title, justify="right" if title == "value" else "left")
    for column in statistics_columns():
        value = description.values[column.name]
        table.add_row(column.name, f"{value:.6g}", column.unit, column.long_name)
    console.print(table)
    if description.reason:
        console.print(f"nan: {description.reason}")


def print_areal(parameters: Description) -> None:
    """Print the areal parameters of a surface.

    Parameters
    ----------
    parameters : gen.statistics.Description
        Values and reason, from `gen.measured.areal.areal_parameters`.
    """
    table = Table(box=None, pad_edge=False)
    for title in ("ISO 25178", "value", "unit", "meaning"):
        table.add_column(title, justify="right" if title == "value" else "left")
    for name, unit, meaning in PARAMETERS:
        table.add_row(name, f"{parameters.values[name]:.6g}", unit, meaning)
    console = _console()
    console.print(table)
    if parameters.reason:
        console.print(f"nan: {parameters.reason}")


def print_self_affine(fit: SelfAffineFit | str) -> None:
    """Print a self-affine law as the generator `spectral` takes it, or why there is none.

    Parameters
    ----------
    fit : SelfAffineFit or str
        Law or reason, from `gen.measured.self_affine.fit_self_affine`.
    """
    console = _console()
    if isinstance(fit, str):
        console.print(f"self-affine law: none, {fit}")
        return
    law = fit.spectrum
    remarks = "".join(f"; {remark}" for remark in fit.remarks)
    console.print(
        f"self-affine law from {fit.longest:.4g} to {law.cut_off:.4g} um, the spectrum within a"
        f" factor of {fit.scatter:.3g}{remarks}; as a start for the generator spectral:"
    )
    table = Table(box=None, pad_edge=False, show_header=False)
    for name, value, unit, meaning in (
        ("hurst", law.hurst, "1", "Hurst exponent"),
        ("roll_off", law.roll_off, "um", "longest wavelength of the power law"),
        ("cut_off", law.cut_off, "um", "shortest wavelength"),
        ("rms_height", fit.rms_height, "um", "root mean square height"),
    ):
        table.add_row(name, f"{value:.6g}", unit, meaning)
    console.print(table)


def _console() -> Console:
    """Return a console for plain text; lines that go to a file or a pipe are not broken."""
    width = None if sys.stdout.isatty() else 1000
    return new_console(markup=False, highlight=False, width=width)


def _scene_lines(scene: dict[str, Any]) -> list[str]:
    """Return the lines that show a scene: single keys first, then one line for each table."""
    tables = {name: value for name, value in scene.items() if isinstance(value, dict)}
    single = {name: value for name, value in scene.items() if name not in {"title", *tables}}
    lines = [", ".join(f"{name} = {json.dumps(value)}" for name, value in single.items())]
    for table, keys in tables.items():
        found = {name: keys[name] for name in MAPS if name in keys and table == "surface"}
        shown = {name: value for name, value in keys.items() if name not in found}
        settings = ", ".join(f"{name} = {json.dumps(value)}" for name, value in shown.items())
        lines.append(f"[{table}] {settings}")
        for name, maps in found.items():
            numbered = enumerate(maps["maps"])
            lines += [
                f"  {MAPS[name]} {number}: {_map_in_words(each)}" for number, each in numbered
            ]
    return lines


def _map_in_words(found: dict[str, Any]) -> str:
    """Return the line that shows a map of a scene."""
    nx, ny = found["nodes"]
    return f"{nx} x {ny} nodes, SHA-256 {found['sha256'][:12]}..., {found['file']}"


def _changes_since(physics: int, scene: Scene) -> list[str]:
    """Say in one line each how today's results differ from those of an earlier physics number."""
    changes = changes_since(physics, scene)
    lines = [f"physics {number}: {change}" for number, change in changes.items()]
    return ["what has changed since then:", *lines] if lines else []


def _times(reader: Reader) -> str:
    """Return the times of the done rows in words."""
    done = reader.column("status") == Status.DONE
    if not done.any():
        return "no row is done"
    solve = 1e3 * reader.column("solve_seconds")[done]
    surface = 1e3 * reader.column("surface_seconds")[done]
    return (
        f"solve {solve.mean():.2f} ms on average, {np.median(solve):.2f} median,"
        f" {solve.max():.2f} at most; surface and statistics {surface.mean():.2f} ms"
    )


def _ranges_table(reader: Reader) -> Table:
    """Tabulate the range of every column over the done rows beside that of the paper."""
    table = Table(box=None, pad_edge=False)
    for title in ("column", "unit", "from", "to", "paper from", "paper to"):
        table.add_column(title, justify="left" if title in {"column", "unit"} else "right")
    ranges = reader.ranges()
    for column in reader.columns():
        if column.name in ranges and column.group != RUNTIME:
            table.add_row(column.name, column.unit, *_limits(ranges[column.name], column))
    return table


def _limits(limits_here: tuple[float, float], column: Column) -> list[str]:
    """Return four cells: the range here, then that of the paper, empty if it has none."""
    limits = [*limits_here, *(column.paper_range or ())]
    return [f"{limit:.6g}" for limit in limits] + [""] * (4 - len(limits))
