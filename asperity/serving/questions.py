"""A client's question to a model: inputs, a configuration, and the scene that follows from both."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gen.arrays import Heights
from gen.generation.sample import load_of, surface_numbered
from gen.runtime.errors import InputError
from gen.scene import ScanSurface, Scene
from gen.scene.distribution import is_drawn

Vectors = list[list[FiniteFloat]]
"""Input or output of a model: vectors, each of one size."""


class Configuration(BaseModel):
    """Settings that a client may send with its input.

    Attributes
    ----------
    surface : int
        Index of the surface, which decides its random numbers; that of a database's column.
    seed : int, optional
        Seed of the scene.
    nodes : int or list of int, optional
        Nodes of the grid along x and y, the fidelity of the model.
    stiffness : bool
        Whether the solver tells the stiffness too, as a fourth output.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    surface: int = Field(default=0, ge=0, lt=2**32)
    seed: int | None = None
    nodes: int | Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    stiffness: bool = False


@dataclass(frozen=True)
class Inputs:
    """The inputs of a model: drawn parameters of the surface, load and hardness.

    Attributes
    ----------
    parameters : tuple of str
        Parameters of the surface that the scene draws, the first vector if there are any.
    load : str
        Quantity of the load in its own vector, see `gen.scene.load`.
    hardness : bool
        Whether the hardness is an input, the last vector.
    """

    parameters: tuple[str, ...]
    load: str
    hardness: bool

    @classmethod
    def of(cls, scene: Scene) -> "Inputs":
        """Return the inputs that a scene leaves open: drawn parameters, load, drawn hardness."""
        drawn = (name for name, given in scene.drawn_parameters.items() if is_drawn(given))
        return cls(tuple(drawn), scene.quantity, scene.contact.draws_hardness)

    @property
    def sizes(self) -> list[int]:
        """Sizes of the vectors."""
        surface = [len(self.parameters)] if self.parameters else []
        return [*surface, 1, *([1] if self.hardness else [])]


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


def question(
    scene: Scene, inputs: Inputs, vectors: Vectors, configuration: Configuration
) -> Question:
    """Turn inputs and configuration into a contact problem.

    Parameters
    ----------
    scene : Scene
        Scene of the model.
    inputs : Inputs
        What the vectors hold.
    vectors : list of list of float
        Finite numbers, in vectors of these inputs' sizes.
    configuration : Configuration
        The client's settings.

    Raises
    ------
    InputError
        If a value is not allowed, with its name.
    """
    drawn = dict(zip(inputs.parameters, vectors[0], strict=True)) if inputs.parameters else {}
    hardness = vectors[-1][0] if inputs.hardness else None
    load = vectors[-2 if inputs.hardness else -1][0]
    for name, value in ((inputs.load, load), ("hardness", hardness)):
        if value is not None and not value > 0:
            raise InputError(f"input: {name} = {value:g}; allowed: a number above 0")
    if isinstance(scene.surface, ScanSurface) and configuration.nodes is not None:
        raise InputError("config.nodes: the surfaces are windows of maps, which have the scene's")
    asked = scene.with_parameters(drawn, nodes=configuration.nodes, seed=configuration.seed)
    heights = surface_numbered(asked, configuration.surface)
    given = load_of(asked, heights, load) if inputs.load == asked.quantity else {inputs.load: load}
    return Question(asked, heights, given, hardness)
