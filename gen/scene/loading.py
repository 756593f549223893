"""Scenes that are shipped, and those in files."""

from importlib.resources import files
from pathlib import Path

from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.scene.scene import Scene
from gen.scene.surface import ScanSurface
from gen.scene.words import one_line

MOST_BYTES = 1_000_000
"""Largest size of a scene's file: a scene takes a few hundred bytes, apart from its title."""


def preset_names() -> tuple[str, ...]:
    """Return the names of the scenes that are shipped in `gen/scenes`, in alphabetical order."""
    names = (entry.name for entry in (files("gen") / "scenes").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


def load(name_or_path: str) -> Scene:
    """Read a shipped scene by its name, or a scene from a TOML file.

    Parameters
    ----------
    name_or_path : str
        One of `preset_names` or the path of a file; the name of a preset takes precedence.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If there is no such scene, the file cannot be read, or the scene is not valid. The message
        is one line with the file, the key, its value and the values that are allowed.
    """
    if name_or_path in preset_names():
        preset = files("gen") / "scenes" / f"{name_or_path}.toml"
        return Scene.parse(preset.read_text(encoding="utf-8"), f"scene {name_or_path}")
    return _anchored(Scene.parse(_read(name_or_path), name_or_path), Path(name_or_path).parent)


def _anchored(scene: Scene, folder: Path) -> Scene:
    """Let the files of maps that a scene names start from the folder of its own file."""
    if not isinstance(scene.surface, ScanSurface):
        return scene

    def anchored(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(
            name if name.startswith("~") else str(folder.absolute() / name) for name in names
        )

    update: dict[str, object] = {"files": anchored(scene.surface.files)}
    if isinstance(scene.surface.against, tuple):
        update["against"] = anchored(scene.surface.against)
    return scene.model_copy(update={"surface": scene.surface.model_copy(update=update)})


def _read(path: str) -> str:
    """Read a scene's file; drop the byte order mark that some editors write."""
    try:
        with require_file(Path(path)).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) <= MOST_BYTES:
            return content.decode("utf-8-sig")
        reason = f"over {MOST_BYTES:,} bytes"
    except InputError:
        raise
    except FileNotFoundError:
        reason = "neither a file nor a preset"
    except UnicodeDecodeError as error:
        reason = f"not UTF-8 text (byte {error.start} is {error.object[error.start]:#04x})"
    except OSError as error:
        reason = error.strerror or str(error)
    except ValueError as error:  # a null character in the path
        reason = str(error)
    presets = ", ".join(preset_names())
    raise InputError(
        one_line(f"scene {path!r}: {reason}; give a preset ({presets}) or the path of a TOML file")
    )
