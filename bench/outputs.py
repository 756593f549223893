"""The cost of each optional output of a database: time and bytes per sample, on and off."""

import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from bench.report import Report
from bench.table import formatted
from gen import database
from gen.generation.sample import compute_rows
from gen.scene import Scene, Store, flags, load
from gen.schema import row_bytes

SAMPLES = 64  # rows of a round

COLUMNS = {
    "`[store]`": "`{column}`",
    "ms per sample": "{more_ms:+.2f}",
    "time with / without": "{ratio:.3f} ({ratio_low:.3f} to {ratio_high:.3f})",
    "bytes per sample": "{bytes:,}",
}
"""The table as it is printed."""


def measure(scene_name: str, rounds: int) -> list[dict[str, Any]]:
    """Compute and write the first rows of a scene with and without each optional output, in turn.

    Returns
    -------
    list of dict
        For each output of the scene's table [store]: the median of the additional processor time
        [ms per sample], smallest, middle and largest ratio of the times, additional bytes.
    """
    plain = load(scene_name)
    compute_rows(plain, 0, 8)  # plans and tables are made before the clock starts
    costs = []
    for name in flags():
        asked = plain.model_copy(update={"store": Store.model_validate({name: True})})
        pairs = [(_seconds(plain), _seconds(asked)) for _ in range(rounds)]
        ratios = [with_it / without for without, with_it in pairs]
        costs.append(
            {
                "column": name,
                "more_ms": 1e3 * median(b - a for a, b in pairs) / SAMPLES,
                "ratio": median(ratios),
                "ratio_low": min(ratios),
                "ratio_high": max(ratios),
                "bytes": row_bytes(asked) - row_bytes(plain),
            }
        )
    return costs


def report(costs: list[dict[str, Any]]) -> Report:
    """Make a report of the rows of `measure`."""
    return Report({"outputs": costs}, text=formatted(COLUMNS, costs))


def _seconds(scene: Scene) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "outputs.h5"
        database.create(path, scene.model_copy(update={"samples": SAMPLES}))
        with database.Writer(path, scene) as writer:
            began = time.process_time()
            writer.write_block(0, SAMPLES, compute_rows(scene, 0, SAMPLES))
            return time.process_time() - began
