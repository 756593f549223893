"""What the single reports show, and what to see in it."""

from collections.abc import Sequence
from pathlib import Path

from bench.page.content import Absent, Content, Figure, Table, Words
from bench.page.table import column


def hertz(folder: Path) -> Sequence[Content]:
    """The paraboloid."""
    return [
        Figure(
            folder / "hertz.png",
            "A rigid paraboloid (R = 5 mm) pressed into a half-space: force and contact area over"
            " the displacement, with the deviation from Hertz below, in per cent of Hertz's largest"
            " value. Areas move in steps because nodes touch one after the other. The default"
            " kernel, uniform pressure on cells, is the nearer one; the concentrated-force kernel,"
            " MIRCO's, gives way too little under a cell's own force.",
            data=(folder / "hertz.csv",),
        )
    ]


def solver(folder: Path) -> Sequence[Content]:
    """Error against run time."""
    from bench.work_precision.report import contents

    return contents(folder)


def peers(folder: Path) -> Sequence[Content]:
    """Other solvers."""
    from bench.peers.report import contents

    return contents(folder)


def growth(folder: Path) -> Sequence[Content]:
    """Growth with the grid."""
    return [
        Figure(
            folder / "growth.png",
            "Convolutions, seconds and memory of a solve over the nodes a side, at 1, 10 and 50 %"
            " of the nodes in contact. Seconds grow with the nodes times their logarithm, and with"
            " the convolutions.",
            data=(folder / "growth.csv",),
        ),
        Table(
            folder / "growth.csv",
            "Growth is per doubling of the nodes a side, from the first grid on. Convolutions are"
            " those of iterations alone: dense algebra, for which only small grids have few enough"
            " nodes in contact, would pass for growth.",
        ),
    ]


def scale(folder: Path) -> Sequence[Content]:
    """The farm on many ranks."""
    shown: list[Content] = [
        Figure(
            folder / "scale.png",
            "SIMULATED, with costs of rows, messages and writes measured on this machine:"
            " efficiency of the farm on 10 to 10,000 ranks, for 1e4 to 1e7 rows, both writers.",
            data=(folder / "scale.csv",),
        )
    ]
    if (folder / "validation.csv").exists():
        shown.append(Table(folder / "validation.csv", "The simulation beside real runs here."))
    return shown


def generalisation(folder: Path) -> Sequence[Content]:
    """Surrogates where they were not trained."""
    return [
        *(
            Figure(
                picture,
                "Prediction over truth where the surrogate was not trained: a row for each feature"
                " set, a column for each case; dots off the diagonal are wrong. Statistics such as"
                " curvatures depend on the spacing of the nodes, a loose solve among the features"
                " does not.",
                data=(folder / "generalisation.csv",),
            )
            for picture in sorted(folder.glob("generalisation-*.png"))
        ),
        Table(
            folder / "generalisation.csv",
            "Scores [%]; shares (0 to 1) of rows flagged as outside the training ranges, and"
            " covered by the 90 % intervals; and what follows.",
            columns=(
                "tested_on", "features", "trained", "judged", "nmse", "nmae", "r2", "flagged",
                "covered", "verdict",
            ),
        ),
    ]  # fmt: skip


def cost(folder: Path) -> Sequence[Content]:
    """What surrogates cost in all."""
    words = folder / "cost.txt"
    return [
        Figure(
            folder / "cost.png",
            "Above, total cost against queries, with the paper's solver (190 s a solve) and with"
            " ours: dots mark where a surrogate starts to pay. Below, test error against training"
            " samples and against the seconds that database, tuning and fit took.",
            data=(folder / "cost.csv", folder / "learning.csv"),
        ),
        Table(
            folder / "cost.csv",
            "Database, tuning, fit, a solve and an answer [s]; break-even in queries.",
        ),
        *([Words(words.read_text(encoding="utf-8"), typed=True)] if words.exists() else []),
    ]


def throughput(folder: Path) -> Sequence[Content]:
    """Contacts a second."""
    return [
        Table(
            folder / "throughput.csv",
            "Processor time of one contact, by surrogates called singly and in batches and by the"
            " solver; `solves` is how many of them fit into the time of one solve.",
        )
    ]


def memory(folder: Path) -> Sequence[Content]:
    """Memory of fits."""
    return [
        Table(folder / "memory.csv", "Peak memory [GiB] of the dearest fit of each model's space.")
    ]


def comparison(folder: Path) -> Sequence[Content]:
    """Nine models."""
    found = sorted(folder.glob("*/scores.csv"))
    return [content for table in found for content in _target(table.parent)]


def _target(folder: Path) -> Sequence[Content]:
    return [
        Table(
            folder / "scores.csv",
            f"{folder.name}: scores on the test rows [%], the paper's Table 4 beside ours.",
            columns=(
                "model", "result", "nmse", "nmae", "nmaxe", "r2", "paper_nmse", "paper_nmae",
                "paper_nmaxe", "paper_r2", "failure",
            ),
        ),
        Table(
            folder / "times.csv",
            "Times of fits made alone, on one thread, and of predictions [s].",
        ),
    ]  # fmt: skip


def tuning(folder: Path) -> Sequence[Content]:
    """Searches of settings."""
    return [_searches(table) for table in sorted(folder.glob("*/tuning.csv"))]


def grids(folder: Path) -> Sequence[Content]:
    """Times of whole grids."""
    return [_whole_grids(table) for table in sorted(folder.glob("*/whole-grids.csv"))]


def _whole_grids(table: Path) -> Content:
    if not column(table, "model"):
        return Absent("whole grids", f"python -m learn estimate DATABASE -o {table.parent.parent}")
    return Table(
        table,
        f"{table.parent.name}: what searching the whole grid takes on one thread [s], and the"
        " standard error of that; so many fits of all were timed on all rows. Where they are fewer,"
        " fits drawn at random were done on few rows, and as many as there was time for on more, up"
        " to the rows given; the paper's time beside it.",
    )


def _searches(table: Path) -> Content:
    if column(table, "model"):
        caption = f"{table.parent.name}: what was searched, of which grid, and what was found."
        return Table(table, caption)
    return Absent("tuned models", f"python -m learn tune DATABASE -o {table.parent.parent}")


def models(folder: Path) -> Sequence[Content]:
    """Error against time, of models."""
    return [
        Figure(
            folder / "models.png",
            "Test error of the nine models over the time that one prediction, a fit and a search"
            " of the hyperparameters take; filled dots are tuned, hollow ones have their"
            " libraries' settings. The line is the Pareto front: whatever lies above it is both"
            " slower and less accurate than something else.",
            data=(folder / "models.csv",),
        ),
        Table(folder / "models.csv", "The same as numbers; times in seconds, error nMAE in %."),
    ]


def stability(folder: Path) -> Sequence[Content]:
    """Extreme cases."""
    from bench.stability.contents import contents

    return contents(folder)


def tolerance(folder: Path) -> Sequence[Content]:
    """From the solver's tolerance to the surrogate's error."""
    from bench.surrogates.tolerance_report import contents

    return contents(folder)


def paper(folder: Path) -> Sequence[Content]:
    """The paper's figures and tables."""
    from bench.paper.contents import contents

    return contents(folder)


def unstated(folder: Path) -> Sequence[Content]:
    """Choices that the paper leaves open."""
    from bench.unstated.report import contents

    return contents(folder)


def benchmarks(folder: Path) -> Sequence[Content]:
    """Times by pytest-benchmark."""
    from bench.benchmarks import contents

    return contents(folder / "times.json")
