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
            " the displacement, with the deviation from Hertz below. The force of the default"
            " kernel, uniform pressure on cells, stays within a per cent; the area moves in steps"
            " because nodes touch one after the other. The concentrated-force kernel, MIRCO's,"
            " makes forces too large and areas too small.",
            data=(folder / "hertz.csv",),
        )
    ]


def solver(folder: Path) -> Sequence[Content]:
    """Error against run time."""
    return [
        Figure(
            folder / "solver.png",
            "Error of force, area and pressure against wall time and against convolutions: for the"
            " tolerance, the grid, both kernels, both precisions, and other solvers where they are"
            " installed. Down and to the left is better. A tighter tolerance costs little: the"
            " curves are steep. The area of a self-affine surface does not converge with the grid,"
            " as the force does.",
            data=(folder / "solver.csv",),
        )
    ]


def peers(folder: Path) -> Sequence[Content]:
    """Other solvers."""
    return [
        Figure(
            folder / "peers.png",
            "Processor time of a solve against the displacement, each solver at its loosest"
            " tolerance with the force within 1e-6 and the contact set within 0.05 %; below, over"
            " ours (1 is as fast). The paper's algorithm, non-negative least squares with a dense"
            " matrix, is as fast where a few nodes touch and hundreds of times slower at 5 % of"
            " the nodes.",
            data=(folder / "peers.csv",),
        ),
        Table(
            folder / "peers.csv",
            "The same as numbers.",
            columns=(
                "nodes", "hurst", "delta_um", "contact_nodes", "solver", "tolerance", "seconds",
                "times_ours", "load_error", "misplaced_nodes", "remark",
            ),
        ),
        *_absent_peers(folder / "peers.csv"),
    ]  # fmt: skip


def _absent_peers(table: Path) -> Sequence[Content]:
    """The packages that no line of the table is about, with how to get them."""
    from bench.peers.compare import PEERS

    solvers = set(column(table, "solver"))
    known = {peer.package: peer.install for peer in PEERS}
    there = {peer.package for peer in PEERS if peer.name in solvers}
    return [Absent(package, how) for package, how in known.items() if package not in there]


def growth(folder: Path) -> Sequence[Content]:
    """Growth with the grid."""
    return [
        Figure(
            folder / "growth.png",
            "Convolutions, seconds and memory of a solve over the nodes a side, at 1, 10 and 50 %"
            " of the nodes in contact. Seconds grow with the nodes times their logarithm and with"
            " the convolutions, of which a grid of twice the nodes a side needs 1.1 to 1.4 times"
            " as many.",
            data=(folder / "growth.csv",),
        ),
        Table(
            folder / "growth.csv",
            "Growth is per doubling of the nodes a side, from the first grid on.",
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
                " set, a column for each case; dots off the diagonal are wrong. On the finer grid"
                " the statistics alone fail, since their values depend on the spacing; a loose"
                " solve among the features mends it.",
                data=(folder / "generalisation.csv",),
            )
            for picture in sorted(folder.glob("generalisation-*.png"))
        ),
        Table(
            folder / "generalisation.csv",
            "Scores [%], share of rows flagged as outside the training ranges and inside the 90 %"
            " intervals, and what follows.",
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
            "Contacts a second of surrogates, called singly and in batches, beside the solver.",
        )
    ]


def memory(folder: Path) -> Sequence[Content]:
    """Memory of fits."""
    return [
        Table(folder / "memory.csv", "Peak memory of the dearest fit of each model's search space.")
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
        _searches(folder / "tuning.csv"),
    ]  # fmt: skip


def _searches(table: Path) -> Content:
    if column(table, "model"):
        return Table(table, "What was searched, of which grid, and what was found.")
    how = "python -m learn tune DATABASE --area-max 16.56 -o COMPARISON --model kernel-ridge"
    return Absent("Tuned models", how)


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
