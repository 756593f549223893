"""How a map is read and prepared: each key once, with all that is said of it.

The options of commands, the tables of scenes, the words of messages and the table of the manual are
made of the fields of `Reading` and of what `KEYS` says of each. Nothing here needs pydantic, which
would delay the help of every command: the tables of scenes are made where scenes are.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from gen.runtime.errors import InputError
from gen.runtime.terminal import quoted

# height of the highest node above the median of its neighbours from which it is called a spike, in
# robust standard deviations of this quantity over all nodes; self-affine surfaces stay below 5
SPIKE = 7.0
# largest total degree of a form: higher ones follow the waviness, which is for an L-filter
HIGHEST_DEGREE = 20
READ, PREPARED = "reading", "preparation"  # tables of `[surface]` in a scene


def as_option(setting: str) -> str:
    """Write a key of `Reading`, alone or with its value, as an option of a command.

    Parameters
    ----------
    setting : str
        The key, or the key, a blank and its value, as "despike 7".

    Returns
    -------
    str
        The option, as "--despike 7".
    """
    key, blank, value = setting.partition(" ")
    return f"--{key.replace('_', '-')}{blank}{value}"


def in_scene_words(message: str, path: Path) -> str:
    """Name the keys of `Reading` in a message about a map as a scene does: `side`, not `--side`.

    Everything that reads and prepares maps names options. Scenes have the same keys, without
    dashes, and pass messages on in these words.

    Parameters
    ----------
    message : str
        An error or a warning.
    path : Path
        The file of the map. Its name stays as it is, whatever it contains.

    Returns
    -------
    str
        The message for the author of a scene.
    """
    parts = message.split(str(path))
    reworded = [
        OPTION.sub(lambda match: match[1].replace("-", "_"), part) for part in parts
    ]
    return str(path).join(reworded)


def numbers_in(text: str, separator: str = ",") -> list[float]:
    """Return the numbers of a text; none if one of its parts is no number."""
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        return []


class Key(NamedTuple):
    """What is said of a key of `Reading`."""

    help: str  # of the option, and in the manual
    metavar: str = ""  # value of the option in its help; "" for a flag
    table: str = (
        ""  # of `[surface]` in a scene that has the key; "" for one that no scene has
    )
    words: str = ""  # what is allowed, where the metavar does not say it
    suits: Callable[[Any], bool] = lambda value: (
        True
    )  # whether a value of the right type is

    @property
    def allowed(self) -> str:
        """What may be given, in words."""
        return self.words or (
            f"text, {self.metavar}" if self.metavar else "true or false"
        )


KEYS = {
    "side": Key(
        "Scan length in um for a file without lengths; two for an oblong patch: 1000,500.",
        "UM",
        READ,
        "the scan length in um, or two as [1000, 500] or '1000,500'",
    ),
    "unit": Key("Unit of a file that names none, as um, nm or inch.", "UNIT", READ),
    "channel": Key("Name or index of a channel of the file.", "NAME", READ),
    "override_scale": Key("Let --side and --unit overrule the file's own."),
    "crop": Key(
        "Keep only this part, in um from the first node, as 100:900,0:500.",
        "X0:X1,Y0:Y1",
        PREPARED,
    ),
    "invert": Key("Turn upside down: heights point into the material.", "", PREPARED),
    "mask": Key(
        "Heights outside these, in um, become holes, as -5:3.",
        "BELOW:ABOVE",
        PREPARED,
        words="the lowest and the highest height to keep in um, as -5:3, :3 or -5:",
    ),
    "despike": Key(
        "Replace nodes further from the local median than this times the scatter, as 7, by it.",
        "THRESHOLD",
        PREPARED,
        "a number above 0, as 7",
        suits=lambda threshold: 0 < threshold < math.inf,
    ),
    "level": Key(
        "Subtract the mean, plane or quadratic fit over the measured nodes.",
        "HOW",
        PREPARED,
        "one of 'mean', 'plane', 'quadratic'",
        suits=("mean", "plane", "quadratic").__contains__,
    ),
    "form": Key(
        f"Subtract the fitted polynomial of total degree N, 1 to {HIGHEST_DEGREE}.",
        "N",
        PREPARED,
        words=f"the degree of a polynomial, a whole number from 1 to {HIGHEST_DEGREE}",
        suits=lambda degree: 1 <= degree <= HIGHEST_DEGREE,
    ),
    "fill": Key(
        "Close holes by Laplace's equation between the heights of their rims.",
        "",
        PREPARED,
    ),
    "fill_most": Key("Fill even if more than half is missing.", "", PREPARED),
    "filter": Key(
        "Gaussian filter (ISO 16610-61): cut-offs of the S- and L-filter in um, as 2.5:80; one"
        " may be left out.",
        "S:L",
        PREPARED,
        words="the cut-offs of the S-filter and the L-filter in um, as 2.5:80, 2.5: or :80",
    ),
    "downsample": Key(
        "Take the means of N x N nodes as nodes.",
        "N",
        PREPARED,
        "a whole number of 2 or more",
        suits=lambda nodes: nodes >= 2,
    ),
}
"""The keys; those of the preparation in the order of their steps, which is a metrologist's."""

# the option of a key in a message
OPTION = re.compile(rf"(?<![\w-])--({'|'.join(KEYS).replace('_', '-')})(?![\w-])")


@dataclass(frozen=True)
class FileReading:
    """How the file of a map is read where it does not say it itself; by default, as it says.

    The fields are the options of commands, in their order.
    """

    KEYS: ClassVar = KEYS
    side: str = ""
    unit: str = (
        ""  # of the heights, and of the lengths of the file; .npy and text are in um
    )
    channel: str = ""  # the first one with heights by default


@dataclass(frozen=True)
class Reading(FileReading):
    """How a map is read, and what is done to it before it is used; by default nothing."""

    override_scale: bool = False
    fill: bool = False
    fill_most: bool = False
    level: str = ""
    crop: str = ""
    invert: bool = False
    mask: str = ""
    despike: float | None = None
    form: int | None = None
    filter: str = ""
    downsample: int | None = None

    def ends(self, key: str) -> tuple[float | None, float | None]:
        """Return both ends of `mask`, or both cut-offs of `filter` [um]; None where one is open."""
        text, least = getattr(self, key), 0.0 if key == "filter" else -math.inf
        if not text:
            return None, None
        parts = [part.strip() for part in text.split(":")]
        given = numbers_in(":".join(filter(None, parts)), ":")
        rising = given == sorted(set(given)) and all(
            least < each < math.inf for each in given
        )
        if len(parts) != 2 or not given or not rising:
            advice = f"give {KEYS[key].allowed}, the first below the second"
            raise InputError(f"--{key} {quoted(text)}: {advice}")
        low, high = (float(part) if part else None for part in parts)
        return low, high

    def of(self, table: str) -> dict[str, Any]:
        """Return the values of the keys of a table of scenes."""
        return {name: getattr(self, name) for name in keys(table)}


def keys(table: str) -> dict[str, Key]:
    """Return the keys of a table of scenes, in the order in which they are followed."""
    return {name: key for name, key in KEYS.items() if key.table == table}
