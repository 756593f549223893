"""Print a surface: how it was prepared, its statistics, its self-affine law."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from gen.maps.areal import PARAMETERS
from gen.maps.doubts import tilt
from gen.runtime.terminal import echo, print_table
from gen.schema import statistics_columns

if TYPE_CHECKING:  # statistics are printed without the solver
    from gen.maps.read import Topography
    from gen.maps.self_affine import SelfAffineFit
    from gen.statistics import Description


def print_preparation(topography: Topography, warnings: list[str]) -> None:
    """Print the steps from a file to a surface, and the warnings about it on standard error.

    Parameters
    ----------
    topography : Topography
        Surface.
    warnings : list of str
        One line for each warning.
    """
    for step in topography.steps:
        echo(f"{topography.name}: {step}")
    for warning in warnings:
        echo(f"warning: {warning}", err=True)


def print_statistics(topography: Topography, description: Description) -> None:
    """Print the 22 roughness statistics of a surface, and its tilt unless it has been levelled.

    Parameters
    ----------
    topography : Topography
        Surface without holes.
    description : gen.statistics.Description
        Statistics of the heights.
    """
    heights, spacing = topography.heights, topography.spacing
    said = (
        f"{heights.shape[0]} x {heights.shape[1]} nodes, spacing {spacing[0]:.6g} x"
        f" {spacing[1]:.6g} um, heights {heights.min():.6g} to {heights.max():.6g} um"
    )
    if not topography.followed & {"level plane", "level quadratic", "form"}:
        said += ", tilt {:.4g} along x, {:.4g} along y".format(*tilt(topography))
    echo(said)
    table = Table(box=None, pad_edge=False)
    for title in ("statistic", "value", "unit", "meaning"):
        table.add_column(title, justify="right" if title == "value" else "left")
    for column in statistics_columns():
        value = description.values[column.name]
        table.add_row(column.name, f"{value:.6g}", column.unit, column.long_name)
    print_table(table)
    if description.reason:
        echo(f"nan: {description.reason}")


def print_areal(parameters: Description) -> None:
    """Print the areal parameters of a surface.

    Parameters
    ----------
    parameters : gen.statistics.Description
        Values and reason, from `gen.maps.areal.areal_parameters`.
    """
    table = Table(box=None, pad_edge=False)
    for title in ("ISO 25178", "value", "unit", "meaning"):
        table.add_column(title, justify="right" if title == "value" else "left")
    for name, unit, meaning in PARAMETERS:
        if name in parameters.values:
            table.add_row(name, f"{parameters.values[name]:.6g}", unit, meaning)
    print_table(table)
    if parameters.reason:
        echo(f"nan: {parameters.reason}")


def print_self_affine(fit: SelfAffineFit | str) -> None:
    """Print a self-affine law as the generator `spectral` takes it, or why there is none.

    Parameters
    ----------
    fit : SelfAffineFit or str
        Law or reason, from `gen.maps.self_affine.fit_self_affine`.
    """
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
    table = Table(box=None, pad_edge=False, show_header=False)
    for name, value, unit, meaning in (
        ("hurst", law.hurst, "1", "Hurst exponent"),
        ("roll_off", law.roll_off, "um", "longest wavelength of the power law"),
        ("cut_off", law.cut_off, "um", "shortest wavelength"),
        ("rms_height", fit.rms_height, "um", "root mean square height"),
    ):
        table.add_row(name, f"{value:.6g}", unit, meaning)
    print_table(table)
