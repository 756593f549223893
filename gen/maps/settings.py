"""Settings by which a map is read and prepared, with their help texts and allowed values.

The options of commands, the tables of scenes, the words of messages and a table of the manual are
made from the fields of `Reading` and the records in `KEYS`. This module does not import pydantic,
which would delay the help of every command: `gen.generators.scans` makes the tables of scenes.
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

# A node may be a spike or a pit if its distance from the median of its neighbours is at least this
# many robust standard deviations of the distance over all nodes; self-affine surfaces stay below 5.
SPIKE = 7.0
# largest total degree of a form; higher degrees follow the waviness, which an L-filter separates
HIGHEST_DEGREE = 20
# names of the tables of settings below `[surface]` in a scene
READ = "reading"
PREPARED = "preparation"


def as_option(setting: str) -> str:
    """Write a key of `Reading`, alone or with its value, as an option of a command.

    Parameters
    ----------
    setting : str
        The key, as "fill_most", or the key, a blank and its value, as "despike 7".

    Returns
    -------
    str
        The option, as "--fill-most" or "--despike 7".
    """
    key, blank, value = setting.partition(" ")
    return f"--{key.replace('_', '-')}{blank}{value}"


def in_scene_words(message: str, path: Path) -> str:
    """Replace the names of options in a message about a map by keys: `--side` becomes `side`.

    The functions that read and prepare maps name options of commands in their messages. The author
    of a scene gives the same settings as keys, without dashes.

    Parameters
    ----------
    message : str
        The text of an error or a warning.
    path : Path
        The file of the map. Its name in the message is not changed.

    Returns
    -------
    str
        The message for the author of a scene.
    """
    parts = message.split(str(path))
    reworded = [OPTION.sub(_key_of_option, part) for part in parts]
    return str(path).join(reworded)


def _key_of_option(match: re.Match[str]) -> str:
    """Return the key for an option, without its dashes, that `OPTION` has matched: "fill_most"."""
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
        The numbers; an empty list if any part of the text is no number.
    """
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        return []


def _suits_always(value: object) -> bool:
    """Accept every value; the default rule of a key."""
    return True


@dataclass(frozen=True, kw_only=True)
class Key:
    """The texts about one field of `Reading`, and the rule for its values."""

    help: str  # help text of the option, and description in the manual
    metavar: str = ""  # placeholder for the value of the option, as "UM"; "" for a flag
    # table of a scene that has the key: `READ`, `PREPARED` or "" for none
    table: str = ""
    # the allowed values in words; "" if the metavar and the type say enough
    words: str = ""
    # function that tells whether a value, which has the type of the field, is allowed
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
    "override_scale": Key(help="Let --side and --unit overrule those of the file."),
    "prepare": Key(
        help="Despike, level and fill as the map needs it, as gen scene does; --despike, --level"
        " and --form overrule it."
    ),
    "crop": Key(
        help="Keep only this part, in um from the first node, as 100:900,0:500.",
        metavar="X0:X1,Y0:Y1",
        table=PREPARED,
    ),
    "invert": Key(
        help="Turn the map upside down, if its heights point into the material.",
        table=PREPARED,
    ),
    "mask": Key(
        help="Turn heights outside these limits in um, as -5:3, into holes.",
        metavar="BELOW:ABOVE",
        table=PREPARED,
        words="the lowest and the highest height to keep in um, as -5:3, :3 or -5:",
    ),
    "despike": Key(
        help="Replace a height that differs from its local median by more than this many times"
        " the scatter, such as 7.",
        metavar="THRESHOLD",
        table=PREPARED,
        words="a number above 0, as 7",
        suits=lambda threshold: 0 < threshold < math.inf,
    ),
    "level": Key(
        help="Subtract the mean, plane or quadratic fit over the measured nodes; lines: first shift"
        " lines along x by their median differences.",
        metavar="HOW",
        table=PREPARED,
        words="one of 'mean', 'plane', 'quadratic', 'lines'",
        suits=lambda level: level in {"mean", "plane", "quadratic", "lines"},
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
        help="Replace N x N nodes by one node with their mean height.",
        metavar="N",
        table=PREPARED,
        words="a whole number of 2 or more",
        suits=lambda nodes: nodes >= 2,
    ),
}
"""The records of all keys. Keys of the preparation have the order in which their steps are taken,
which is usual in metrology."""

# option of a key in a message
OPTION = re.compile(rf"(?<![\w-])--({'|'.join(KEYS).replace('_', '-')})(?![\w-])")


@dataclass(frozen=True)
class FileReading:
    """Settings that a file may need to be read: its length, its unit and the channel to read.

    The fields are options of commands, in this order. `KEYS` describes them.
    """

    KEYS: ClassVar = KEYS
    # scan length as "1000" or "1000,500" [um]; "" to take it from the file
    side: str = ""
    # Unit of the heights, and of lengths in the file that have no unit of their own. "" takes the
    # unit from the file, or um if a .npy file or a text names none.
    unit: str = ""
    channel: str = ""  # name or index of a channel; "" for the first channel with heights


@dataclass(frozen=True)
class SceneReading(FileReading):
    """Settings by which `gen scene` reads maps, and steps that it else chooses itself.

    The fields are options of the command. `KEYS` describes them.
    """

    despike: float | None = None
    level: str = ""


@dataclass(frozen=True)
class Reading(FileReading):
    """Settings by which a map is read and prepared; by default it is not prepared.

    The fields are options of commands and keys of scenes. `KEYS` describes them. False, "" and None
    leave a step out.
    """

    override_scale: bool = False
    prepare: bool = False
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
        """Return both limits of `mask`, or both cut-offs of `filter`.

        Parameters
        ----------
        key : {"mask", "filter"}
            Name of the field, which holds "low:high", "low:", ":high" or "".

        Returns
        -------
        low, high : float or None
            The two ends [um]; None for an end that the field leaves out.

        Raises
        ------
        InputError
            If the field holds anything else, the first end is not below the second, an end is
            infinite, or a cut-off is not above 0.
        """
        text = getattr(self, key)
        if not text:
            return None, None
        advice = f"give {KEYS[key].allowed}, the first below the second"
        refusal = InputError(f"{as_option(key)} {quoted(text)}: {advice}")
        try:
            ends = [_end(part) for part in text.split(":")]
        except ValueError:  # an end is no number
            raise refusal from None
        stated_ends = [end for end in ends if end is not None]
        if len(ends) != 2 or not stated_ends:
            raise refusal
        lowest = 0.0 if key == "filter" else -math.inf
        if not all(lowest < end < math.inf for end in stated_ends):
            raise refusal
        low, high = ends
        if low is not None and high is not None and low >= high:
            raise refusal
        return low, high

    def values_of(self, table: str) -> dict[str, Any]:
        """Return the values of the fields that are keys of a table of scenes.

        Parameters
        ----------
        table : {"reading", "preparation"}
            Name of the table.

        Returns
        -------
        dict of str to any
            Value of each key of the table, in the order of `KEYS`.
        """
        return {name: getattr(self, name) for name in keys(table)}

    @property
    def changed_options(self) -> str:
        """The options of commands whose values are not the default, as "--level --side"."""
        default = type(self)()
        names = [name for name in KEYS if getattr(self, name) != getattr(default, name)]
        return " ".join(as_option(name) for name in sorted(names))

    @property
    def options_of_steps(self) -> str:
        """The steps of the preparation as options of commands, as "--level plane --fill".

        The text is "" if there is no step.
        """
        options = []
        for name, value in self.values_of(PREPARED).items():
            if value is True:
                options.append(as_option(name))
            elif isinstance(value, float):
                options.append(as_option(f"{name} {value:g}"))
            elif value:
                options.append(as_option(f"{name} {value}"))
        return " ".join(options)


def _end(text: str) -> float | None:
    """Return the number in the text of an end; None if the text is blank.

    ValueError if the text is anything else.
    """
    if not text.strip():
        return None
    return float(text)


def keys(table: str) -> dict[str, Key]:
    """Return the records of the keys of a table of scenes.

    Parameters
    ----------
    table : {"reading", "preparation"}
        Name of the table.

    Returns
    -------
    dict of str to Key
        Record of each key by its name, in the order of `KEYS`.
    """
    return {name: key for name, key in KEYS.items() if key.table == table}
