"""Options that say how the files of surfaces are read and prepared, as `gen contact` has them."""

from typing import Annotated, NamedTuple

import typer


class Reading(NamedTuple):
    """How the file of a surface is read and prepared.

    Attributes
    ----------
    side : str
        Scan length, or two with a comma, where the file has none [um].
    unit : str
        Unit of a file that states none.
    channel : str
        Name or index of the channel, for a file with several.
    override_scale : bool
        True to let `side` and `unit` overrule what the file states.
    fill : bool
        True to fill missing points.
    fill_most : bool
        True to fill them even where more than half of the points are missing.
    level : str
        "mean", "plane" or "quadratic": the fit that is subtracted; "" for none.
    crop : str
        Part to keep, "x0:x1,y0:y1"; "" for the whole map [um].
    invert : bool
        True to turn the surface upside down.
    """

    side: Annotated[
        str,
        typer.Option(metavar="UM", help="Scan length where a file has none; 1000,500 if oblong."),
    ] = ""
    unit: Annotated[
        str, typer.Option(metavar="UNIT", help="Unit of a file that states none: m, mm, um, nm.")
    ] = ""
    channel: Annotated[
        str, typer.Option(metavar="NAME", help="Channel of a file with several, or its index.")
    ] = ""
    override_scale: Annotated[
        bool,
        typer.Option("--override-scale", help="Let --side and --unit overrule the file's own."),
    ] = False
    fill: Annotated[bool, typer.Option("--fill", help="Close holes harmonically.")] = False
    fill_most: Annotated[
        bool, typer.Option("--fill-most", help="Fill even if more than half is missing.")
    ] = False
    level: Annotated[
        str,
        typer.Option(metavar="HOW", help="Subtract the mean, the plane or the quadratic fit."),
    ] = ""
    crop: Annotated[
        str, typer.Option(metavar="X0:X1,Y0:Y1", help="Keep this part only, in um.")
    ] = ""
    invert: Annotated[bool, typer.Option("--invert", help="Turn upside down.")] = False
