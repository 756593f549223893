"""`learn predict` and `card`: ask a surrogate about surfaces, or about itself."""

from pathlib import Path
from typing import Annotated

import typer

from gen.maps.settings import Reading
from gen.runtime.command_line import grouped
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import echo
from learn.commands.options import Coverage, Deltas, File, Inputs, Material

TableFile = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="CSV", help="Write all rows.")
]


@grouped
def predict(
    file: File,
    inputs: Inputs,
    delta: Deltas = "",
    output: TableFile = None,
    interval: Coverage = 0.9,
    *,
    reading: Reading,
    material: Material,
) -> None:
    """Predict area and force of surfaces, with intervals, and a flag outside the training."""
    from gen.law.contact_law import deltas_from
    from gen.runtime.documents import Row, write_csv
    from gen.runtime.terminal import RunProgress
    from learn.surrogate import Surrogate
    from learn.surrogate.answers import Question, answers, show
    from learn.surrogate.model import require_level

    check_outputs([Output(output, "--output")], [file, *inputs])
    surrogate = Surrogate.load(file)
    require_level(surrogate, interval)
    question = Question(
        deltas=deltas_from(delta) if delta else None,
        e_star=material.modulus(),
        hardness=material.hardness,
        level=interval,
        reading=reading,
    )
    rows: list[Row] = []
    with RunProgress(len(inputs), "inputs") as progress:
        for path in inputs:
            rows += answers(surrogate, [path], question, progress.say)
            progress.advance(1, 0)
    show(rows, interval, question.bodies(surrogate))
    if output is not None:
        write_csv(output, rows)
        echo(f"wrote {output}")


def card(file: File) -> None:
    """Print a surrogate's model card: what it was made of, its scores, intervals and ranges."""
    from learn.surrogate.card import show
    from learn.surrogate.file import read_card

    show(*read_card(file))
