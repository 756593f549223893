"""What a client asks of a model: inputs, a configuration, and a scene that follows from both."""

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gen.arrays import Heights
from gen.generation.plan import Parameters
from gen.generation.sample import load_of, surface_of
from gen.runtime.errors import InputError
from gen.scene import ScanSurface, Scene

Vectors = list[list[float]]
"""Input or output of a model: vectors, each of one size."""


class Configuration(BaseModel):
    """Settings that a client may send with its input.

    Attributes
    ----------
    surface : int
        Index of the surface, which decides its random numbers; that of a database's column.
    seed : int, optional
        Seed of the scene.
    nodes : int or pair of int, optional
        Nodes of the grid along x and y, the fidelity of the model.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    surface: int = Field(default=0, ge=0, lt=2**32)
    seed: int | None = None
    nodes: int | list[int] | None = None

    @classmethod
    def of(cls, content: dict[str, Any]) -> "Configuration":
        """Check a configuration as it was sent.

        Raises
        ------
        InputError
            If it has an unknown key or a value that is not allowed.
        """
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            fault = error.errors()[0]
            key = ".".join(map(str, fault["loc"]))
            raise InputError(
                f"config {key} = {fault['input']!r:.100}; allowed: surface, an index from 0; seed,"
                " a whole number; nodes, one number or two"
            ) from None


@dataclass(frozen=True)
class Inputs:
    """Names of the inputs of a model of a scene.

    Attributes
    ----------
    parameters : tuple of str
        Parameters of the surface, the first vector if there are any.
    hardness : bool
        Whether the hardness is an input, the last vector.
    """

    parameters: tuple[str, ...]
    hardness: bool

    @classmethod
    def of(cls, scene: Scene) -> "Inputs":
        """Return the inputs that a scene leaves open: its drawn parameters, load and hardness."""
        return cls(tuple(scene.drawn_parameters), scene.contact.draws_hardness)

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors."""
        surface = [len(self.parameters)] if self.parameters else []
        return [*surface, 1, *([1] if self.hardness else [])]

    @property
    def load(self) -> int:
        """Index of the vector with the load."""
        return 1 if self.parameters else 0


@dataclass(frozen=True)
class Question:
    """One contact problem that a client asks for.

    Attributes
    ----------
    scene : Scene
        The scene with the client's parameters and configuration.
    heights : ndarray, shape (nx, ny)
        Heights of its surface [um].
    load : dict of str to float
        "delta" [um], "pressure" [MPa] or "force" [uN] with its value.
    hardness : float or None
        Hardness [MPa] if it is an input.
    """

    scene: Scene
    heights: Heights
    load: dict[str, float]
    hardness: float | None


def require_servable(scene: Scene, name: str) -> None:
    """Refuse a scene whose surfaces have no parameters that a client could give.

    Raises
    ------
    InputError
        If the surfaces are windows of maps.
    """
    if isinstance(scene.surface, ScanSurface):
        raise InputError(
            f"{name}: its surfaces are windows of maps, which have no parameters; serve a scene of"
            " another generator, as `gen scene --like MAP` writes one"
        )


def question(scene: Scene, vectors: Vectors, content: dict[str, Any]) -> Question:
    """Turn inputs and configuration into a contact problem.

    Parameters
    ----------
    scene : Scene
        Scene of the model.
    vectors : list of list of float
        Inputs, see `Inputs`.
    content : dict
        Configuration as it was sent, see `Configuration`.

    Raises
    ------
    InputError
        If a value is not allowed, with its name.
    """
    inputs, configuration = Inputs.of(scene), Configuration.of(content)
    values = [[float(value) for value in vector] for vector in vectors]
    if not all(math.isfinite(value) for vector in values for value in vector):
        raise InputError("input: every number must be finite")
    drawn = dict(zip(inputs.parameters, values[0], strict=True)) if inputs.parameters else {}
    load = values[inputs.load][0]
    hardness = values[-1][0] if inputs.hardness else None
    for name, value in ((scene.quantity, load), ("hardness", hardness)):
        if value is not None and not value > 0:
            raise InputError(f"input: {name} = {value:g}; allowed: a number above 0")
    asked = _with(scene, drawn, configuration)
    plan = Parameters(
        surface=np.array([configuration.surface]),
        drawn={name: np.array([value]) for name, value in drawn.items()},
        load=np.array([load]),
        quantity=scene.quantity,
    )
    heights = surface_of(asked, plan, 0)
    return Question(asked, heights, load_of(asked, heights, load), hardness)


def _with(scene: Scene, drawn: dict[str, float], configuration: Configuration) -> Scene:
    """Return a scene with fixed parameters of its surfaces and a client's configuration."""
    content = json.loads(scene.text())
    surface = content["surface"]
    own = surface.get("parameters", surface)
    own |= drawn
    if configuration.nodes is not None:
        surface["nodes"] = configuration.nodes
    if configuration.seed is not None:
        content["seed"] = configuration.seed
    return Scene.from_text(json.dumps(content), "input and config")
