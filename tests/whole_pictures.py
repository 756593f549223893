"""What every picture has to be."""

from typing import Any


def assert_whole(figure: Any, renderer: Any) -> None:
    """Check that nothing is cut at any border."""
    box, (width, height) = figure.get_tightbbox(renderer), figure.get_size_inches()
    assert min(box.x0, box.y0) >= 0, "something is cut on the left or below"
    assert (box.x1 <= width, box.y1 <= height) == (True, True), "something is cut"
