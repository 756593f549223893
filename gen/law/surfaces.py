"""The surfaces of a contact law: from files and folders, or the population of a scene."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bem.problem import Boundary, Problem, pose
from gen.distribution import limits
from gen.doubts import DOUBTED_SHARE, STEEP_ROW, steep_slopes
from gen.generators.like import LikeSurface
from gen.generators.scans import ScanSurface
from gen.law.order import Order
from gen.maps.bodies import Opposite, read_surface
from gen.maps.read import Topography, files_in
from gen.material import Bodies, LayeredBody
from gen.quantities import BODIES_ALONE, MEAN_GAP, Media, Quantity, patch_compliance
from gen.runtime.errors import InputError
from gen.runtime.files import digest
from gen.runtime.terminal import echo
from gen.scene import Scene, load, preset_names
from gen.statistics import rms_slope

USUAL_BOUNDARY: Boundary = "mirror"
"""Boundary of the patches if the order names none, because a patch is a piece of an interface."""

SOLVER_SETTINGS = ("kernel", "far_field", "rtol", "max_iterations")
"""Settings in the table `[contact]` of a scene with which its law solves contacts, too."""


LOW_SUMMIT = 0.85
"""Mean height of the summits of patches over that of the maps below which a law of patches is not
one of the maps: at light loads the mean gap is as wide as the summit is high."""

UNIT_BODIES = Bodies(e_star=1.0)
"""Half-spaces of E* = 1 MPa, for answers that do not depend on the bodies."""


@dataclass(frozen=True, eq=False)
class LawSurface(Topography):
    """A surface of a law."""

    # Values of `SOLVER_SETTINGS` of the scene; empty for a surface from a file.
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def nominal(self) -> float:
        """Area of the cells of all nodes, over which the nominal pressure is a mean [um2]."""
        return float(self.spacing[0] * self.spacing[1] * self.heights.size)

    def posed(self, bodies: Bodies = UNIT_BODIES) -> Problem:
        """Pose the contact of the surface with a flat one at first touch.

        Parameters
        ----------
        bodies : Bodies
            Material of the bodies; their hardness is left out.

        Returns
        -------
        bem.problem.Problem
            The problem, with a force of 0.

        Raises
        ------
        ValueError
            If bodies with a layer cannot have the far field of the surface, or if the layer is too
            thin for the cells of a free patch.
        """
        return pose(
            self.heights,
            self.sides,
            delta=None,
            force=0.0,
            spacing=self.spacing,
            boundary=self.boundary,
            **bodies.elastic_settings,
            kernel=self.settings.get("kernel", "uniform-pressure"),
            far_field=self.settings.get("far_field", "rigid"),
        )

    def at_rest(
        self, quantities: Iterable[Quantity] = (MEAN_GAP,), media: Media = BODIES_ALONE
    ) -> dict[str, float]:
        """Compute quantities at first touch, where bodies do not touch in any spot yet.

        Parameters
        ----------
        quantities : iterable of Quantity
            Quantities of a law.
        media : Media
            Conductivities and gas, for the conductances.

        Returns
        -------
        dict of float
            Values by names in laws, in the units of laws. Quantities that are 0 at first touch on
            every surface are left out.

        Raises
        ------
        ValueError
            If a quantity depends on a medium that `media` lacks.
        ArithmeticError
            If the flow through the gap, for an aperture, does not converge.
        """
        problem = self.posed()
        return {
            quantity.in_laws: quantity.resting(problem, media)
            for quantity in quantities
            if quantity.at_rest is not None
        }

    def patch_compliance(self, bodies: Bodies) -> float:
        """Compute how far a flat punch that fills the patch sinks, per unit of mean pressure.

        Parameters
        ----------
        bodies : Bodies
            Material of the bodies.

        Returns
        -------
        float
            Compliance [um / MPa]. It is 0 on a compliant far field, and for a patch without edges
            unless a layer lies on a rigid base.

        Raises
        ------
        ValueError
            As `posed`.
        """
        return patch_compliance(self.posed(bodies))


@dataclass(frozen=True)
class SourceFile:
    """A file that surfaces of a law come from."""

    path: str
    sha256: str  # of its content


@dataclass(frozen=True)
class Source:
    """The files of one surface of a law, or of all surfaces of a scene, and their preparation."""

    name: str  # of the surface or the scene
    # The maps of both bodies; or the file of the scene, and the maps that it names.
    files: tuple[SourceFile, ...]
    steps: tuple[str, ...]  # the steps of the preparation in order, one line each

    @property
    def text(self) -> str:
        """Files with their hashes, and the steps, in one line."""
        files = "; ".join(f"{file.path} (SHA-256 {file.sha256})" for file in self.files)
        if not self.steps:
            return files
        return f"{files}: {'; '.join(self.steps)}"


@dataclass(frozen=True, eq=False)
class LawInput:
    """One input of a law: a surface, a folder of surfaces, a database or a scene."""

    description: str  # one line
    scene: Scene | None = None  # the scene that generated its surfaces; None for files


@dataclass(frozen=True, eq=False)
class InputSurfaces:
    """One input of a law with all its surfaces."""

    about: LawInput
    surfaces: list[LawSurface]
    sources: list[Source]
    doubts: list[str]  # warnings about the surfaces, each with the name of the input


@dataclass(frozen=True, eq=False)
class LawSurfaces:
    """All surfaces of a law, one or more."""

    surfaces: Sequence[LawSurface]
    inputs: Sequence[LawInput]
    # Warnings about the surfaces, each with the name of its input.
    doubts: Sequence[str] = ()
    sources: Sequence[Source] = ()  # files of the surfaces and their preparation

    @property
    def descriptions(self) -> list[str]:
        """Descriptions of the inputs, one line each."""
        return [about.description for about in self.inputs]

    def modulus(self) -> float | None:
        """Return the modulus that all scenes share.

        Returns
        -------
        float or None
            E* [MPa]; None if an input is no scene.

        Raises
        ------
        InputError
            If all inputs are scenes, and have different moduli.
        """
        scenes = self._scenes_alone()
        if not scenes:
            return None  # files do not give a modulus
        moduli = {scene.contact.e_star for scene in scenes}
        if len(moduli) > 1:
            listed = " and ".join(f"{modulus:g}" for modulus in sorted(moduli))
            raise InputError(f"the scenes have E* = {listed} MPa: give one with --e-star")
        return moduli.pop()

    def layered_body(self) -> LayeredBody | None:
        """Return the layered body that all inputs share.

        Returns
        -------
        LayeredBody or None
            The body; None if no input is a scene with a layer.

        Raises
        ------
        InputError
            If a scene has a layer, and another input has no layer or a different one; or if a scene
            draws its layers.
        """
        distinct: set[LayeredBody | None] = set()
        for about in self.inputs:
            layered: LayeredBody | None = None
            if about.scene is not None:
                layered = layered_body_of(about.scene, about.description)
            distinct.add(layered)
        if len(distinct) > 1:
            raise InputError(
                "a scene has a layer that not all inputs have: give the bodies of the law with"
                " --layer-thickness, --layer-young and --young, or --layer-base rigid"
            )
        [layered] = distinct
        return layered

    def hardness_ratio(self) -> float | None:
        """Return the hardness over E* that all scenes share; no scene may draw a hardness.

        Returns
        -------
        float or None
            The ratio; None if the bodies of the scenes are elastic, or an input is no scene.

        Raises
        ------
        InputError
            If all inputs are scenes, and these have more than one ratio, or only some have one.
        """
        scenes = self._scenes_alone()
        if not scenes:
            return None  # files do not give a hardness
        ratios: set[float | None] = set()
        for scene in scenes:
            if scene.contact.hardness_limits is None:
                ratios.add(None)
            else:  # two limits that differ are two ratios
                e_star = scene.contact.e_star
                ratios |= {end / e_star for end in scene.contact.hardness_limits}
        if len(ratios) > 1:
            raise InputError(
                "the scenes have more than one hardness: give one with --hardness"
            )
        return ratios.pop()

    def _scenes_alone(self) -> list[Scene]:
        """Return the scenes of all inputs, or an empty list if an input is no scene."""
        scenes = [about.scene for about in self.inputs if about.scene is not None]
        if len(scenes) < len(self.inputs):
            return []
        return scenes


def layered_body_of(scene: Scene, description: str) -> LayeredBody | None:
    """Return the layered body of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    description : str
        Description of the input for the message of an error.

    Returns
    -------
    LayeredBody or None
        The body; None for half-spaces.

    Raises
    ------
    InputError
        If the scene draws its layers.
    """
    layer = scene.contact.layer
    if layer is not None and layer.drawn:
        raise InputError(
            f"{description}: the scene draws its layers, and a law is that of one: give"
            " contact.layer one thickness and one modulus"
        )
    return scene.contact.layered_body({})


def read_law_surfaces(order: Order, only: Boundary | None = None) -> LawSurfaces:
    """Read or generate all surfaces of a law.

    Scenes and databases give their first surfaces; if a second body is pressed against these, the
    scene names it. Surfaces from files are pressed against the second rough body of the order, or
    against each body in the order's folder. The preparation of files is printed on standard error.

    Parameters
    ----------
    order : Order
        The request for the law.
    only : {"free", "periodic", "mirror"} or None
        Boundary that a surrogate was trained with. It replaces the boundary of the order, and a
        scene with another one is refused. If it is None, a scene takes the boundary of the order
        in place of its own; then it loses its kernel and far field, see `_scene_of_law`.

    Returns
    -------
    LawSurfaces
        One surface or more, all with the same boundary.

    Raises
    ------
    InputError
        If a surface cannot be read or is flat; if a scene has another boundary than `only` or
        comes with a second body or with errors in the order; or if the order has settings for
        reading and preparing files, but no input is a file.
    """
    boundary = only or order.boundary or USUAL_BOUNDARY
    opposites: list[Opposite | None] = [None]  # a flat second body
    if order.opposite is not None:
        files = files_in(order.opposite.path)
        opposites = [replace(order.opposite, path=file) for file in files]
    scenes = [scene_of(text) for text in order.inputs]
    if None not in scenes:
        _refuse_reading(order)
    parts: list[InputSurfaces] = []
    for text, scene in zip(order.inputs, scenes, strict=True):
        if scene is not None and order.errors is not None:
            raise InputError(
                f"--error: {text} is a scene: its means are made by gen.law.by_means"
            )
        if scene is None:
            parts.append(_read_files(text, order, boundary, opposites))
        else:
            scene_of_law = _scene_of_law(scene, text, order, boundary, only)
            parts.append(_generate(scene_of_law, text, order.surfaces))
    doubts = [doubt for part in parts for doubt in part.doubts]
    return LawSurfaces(
        surfaces=[surface for part in parts for surface in part.surfaces],
        inputs=[part.about for part in parts],
        doubts=list(dict.fromkeys(doubts)),  # each once
        sources=[source for part in parts for source in part.sources],
    )


def _refuse_reading(order: Order) -> None:
    """Raise InputError if an order that has no files has settings by which files are read."""
    settings = order.reading.changed_options
    if settings:
        raise InputError(
            f"{settings}: goes with files of surfaces; the surfaces of"
            f" {', '.join(order.inputs)} are made as the scene says"
        )


def _generate(scene: Scene, text: str, number: int) -> InputSurfaces:
    """Generate the first `number` surfaces of a scene, and return them as an input of a law.

    `text` is the input that names the scene: its path, or the name of a shipped scene.
    """
    population = list(surfaces_of_scene(scene, text, range(number)))
    doubts = [*_slope_doubts(population), *_size_doubts(scene, population)]
    doubts = [f"warning: {text}: {doubt}" for doubt in doubts]
    return InputSurfaces(
        about=scene_as_input(scene, text, f"its first {number} surfaces"),
        surfaces=population,
        sources=_sources_of_scene(scene, text),
        doubts=doubts,
    )


def scene_as_input(scene: Scene, text: str, surfaces: str) -> LawInput:
    """Describe a scene as an input of a law.

    Parameters
    ----------
    scene : Scene
        The scene.
    text : str
        Input that names it.
    surfaces : str
        Which of its surfaces the law has, in words.

    Returns
    -------
    LawInput
        The scene with its description, which names the second rough body if it has one.
    """
    against = scene.surface.against
    facing = ""
    if isinstance(against, tuple):  # files of the second body
        facing = f" against {', '.join(against)}"
    elif against is not None:
        facing = " against another of them"
    return LawInput(description=f"{text}: {surfaces}{facing}", scene=scene)


def _read_files(
    text: str, order: Order, boundary: Boundary, opposites: Sequence[Opposite | None]
) -> InputSurfaces:
    """Read the file or the folder `text`, each surface against each second body in turn.

    `opposites` are the second bodies; None among them is a flat body. Print the preparation of each
    surface, and its warnings, on standard error. Raises InputError for a flat surface.
    """
    description = text
    if order.opposite is not None:
        description = f"{text} against {order.opposite.path}"
    surfaces: list[LawSurface] = []
    sources: list[Source] = []
    doubts: list[str] = []
    for file in files_in(Path(text)):
        for opposite in opposites:
            topography, warnings = read_surface(file, order.reading, boundary, opposite)
            if topography.heights.max() == topography.heights.min():
                raise InputError(
                    f"{file}: is flat: all of it touches at once, there is no law"
                )
            echo(f"{topography.name}: {'; '.join(topography.steps)}", err=True)
            for line in warnings:
                echo(f"  warning: {line}", err=True)
            surfaces.append(_law_surface(topography))
            sources.append(_source_of_map(topography, file, opposite))
            doubts += [
                f"warning: {description}: {doubt}" for doubt in topography.warnings
            ]
    return InputSurfaces(
        about=LawInput(description), surfaces=surfaces, sources=sources, doubts=doubts
    )


def _law_surface(topography: Topography) -> LawSurface:
    """Return the surface of one body or two from files as a surface of a law, without its steps."""
    return LawSurface(
        name=topography.name,
        heights=topography.heights,
        sides=topography.sides,
        boundary=topography.boundary,
        instrument=topography.instrument,
    )


def _source_of_map(
    topography: Topography, file: Path, opposite: Opposite | None
) -> Source:
    """Return the files of a surface, with that of the second body, and the steps of preparation."""
    files = [_source_file(file)]
    if opposite is not None:
        files.append(_source_file(opposite.path))
    return Source(name=topography.name, files=tuple(files), steps=topography.steps)


def _scene_of_law(
    scene: Scene, text: str, order: Order, boundary: Boundary, only: Boundary | None
) -> Scene:
    """Return a scene with the boundary of the law.

    A scene whose boundary changes gets the kernel and the far field that every boundary allows.
    Raises InputError if the boundary of a surrogate, `only`, is another one, or if the order has a
    second body.
    """
    if order.opposite is not None:
        raise InputError(
            f"--against: {text} is a scene, which names the second body of its surfaces"
            " itself: surface.against"
        )
    contact = scene.contact
    if contact.boundary == boundary:
        return scene
    if only:
        raise InputError(
            f"{text}: has a {contact.boundary} boundary, the law a {boundary} one: a law"
            " has patches of one boundary, that of its surrogate if there is one"
        )
    change = {"boundary": boundary, "kernel": "uniform-pressure", "far_field": "rigid"}
    return scene.model_copy(update={"contact": contact.model_copy(update=change)})


def _source_file(path: Path) -> SourceFile:
    """Read a file, and return its path with the hash of its content."""
    return SourceFile(path=str(path), sha256=digest(path))


def _sources_of_scene(scene: Scene, text: str) -> list[Source]:
    """Return a list of one source: the file of a scene, and the files that its surfaces need.

    The latter are maps, or the module of a user's function. `text` is the scene as the user named
    it: the path of a scene or a database, or the name of a shipped scene, which has no file. The
    list is empty without any file.
    """
    files: list[SourceFile] = []
    steps: list[str] = []
    if Path(text).is_file():
        files.append(_source_file(Path(text)))
    surface = scene.surface
    if isinstance(surface, ScanSurface):
        files += _maps_of_scans(surface)
        steps = _settings_of_scans(surface)
    else:
        files += [_source_file(path) for path in surface.sources()]
    if not files:
        return []
    return [Source(name=text, files=tuple(files), steps=tuple(steps))]


def _maps_of_scans(surface: ScanSurface) -> list[SourceFile]:
    """Return the maps of both bodies of a scene whose maps a run has recorded.

    Hashes are taken from the scene, not from the files: a database knows maps by their content, and
    the files may have moved.
    """
    files: list[SourceFile] = []
    for recorded in (surface.found, surface.against_found):  # one body each
        if recorded is None:  # there are no maps of a second body
            continue
        files += [
            SourceFile(path=entry.file, sha256=entry.sha256) for entry in recorded.maps
        ]
    return files


def _settings_of_scans(surface: ScanSurface) -> list[str]:
    """Return the settings of reading and preparing a scene's maps, as "table.key = value"."""
    tables = {"reading": surface.reading, "preparation": surface.preparation}
    lines: list[str] = []
    for name, table in tables.items():
        for key, value in table.model_dump(exclude_none=True).items():
            lines.append(f"{name}.{key} = {json.dumps(value)}")
    return lines


def files_read(inputs: Iterable[str]) -> Iterator[Path | str]:
    """Yield the files that a law reads, so that no output replaces one of them.

    Parameters
    ----------
    inputs : iterable of str
        Inputs of the law.

    Yields
    ------
    Path or str
        Each input, then the files that it names if it is a scene or a database.
    """
    for text in inputs:
        yield text
        scene = scene_of(text, ready=False)
        if scene is not None:
            yield from scene.surface.sources()


def has_scene(inputs: Iterable[str]) -> bool:
    """Return whether an input of a law is a scene or a database.

    Parameters
    ----------
    inputs : iterable of str
        Inputs of the law.

    Returns
    -------
    bool
        True if one is, or more.

    Raises
    ------
    InputError
        If the scene or the database cannot be used.
    """
    return any(scene_of(text, ready=False) is not None for text in inputs)


def scene_of(text: str, *, ready: bool = True) -> Scene | None:
    """Return the scene that an input of a law names: a shipped one, its file, or a database.

    Parameters
    ----------
    text : str
        Name of a shipped scene, or path of a scene, a database or a surface.
    ready : bool
        True to read the maps of the scene, so that it can generate surfaces.

    Returns
    -------
    Scene or None
        The scene; None if the input is a surface or a folder.

    Raises
    ------
    InputError
        If the scene or the database cannot be used.
    """
    suffix = Path(text).suffix.lower()
    if suffix == ".toml" or (not suffix and text in preset_names()):
        scene = load(text)
        if scene.needs_trial:
            raise InputError(
                f"{text}: [accuracy] holds for the scene's own loads, and a run finds its nodes:"
                " give the database of a run, or leave out [accuracy]"
            )
        return scene.resolved() if ready else scene
    if suffix != ".h5":
        return None  # a surface or a folder
    from gen.database import Reader  # here, so that other inputs do not load h5py

    with Reader(Path(text)) as reader:
        if ready:
            reader.scene.surface.make_ready(Path(text).parent)
        return reader.scene


def _slope_doubts(population: Sequence[LawSurface]) -> list[str]:
    """Return a list of one doubt, or none: that most surfaces are too steep for the theory.

    There is a doubt if a larger share of the surfaces than `DOUBTED_SHARE` has an rms slope above
    `STEEP_ROW`.
    """
    slopes = [rms_slope(surface.heights, surface.spacing) for surface in population]
    steep = [slope for slope in slopes if slope > STEEP_ROW]
    if len(steep) <= DOUBTED_SHARE * len(slopes):
        return []
    where = f", above {STEEP_ROW:g} in {len(steep)} of {len(slopes)} surfaces"
    return [steep_slopes(max(steep), max(population[0].spacing), where)]


def _size_doubts(scene: Scene, population: Sequence[LawSurface]) -> list[str]:
    """Return a list of one doubt, or none: that patches are too small for the law of their maps.

    There is a doubt if the patches are smaller than the maps that the surfaces are like, and their
    summits are below `LOW_SUMMIT` times that of the maps, above the mean height.
    """
    table = scene.surface
    if not isinstance(table, LikeSurface):
        return []
    fitted = table.recorded_population()
    nx, ny = population[0].heights.shape
    map_nx, map_ny = fitted.nodes
    summits = [surface.heights.max() - surface.heights.mean() for surface in population]
    summit = float(np.mean(summits))
    summit_of_maps = float(np.mean(limits(table.scale))) * fitted.summit
    if (nx >= map_nx and ny >= map_ny) or summit > LOW_SUMMIT * summit_of_maps:
        return []
    line = (
        f"patches of {nx} x {ny} nodes rise {summit:.3g} um above their mean, maps of {map_nx} x"
        f" {map_ny} nodes {summit_of_maps:.3g} um: closure, gap, stiffness and their scatter are"
        f" those of patches; nodes = [{max(nx, map_nx)}, {max(ny, map_ny)}] in [surface] gives"
        " those of surfaces as large as the maps"
    )
    return [line]


def surfaces_of_scene(
    scene: Scene, text: str, numbers: Iterable[int]
) -> Iterator[LawSurface]:
    """Make surfaces of a scene, with the scene's settings of the solver.

    Parameters
    ----------
    scene : Scene
        The scene, whose surfaces are ready (`make_ready`).
    text : str
        Input that names it.
    numbers : iterable of int
        Indices of the surfaces, as in a database of the scene.

    Yields
    ------
    LawSurface
        Each surface.

    Raises
    ------
    InputError
        If a surface cannot be made.
    """
    from gen.generation.sample import surface_numbered  # it loads what databases need

    contact = scene.contact
    settings = {name: getattr(contact, name) for name in SOLVER_SETTINGS}
    for number in numbers:
        yield LawSurface(
            name=f"{text}, surface {number}",
            heights=surface_numbered(scene, number),
            sides=scene.grid.sides,
            boundary=contact.boundary,
            exact_spacing=scene.grid.spacing,
            settings=settings,
        )
