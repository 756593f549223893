"""Print a surface: how it was prepared, its statistics, its self-affine law, and its contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gen.maps.prepare import tilt
from gen.maps.texture import PARAMETERS
from gen.runtime.terminal import RunProgress, echo, print_columns
from gen.schema import statistics_columns

if TYPE_CHECKING:  # statistics are printed without the solver
    from collections.abc import Iterable, Sequence

    from bem import Contact
    from gen.maps.contacts import Solution, Wanted
    from gen.maps.read import Topography
    from gen.maps.texture import SelfAffineFit
    from gen.statistics import Description


def print_preparation(topography: Topography, warnings: list[str]) -> None:
    """Print the steps from a file to a surface, and the warnings about it on standard error."""
    for step in topography.steps:
        echo(f"{topography.name}: {step}")
    for warning in warnings:
        echo(f"warning: {warning}", err=True)


def print_statistics(topography: Topography, description: Description) -> None:
    """Print the 22 roughness statistics of a surface, and its tilt unless it has been levelled."""
    heights, spacing = topography.heights, topography.spacing
    said = (
        f"{heights.shape[0]} x {heights.shape[1]} nodes, spacing {spacing[0]:.6g} x"
        f" {spacing[1]:.6g} um, heights {heights.min():.6g} to {heights.max():.6g} um"
    )
    if not topography.followed & {"level plane", "level quadratic", "form"}:
        said += ", tilt {:.4g} along x, {:.4g} along y".format(*tilt(topography))
    echo(said)
    print_columns(
        (
            (each.name, f"{description.values[each.name]:.6g}", each.unit, each.long_name)
            for each in statistics_columns()
        ),
        ("statistic", "value", "unit", "meaning"),
        right={"value"},
    )
    if description.reason:
        echo(f"nan: {description.reason}")


def print_areal(parameters: Description) -> None:
    """Print the areal parameters of a surface."""
    print_columns(
        (
            (name, f"{parameters.values[name]:.6g}", unit, meaning)
            for name, unit, meaning in PARAMETERS
            if name in parameters.values
        ),
        ("ISO 25178", "value", "unit", "meaning"),
        right={"value"},
    )
    if parameters.reason:
        echo(f"nan: {parameters.reason}")


def print_self_affine(fit: SelfAffineFit | str) -> None:
    """Print a self-affine law as the generator `spectral` takes it, or why there is none."""
    if isinstance(fit, str):
        echo(f"self-affine law: none, {fit}")
        return
    law = fit.spectrum
    remarks = "".join(f"; {remark}" for remark in fit.remarks)
    echo(
        f"self-affine law over {fit.decades:.2g} decades, from {law.roll_off:.4g} to"
        f" {law.cut_off:.4g} um, the spectrum within a factor of {fit.scatter:.3g}{remarks}; as a"
        " start for the generator spectral:"
    )
    print_columns(
        (name, f"{value:.6g}", unit, meaning)
        for name, value, unit, meaning in (
            ("hurst", law.hurst, "1", "Hurst exponent"),
            ("roll_off", law.roll_off, "um", "longest wavelength of the power law"),
            ("cut_off", law.cut_off, "um", "shortest wavelength"),
            ("rms_height", fit.rms_height, "um", "root mean square height"),
        )
    )


def follow_contacts(
    topography: Topography,
    warnings: list[str],
    solutions: Iterable[Solution],
    count: int,
    *,
    wanted: Wanted,
    material: bool,
) -> tuple[list[Contact], list[str]]:
    """Collect the contacts of a surface with a progress bar, then print surface and contacts.

    A single contact is printed in full, several as one table. Nothing is printed before the first
    contact is solved, since its load may be refused. Return the contacts that were solved, and the
    warnings about the surface, its contacts and loads that were not solved.
    """
    from gen.maps.contacts import answers, border_remark, contact_warnings

    contacts, faults = [], []
    if count == 1:
        [(contact, seconds, _)] = solutions
        assert contact is not None
        contacts.append(contact)
    else:
        with RunProgress(count, noun="loads") as progress:
            for contact, _, fault in solutions:
                if contact is None:
                    faults.append(f"not solved, left out: {fault}")
                else:
                    contacts.append(contact)
                    answers(contact, wanted)  # computed under the bar, and kept by the contact
                progress.advance(1, contact is None)
    warnings = warnings + contact_warnings(topography, contacts, material=material) + faults
    print_preparation(topography, warnings)
    if count == 1:
        print_contact(contacts[0], seconds, wanted)
    else:
        print_law(contacts, wanted)
    if remark := border_remark(topography, contacts):
        echo(f"{topography.name}: {remark}")
    return contacts, warnings


def print_contact(contact: Contact, seconds: float, wanted: Wanted) -> None:
    """Print the solution of one contact problem, and the time that it took [s]."""
    from gen.maps.contacts import answers

    found = answers(contact, wanted)
    area, further = (found[:3:2], found[3:]) if wanted.grid_error else ([], found)
    problem = contact.problem
    nx, ny = contact.pressure.shape
    cell = problem.spacing[0] * problem.spacing[1]
    nominal = nx * ny * cell  # A_e is a share of nodes, so the patch counts as their cells
    touching = contact.contact_nodes * cell
    boundary = [] if problem.boundary == "free" else [("boundary", problem.boundary, "")]
    yielding, far_field = [], []
    if problem.hardness is not None:
        yielding = [
            ("hardness", f"{problem.hardness:.6g}", "MPa"),
            ("yielded nodes", f"{contact.yielded_percent:.6g}", "% of all nodes"),
            ("largest yielded depth", f"{contact.yielded_depth.max():.6g}", "um"),
        ]
    delta, approach = f"{contact.delta:.10g}", f"{contact.approach:.10g}"
    if approach != delta:  # as it is not on a rigid far field
        words = "um, Delta and the compliance of the far field"
        far_field = [("far-field displacement", approach, words)]
    lines = (
        ("effective contact area", f"{contact.area_percent:.6g}", "% of the nodes"),
        *((each.label, each.shown, each.unit) for each in area),
        ("contact nodes", f"{contact.contact_nodes}", f"of {nx} x {ny}"),
        ("spacing", f"{problem.spacing[0]:.6g} x {problem.spacing[1]:.6g}", "um"),
        *boundary,
        ("modulus E*", f"{problem.modulus:.6g}", "MPa"),
        ("force", f"{contact.force:.8g}", "uN"),
        ("nominal pressure", f"{contact.force / nominal:.6g}", "MPa, force over the whole patch"),
        (
            "contact pressure",
            f"{contact.force / (touching or 1):.6g}",
            "MPa, mean where in contact",
        ),
        ("largest pressure", f"{contact.largest_pressure:.6g}", "MPa"),
        *yielding,
        *((each.label, each.shown, each.unit) for each in further),
        ("mean gap", f"{contact.mean_gap:.6g}", "um"),
        ("contact perimeter", f"{contact.perimeter:.6g}", "um"),
        ("displacement Delta", delta, "um"),
        *far_field,
        ("residual", f"{contact.residual:.2e}", "of Delta"),
        ("iterations", f"{contact.iterations}", f"({contact.convolutions} convolutions)"),
        ("time", f"{1e3 * seconds:.1f}", "ms, the set-up of a first solve included"),
    )
    print_columns(lines)


def print_law(contacts: Sequence[Contact], wanted: Wanted) -> None:
    """Print contacts of one surface as a table with a line for each load."""
    from gen.maps.contacts import answers

    titles = ["Delta um", "force uN", "pressure MPa", "area %", "largest MPa", "mean gap um"]
    yielding = contacts[0].problem.hardness is not None
    if yielding:
        titles += ["yielded %", "depth um"]
    titles += [each.column for each in answers(contacts[0], wanted)]
    rows = []
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
        rows.append([*(f"{number:.6g}" for number in numbers), *more])
    print_columns(rows, titles, right=titles)
