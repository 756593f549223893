"""Time of features and of a surrogate's answers, asserted.

    pytest bench --benchmark-only -k "features or surrogate"

Features of a surface are its statistics and, for the hybrid set, a loose solve on 33 x 33 blocks.
"""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.stability.fitted import fitted, ordinary, rows_of
from gen.surface import generate
from learn.features import SETS, SurfaceFeatures, chosen
from learn.features.sets import HYBRID

NODES = {"smoke": 33, "paper": 129, "large": 513}
ROWS = {"smoke": 1, "paper": 1000, "large": 100_000}
SIDE, DELTA = 1000.0, 12.0


@pytest.mark.parametrize("size", NODES)
@pytest.mark.parametrize("name", SETS)
def test_features(benchmark: Any, name: str, size: str) -> None:
    """Cold: statistics, and all else that a surface is asked for, anew in every round."""
    heights = generate("diamond-square", NODES[size], 0.65, 12.0, np.random.default_rng(7))
    wanted, deltas = chosen(name), np.array([DELTA])

    def features() -> NDArray[np.float64]:
        return SurfaceFeatures(heights, (SIDE, SIDE)).features(wanted, deltas)

    found = benchmark(features)
    assert found.shape == (1, len(wanted.columns))
    if wanted.needs_surface:
        above = np.maximum(heights - (heights.max() - DELTA), 0.0)
        places = [wanted.columns.index(column) for column in HYBRID[:2]]
        bearing = found[0, places]
        assert bearing == pytest.approx([np.mean(above > 0), above.mean() / DELTA], rel=1e-12)
    lengths = 1.0 if wanted.scaled else 2.0
    doubled = SurfaceFeatures(2 * heights, (2 * SIDE, 2 * SIDE)).features(wanted, 2 * deltas)
    assert doubled[0, 0] == pytest.approx(lengths * found[0, 0], rel=1e-12)


@pytest.mark.parametrize("size", ROWS)
@pytest.mark.parametrize("name", ["kernel-ridge", "xgboost", "gaussian-process"])
def test_surrogate(benchmark: Any, name: str, size: str) -> None:
    """Answers with intervals; each row's must not depend on how many are asked."""
    asked = fitted(name, "tuned", ordinary("dimensionless"))
    order = np.arange(ROWS[size]) % asked.test.size
    rows = rows_of(asked.test.at(order))
    answer = benchmark(asked.surrogate.predict_rows, rows)
    alone = asked.surrogate.predict_rows(rows_of(asked.test))
    few = order[:40]
    assert answer.values["target"][:40] == pytest.approx(alone.values["target"][few], rel=1e-9)
    assert answer.low["target"][:40] == pytest.approx(alone.low["target"][few], rel=1e-9)
    if benchmark.enabled:
        benchmark.extra_info["answers_per_second"] = ROWS[size] / benchmark.stats["median"]
