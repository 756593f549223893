"""Scenes of small databases that no default decides, a user's generator, targets of all kinds."""

import numpy as np

from bench.made_maps import MadeMap

MAPS = (
    MadeMap("sandblasted", 0, (90, 60), 1.0, 15.0, (0.5, 0.8)),
    MadeMap("fractal", 0, (50, 70), 0.5, 20.0, (0.5, 0.8), format="nc"),
)
"""Maps of the scene of windows, to be written into a folder `maps` beside it."""

POPULATIONS = {
    "spectral": """
        samples = 60
        [surface]
        generator = "spectral"
        nodes = [18, 33]
        side = [700.0, 1200.0]
        roll_off = { log_uniform = [200.0, 400.0] }
        cut_off = 90.0
        rms_slope = { normal = [0.1, 0.02] }
        [load]
        quantity = "pressure/(E* slope_rms)"
        range = { log_uniform = [0.05, 0.5] }
        [store]
        mean_gap = true
    """,
    "python": """
        samples = 60
        samples_per_surface = 3
        [surface]
        generator = "python"
        function = "small_populations:waves"
        nodes = [20, 17]
        side = [500.0, 400.0]
        parameters = { amplitude = [1.0, 3.0], count = { choice = [4, 8] } }
        [load]
        quantity = "pressure"
        range = [0.001, 0.02]
        [contact]
        boundary = "mirror"
        hardness = 0.1
    """,
    "force": """
        samples = 60
        [surface]
        generator = "spectral"
        nodes = 16
        side = [500.0, 400.0]
        roll_off = 250.0
        cut_off = 80.0
        rms_height = [2.0, 3.0]
        [load]
        quantity = "force"
        range = [10.0, 200.0]
        [contact]
        boundary = "periodic"
    """,
    "scans": """
        samples = 60
        samples_per_surface = 2
        [surface]
        generator = "scans"
        files = "maps"
        nodes = [20, 17]
        [surface.preparation]
        level = "plane"
        [load]
        quantity = "pressure/(E* slope_rms)"
        range = { log_uniform = [0.02, 0.2] }
    """,
    "relative": """
        samples = 60
        samples_per_surface = 2
        [surface]
        generator = "midpoint"
        nodes = 17
        hurst = { choice = [0.5, 0.8] }
        [load]
        quantity = "delta/height_rms"
        range = [0.3, 2.0]
    """,
}
"""Scenes of every generator, every quantity of loads and every boundary, mostly oblong."""


def waves(shape, spacing, rng, amplitude, count):
    """Heights (nx, ny) [um]: waves and noise."""
    x, y = np.meshgrid(*(np.arange(nodes) / nodes for nodes in shape), indexing="ij")
    heights = 0.1 * rng.normal(size=shape)
    for _ in range(int(count)):
        along_x, along_y = rng.integers(1, 5, 2)
        phase = 2 * np.pi * (along_x * x + along_y * y + rng.uniform())
        heights += rng.normal() * np.cos(phase) / np.hypot(along_x, along_y)
    return amplitude * heights


KINDS = {
    "negative": "-1.0 - area",
    "signed": "area - 4.0",
    "zero_in_part": "max(area - 5.0, 0.0)",
    "negative_in_part": "min(area - 5.0, 0.0)",
    "constant_in_part": "max(area, 4.0)",
    "rare": "max(area - 15.0, 0.0)",
    "tiny": "-1e-15 * area",
    "huge": "1e15 * area",
    "distant": "1e6 + area",
    "spoilt": "area",
}
"""Targets of every kind, by their names, as functions of the area [%]."""

KIND_SCENES = {
    "free": "",
    "yielding": "[contact]\nhardness_ratio = [0.003, 0.1]\n",
    "mirror": (
        "[contact]\nboundary = 'mirror'\n[delta]\npieces = [{ share = 1.0, range = [0.5, 9.0] }]\n"
    ),
}
