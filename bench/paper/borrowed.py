"""Pictures that other commands draw, with captions that compare them with the paper."""

from pathlib import Path

from bench import hertz
from bench.contents import Content, Figure
from bench.files import write_rows
from bench.paper.facts import AREA_MAX
from bench.paper.texts import caption
from bench.picture import save
from learn.comparison import appendix
from learn.request import Request

APPENDIX_ROWS = 3000
"""Training rows of Appendix A at most: that two predictions agree needs no more, and a Gaussian
process's memory grows with their square."""


def paraboloid(folder: Path) -> list[Content]:
    """Press the paraboloid, and draw it as `python -m bench hertz` does (section 2.4)."""
    rows = hertz.compare()
    table = write_rows(folder / "hertz.csv", rows.to_dict("records"))
    picture = save(hertz.picture(rows), folder / "hertz.png")
    exact, *areas = rows.groupby(["solution", "nodes"], sort=False)["area_percent"].sum().items()
    off = [
        f"{100 * (area / exact[1] - 1):+.1f} % ({kernel} on {nodes} nodes a side)"
        for (kernel, nodes), area in areas
    ]
    return [Figure(picture, caption("hertz", off=", ".join(off)), data=(table,))]


def equal_kernels(folder: Path, database: Path) -> list[Content]:
    """Compare two models that are one, as `learn appendix` does (Appendix A)."""
    said: list[str] = []
    # Its own folder of other rows, if the inputs have changed: `learn appendix` would refuse it.
    (folder / "appendix" / "area" / "comparison.json").unlink(missing_ok=True)
    output, rows = folder / "appendix", APPENDIX_ROWS
    asked = Request(database, output, area_max=AREA_MAX, train_rows=rows, again=True)
    table, picture = appendix.write_report(asked, said.append)
    words = caption("appendix", said="; ".join(said), rows=rows)
    return [Figure(picture, words, data=(table,))]
