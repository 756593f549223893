"""How a map is read and prepared: the keys, with their help texts and what they allow.

The options of commands, the tables of scenes, the words of messages and the table of the manual are
made of the fields of `Reading` and of the records in `KEYS`. This module does without pydantic,
which would delay the help of every command: the tables of scenes are made where scenes are.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from gen.runtime.errors import InputError
from gen.runtime.terminal import quoted

# height of the highest node above the median of its neighbours from which it is called a spike, in
# robust standard deviations of this quantity over all nodes; self-affine surfaces stay below 5
SPIKE = 7.0
# largest total degree of a form: higher ones follow the waviness, which is for an L-filter
HIGHEST_DEGREE = 20
# tables of `[surface]` in a scene
READ = "reading"
PREPARED = "preparation"


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

    The functions that read and prepare maps name options in their messages. Scenes have the same
    keys, without dashes, and pass these messages on in their own words.

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
    reworded = [OPTION.sub(_key_of_option, part) for part in parts]
    return str(path).join(reworded)


def _key_of_option(match: re.Match[str]) -> str:
    """Return the key that a match of `OPTION` names."""
    return match[1].replace("-", "_")


def numbers_in(text: str, separator: str = ",") -> list[float]:
    """Return the numbers of a text.

    Parameters
    ----------
    text : str
        Numbers, as "5,0".
    separator : str
        The characters between the numbers.

    Returns
    -------
    list of float
        The numbers; an empty list if a part of the text is no number.
    """
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        return []


def _suits_always(value: object) -> bool:
    """Accept every value that has the type of its field."""
    return True


@dataclass(frozen=True, kw_only=True)
class Key:
    """The texts and the rule of one key of `Reading`."""

    help: str  # help text of the option, and description in the manual
    metavar: str = ""  # value of the option in its help text; "" for a flag
    table: str = ""  # table of `[surface]` that has the key; "" if scenes do not have it
    words: str = ""  # the allowed values, where the metavar does not tell them
    # whether a value of the right type is allowed
    suits: Callable[[Any], bool] = _suits_always

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if self.words:
            return self.words
        if self.metavar:
            return f"text, {self.metavar}"
        return "true or false"


KEYS = {
    "side": Key(
        help="Scan length in um for a file without lengths; two for an oblong patch: 1000,500.",
        metavar="UM",
        table=READ,
        words="the scan length in um, or two as [1000, 500] or '1000,500'",
    ),
    "unit": Key(
        help="Unit of a file that names none, as um, nm or inch.",
        metavar="UNIT",
        table=READ,
    ),
    "channel": Key(
        help="Name or index of a channel of the file.", metavar="NAME", table=READ
    ),
    "override_scale": Key(help="Let --side and --unit overrule the file's own."),
    "crop": Key(
        help="Keep only this part, in um from the first node, as 100:900,0:500.",
        metavar="X0:X1,Y0:Y1",
        table=PREPARED,
    ),
    "invert": Key(
        help="Turn upside down: heights point into the material.", table=PREPARED
    ),
    "mask": Key(
        help="Heights outside these, in um, become holes, as -5:3.",
        metavar="BELOW:ABOVE",
        table=PREPARED,
        words="the lowest and the highest height to keep in um, as -5:3, :3 or -5:",
    ),
    "despike": Key(
        help="Replace nodes further from the local median than this times the scatter, as 7, by"
        " it.",
        metavar="THRESHOLD",
        table=PREPARED,
        words="a number above 0, as 7",
        suits=lambda threshold: 0 < threshold < math.inf,
    ),
    "level": Key(
        help="Subtract the mean, plane or quadratic fit over the measured nodes.",
        metavar="HOW",
        table=PREPARED,
        words="one of 'mean', 'plane', 'quadratic'",
        suits=lambda level: level in {"mean", "plane", "quadratic"},
    ),
    "form": Key(
        help=f"Subtract the fitted polynomial of total degree N, 1 to {HIGHEST_DEGREE}.",
        metavar="N",
        table=PREPARED,
        words=f"the degree of a polynomial, a whole number from 1 to {HIGHEST_DEGREE}",
        suits=lambda degree: 1 <= degree <= HIGHEST_DEGREE,
    ),
    "fill": Key(
        help="Close holes by Laplace's equation between the heights of their rims.",
        table=PREPARED,
    ),
    "fill_most": Key(help="Fill even if more than half is missing.", table=PREPARED),
    "filter": Key(
        help="Gaussian filter (ISO 16610-61): cut-offs of the S- and L-filter in um, as 2.5:80;"
        " one may be left out.",
        metavar="S:L",
        table=PREPARED,
        words="the cut-offs of the S-filter and the L-filter in um, as 2.5:80, 2.5: or :80",
    ),
    "downsample": Key(
        help="Take the means of N x N nodes as nodes.",
        metavar="N",
        table=PREPARED,
        words="a whole number of 2 or more",
        suits=lambda nodes: nodes >= 2,
    ),
}
"""The keys; those of the preparation in the order of their steps, which is a metrologist's."""

# the option of a key in a message
OPTION = re.compile(rf"(?<![\w-])--({'|'.join(KEYS).replace('_', '-')})(?![\w-])")


@dataclass(frozen=True)
class FileReading:
    """What a file lacks that is needed to read it: length, unit, and the channel to take.

    The fields are the options of commands, in their order.
    """

    KEYS: ClassVar = KEYS
    side: str = ""  # scan length as "1000" or "1000,500" [um]; "" if the file has it
    # unit of the heights, and of the lengths if the file has any; "" stands for the file's own,
    # or for um in .npy and text
    unit: str = ""
    channel: str = ""  # name or index; "" stands for the first channel with heights


@dataclass(frozen=True)
class Reading(FileReading):
    """How a map is read, and how it is prepared before it is used; by default not at all."""

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
        """Return both ends of `mask`, or both cut-offs of `filter`.

        Parameters
        ----------
        key : {"mask", "filter"}
            The field, which holds "low:high", "low:", ":high" or "".

        Returns
        -------
        low, high : float or None
            The two ends [um]; None for an end that is open.

        Raises
        ------
        InputError
            If the field holds anything else, the first end is not below the second, or a cut-off
            is not above 0.
        """
        text = getattr(self, key)
        if not text:
            return None, None
        parts = [part.strip() for part in text.split(":")]
        stated = [part for part in parts if part]
        numbers = numbers_in(":".join(stated), ":")
        lowest = 0.0 if key == "filter" else -math.inf
        rising = numbers == sorted(set(numbers))
        inside = all(lowest < number < math.inf for number in numbers)
        if len(parts) != 2 or not numbers or not rising or not inside:
            advice = f"give {KEYS[key].allowed}, the first below the second"
            raise InputError(f"{as_option(key)} {quoted(text)}: {advice}")
        return _end(parts[0]), _end(parts[1])

    def values_of(self, table: str) -> dict[str, Any]:
        """Return the values of the keys that a table of scenes has.

        Parameters
        ----------
        table : {"reading", "preparation"}
            The name of the table.

        Returns
        -------
        dict
            The value of each of its keys, in the order of `keys`.
        """
        return {name: getattr(self, name) for name in keys(table)}


def _end(text: str) -> float | None:
    """Return the number of an end; None for an open one, whose text is empty."""
    if not text:
        return None
    return float(text)


def keys(table: str) -> dict[str, Key]:
    """Return the keys of a table of scenes.

    Parameters
    ----------
    table : {"reading", "preparation"}
        The name of the table.

    Returns
    -------
    dict
        Record of each key, in the order in which the steps are taken.
    """
    return {name: key for name, key in KEYS.items() if key.table == table}
