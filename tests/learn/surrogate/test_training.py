"""Which rows train and which calibrate."""

import numpy as np

from learn import split
from learn.surrogate.calibration_rows import without_calibration


def test_calibration_rows_train_nothing(solved, monkeypatch):
    from learn import dataset

    rows = dataset.read(solved, "area", features="dimensionless")
    parts = split.draw(rows)
    train, calibration = without_calibration(rows, parts.train)
    assert calibration.size == 14
    everything = np.concatenate([train, calibration, parts.test])
    np.testing.assert_array_equal(np.sort(everything), np.arange(90))
    assert not set(rows.groups[train]) & set(rows.groups[calibration])
