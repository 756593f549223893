"""Options that say how the files of surfaces are read and prepared, as `gen contact` has them."""

from typing import NamedTuple

from gen import options


class Reading(NamedTuple):
    """How the file of a surface is read and prepared.

    Attributes
    ----------
    side : str
        Scan length, or two with a comma, for a file without lengths [um].
    unit : str
        Unit of a file that names none.
    channel : str
        Name or index of the channel, for a file with several.
    override_scale : bool
        True to let `side` and `unit` overrule the file.
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

    side: options.Side = ""
    unit: options.Unit = ""
    channel: options.Channel = ""
    override_scale: options.OverrideScale = False
    fill: options.Fill = False
    fill_most: options.FillMost = False
    level: options.Level = ""
    crop: options.Crop = ""
    invert: options.Invert = False
