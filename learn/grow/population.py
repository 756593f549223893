"""The scene of a growing database: a shipped one, one of a file, or that of a folder of maps."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gen.draft import proposal, scene_text
from gen.draft.proposal import Material
from gen.draft.scene_text import Key
from gen.draft.survey import print_looks
from gen.maps.files import digest, map_files
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress, to_type
from gen.scene import Scene, load, preset_names


@dataclass(frozen=True)
class Population:
    """Surfaces and loads that a surrogate is to know, as the user names them.

    Attributes
    ----------
    name : str
        Name of a shipped scene, or path of a scene or of a folder of maps.
    reading : Reading
        How the files of a folder are read.
    material : Material
        Elastic constants and hardness for a folder of maps.
    given : tuple of str
        Options of reading and material that the user gave: scenes hold these themselves.
    command : str
        Command line, for the record in a scene that is written.
    """

    name: str
    reading: Reading
    material: Material
    given: tuple[str, ...]
    command: str

    @property
    def is_folder(self) -> bool:
        """Whether this is a folder of maps."""
        return self.name not in preset_names() and Path(self.name).is_dir()

    def check(self, output: Path) -> None:
        """Refuse options that scenes do not take, and outputs in the folder of the maps.

        Parameters
        ----------
        output : Path
            The surrogate, beside which the other files will stand.

        Raises
        ------
        InputError
            With the option or the folder.
        """
        if self.given and not self.is_folder:
            raise InputError(
                f"{self.given[0]}: is for a folder of maps; the scene {self.name} holds material"
                " and files itself"
            )
        if self.is_folder and output.absolute().parent.resolve() == Path(self.name).resolve():
            raise InputError(
                f"--output {output}: would stand among the maps of {self.name}: give another folder"
            )


def scene_of(population: Population, file: Path, say: Callable[[str], None]) -> Scene:
    """Return the scene of a population; that of a folder of maps is written to a file.

    Parameters
    ----------
    population : Population
        Surfaces and loads.
    file : Path
        Scene (.toml) to write for a folder of maps; one that is there has to be of these maps.
    say : callable
        Called with lines for the user.

    Raises
    ------
    InputError
        If the scene is not valid, no map can be used, or the file is of other maps or options.
    """
    if not population.is_folder:
        return load(population.name)
    paths = map_files([population.name], Path.cwd())
    origin = _origin(paths, population)
    if file.exists():
        _require_origin(file, origin, population)
        say(f"{file}: the scene of {population.name}, as before")
        return load(str(file))
    with RunProgress(2 * len(paths), noun="readings") as progress:
        proposed = proposal.propose(
            paths, population.reading, population.material, lambda: progress.advance(1, 0)
        )
    print_looks(proposed.looks)
    keys = scene_text.keys(proposed, [population.name], population.command, file)
    scene_text.write(file, [*keys, Key(origin)])
    say(f"wrote {file}: {to_type(f'gen run {file}')} gives its database more rows")
    return load(str(file))


def _origin(paths: list[Path], population: Population) -> str:
    """Return a comment that tells from which maps and options a scene was drafted."""
    keys = population.reading.of("reading").items()
    reading = f"Reading({', '.join(f'{name}={value!r}' for name, value in keys)})"
    told = [*map(digest, paths), reading, str(population.material)]
    return f"Drafted from maps and options {hashlib.sha256(' '.join(told).encode()).hexdigest()}"


def _require_origin(file: Path, origin: str, population: Population) -> None:
    """Refuse a scene of other maps or options; use an edited scene unchanged."""
    try:
        present = file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: is there already and cannot be read: {error}") from None
    if f"# {origin}\n" not in present:
        raise InputError(
            f"{file}: is there already, and not the scene of the maps in {population.name} with"
            " these options: to go on with it give it as SCENE, or give another --output"
        )
