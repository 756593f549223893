"""A contact law as tables for MOOSE, Ansys and COMSOL, with all of its columns.

The three programs join the points of a table by straight lines:

- MOOSE reads a CSV file by `PiecewiseLinear` (its source PiecewiseTabularBase.C): lines that begin
  with "#" are comments, and `x_title` and `y_title` choose columns by their titles.
- Ansys reads APDL: `*DIM, NAME, TABLE, rows, 1, 1, PRESSURE` and the numbers of the table. The
  primary variable PRESSURE is positive in compression, GAP is positive where bodies overlap
  (Mechanical APDL Basic Analysis Guide, section 2.5.15).
- COMSOL reads its spreadsheet format: rows of numbers, the argument first, then a column for each
  function; "%" begins a comment (COMSOL Programming Reference Manual, "Spreadsheet Data Format").

None of the three programs was run on these files.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gen.arrays import Values
from gen.law.contact_law import Law
from gen.law.cubics import short_name
from gen.law.finite_elements import (
    comment,
    description,
    name_in_capitals,
    rising,
    write_lines,
)
from gen.law.unit_systems import UNITS
from gen.options import Units
from gen.quantities import CLOSURE, IN_LAWS, PRESSURE

LONGEST_NAME = 32
"""Largest number of letters of the name of an array in APDL."""

CONTINUED = 1000.0
"""Closure of the last point of the pressure over the closure, over the last closure of the law."""


@dataclass(frozen=True, eq=False)
class Column:
    """A quantity at the k + 1 points of a table, in the units of a file."""

    name: str  # short name, such as "conductance"
    unit: str  # unit in the file, such as "W/(m2 K)"
    values: Values  # (k + 1,)


@dataclass(frozen=True, eq=False)
class ProgramTable:
    """First touch and the contacts of a law over pressure, in the units of a file."""

    pressure: Column
    closure: Column
    curves: tuple[Column, ...]  # all further columns of the law

    @property
    def over_pressure(self) -> tuple[Column, ...]:
        """The closure and all further columns, without the pressure."""
        return (self.closure, *self.curves)

    @property
    def pressure_over_closure(self) -> tuple[Column, Column]:
        """The closure and the pressure, with a further point far away on each side, (k + 3,).

        The pressure is 0 before first touch, and follows the last slope behind the last point, as
        in CalculiX and Abaqus. Then it is right in programs that hold the end values of a table,
        and in those that continue its first and last lines.
        """
        closures = self.closure.values
        pressures = self.pressure.values
        far = CONTINUED * closures[-1]
        slope = (pressures[-1] - pressures[-2]) / (closures[-1] - closures[-2])
        far_pressure = pressures[-1] + slope * (far - closures[-1])
        return (
            replace(self.closure, values=np.concatenate([[-far], closures, [far]])),
            replace(
                self.pressure, values=np.concatenate([[0.0], pressures, [far_pressure]])
            ),
        )


def write_for_moose(path: Path, law: Law, units: Units) -> list[Path]:
    """Write a law as two CSV files of functions of MOOSE.

    The first one has all columns over the pressure, the second one, with "-closure" after its stem,
    the pressure over the closure.

    Parameters
    ----------
    path : Path
        The first file.
    law : Law
        The law, which closes somewhere.
    units : {"mm", "si", "um"}
        System of units of the files.

    Returns
    -------
    list of Path
        Both files.
    """
    table = program_table(law, units)
    head = list(_head(law, units, table, "# "))
    over_pressure = _moose_lines([table.pressure, *table.over_pressure])
    over_closure = _moose_lines(table.pressure_over_closure)
    inverse_path = path.with_stem(f"{path.stem}-closure")
    return [
        *write_lines(path, [*head, *over_pressure]),
        *write_lines(inverse_path, [*head, *over_closure]),
    ]


def _moose_lines(columns: Sequence[Column]) -> Iterator[str]:
    """Yield the lines of a CSV file below its head: the units, the titles, the rows of numbers."""
    yield from comment([_units_in_words(columns)], "# ")
    yield ",".join(column.name for column in columns)
    for row in _rows(columns):
        yield ",".join(row)


def write_for_ansys(path: Path, law: Law, units: Units) -> list[Path]:
    """Write a law as tables of Ansys' APDL, one for each column.

    The pressure is tabulated over the closure, and each other column over the pressure.

    Parameters
    ----------
    path : Path
        The file.
    law : Law
        The law, which closes somewhere.
    units : {"mm", "si", "um"}
        System of units of the file.

    Returns
    -------
    list of Path
        The file.
    """
    table = program_table(law, units)
    lines = list(_head(law, units, table, "! "))
    beginning = name_in_capitals(path)
    closure, pressure = table.pressure_over_closure
    lines += _apdl_table(beginning, closure, pressure, "GAP")
    for column in table.over_pressure:
        lines += _apdl_table(beginning, table.pressure, column, "PRESSURE")
    return write_lines(path, lines)


def write_for_comsol(path: Path, law: Law, units: Units) -> list[Path]:
    """Write a law as two files of interpolation functions of COMSOL.

    The first one has all columns over the pressure, the second one, with "-closure" after its stem,
    the pressure over the closure.

    Parameters
    ----------
    path : Path
        The first file.
    law : Law
        The law, which closes somewhere.
    units : {"mm", "si", "um"}
        System of units of the files.

    Returns
    -------
    list of Path
        Both files.
    """
    table = program_table(law, units)
    head = list(_head(law, units, table, "% "))
    over_pressure = _comsol_lines(table.pressure, table.over_pressure)
    closure, pressure = table.pressure_over_closure
    over_closure = _comsol_lines(closure, [pressure])
    inverse_path = path.with_stem(f"{path.stem}-closure")
    return [
        *write_lines(path, [*head, *over_pressure]),
        *write_lines(inverse_path, [*head, *over_closure]),
    ]


def _comsol_lines(argument: Column, functions: Sequence[Column]) -> Iterator[str]:
    """Yield the lines of a COMSOL file below its head: two comments, then the rows of numbers."""
    columns = [argument, *functions]
    names = ", ".join(function.name for function in functions)
    about = f"Argument: {argument.name}. Functions, in this order: {names}."
    yield from comment([about, _units_in_words(columns)], "% ")
    for row in _rows(columns):
        yield " ".join(row)


def program_table(law: Law, units: Units) -> ProgramTable:
    """Return first touch and the contacts of a law over pressure, with all of its columns.

    Parameters
    ----------
    law : Law
        The law, which closes somewhere.
    units : {"mm", "si", "um"}
        System of units of the result.

    Returns
    -------
    ProgramTable
        The points at which the closure rises. Columns with a value that is not finite are left
        out.

    Raises
    ------
    InputError
        If the law closes nowhere.
    """
    joint = rising(law)
    table = law.over_pressure
    places = np.flatnonzero(np.isin(table.at, joint.pressures[1:]))
    curves: list[Column] = []
    for name, curve in table.curves.items():
        if name in {CLOSURE.in_laws, PRESSURE.in_laws}:
            continue
        at_rest = table.at_rest.get(name, 0.0)
        values = np.append(at_rest, curve.value[places])
        if np.isfinite(values).all():
            curves.append(_column(name, values, units))
    return ProgramTable(
        pressure=_column(PRESSURE.in_laws, joint.pressures, units),
        closure=_column(CLOSURE.in_laws, joint.closures, units),
        curves=tuple(curves),
    )


def _column(name: str, values: Values, units: Units) -> Column:
    """Convert values of a quantity of laws, (k + 1,), to the units of a file."""
    conversion = conversions(units)[IN_LAWS[name].law_unit]
    return Column(
        name=short_name(name),
        unit=conversion.unit,
        values=conversion.factor * values,
    )


@dataclass(frozen=True)
class Conversion:
    """The unit of a quantity in a file, and the factor from its unit in laws to it."""

    unit: str
    factor: float  # value in the file over the value in the law


def conversions(units: Units) -> dict[str, Conversion]:
    """Return the conversions from the units of laws to those of a file.

    Percentages become shares.

    Parameters
    ----------
    units : {"mm", "si", "um"}
        System of units of the file.

    Returns
    -------
    dict of str to Conversion
        A conversion for each unit of the quantities of `gen.quantities.IN_LAWS`, by this unit.
    """
    system = UNITS[units]
    length_unit = system.length_unit
    pressure_unit = system.pressure_unit
    pressure = system.pressure
    length = system.length
    return {
        "um": Conversion(length_unit, length),
        "um2": Conversion(f"{length_unit}2", length**2),
        "MPa": Conversion(pressure_unit, pressure),
        "uN": Conversion(system.force_unit, pressure * length**2),
        "MPa/um": Conversion(f"{pressure_unit}/{length_unit}", pressure / length),
        "J/m2": Conversion(f"{pressure_unit} {length_unit}", pressure * length),
        "W/(mm2 K)": Conversion(system.conductance_unit, system.conductance),
        "%": Conversion("share", 0.01),
        "1": Conversion("1", 1.0),
    }


def _head(law: Law, units: Units, table: ProgramTable, mark: str) -> Iterator[str]:
    """Yield the comment at the top of a file, whose lines begin with `mark`."""
    system = UNITS[units]
    pressures = table.pressure.values / system.pressure
    yield from comment(description(law, "table", system, pressures, ""), mark)


def _units_in_words(columns: Sequence[Column]) -> str:
    """Return a sentence with the units of columns."""
    texts = [f"{column.name} [{column.unit}]" for column in columns]
    return f"Columns and their units: {', '.join(texts)}."


def _rows(columns: Sequence[Column]) -> Iterator[list[str]]:
    """Yield the numbers of each point as texts, one for each column."""
    for row in zip(*(column.values.tolist() for column in columns), strict=True):
        yield [f"{number:.10g}" for number in row]


def _apdl_table(
    beginning: str, argument: Column, column: Column, variable: str
) -> Iterator[str]:
    """Yield the lines of a table of APDL: its units, its dimension, then a line for each number.

    The name of the table is `beginning`, shortened if necessary, and the name of the column.
    `variable` is the primary variable of the argument, PRESSURE or GAP.
    """
    ending = f"_{column.name.upper()}"
    name = beginning[: LONGEST_NAME - len(ending)] + ending
    rows = column.values.size
    yield f"! {column.name} [{column.unit}] over {argument.name} [{argument.unit}]"
    yield f"*DIM,{name},TABLE,{rows},1,1,{variable}"
    pairs = zip(argument.values.tolist(), column.values.tolist(), strict=True)
    for row, (at, value) in enumerate(pairs, start=1):
        yield f"{name}({row},0)={at:.10g}"
        yield f"{name}({row},1)={value:.10g}"
