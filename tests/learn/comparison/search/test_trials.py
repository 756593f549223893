"""Files of finished fits: those of others, and older ones."""

import json

import pytest

from gen.runtime.errors import InputError
from learn.comparison.search.trials import Trials


def test_trials_of_other_conditions_are_refused(tmp_path):
    path = tmp_path / "trials.jsonl"
    common = {"seed": 0, "versions": {"a": "1"}}
    with Trials(path, common):
        pass
    with pytest.raises(InputError, match=r"holds trials with seed 0, not 1"):
        Trials(path, {"seed": 1, "versions": {"a": "1"}})
    path.write_text("nonsense\n")
    with pytest.raises(InputError, match="damaged"):
        Trials(path, {})
    with pytest.raises(InputError, match="cannot be"):
        Trials(path / "below" / "trials.jsonl", {})


def test_scores_of_diverged_fits_in_older_files_are_failures(tmp_path):
    path = tmp_path / "trials.jsonl"
    line = {"candidate": "learning_rate=2.0", "fold": 0, "rows": 374, "r2": -2e39}
    path.write_text("{}\n" + json.dumps(line) + "\n")
    with Trials(path, {}) as trials:
        (trial,) = trials.finished.values()
    assert trial.r2 is None
    assert trial.failure == "prediction diverged"
