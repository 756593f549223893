"""Processes that answer for the models, so that several clients are served at once."""

import asyncio
import multiprocessing
import os
import resource
import threading
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

from asperity.functions import Unsolved
from asperity.serving.models import Answer, Configuration, Model, Vectors, model_of
from gen.runtime.errors import InputError
from gen.runtime.farm import signals_blocked
from gen.runtime.memory import require_blas
from gen.runtime.user_code import TRUSTED

ATTEMPTS = 2
"""Largest number of times that a question is put to a process. If the process ends without an
answer, killed from outside for example, a new one takes its place before the next attempt."""

WAITING = 1000
"""Largest number of questions that wait for a free process; further ones are refused."""

FILES_PER_PROCESS = 8
"""Number of open files that the server is allowed for each process: it needs six."""

GRACE = 5.0
"""Time in which a process may finish a question whose client is gone [s]; then it is replaced. The
time is longer than the start of a process: clients that leave early must not end processes that
have only just started."""

STATUS = {"ModelError": 500, "InvalidOutput": 500, "Busy": 503}
"""HTTP status by the type of an error; 400 for all other types, which are faults of a client."""


class Refusal(Exception):
    """An answer that is an error of the protocol.

    Parameters
    ----------
    kind : str
        Type of the error in the protocol, as "InvalidInput".
    message : str
        Text for the client; line breaks become spaces.
    """

    def __init__(self, kind: str, message: str) -> None:
        # With both arguments, the error can be pickled on its way from a worker.
        super().__init__(kind, message)
        self.kind = kind
        self.message = " ".join(message.split())

    @property
    def status(self) -> int:
        """HTTP status of the answer."""
        return STATUS.get(self.kind, 400)


class Call(NamedTuple):
    """A question to a model."""

    model: str  # name of the model
    vectors: Vectors  # its input
    config: Configuration  # settings of the client


_MODELS: dict[str, Model] = {}
"""In a worker, its models by name; empty in the server's process."""


class Workers:
    """Processes that have all models; each answers one question at a time.

    Every process is a pool of its own, so that ending it ends no other question. Processes start
    when the first questions need them. Making this object raises the limit of open files of this
    process, as far as the system allows.

    Parameters
    ----------
    sources : sequence of str
        Scenes and surrogates, as `model_of` takes them.
    number : int
        Number of processes.
    """

    def __init__(self, sources: Sequence[str], number: int) -> None:
        self._sources = tuple(sources)
        self._waiting = 0  # questions that wait for a free process
        self._closed = False
        self._pools: set[ProcessPoolExecutor] = set()
        # The last process that became free is the first to be used; None stands for a process that
        # has not been started, and is used last.
        self._free: asyncio.LifoQueue[ProcessPoolExecutor | None] = asyncio.LifoQueue()
        for _ in range(number):
            self._free.put_nowait(None)
        _raise_file_limit(number)

    async def ask(self, call: Call) -> Answer:
        """Answer a question on a free process.

        If the caller is cancelled because its client is gone, the question leaves the queue. If a
        process computes it already, that process has `GRACE` to finish.

        Parameters
        ----------
        call : Call
            The question.

        Returns
        -------
        list of list of float or None
            Output of the model.

        Raises
        ------
        Refusal
            If too many questions wait, the model refuses the question, the server is closed, or
            `ATTEMPTS` processes that compute the answer are ended.
        """
        if self._waiting >= WAITING:
            raise Refusal("Busy", f"{WAITING} questions wait already: ask again later")
        self._waiting += 1
        try:
            pool = await self._free.get() or self._new_pool()
        finally:
            self._waiting -= 1
        answer = asyncio.create_task(self._answered(pool, call))
        try:
            return await asyncio.shield(answer)
        except asyncio.CancelledError:
            asyncio.get_running_loop().call_later(GRACE, answer.cancel)
            # Nobody awaits the answer now: take its error, so that asyncio does not complain.
            answer.add_done_callback(lambda done: done.cancelled() or done.exception())
            raise

    async def _answered(self, pool: ProcessPoolExecutor, call: Call) -> Answer:
        """Answer a question on one process, or on the one that takes its place.

        The process is in `_free` afterwards. If this task is cancelled, the process is ended, and a
        new one is free. Raises Refusal as `ask` does.
        """
        try:
            for _ in range(ATTEMPTS):
                if self._closed:
                    break
                try:
                    # A process that starts here inherits the blocked signals: Ctrl-C is for the
                    # server alone.
                    with signals_blocked():
                        future = pool.submit(_answer, call)
                    return await asyncio.wrap_future(future)
                except BrokenProcessPool:
                    pool = self._replaced(pool)
                except asyncio.CancelledError:
                    # Either `ask` has cancelled this task, or `close` has cancelled the future.
                    pool = self._replaced(pool)
                    if not self._closed:
                        raise
            if self._closed:
                raise Refusal("ModelError", "the server was ended")
            raise Refusal("ModelError", "the process that computed the answer was ended")
        finally:
            self._free.put_nowait(pool)

    def close(self) -> None:
        """End all processes; the questions that they have not answered are refused."""
        self._closed = True
        for pool in self._pools:
            _end(pool)
        for pool in self._pools:
            # This waits for the thread of the pool, which would complain when Python ends.
            pool.shutdown(cancel_futures=True)

    def _replaced(self, pool: ProcessPoolExecutor) -> ProcessPoolExecutor:
        """End the process of a pool, and return a new pool in its place.

        After `close`, which has ended all processes, return the old pool.
        """
        if self._closed:
            return pool
        _end(pool)
        pool.shutdown(wait=False)
        self._pools.remove(pool)
        return self._new_pool()

    def _new_pool(self) -> ProcessPoolExecutor:
        """Return a new pool of one process, which starts with its first question."""
        # This process has threads, and must not be forked.
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(
            max_workers=1,
            mp_context=context,
            initializer=_begin,
            initargs=(self._sources, TRUSTED.get()),
        )
        self._pools.add(pool)
        return pool


def _raise_file_limit(number: int) -> None:
    """Raise this process's limit of open files for a number of worker processes.

    Each client that waits has one open file. The new limit is lower than needed if the system
    allows no more.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return
    limit = max(soft, FILES_PER_PROCESS * number + WAITING)
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


def _end(pool: ProcessPoolExecutor) -> None:
    """Kill the process of a pool, if it has been started."""
    for process in list((pool._processes or {}).values()):
        process.kill()


def _begin(sources: tuple[str, ...], trusted: bool) -> None:
    """Prepare this worker, which has just started: fill `_MODELS`, and end with the server.

    `sources` are the scenes and surrogates. `trusted` is True if functions of scenes may run.
    """
    threading.Thread(target=_end_with_server, daemon=True).start()
    require_blas()
    TRUSTED.set(trusted)
    for source in sources:
        model = model_of(source)
        _MODELS[model.name] = model


def _end_with_server() -> None:
    """Wait until the server is gone, killed or not, and then end this worker."""
    server = multiprocessing.parent_process()
    if server is not None:
        server.join()
        os._exit(1)


def _answer(call: Call) -> Answer:
    """Evaluate a model in this worker, and return its output.

    Refusal is raised in place of errors of the question and of contacts without a solution.
    """
    try:
        return _MODELS[call.model].evaluate(call.vectors, call.config)
    except InputError as error:
        raise Refusal("InvalidInput", str(error)) from None
    except (Unsolved, ArithmeticError) as error:
        raise Refusal("ModelError", str(error)) from None
