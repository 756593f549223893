"""A contact law as a table: printed, and written as CSV."""

from collections.abc import Iterator
from pathlib import Path

from gen.table import Row, write_csv
from learn.surrogate import header
from learn.surrogate.curves import QUANTITIES, Curve
from learn.surrogate.law import Law


def write(law: Law, table: Path | None, c_header: Path | None) -> list[Path]:
    """Write a law as CSV and as a C header, where asked for."""
    written = []
    if table is not None:
        write_csv(table, list(_rows(law)))
        written.append(table)
    if c_header is not None:
        header.write(c_header, law)
        written.append(c_header)
    return written


def show(law: Law) -> None:
    """Print the law against Delta."""
    from rich.table import Table

    from gen.console import wide_console

    console = wide_console(120)
    for note in law.notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    table = Table(title=f"E* = {law.e_star:g} MPa; band: {law.band}")
    table.add_column("delta_um", justify="right")
    for name in QUANTITIES:
        table.add_column(name, justify="right")
    for place, delta in enumerate(law.delta):
        cells = [f"{delta:.5g}"]
        for name in QUANTITIES:
            curve = law.by_delta[name]
            low, high = curve.low[place], curve.high[place]
            ends = f" ({low:.4g} to {high:.4g})" if low < high else ""
            cells.append(f"{curve.value[place]:.4g}{ends}")
        table.add_row(*cells)
    console.print(table)


def _rows(law: Law) -> Iterator[Row]:
    """Rows of the CSV: the table against Delta with what is outside, the table against pressure."""
    for against, arguments, curves in (
        ("delta_um", law.delta, law.by_delta),
        ("pressure_MPa", law.pressure, law.by_pressure),
    ):
        for place, argument in enumerate(arguments):
            row: Row = {"against": against, "outside": ""}
            if against == "delta_um":
                row["outside"] = float(law.outside[place])
            for name in ("delta_um", *QUANTITIES):
                row |= {f"{name}{end}": "" for end in ("", "_low", "_high", "_slope")}
                if name == against:
                    row[name] = float(argument)
                elif name in curves:
                    row |= _cells(name, curves[name], place)
            yield row


def _cells(name: str, curve: Curve, place: int) -> Row:
    return {
        name: float(curve.value[place]),
        f"{name}_low": float(curve.low[place]),
        f"{name}_high": float(curve.high[place]),
        f"{name}_slope": float(curve.slope[place]),
    }
