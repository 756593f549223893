"""Threads that share passes, sections of compiled code, and memory that stays with a process."""

import os
import platform
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np
import pytest
from launch import python
from threadpoolctl import ThreadpoolController, threadpool_limits

import bem
from bem import dense, threads
from gen.runtime.farm import Overtime, time_limit
from gen.surface import generate

ROUGH = generate("diamond-square", 65, 0.7, 12.0, np.random.default_rng(0))


@pytest.fixture
def four_cores(monkeypatch):
    """More threads than there are processors are never begun."""
    monkeypatch.setattr(threads, "cores", lambda: 4)


def blas_threads():
    pools = ThreadpoolController().select(user_api="blas").lib_controllers
    return {pool.get_num_threads() for pool in pools}


def test_dense_algebra_has_one_thread_and_leaves_the_others_alone(monkeypatch):
    seen: list[set[int]] = []
    by = dense.ContactFactor._by

    def watched(*matrices, **how):
        seen.append(blas_threads())
        return by(*matrices, **how)

    monkeypatch.setattr(dense.ContactFactor, "_by", watched)
    bem.solve(ROUGH, 1000.0, 10.0)  # everything is loaded
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        bem.solve(ROUGH, 1000.0, 10.0)
        assert blas_threads() == before
    assert seen
    assert all(threads == {1} for threads in seen)


def test_the_first_in_limits_and_the_last_out_restores():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        inside, leave = threading.Event(), threading.Event()

        def other():
            with threads.on_one_blas_thread():
                inside.set()
                leave.wait(600)

        thread = threading.Thread(target=other)
        with threads.on_one_blas_thread():
            thread.start()
            assert inside.wait(600)
        assert blas_threads() == {1}
        leave.set()
        thread.join()
        assert blas_threads() == before


def forked(work):
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
    end = time.monotonic() + 300
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(child, 9)
    os.waitpid(child, 0)
    return -1


def test_a_fork_waits_for_other_threads_to_leave():
    inside, left = threading.Event(), []

    def other():
        with threads.unforked():
            inside.set()
            time.sleep(0.2)
            left.append(True)

    thread = threading.Thread(target=other)
    thread.start()
    assert inside.wait(600)
    seen = left  # as it was when the child was forked
    assert forked(lambda: os._exit(0 if seen else 3)) == 0
    thread.join()


def test_a_child_forked_while_a_contact_computes_computes_too(monkeypatch):
    """A property of the class must not be locked: the child would wait for its parent's thread."""
    contacts = [
        bem.solve(ROUGH, 1000.0, delta, boundary="mirror") for delta in (4.0, 5.0)
    ]
    inside, leave, parent = threading.Event(), threading.Event(), os.getpid()

    def slow(*problem):
        if os.getpid() == parent:
            inside.set()
            leave.wait(600)
        return original(*problem)

    original = bem.contact.displacement_filter
    monkeypatch.setattr(bem.contact, "displacement_filter", slow)
    thread = threading.Thread(target=lambda: contacts[0].gap)
    thread.start()
    try:
        assert inside.wait(600)
        assert forked(lambda: contacts[1].gap) == 0
    finally:
        leave.set()
        thread.join()


def test_what_is_computed_once_is_the_same_for_all_threads():
    contact, start = bem.solve(ROUGH, 1000.0, 4.0), threading.Barrier(8)

    def gap():
        start.wait(600)
        return contact.gap

    with ThreadPoolExecutor(8) as pool:
        seen = [future.result() for future in [pool.submit(gap) for _ in range(8)]]
    assert all(field is contact.gap for field in seen)


def test_an_interrupt_on_the_way_into_a_section_leaves_no_thread_inside(monkeypatch):
    """Else forks of other threads would wait for this one forever."""
    known = threads._SECTIONS
    put = known.put

    def interrupted(depth):
        put(depth)
        if depth == 2:
            raise KeyboardInterrupt

    with threads.unforked():
        monkeypatch.setattr(known, "put", interrupted)
        with pytest.raises(KeyboardInterrupt), threads.unforked():
            pass
        assert list(known.inside.values()) == [1]
    assert not known.inside


@pytest.mark.parametrize("section", [threads.unforked, threads.on_one_blas_thread])
def test_alarms_between_any_two_steps_leave_no_lock_and_no_thread_behind(section):
    """Else other threads, their forks or later sections would wait for this one forever."""
    known, other = threads._SECTIONS, ThreadPoolExecutor(1)
    random, free = np.random.default_rng(0), []

    def is_free():
        taken = known.lock.acquire(timeout=1)
        if taken:
            known.lock.release()
        return taken

    with section():
        pass  # everything is loaded
    with other:
        for _ in range(300):
            with suppress(Overtime), time_limit(random.uniform(2e-5, 2e-4)):
                while True:
                    with section():
                        pass
            free.append(other.submit(is_free).result())
            if not free[-1]:
                known.lock.release()
    assert all(free)
    assert not {**known.inside, **known.dense}


@pytest.mark.parametrize("point", ["before", "after"])
def test_an_interrupt_on_the_way_into_a_dense_section_limits_nothing_for_good(
    monkeypatch, point
):
    """Else no later section would have one BLAS thread, and the rest of the process no other."""
    known = threads._SECTIONS
    put = known.put_dense

    def interrupted(depth):
        if point == "after" or not depth:
            put(depth)
        if depth:
            raise KeyboardInterrupt

    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with monkeypatch.context() as patched:
            patched.setattr(known, "put_dense", interrupted)
            with pytest.raises(KeyboardInterrupt), threads.on_one_blas_thread():
                pass
        assert blas_threads() == before
        with threads.on_one_blas_thread(), threads.on_one_blas_thread():
            assert blas_threads() == {1}
        assert blas_threads() == before


@pytest.mark.usefixtures("four_cores")
def test_no_more_threads_are_begun_than_there_are_processors(monkeypatch):
    class Counted(ThreadPoolExecutor):
        def __init__(self, many, name):
            begun.append(many)
            super().__init__(min(many, 3), name)

    begun: list[int] = []
    monkeypatch.setattr(threads, "ThreadPoolExecutor", Counted)
    monkeypatch.setenv("OMP_NUM_THREADS", str(10**9))
    heights = np.random.default_rng(0).normal(size=(9, 9))
    for many in (10**9, None):
        assert bem.solve(heights, 1.0, 0.5, threads=many).contact_nodes > 0
    assert begun == [3, 3]


@pytest.mark.usefixtures("four_cores")
@pytest.mark.parametrize("many", [1, 2, 3])
def test_every_piece_is_worked_on_once(many):
    done: list[tuple[int, int]] = []
    with threads.on_threads(many):
        threads.share(lambda *thread_and_piece: done.append(thread_and_piece), range(50))
    assert sorted(piece for _, piece in done) == list(range(50))
    assert {thread for thread, _ in done} <= set(range(many))


@pytest.mark.usefixtures("four_cores")
def test_an_error_of_any_piece_is_raised_when_nobody_works_any_more():
    working = []

    def work(_, piece):
        working.append(piece)
        time.sleep(0.01)
        working.remove(piece)
        raise ArithmeticError(str(piece))

    with threads.on_threads(3), pytest.raises(ArithmeticError):
        threads.share(work, range(20))
    assert not working


@pytest.mark.usefixtures("four_cores")
@pytest.mark.parametrize(("said", "many"), [("4", 4), ("", 7), ("all", 7)])
def test_the_environment_says_how_many(monkeypatch, said, many):
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert threads.default_threads(7) == many
    with threads.on_threads(None):
        assert threads.threads_here() == (many if many != 7 else 1)
        with threads.on_threads(2), threads.on_threads(None):
            assert threads.threads_here() == 2


@pytest.mark.usefixtures("four_cores")
@pytest.mark.parametrize("many", [1.5, True])
def test_other_numbers_of_threads_are_refused(many):
    for solve, load in ((bem.solve, 0.5), (bem.ladder, [0.5])):
        with pytest.raises(
            ValueError, match=r"threads = .*: must be a whole number of at least 1"
        ):
            solve(np.eye(3), 1.0, load, threads=many)


@pytest.mark.few(2)
@pytest.mark.usefixtures("four_cores")
@pytest.mark.parametrize(
    "settings",
    [{"delta": 15.0, "pressure": None}, {}, {"hardness": 0.05}, {"boundary": "mirror"}],
)
def test_contacts_are_the_same_bits_on_any_number_of_threads(settings):
    edgeless = "boundary" in settings
    heights = generate("diamond-square", 513, 0.7, 12.5, np.random.default_rng(5))
    surface = heights[:512, :512] if edgeless else heights
    one, *others = (
        bem.solve(surface, 1000.0, threads=many, **{"pressure": 2e-3, **settings})
        for many in (1, 2, 3)
    )
    for other in others:
        np.testing.assert_array_equal(other.pressure, one.pressure)
        assert (other.delta, other.residual) == (one.delta, one.residual)
        assert (other.iterations, other.convolutions) == (
            one.iterations,
            one.convolutions,
        )


SOLVES = """
import numpy as np, resource, bem
heights = np.random.default_rng(1).standard_normal((256, 256))
faults = []
for _ in range(6):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    bem.solve(heights, 1.0, pressure=20.0, boundary="periodic", rtol=1e-2)
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(min(faults))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="about glibc's heap")
def test_a_solve_finds_the_memory_of_the_one_before():
    """It would wait for hundreds of pages otherwise, of 4 KB each."""
    run = python("-c", SOLVES)
    assert int(run.stdout) < 20
