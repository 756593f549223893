"""A short form of the fault campaign; `python -m bench faults` runs the long one."""

from bench.faults import campaign


def test_interrupted_runs_lose_nothing(tmp_path):
    rounds = campaign(tmp_path, rounds=5, seed=3, samples=1200)
    assert [interrupted.fault for interrupted in rounds] == [""] * len(rounds)
    assert rounds[-1].after == 1200
    assert any(0 < interrupted.after < 1200 for interrupted in rounds), (
        "no run was met in its midst"
    )
