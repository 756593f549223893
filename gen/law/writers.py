"""The files of a contact law, as far as they are asked for."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gen.law import c_header, finite_elements, json_file, table
from gen.law.contact_law import Law
from gen.option_groups import Files


def write(law: Law, files: Files, figure: Any) -> Iterator[Path]:
    """Write a law to the files asked for, one after the other.

    Parameters
    ----------
    law : Law
        The law.
    files : Files
        Files to write.
    figure : matplotlib.figure.Figure or None
        Figure of `Files.empty_figure`.

    Yields
    ------
    Path
        A file that has been written.

    Raises
    ------
    InputError
        If a file cannot be written, or the law cannot be told in its format.
    """
    if any((files.header, files.calculix, files.abaqus, files.picture)):
        finite_elements.rising(law)  # refused before any file is written
    if files.table is not None:
        table.write(files.table, law)
        yield files.table
    if files.json is not None:
        json_file.write(files.json, law)
        yield files.json
    if files.header is not None:
        c_header.write(files.header, law)
        yield files.header
    if files.calculix is not None:
        yield from finite_elements.write(files.calculix, law, "calculix", files.units)
    if files.abaqus is not None:
        yield from finite_elements.write(files.abaqus, law, "abaqus", files.units)
    if files.picture is not None:
        from gen.law.picture import draw

        draw(figure, law, files.picture)
        yield files.picture
