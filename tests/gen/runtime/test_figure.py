"""Axes that every picture shares."""

from itertools import pairwise

import pytest

from gen.runtime.figure import log_axis, new_figure


@pytest.mark.parametrize("values", [(2.1, 4.4), (5.0, 60.0), (7.0, 45.0), (1e-4, 4e-4), (1, 1e6)])
def test_a_logarithmic_axis_has_two_numbers_or_more_that_keep_apart(values):
    figure = new_figure(4, 3)
    panel = figure.subplots()
    panel.plot(values, values, "o")
    log_axis(panel.xaxis)
    log_axis(panel.yaxis)
    figure.draw_without_rendering()
    low, high = panel.get_xlim()
    numbers = [
        label.get_window_extent()
        for label in panel.get_xticklabels(which="both")
        if label.get_text() and low <= label.get_position()[0] <= high
    ]
    assert len(numbers) >= 2
    for left, right in pairwise(numbers):
        assert left.x1 <= right.x0
