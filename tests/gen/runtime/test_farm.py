"""The serial side of the farm's contract; tests/mpi has the same for several ranks."""

import os
import sys

import pytest

from gen.runtime import farm
from gen.runtime.errors import InputError


def test_every_task_is_done_once_and_drawn_lazily():
    drawn, done = [], []

    def tasks():
        for task in range(5):
            drawn.append(task)
            assert len(drawn) == len(done) + 1
            yield task

    farm.run(lambda task: task**2, tasks(), lambda *pair: done.append(pair), farm.World())
    assert done == [(task, task**2) for task in range(5)]


def test_stopping_ends_before_the_next_task():
    done = []
    farm.run(
        lambda task: task,
        iter(range(100)),
        lambda task, _: done.append(task),
        farm.World(),
        stopping=lambda: len(done) >= 3,
    )
    assert done == [0, 1, 2]


def test_the_world_is_one_process_unless_a_launcher_says_otherwise(monkeypatch):
    for name in farm.LAUNCHERS:
        monkeypatch.delenv(name, raising=False)
    for name in [name for name in sys.modules if name.partition(".")[0] == "mpi4py"]:
        monkeypatch.delitem(sys.modules, name)
    assert farm.this_world() == farm.World(0, 1, None)
    assert "mpi4py" not in sys.modules


def test_a_launcher_without_mpi4py_is_one_clear_line(monkeypatch):
    monkeypatch.setitem(os.environ, "PMI_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    with pytest.raises(InputError, match=r"to bring one along .*\[mpich\]") as caught:
        farm.this_world()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("environment", "name"),
    [
        ({"PMI_SIZE": "many"}, "PMI_SIZE"),
        ({"PMI_SIZE": "2", "PMI_FD": "977"}, "PMI_FD"),
        ({"PMI_SIZE": "2", "PMI_FD": "x"}, "PMI_FD"),
        ({"PMIX_RANK": "0"}, "PMIX_RANK"),
    ],
)
def test_variables_of_no_launcher_are_named(environment, name, monkeypatch):
    for variable in ("PMI_SIZE", "PMI_FD", "PMIX_RANK", "PMIX_NAMESPACE"):
        monkeypatch.delenv(variable, raising=False)
    for variable, value in environment.items():
        monkeypatch.setenv(variable, value)
    with pytest.raises(InputError, match=f"^{name} = .* to run alone: unset {name}$"):
        farm.this_world()
