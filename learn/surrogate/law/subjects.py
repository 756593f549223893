"""The surfaces of a contact law: from files and folders, or the population of a scene."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bem.spacing import Boundary
from gen.runtime.errors import InputError
from gen.scene import Scene, preset_names
from learn.arrays import Values
from learn.features import SurfaceFeatures
from learn.features.hardness import hardness_limits, modulus
from learn.reading import Reading
from learn.surrogate.sources import files_in, is_table, read_surface

Sides = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Subject:
    """A surface of a law.

    Attributes
    ----------
    name : str
        Name of the surface in messages.
    heights : ndarray, shape (nx, ny)
        Heights [um].
    sides : tuple of float
        Scan lengths along x and y [um].
    spacing : tuple of float
        Spacing of the nodes along x and y [um].
    settings : mapping of str to object
        Settings of the solver that a scene states: kernel, far_field, rtol, max_iterations.
    boundary : {"free", "periodic", "mirror"}
        Boundary of the patch.
    """

    name: str
    heights: Values
    sides: Sides
    spacing: Sides
    settings: Mapping[str, Any] = field(default_factory=dict)
    boundary: Boundary = "free"

    @property
    def nominal(self) -> float:
        """Area of the cells of all nodes, over which the nominal pressure is a mean [um2]."""
        return float(self.spacing[0] * self.spacing[1] * self.heights.size)

    @property
    def gap_at_rest(self) -> float:
        """Mean gap at first touch, Delta = 0 [um]."""
        return float(self.heights.max()) - float(self.heights.mean())

    def features(self) -> SurfaceFeatures:
        """Return the surface as one whose features can be computed."""
        return SurfaceFeatures(self.heights, self.sides, self.spacing, self.name, self.boundary)


@dataclass(frozen=True, eq=False)
class Subjects:
    """All surfaces of a law.

    Attributes
    ----------
    surfaces : sequence of Subject
        One surface or more.
    scenes : sequence of Scene
        Scenes that surfaces were generated from.
    origins : sequence of str
        Descriptions of the surfaces, one line for each input.
    """

    surfaces: Sequence[Subject]
    scenes: Sequence[Scene]
    origins: Sequence[str]

    @property
    def only_scenes(self) -> bool:
        """True if every surface comes from a scene."""
        return len(self.scenes) == len(self.origins)

    def modulus(self) -> float | None:
        """Return the E* of all scenes [MPa], or None if a surface comes from a file.

        Raises
        ------
        InputError
            If the scenes have different E*.
        """
        moduli = {modulus(scene) for scene in self.scenes}
        if not self.only_scenes or not moduli:
            return None
        if len(moduli) > 1:
            said = " and ".join(f"{each:g}" for each in sorted(moduli))
            raise InputError(f"the scenes have E* = {said} MPa: give one with --e-star")
        return moduli.pop()

    def hardness_ratio(self) -> float | None:
        """Return the hardness over E* of all scenes, or None if a surface comes from a file.

        Raises
        ------
        InputError
            If the scenes have several.
        """
        limits = {hardness_limits(scene) for scene in self.scenes}
        if not self.only_scenes or limits <= {None}:
            return None
        ends = {end for each in limits if each is not None for end in each}
        if None in limits or len(ends) > 1:
            raise InputError("the scenes have more than one hardness: give one with --hardness")
        return ends.pop()

    def displacements(self) -> Sides | None:
        """Return the range of Delta of all scenes [um], or None if a surface comes from a file."""
        if not self.only_scenes:
            return None
        ranges = [piece.range for scene in self.scenes for piece in scene.delta.pieces]
        return min(low for low, _ in ranges), max(high for _, high in ranges)


def read_subjects(
    inputs: Sequence[str],
    surfaces: int,
    reading: Reading,
    boundary: Boundary,
    say: Callable[[str], None],
) -> Subjects:
    """Read or generate all surfaces.

    Parameters
    ----------
    inputs : sequence of str
        Surfaces, folders of them, databases, scenes.
    surfaces : int
        Number of surfaces of each scene or database.
    reading : Reading
        Options that say how files are read.
    boundary : {"free", "periodic", "mirror"}
        Boundary of all patches; scenes have to agree.
    say : callable
        Called with a line for the user about each file.

    Raises
    ------
    InputError
        For the first input that cannot be used.
    """
    subjects: list[Subject] = []
    scenes: list[Scene] = []
    origins: list[str] = []
    for text in inputs:
        path = Path(text)
        if is_scene(text):
            scenes.append(_scene(text, boundary))
            subjects += _population(scenes[-1], text, surfaces)
            origins.append(f"{text}: its first {surfaces} surfaces")
            continue
        doubts: list[str] = []
        for file in files_in([path])[0]:
            subject, doubtful = _from_file(file, reading, boundary, say)
            subjects.append(subject)
            doubts += doubtful
        origins.append(f"{text}: {'; '.join(dict.fromkeys(doubts))}" if doubts else text)
    return Subjects(subjects, scenes, origins)


def _from_file(
    file: Path, reading: Reading, boundary: Boundary, say: Callable[[str], None]
) -> tuple[Subject, Sequence[str]]:
    """Read one surface; return it with the warnings about its scale and its holes."""
    if is_table(file):
        raise InputError(f"{file}: a law needs surfaces, not their statistics")
    topography, warnings = read_surface(file, reading, boundary)
    say(f"{file}: {'; '.join(topography.steps)}")
    for line in warnings:
        say(f"  warning: {line}")
    heights, sides, spacing = topography.heights, topography.sides, topography.spacing
    subject = Subject(str(file), heights, sides, spacing, boundary=boundary)
    return subject, topography.warnings


def is_scene(text: str) -> bool:
    """Return whether an input is a scene or a database rather than surfaces."""
    return text in preset_names() or Path(text).suffix.lower() in {".toml", ".h5"}


def scene_of(text: str) -> Scene:
    """Return the scene of a name, of a file, or of a database."""
    from gen.scene import load

    if not text.lower().endswith(".h5"):
        return load(text)
    from gen.database import Reader

    with Reader(Path(text)) as reader:
        return reader.scene


def _scene(text: str, boundary: Boundary) -> Scene:
    """Return the scene of an input, whose patches need to have the law's boundary."""
    scene = scene_of(text)
    if scene.contact.boundary != boundary:
        raise InputError(
            f"{text}: has a {scene.contact.boundary} boundary, the law a {boundary} one: a law has"
            " patches of one boundary, that of its surrogate if there is one"
        )
    return scene


def _population(scene: Scene, text: str, number: int) -> Iterator[Subject]:
    """Yield the first surfaces of a scene, with the solver's settings of the scene."""
    from gen.generation.plan import parameters
    from gen.generation.sample import surface_of

    contact = scene.contact
    names = "kernel", "far_field", "rtol", "max_iterations"
    settings = {"spacing": scene.spacing, **{name: getattr(contact, name) for name in names}}
    step = scene.samples_per_surface
    plan = parameters(scene, 0, step * number)
    sides, spacing = (scene.surface.side,) * 2, (scene.spacing,) * 2
    for surface in range(number):
        heights = surface_of(scene, plan, step * surface)
        name = f"{text}, surface {surface}"
        yield Subject(name, heights, sides, spacing, settings, contact.boundary)
