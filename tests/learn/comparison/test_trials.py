"""Files of finished fits: those of others, and damaged ones."""

import pytest

from gen.runtime.errors import InputError
from learn.comparison.trials import Trials


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
