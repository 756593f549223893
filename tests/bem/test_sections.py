"""Sections of compiled code: BLAS has one thread in them and its own number after; forks wait."""

import hashlib
import os
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

import bem
from bem import dense, sections
from gen.runtime.signals import Overtime, at_most
from gen.surface import generate

ROUGH = generate("diamond-square", 65, 0.7, 12.0, np.random.default_rng(0))
ROOT = Path(__file__).resolve().parents[2]


def blas_threads() -> set[int]:
    pools = ThreadpoolController().select(user_api="blas").lib_controllers
    return {pool.get_num_threads() for pool in pools}


def test_dense_algebra_has_one_thread_and_leaves_the_others_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[set[int]] = []
    factorised = dense.ContactFactor._factorised

    def watched(self: dense.ContactFactor, matrix: np.ndarray) -> np.ndarray:
        seen.append(blas_threads())
        return factorised(self, matrix)

    monkeypatch.setattr(dense.ContactFactor, "_factorised", watched)
    bem.solve(ROUGH, 1000.0, 10.0)  # everything is loaded
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        bem.solve(ROUGH, 1000.0, 10.0)
        assert blas_threads() == before
    assert seen
    assert all(threads == {1} for threads in seen)


def test_the_first_in_limits_and_the_last_out_restores() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        inside, leave = threading.Event(), threading.Event()

        def other() -> None:
            with sections.on_one_blas_thread():
                inside.set()
                leave.wait(10)

        thread = threading.Thread(target=other)
        with sections.on_one_blas_thread():
            thread.start()
            assert inside.wait(10)
        assert blas_threads() == {1}
        leave.set()
        thread.join(10)
        assert blas_threads() == before


FORCES = """
import hashlib, numpy as np, bem
from gen.surface import generate
heights = generate("diamond-square", 65, 0.7, 12.0, np.random.default_rng(0))
contacts = [*bem.ladder(heights, 1000.0, [4.0, 10.0]), bem.solve(heights, 1000.0, pressure=0.004)]
print(hashlib.sha256(b"".join(contact.pressure.tobytes() for contact in contacts)).hexdigest())
"""


def test_results_do_not_depend_on_the_number_of_blas_threads() -> None:
    contacts = [*bem.ladder(ROUGH, 1000.0, [4.0, 10.0]), bem.solve(ROUGH, 1000.0, pressure=0.004)]
    here = b"".join(contact.pressure.tobytes() for contact in contacts)
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", FORCES],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stdout.strip() == hashlib.sha256(here).hexdigest()


def forked(work: Callable[[], object]) -> int:
    """Exit code of a child that does some work, -1 if it hangs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of forks beside threads
        child = os.fork()
    if child == 0:
        try:
            work()
        except BaseException:
            os._exit(1)
        os._exit(0)
    end = time.monotonic() + 20
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(child, 9)
    os.waitpid(child, 0)
    return -1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks here")
def test_a_fork_waits_for_other_threads_to_leave() -> None:
    inside, left = threading.Event(), []

    def other() -> None:
        with sections.unforked():
            inside.set()
            time.sleep(0.2)
            left.append(True)

    thread = threading.Thread(target=other)
    thread.start()
    assert inside.wait(10)
    seen = left  # as it was when the child was forked
    assert forked(lambda: os._exit(0 if seen else 3)) == 0
    thread.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks here")
def test_children_forked_beside_solving_threads_solve_too() -> None:
    """On new grids: every one of them makes plans and tables."""
    stop = threading.Event()

    def solve_on(first: int) -> None:
        nodes = first
        while not stop.is_set():
            nodes = nodes + 1 if nodes < 60 else first
            bem.solve(ROUGH[:nodes, : nodes + 1], 1.0, 8.0, spacing=5.0)

    threads = [threading.Thread(target=solve_on, args=(first,)) for first in (20, 33)]
    for thread in threads:
        thread.start()
    try:
        codes = [
            forked(lambda nodes=nodes: bem.solve(ROUGH[:nodes, :nodes], 1.0, 8.0, spacing=5.0))
            for nodes in range(36, 60)
        ]
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    assert codes == [0] * 24


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks here")
def test_a_child_forked_while_a_contact_computes_computes_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A property of the class must not be locked: the child would wait for its parent's thread."""
    contacts = [bem.solve(ROUGH, 1000.0, delta, boundary="mirror") for delta in (4.0, 5.0)]
    inside, leave, parent = threading.Event(), threading.Event(), os.getpid()

    def slow(*problem: Any) -> object:
        if os.getpid() == parent:
            inside.set()
            leave.wait(60)
        return original(*problem)

    original = bem.contact.displacement_filter
    monkeypatch.setattr(bem.contact, "displacement_filter", slow)
    thread = threading.Thread(target=lambda: contacts[0].gap)
    thread.start()
    try:
        assert inside.wait(10)
        assert forked(lambda: contacts[1].gap) == 0
    finally:
        leave.set()
        thread.join()


def test_what_is_computed_once_is_the_same_for_all_threads() -> None:
    contact, start = bem.solve(ROUGH, 1000.0, 4.0), threading.Barrier(8)

    def gap() -> np.ndarray:
        start.wait(10)
        return contact.gap

    with ThreadPoolExecutor(8) as threads:
        seen = [future.result() for future in [threads.submit(gap) for _ in range(8)]]
    assert all(field is contact.gap for field in seen)


def test_an_interrupt_on_the_way_into_a_section_leaves_no_thread_inside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else forks of other threads would wait for this one forever."""
    known = sections._SECTIONS
    entered = known.enter

    def interrupted() -> None:
        entered()
        raise KeyboardInterrupt

    with sections.unforked():
        monkeypatch.setattr(known, "enter", interrupted)
        with pytest.raises(KeyboardInterrupt), sections.unforked():
            pass
        assert known.depth() == 1
    assert known.depth() == 0


@pytest.mark.parametrize("section", [sections.unforked, sections.on_one_blas_thread])
def test_alarms_between_any_two_steps_leave_no_lock_and_no_thread_behind(
    section: Callable[[], AbstractContextManager[None]],
) -> None:
    """Else other threads, their forks or later sections would wait for this one forever."""
    known, other = sections._SECTIONS, ThreadPoolExecutor(1)
    random, free = np.random.default_rng(0), []

    def is_free() -> bool:
        taken = known.lock.acquire(timeout=1)
        if taken:
            known.lock.release()
        return taken

    with other:
        for _ in range(300):
            with suppress(Overtime), at_most(random.uniform(2e-5, 2e-4)):
                while True:
                    with section():
                        pass
            free.append(other.submit(is_free).result())
            if not free[-1]:
                known.lock.release()
    assert all(free)
    assert (known.depth(), known.dense_depth()) == (0, 0)


@pytest.mark.parametrize("point", ["before", "after"])
def test_an_interrupt_on_the_way_into_a_dense_section_limits_nothing_for_good(
    monkeypatch: pytest.MonkeyPatch, point: str
) -> None:
    """Else no later section would have one BLAS thread, and the rest of the process no other."""
    known = sections._SECTIONS
    limited = known.limit

    def interrupted() -> None:
        if point == "after":
            limited()
        raise KeyboardInterrupt

    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with monkeypatch.context() as patched:
            patched.setattr(known, "limit", interrupted)
            with pytest.raises(KeyboardInterrupt), sections.on_one_blas_thread():
                pass
        assert blas_threads() == before
        with sections.on_one_blas_thread(), sections.on_one_blas_thread():
            assert blas_threads() == {1}
        assert blas_threads() == before
