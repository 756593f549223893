"""The files of a contact law, as far as they are asked for."""

from pathlib import Path
from typing import Any

from gen.law import c_header, finite_elements, json_file, table
from gen.law.contact_law import Law
from gen.option_groups import Files


def write(law: Law, files: Files, figure: Any) -> list[Path]:
    """Write a law to the files asked for.

    Parameters
    ----------
    law : Law
        The law.
    files : Files
        Files to write.
    figure : matplotlib.figure.Figure or None
        Figure of `Files.empty_figure`.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    InputError
        If a file cannot be written, or the law cannot be told in its format.
    """
    if files.table is not None:
        table.write(files.table, law)
    if files.json is not None:
        json_file.write(files.json, law)
    if files.header is not None:
        c_header.write(files.header, law)
    if files.calculix is not None:
        finite_elements.write(files.calculix, law, "calculix", files.units)
    if files.abaqus is not None:
        finite_elements.write(files.abaqus, law, "abaqus", files.units)
    if files.picture is not None:
        from gen.law.picture import draw

        draw(figure, law, files.picture)
    return [output.path for output in files.outputs if output.path is not None]
