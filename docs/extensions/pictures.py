"""Pictures of the manual, drawn anew by every build: a Sphinx extension.

A page says `{picture} NAME` for a picture of `DRAWINGS` or `GALLERY`. A drawing is what the steps
of the pages write that readers see there: no picture is older than the code, or of another command.
`python docs/extensions/pictures.py` draws the picture of README.md into `figures`. It is kept there
because README.md is read without a build, and because it shows times, which a busy machine spoils.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from hashlib import sha256
from os.path import relpath
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from bench.page import is_wide

ROOT = Path(__file__).resolve().parents[2]
DRAWN = ROOT / "docs" / "_build" / "pictures"

GALLERY = {"area": "plot_area", "layers": "plot_layers", "like": "plot_like"}
"""Names of pictures with the example of the gallery that draws each of them."""


class Step(NamedTuple):
    """What a page shows, Python or a command, that writes a file."""

    page: str  # path of the page from the top folder
    file: str  # name of the file that the step writes


INTERFACES = "docs/how-to/interfaces.md"
DRAWINGS = {
    "problem": (Step("docs/glossary.md", "problem.svg"),),
    "scan": (
        Step("docs/how-to/scan.md", "ground.x3p"),
        Step("docs/how-to/scan.md", "scan.png"),
    ),
    "spots": (Step("README.md", "surface.npy"), Step(INTERFACES, "spots.png")),
    "law": (Step(INTERFACES, "population.png"),),
    "windows": (Step(INTERFACES, "windows.png"),),
    "texture": (Step("docs/how-to/gradients.md", "texture.png"),),
}
"""Names of pictures with the steps that draw each of them; the last step writes the picture."""

README_STEPS = (Step("README.md", "quick.h5"), Step("README.md", "quick.png"))
"""The steps that draw README's picture."""

README_PICTURE = ROOT / "figures" / "quick.png"
README_DIGEST = README_PICTURE.with_suffix(".sha256")
"""Digest of the code that drew README's picture: a test compares it with that of today."""

README_CODE = (
    "gen/commands/picture.py",
    "gen/maps/contact_pictures.py",
    "gen/maps/pictures.py",
)
"""Files that decide what README's picture looks like."""


def command_of(step: Step) -> list[str]:
    """Return the words of the command that a step runs.

    Raises
    ------
    LookupError
        If the page shows no code and no command that writes the file.
    """
    text = (ROOT / step.page).read_text(encoding="utf-8").replace("\\\n", " ")
    name = re.escape(step.file)
    for block in re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        if f'"{step.file}"' in block:
            return [sys.executable, "-c", block]
    shown = re.search(rf"(?:asperity|python) [^\n`]*(?:-o|--plot) {name}\b[^\n`#]*", text)
    if shown is None:
        raise LookupError(f"{step.page} shows nothing that writes {step.file}")
    program, first, *others = shlex.split(shown[0])
    if program == "asperity":
        return [sys.executable, "-m", first, *others]
    return [sys.executable, str(ROOT / first), *others]


def picture_path(name: str) -> Path:
    """Return the file of a picture, which the build draws."""
    if name in GALLERY:
        return ROOT / "docs" / "gallery" / "images" / f"sphx_glr_{GALLERY[name]}_001.png"
    last = DRAWINGS[name][-1]
    return DRAWN / f"{name}{Path(last.file).suffix}"


def draw(steps: Sequence[Step], path: Path) -> None:
    """Take the steps of a drawing in an empty folder, and keep its picture at a path."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with TemporaryDirectory() as folder:
        for step in steps:
            command = command_of(step)
            done = subprocess.run(
                command,
                check=False,
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
            )
            if done.returncode:
                raise RuntimeError(f"{shlex.join(command)}: {done.stderr[-2000:]}")
        path.parent.mkdir(parents=True, exist_ok=True)
        copyfile(Path(folder, steps[-1].file), path)


def picture(name: str, words: list[str], folder: Path) -> str:
    """Return what shows a picture on a page in a folder; `words` describe it for the blind."""
    path = picture_path(name)
    style = ""
    if path.suffix == ".png" and is_wide(path):
        style = ":class: wide\n"
    return f":::{{image}} {relpath(path, folder)}\n:alt: {' '.join(words)}\n{style}:::"


def readme_digest() -> str:
    """Return the SHA-256 of the code that draws README's picture."""
    digest = sha256()
    for path in README_CODE:
        digest.update((ROOT / path).read_bytes())
    return digest.hexdigest()


def draw_for_readme() -> None:
    """Draw README's picture into `figures`, with the digest of the code that draws it."""
    draw(README_STEPS, README_PICTURE)
    README_DIGEST.write_text(f"{readme_digest()}\n", encoding="utf-8")


pool = ThreadPoolExecutor(2)
"""Draws beside the examples of the gallery, which run one after the other."""

drawings: list[Future[None]] = []
"""The drawings of this build."""


def start(_: Any) -> None:
    """Start to draw all pictures."""
    drawings[:] = [
        pool.submit(draw, steps, picture_path(name)) for name, steps in DRAWINGS.items()
    ]


def wait(*_: Any) -> None:
    """Wait until all pictures are drawn; an error in a drawing ends the build."""
    for drawing in drawings:
        drawing.result()


def setup(app: Any) -> dict[str, Any]:
    """Let Sphinx draw the pictures before it reads the pages."""
    app.connect("builder-inited", start, priority=0)
    app.connect("env-before-read-docs", wait)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    draw_for_readme()
