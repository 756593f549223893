"""What each optional output of a database costs: seconds and bytes per sample, on and off."""

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from gen import database
from gen.generation.sample import compute_rows
from gen.scene import Scene, Store, load
from gen.schema import row_bytes


@dataclass(frozen=True)
class Cost:
    """Cost of one optional output.

    Attributes
    ----------
    name : str
        Flag in the scene's table [store].
    milliseconds : float
        Additional CPU time per sample, computed and written, median of the rounds [ms].
    ratios : tuple of float
        Smallest, median and largest time with it over the time without it [1].
    size : int
        Additional bytes per sample.
    """

    name: str
    milliseconds: float
    ratios: tuple[float, float, float]
    size: int


def measure(scene_name: str = "paper", samples: int = 64, rounds: int = 7) -> list[Cost]:
    """Compute and write the same rows with and without each output, in turn.

    Parameters
    ----------
    scene_name : str
        Scene whose first rows are computed.
    samples : int
        Rows per round.
    rounds : int
        Repetitions, of which the medians count.

    Returns
    -------
    One cost per optional output, in the order of the scene's table
    """
    plain = load(scene_name)
    compute_rows(plain, 0, min(samples, 8))  # plans and tables are made before the clock starts
    costs = []
    for name in Store.model_fields:
        asked = plain.model_copy(update={"store": Store(**{name: True})})
        extra, ratios = [], []
        for _ in range(rounds):
            without, with_it = _seconds(plain, samples), _seconds(asked, samples)
            extra.append(1e3 * (with_it - without) / samples)
            ratios.append(with_it / without)
        size = row_bytes(asked) - row_bytes(plain)
        spread = min(ratios), median(ratios), max(ratios)
        costs.append(Cost(name, median(extra), spread, size))
    return costs


def markdown_table(costs: list[Cost]) -> str:
    """Return the lines of Markdown that stand in the README."""
    lines = ["| `[store]` | ms per sample | time with / without | bytes per sample |"]
    lines.append("|---|---|---|---|")
    for cost in costs:
        low, middle, high = cost.ratios
        lines.append(
            f"| `{cost.name}` | {cost.milliseconds:+.2f} | {middle:.3f} ({low:.3f} to {high:.3f})"
            f" | {cost.size:,} |"
        )
    return "\n".join(lines)


def _seconds(scene: Scene, samples: int) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "outputs.h5"
        database.create(path, scene.model_copy(update={"samples": samples}))
        with database.Writer(path, scene) as writer:
            began = time.process_time()
            writer.write_block(0, samples, compute_rows(scene, 0, samples))
            return time.process_time() - began
