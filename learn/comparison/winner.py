"""Settings of a search's winner, as a comparison folder holds them: only values of the grid."""

from typing import Any, NamedTuple

from gen.runtime.errors import InputError
from learn.comparison.folder import Folder
from learn.comparison.search import spaces
from learn.models import MODELS


class Winner(NamedTuple):
    """The winner of a search.

    Attributes
    ----------
    settings : dict
        Values by setting.
    of_grid : bool
        True for a candidate of the grid, False for the baseline.
    """

    settings: dict[str, Any]
    of_grid: bool


def settings_of(folder: Folder, model: str) -> Winner | None:
    """Read the settings of a search's winner.

    Somebody may have edited the file, and with settings outside the grid a library may use up all
    memory or never end.

    Parameters
    ----------
    folder : Folder
        Folder of a target.
    model : str
        Name of the model.

    Returns
    -------
    Winner or None
        Settings of the winner; None if the folder has no winner.

    Raises
    ------
    InputError
        If the settings are not of the grid.
    """
    result = folder.result("tuned", model)
    if result is None or "settings" not in result:
        return None
    settings, refit = _with_tuples(result["settings"]), result.get("refit", {})
    path = folder.path / "tuned" / f"{model}.json"
    features = folder.record()["conditions"].get("features", "paper")
    if result["search"].get("winner") == "baseline":
        if settings != spaces.baseline(model, features):
            raise InputError(f"{path}: settings = {settings!r} are not those of the baseline")
        return Winner(settings, of_grid=False)
    grid, space = spaces.of(model, features)
    own = result["search"].get("grid", spaces.TABLE_2) == spaces.GIVEN  # searched by a program
    for name, value in settings.items():
        if not own and value not in space.get(name, []):
            raise InputError(f"{path}: {name} = {value!r} is not in the grid {grid!r}")
    if refit not in ({}, dict(MODELS[model].tuned)):  # older folders name the perceptron's
        raise InputError(f"{path}: refit = {refit!r} is not as learn makes it")
    return Winner(settings, of_grid=True)


def _with_tuples(settings: dict[str, Any]) -> dict[str, Any]:
    """Turn lists into tuples: JSON stores the layers of a perceptron as a list."""
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in settings.items()
    }
