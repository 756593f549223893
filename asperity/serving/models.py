"""The models of the server: the solver on a scene's surfaces, and surrogates."""

from pathlib import Path
from typing import Any, Protocol

import bem
from asperity.serving.questions import Inputs, Vectors, question, require_servable
from gen.generation.completion import completed
from gen.generation.sample import solve_contact
from gen.runtime.errors import InputError
from gen.runtime.output import kind_of
from gen.scene import Scene, load, preset_names

FORCE = 1
"""Index of the force among the outputs of the solver."""

AREA_FORCE_DELTA = 3
"""Number of the solver's outputs: area [%], force [uN] and Delta [um]."""


class Unsolved(Exception):
    """A contact problem without a solution, or one that did not converge."""


class Unsupported(Exception):
    """A derivative that a model does not have."""


class Model(Protocol):
    """A function of vectors that answers a client.

    Attributes
    ----------
    name : str
        Name for clients.
    input_sizes, output_sizes : list of int
        Sizes of the vectors.
    derivatives : bool
        Whether `slope` has an answer for one pair of output and input.
    """

    name: str
    input_sizes: list[int]
    output_sizes: list[int]
    derivatives: bool

    def evaluate(self, vectors: Vectors, config: dict[str, Any]) -> Vectors:
        """Return the outputs of inputs that have the right sizes."""

    def slope(self, output: int, given: int, vectors: Vectors, config: dict[str, Any]) -> float:
        """Return the derivative of an output of one number by an input of one number."""


class SolverModel:
    """The solver: parameters of a surface and a load in; area [%], force [uN], Delta [um] out.

    Parameters
    ----------
    scene : Scene
        Scene that says how surfaces are made and contacts solved.
    name : str
        Name for clients.
    """

    def __init__(self, scene: Scene, name: str) -> None:
        require_servable(scene, name)
        self.scene, self.name = completed(scene), name
        inputs = Inputs.of(self.scene)
        self.input_sizes = inputs.sizes
        self.output_sizes = [1] * AREA_FORCE_DELTA
        self._load = inputs.load
        elastic = self.scene.contact.hardness_limits is None
        rigid = self.scene.contact.far_field == "rigid"
        self.derivatives = self.scene.quantity == "delta" and elastic and rigid

    def evaluate(self, vectors: Vectors, config: dict[str, Any]) -> Vectors:
        """Solve one contact problem."""
        contact = self._solved(vectors, config)
        return [[contact.area_percent], [contact.force], [contact.delta]]

    def slope(self, output: int, given: int, vectors: Vectors, config: dict[str, Any]) -> float:
        """Return the stiffness dF/dDelta [N/m = uN/um]; it needs one more linear solve."""
        if not self.derivatives or (output, given) != (FORCE, self._load):
            raise Unsupported(
                f"{self.name} has one derivative, of output {FORCE}, the force, by input"
                f" {self._load}, Delta, where bodies are elastic and Delta is given"
            )
        return self._solved(vectors, config).stiffness

    def _solved(self, vectors: Vectors, config: dict[str, Any]) -> bem.Contact:
        """Solve the contact problem of inputs."""
        asked = question(self.scene, vectors, config)
        try:
            return solve_contact(asked.scene, asked.heights, hardness=asked.hardness, **asked.load)
        except bem.OutOfRange as error:
            raise InputError(str(error)) from None
        except (bem.NoSolution, bem.NotConverged) as error:
            raise Unsolved(str(error)) from None
        except MemoryError:
            raise Unsolved("memory has run out: give fewer nodes") from None


class SurrogateModel:
    """A surrogate: the same inputs; value, both ends of the interval, and 1 inside the training.

    Every target is a vector of four numbers: predicted value, low and high end of its 90 %
    interval, and 1 where the question lies inside what the surrogate was trained on, else 0.

    Parameters
    ----------
    path : Path
        File of the surrogate.
    """

    derivatives = False

    def __init__(self, path: Path) -> None:
        from learn.surrogate import Surrogate

        self.name = path.stem
        self.surrogate = Surrogate.load(path)
        self.scene = Scene.from_text(self.surrogate.card["scene"], str(path))
        require_servable(self.scene, str(path))
        self.input_sizes = Inputs.of(self.scene).sizes
        self.output_sizes = [4] * len(self.surrogate.learnt)

    def evaluate(self, vectors: Vectors, config: dict[str, Any]) -> Vectors:
        """Predict one contact problem."""
        asked = question(self.scene, vectors, config)
        if "delta" not in asked.load:
            raise InputError(f"{self.name}: predicts at a Delta; its scene gives loads otherwise")
        predicted = self.surrogate.predict(
            asked.heights, asked.scene.sides, asked.load["delta"], hardness=asked.hardness
        )
        inside = float(predicted.inside[0])
        return [
            [float(part[name][0]) for part in (predicted.values, predicted.low, predicted.high)]
            + [inside]
            for name in self.surrogate.learnt
        ]

    def slope(self, output: int, given: int, vectors: Vectors, config: dict[str, Any]) -> float:
        """Refuse derivatives, which surrogates do not have."""
        raise Unsupported(f"{self.name} is a surrogate, and has no derivatives")


def model_of(source: str) -> Model:
    """Make the model of a scene or of a surrogate.

    Parameters
    ----------
    source : str
        Name of a shipped scene, or path of a scene's TOML file or of a surrogate.

    Raises
    ------
    InputError
        If it is neither, or cannot be served.
    """
    path = Path(source)
    if source not in preset_names() and path.is_file() and kind_of(path) == "surrogate":
        return SurrogateModel(path)
    return SolverModel(load(source), source if source in preset_names() else path.stem)
