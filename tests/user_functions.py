"""Functions of a user's in a module of the current folder, and scenes that name them."""

import sys
from contextlib import contextmanager
from pathlib import Path

from gen.runtime.user_code import TRUSTED

MODULE = '''
"""Surfaces and outputs of a user's own."""
import numpy as np
from scipy import ndimage


def waves(shape, spacing, rng, amplitude=1.0, length=100.0):
    x = np.arange(shape[0])[:, None] * spacing[0]
    y = np.arange(shape[1])[None, :] * spacing[1]
    crests = np.cos(2 * np.pi * x / length) * np.cos(2 * np.pi * y / length)
    return amplitude * (crests + 0.2 * rng.standard_normal(shape))


def spots(contact):
    _, number = ndimage.label(contact.pressure > 0)
    return {
        "spots": number,
        "top": (float(contact.problem.heights.max()), "um"),
        "mean_pressure": (contact.force / max(contact.contact_nodes, 1), "uN"),
    }
'''

SURFACE = """[surface]
generator = "python"
function = "mine:waves"
nodes = [20, 24]
side = [200.0, 300.0]
parameters = { length = { log_uniform = [50.0, 200.0] }, amplitude = [0.5, 2.0] }
[delta]
pieces = [{ share = 1.0, range = [0.1, 1.0] }]
"""

STORE = '[store]\nfunction = "mine:spots"\n'


def write(folder: Path, scene: str, module: str = MODULE) -> None:
    """Write the module and a scene into a folder."""
    (folder / "mine.py").write_text(module)
    (folder / "mine.toml").write_text(scene)


@contextmanager
def inside(folder: Path, monkeypatch, scene: str):
    """Work in a folder with the module and a scene, which are trusted; forget them afterwards."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    write(folder, scene)
    trust = TRUSTED.set(True)
    try:
        yield
    finally:
        TRUSTED.reset(trust)
        sys.modules.pop("mine", None)
