"""Pictures of one surface, whose names are looked at before anything is computed."""

from pathlib import Path
from typing import Any


def empty_figure(picture: Path | None, width: float, height: float) -> Any:
    """Return the figure to draw into, or None; refuse a picture that cannot be drawn.

    Parameters
    ----------
    picture : Path or None
        File of the picture; None for none.
    width, height : float
        Sides of the figure [inches].

    Raises
    ------
    InputError
        If the suffix is of no picture, or matplotlib is missing.
    """
    if picture is None:
        return None
    from gen.runtime.figure import new_figure, require_picture_name

    require_picture_name(picture)
    return new_figure(width, height, dpi=110)
