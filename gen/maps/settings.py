"""Settings of the preparation of a measured map, as commands and scenes take them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from gen.maps.filters import HIGHEST_DEGREE
from gen.runtime.errors import InputError
from gen.runtime.numbers import shown

SPIKE = 7.0
"""Height of the highest node above the median of its neighbours from which it is called a spike, in
robust standard deviations of this quantity over all nodes; self-affine surfaces stay below 5."""

LEVELS = ("mean", "plane", "quadratic")


@dataclass(frozen=True)
class Preparation:
    """What to do to a measured map before its contacts are solved; by default nothing.

    Attributes
    ----------
    crop : str
        Part to keep, "x0:x1,y0:y1" from the first node on [um].
    invert : bool
        Turn the surface upside down, for files whose heights point into the material.
    mask : str
        Heights to keep, "below:above" [um]; all others become holes. Either end may be empty.
    despike : float, optional
        Distance from the local median from which a node is a spike, in units of the scatter of
        these distances.
    level : {"", "mean", "plane", "quadratic"}
        Least-squares fit of the measured nodes to subtract.
    form : int, optional
        Total degree of the least-squares polynomial to subtract instead of a level.
    fill : bool
        Close holes harmonically: no filled node is above or below the rim of its hole.
    fill_most : bool
        Fill even if more than half of the heights are missing.
    filter : str
        Cut-off wavelengths of the S-filter and the L-filter, "short:long" [um]. Either may be
        empty, which leaves its filter out.
    downsample : int, optional
        Nodes along each side of the blocks whose means become the nodes.
    """

    crop: str = ""
    invert: bool = False
    mask: str = ""
    despike: float | None = None
    level: str = ""
    form: int | None = None
    fill: bool = False
    fill_most: bool = False
    filter: str = ""
    downsample: int | None = None

    def check(self) -> None:
        """Refuse settings that suit no map, by their names on the command line.

        Raises
        ------
        InputError
            If a setting is out of its range, or a level and a form are asked for together.
        """
        self.kept_heights()
        self.cutoffs()
        if self.despike is not None and not 0 < self.despike < math.inf:
            raise InputError(f"--despike {self.despike:g}: give a number above 0, as 7")
        if self.level and self.level not in LEVELS:
            raise InputError(f"--level {self.level!r}: give one of {', '.join(LEVELS)}")
        if self.form is not None and not 1 <= self.form <= HIGHEST_DEGREE:
            raise InputError(f"--form {self.form}: give a degree from 1 to {HIGHEST_DEGREE}")
        if self.level and self.form is not None:
            raise InputError(
                f"--level {self.level} and --form {self.form} given: give one, a form of degree 1"
                " is a plane and one of degree 2 a quadratic"
            )
        if self.downsample is not None and self.downsample < 2:
            raise InputError(f"--downsample {self.downsample}: give a whole number of 2 or more")

    @property
    def options(self) -> frozenset[str]:
        """Options that are given, in the words of advice: "--crop", "--level plane"; a threshold
        of spikes counts as the one that is advised if it takes out as many.
        """
        given = {f"--{name.replace('_', '-')}" for name, value in vars(self).items() if value}
        given -= {"--level", "--despike"}
        if self.level:
            given.add(f"--level {self.level}")
        if self.despike is not None and self.despike <= SPIKE:
            given.add(f"--despike {SPIKE:g}")
        return frozenset(given)

    def kept_heights(self) -> tuple[float, float] | None:
        """Return the lowest and the highest height to keep [um]; None without a mask."""
        advice = "give the lowest and the highest height to keep in um, as -5:3, :3 or -5:"
        ends = _ends(self.mask, "--mask", advice)
        if ends is None:
            return None
        below, above = (-math.inf if ends[0] is None else ends[0]), ends[1]
        return below, math.inf if above is None else above

    def cutoffs(self) -> tuple[float | None, float | None]:
        """Return the cut-off wavelengths of the S-filter and the L-filter, None for no filter."""
        advice = "give the cut-offs of the S-filter and the L-filter in um, as 2.5:80, 2.5: or :80"
        ends = _ends(self.filter, "--filter", advice)
        if ends is None:
            return None, None
        if any(cutoff is not None and cutoff <= 0 for cutoff in ends):
            raise InputError(f"--filter {shown(self.filter)}: cut-offs are above 0; {advice}")
        return ends


def in_words_of_scenes(text: str) -> str:
    """Turn the options of a command in a message into the keys of a scene: --fill-most, fill_most.

    Parameters
    ----------
    text : str
        Message about an option.
    """
    return re.sub(r"--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), text)


def _ends(text: str, option: str, advice: str) -> tuple[float | None, float | None] | None:
    """Parse two rising numbers with a colon between them, one of which may be left out."""
    if not text:
        return None
    try:
        ends = [float(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        ends = []
    given = [end for end in ends if end is not None]
    if len(ends) != 2 or not given or not all(map(math.isfinite, given)):
        raise InputError(f"{option} {shown(text)}: {advice}")
    if len(given) == 2 and given[0] >= given[1]:
        raise InputError(f"{option} {shown(text)}: the first number is below the second; {advice}")
    return ends[0], ends[1]
