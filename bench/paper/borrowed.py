"""Pictures that other commands draw, with what to see in them beside the paper."""

from pathlib import Path

from bench import hertz
from bench.page.content import Content, Figure
from bench.paper import deviations
from bench.paper.facts import AREA_MAX
from learn.comparison import appendix
from learn.request import Request

APPENDIX_ROWS = 3000
"""Training rows of Appendix A at most: that two predictions agree needs no more, and a Gaussian
process's memory grows with their square."""


def paraboloid(folder: Path) -> list[Content]:
    """Press the paraboloid, and draw it as `python -m bench hertz` does (section 2.4)."""
    exact, *curves = hertz.compare()
    table, picture = hertz.report([exact, *curves]).write(folder)
    areas = exact.area_percent.sum()
    off = [
        f"{100 * (each.area_percent.sum() / areas - 1):+.1f} %"
        f" ({each.solution} on {each.nodes} nodes a side)"
        for each in curves
    ]
    caption = (
        "Section 2.4, a paraboloid against Hertz: force and area over the displacement, below how"
        " far they are off. As in the paper, the area moves in steps, finer on the finer grid, for"
        f" it counts nodes. Mean deviation of the area: {', '.join(off)}. {deviations.KERNEL}."
    )
    return [Figure(picture, caption, data=(table,))]


def equal_kernels(folder: Path, database: Path) -> list[Content]:
    """Compare two models that are one, as `learn appendix` does (Appendix A)."""
    said: list[str] = []
    # Its own folder of other rows, if the inputs have changed: `learn appendix` would refuse it.
    (folder / "appendix" / "area" / "comparison.json").unlink(missing_ok=True)
    asked = Request(
        database, folder / "appendix", area_max=AREA_MAX, train_rows=APPENDIX_ROWS, again=True
    )
    table, picture = appendix.write_report(asked, said.append)
    caption = (
        "Appendix A, Gaussian process and kernel ridge with equal kernels: both over the solved"
        " area, one over the other, and their difference (1e-18 where there is none). As in the"
        " paper both are good with the radial basis function and poor with the linear kernel, and"
        " predict the same:"
        f" {'; '.join(said)}. At most {APPENDIX_ROWS:,} training rows here."
    )
    return [Figure(picture, caption, data=(table,))]
