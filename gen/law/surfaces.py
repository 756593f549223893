"""The surfaces of a contact law: from files and folders, or the population of a scene."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bem.problem import Boundary
from gen.doubts import MOST, STEEP_ROW, steep_slopes
from gen.maps.bodies import Opposite
from gen.maps.prepare import read_surface
from gen.maps.read import Topography, files_in
from gen.quantities import BODIES_ALONE, MEAN_GAP, Media, Quantity, patch_compliance
from gen.runtime.errors import InputError
from gen.runtime.terminal import echo
from gen.scene import Scene, preset_names
from gen.statistics import rms_slope

if TYPE_CHECKING:
    from bem.problem import Problem
    from gen.law.contact_law import Order

Load = Literal["delta", "pressure"]  # quantities that a law can be solved at


@dataclass(frozen=True, eq=False)
class LawSurface(Topography):
    """A surface of a law."""

    # Settings of the solver that a scene states: kernel, far_field, rtol, max_iterations.
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def nominal(self) -> float:
        """Area of the cells of all nodes, over which the nominal pressure is a mean [um2]."""
        return float(self.spacing[0] * self.spacing[1] * self.heights.size)

    def posed(self, e_star: float = 1.0) -> "Problem":
        """Return the surface as a posed problem at first touch, of bodies with E* [MPa]."""
        from bem.problem import pose

        return pose(
            self.heights,
            self.sides,
            None,
            force=0.0,
            spacing=self.spacing,
            boundary=self.boundary,
            modulus=e_star,
            kernel=self.settings.get("kernel", "uniform-pressure"),
            far_field=self.settings.get("far_field", "rigid"),
        )

    def at_rest(
        self, quantities: Iterable[Quantity] = (MEAN_GAP,), media: Media = BODIES_ALONE
    ) -> dict[str, float]:
        """Return quantities at first touch, where no heat passes by spots, those that are not 0."""
        problem = self.posed()
        return {
            quantity.in_laws: quantity.resting(problem, media)
            for quantity in quantities
            if quantity.at_rest is not None
        }

    def patch_compliance(self, e_star: float) -> float:
        """Compute how far a flat punch that fills the patch sinks per pressure [um / MPa]."""
        return patch_compliance(self.posed(e_star))


@dataclass(frozen=True, eq=False)
class LawSurfaces:
    """All surfaces of a law, one or more."""

    surfaces: Sequence[LawSurface]
    scenes: Sequence[Scene]  # that surfaces were generated from
    origins: Sequence[str]  # descriptions of the surfaces, one line for each input
    doubts: Sequence[str] = ()  # warnings about the maps, each with the name of its input

    def modulus(self) -> float | None:
        """Return the E* of all scenes [MPa], which have one; None if a surface is from a file."""
        moduli = {scene.contact.e_star for scene in self.scenes}
        if len(self.scenes) == len(self.origins) and len(moduli) > 1:
            said = " and ".join(f"{each:g}" for each in sorted(moduli))
            raise InputError(f"the scenes have E* = {said} MPa: give one with --e-star")
        return moduli.pop() if len(self.scenes) == len(self.origins) else None

    def hardness_ratio(self) -> float | None:
        """Return the hardness over E* of all scenes, which have one; None without any."""
        ratios: set[float | None] = set()
        for scene in self.scenes:
            ends = scene.contact.hardness_limits or (None,)
            ratios |= {None if end is None else end / scene.contact.e_star for end in ends}
        if len(self.scenes) == len(self.origins) and len(ratios) > 1:
            raise InputError("the scenes have more than one hardness: give one with --hardness")
        return ratios.pop() if len(self.scenes) == len(self.origins) else None


def read_subjects(order: "Order", only: Boundary | None = None) -> LawSurfaces:
    """Read or generate all surfaces of a law; say on standard error what is done to each file.

    Scenes and databases give their first surfaces, with the boundary of the law, or are refused if
    it is not theirs and the `only` one. Surfaces from files are pressed against the second rough
    body, or against each of a folder of them; scenes name their own.
    """
    boundary, opposite = only or order.boundary or "mirror", order.opposite
    subjects: list[LawSurface] = []
    scenes: list[Scene] = []
    origins: list[str] = []
    doubts: list[str] = []
    bodies: list[Opposite | None] = [opposite]
    facing = ""
    if opposite is not None:  # a body, or a folder of them
        bodies = [replace(opposite, path=file) for file in files_in(opposite.path)]
        facing = f" against {opposite.path}"
    for text in order.inputs:
        if (scene := scene_of(text)) is not None:
            if opposite is not None:
                raise InputError(
                    f"--against: {text} is a scene, which names the second body of its surfaces"
                    " itself: surface.against"
                )
            if (own := scene.contact).boundary != boundary:
                if only:
                    raise InputError(
                        f"{text}: has a {own.boundary} boundary, the law a {boundary} one: a law"
                        " has patches of one boundary, that of its surrogate if there is one"
                    )
                change = {"boundary": boundary, "kernel": "uniform-pressure", "far_field": "rigid"}
                scene = scene.model_copy(update={"contact": own.model_copy(update=change)})
            scenes.append(scene)
            population = list(_population(scene, text, order.surfaces))
            subjects += population
            doubts += [f"warning: {text}: {doubt}" for doubt in _slope_doubts(population)]
            against = scene.surface.against
            named = ", ".join(against) if isinstance(against, tuple) else "another of them"
            rough = "" if against is None else f" against {named}"
            origins.append(f"{text}: its first {order.surfaces} surfaces{rough}")
            continue
        origins.append(f"{text}{facing}")
        for file, body in product(files_in(Path(text)), bodies):
            each, warnings = read_surface(file, order.reading, boundary, body)
            if each.heights.max() == each.heights.min():
                raise InputError(f"{file}: is flat: all of it touches at once, there is no law")
            echo(f"{each.name}: {'; '.join(each.steps)}", err=True)
            for line in warnings:
                echo(f"  warning: {line}", err=True)
            subjects.append(LawSurface(each.name, each.heights, each.sides, boundary=each.boundary))
            doubts += [f"warning: {text}{facing}: {doubt}" for doubt in each.warnings]
    return LawSurfaces(subjects, scenes, origins, list(dict.fromkeys(doubts)))


def files_read(inputs: Iterable[str]) -> Iterator[Path | str]:
    """Yield the inputs of a law, and the files that scenes and databases among them name."""
    for text in inputs:
        yield text
        if (scene := scene_of(text, ready=False)) is not None:
            yield from scene.surface.sources()


def scene_of(text: str, *, ready: bool = True) -> Scene | None:
    """Return the scene of a name, a file, or a database, `ready` to be drawn; None for surfaces."""
    from gen.scene import load

    suffix = Path(text).suffix.lower()
    if suffix == ".toml" or (not suffix and text in preset_names()):
        return load(text).resolved() if ready else load(text)
    if suffix != ".h5":
        return None
    from gen.database import Reader

    with Reader(Path(text)) as reader:
        if ready:
            reader.scene.surface.make_ready(Path(text).parent)
        return reader.scene


def _slope_doubts(population: Sequence[LawSurface]) -> list[str]:
    """Doubt the surfaces of a scene if most of them are too steep for the theory."""
    slopes = [rms_slope(surface.heights, surface.spacing) for surface in population]
    steep = [slope for slope in slopes if slope > STEEP_ROW]
    if len(steep) <= MOST * len(slopes):
        return []
    where = f", above {STEEP_ROW:g} in {len(steep)} of {len(slopes)} surfaces"
    return [steep_slopes(max(steep), max(population[0].spacing), where)]


def _population(scene: Scene, text: str, number: int) -> Iterator[LawSurface]:
    """Yield the first surfaces of a scene, with the solver's settings of the scene."""
    from gen.generation.sample import surface_numbered

    contact = scene.contact
    names = "kernel", "far_field", "rtol", "max_iterations"
    settings = {name: getattr(contact, name) for name in names}
    for surface in range(number):
        yield LawSurface(
            f"{text}, surface {surface}",
            surface_numbered(scene, surface),
            scene.grid.sides,
            boundary=contact.boundary,
            apart=scene.grid.spacing,
            settings=settings,
        )
