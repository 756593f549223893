"""A population of surfaces like maps, made up by hand: no map is needed."""

import numpy as np

from gen.population import FORMAT, Population, SourceMap


def population(heights=lambda scores: scores, *, spacing=(1.0, 1.0), wide=1.0):
    """Surfaces with a Gaussian spectrum up to a wave of ten nodes, `wide` times as long along x.

    `heights` is the rising curve from normal scores to heights [um].
    """
    bands_x = np.linspace(0.0, 3.0, 40) / spacing[0]
    bands_y = np.linspace(0.0, 3.0, 40) / spacing[1]
    logarithms = -0.5 * (
        (bands_x[:, None] * wide / 0.3) ** 2 + (bands_y[None, :] / 0.3) ** 2
    )
    table = tuple(tuple(row) for row in logarithms.tolist())
    scores = np.linspace(-4.0, 4.0, 33)
    return Population(
        format=FORMAT,
        maps=(SourceMap("made.npy", "0" * 64, (82, 82), 1.0),),
        preparation="levelled by a plane",
        spacing=spacing,
        shortest=10.0,
        remarks=(),
        bands_x=tuple(bands_x.tolist()),
        bands_y=tuple(bands_y.tolist()),
        logarithms=(table, table),
        scores=tuple(scores.tolist()),
        heights=tuple(np.asarray(heights(scores)).tolist()),
    )
