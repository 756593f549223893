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

ATTEMPTS = (
    2  # times that a question is asked; a worker that was killed is replaced in between
)
WAITING = 1000  # most questions that wait for a free process

GRACE = 5.0
"""Seconds in which a process may end a question whose client is gone; then it is replaced. A new
process takes part of that time to start, so that impatient clients must not end young ones."""

STATUS = {"ModelError": 500, "InvalidOutput": 500, "Busy": 503}
"""Status of HTTP by the type of an error; 400 for all others, which are the client's."""


class Refusal(Exception):
    """An answer that is an error of the protocol: its type, as "InvalidInput", and one line."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(kind, message)  # both, so that it can be pickled
        self.kind, self.message = kind, " ".join(message.split())

    @property
    def status(self) -> int:
        """Status of the answer."""
        return STATUS.get(self.kind, 400)


class Call(NamedTuple):
    """A question to a model: its name, the inputs and the client's settings."""

    model: str
    vectors: Vectors
    config: Configuration


_MODELS: dict[str, Model] = {}  # models of this worker by their names


class Workers:
    """Processes which all have all models; each answers one question at a time.

    Every process is a pool of its own: ended, it takes no other question along.
    """

    def __init__(self, sources: Sequence[str], number: int) -> None:
        self._sources, self._waiting, self._closed = tuple(sources), 0, False
        self._pools: set[ProcessPoolExecutor] = set()
        # Running workers come first; None stands for one that was not needed yet.
        self._free: asyncio.LifoQueue[ProcessPoolExecutor | None] = asyncio.LifoQueue()
        for _ in range(number):
            self._free.put_nowait(None)
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if soft != resource.RLIM_INFINITY:  # a pool has six open files, a client one
            wanted = max(soft, 8 * number + WAITING)
            most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))

    async def ask(self, call: Call) -> Answer:
        """Answer a question on a free process.

        A caller that is cancelled, since its client is gone, leaves the queue; a process that
        computes its answer gets `GRACE`. Raise Refusal if too many questions wait, the model
        refuses the question, no process lives long enough to answer, or the processes are ended
        meanwhile.
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
            answer.add_done_callback(lambda done: done.cancelled() or done.exception())
            raise

    async def _answered(self, pool: ProcessPoolExecutor, call: Call) -> Answer:
        """Answer a question on one process, which is free afterwards."""
        try:
            for _ in range(ATTEMPTS):
                if self._closed:
                    break
                try:
                    with signals_blocked():  # Ctrl-C is the server's
                        future = pool.submit(_answer, call)
                    return await asyncio.wrap_future(future)
                except BrokenProcessPool:
                    pool = self._replaced(pool)
                except asyncio.CancelledError:
                    pool = self._replaced(pool)
                    if not self._closed:
                        raise
            who = "server" if self._closed else "process that computed the answer"
            raise Refusal("ModelError", f"the {who} was ended")
        finally:
            self._free.put_nowait(pool)

    def close(self) -> None:
        """End all processes; questions that they have not answered are refused."""
        self._closed = True
        for pool in self._pools:
            _end(pool)
        for pool in self._pools:
            pool.shutdown(
                cancel_futures=True
            )  # waits: a thread left behind complains at exit

    def _replaced(self, pool: ProcessPoolExecutor) -> ProcessPoolExecutor:
        """End a process, and return the one that takes its place unless the server ends."""
        if self._closed:
            return pool
        _end(pool)
        pool.shutdown(wait=False)
        self._pools.remove(pool)
        return self._new_pool()

    def _new_pool(self) -> ProcessPoolExecutor:
        """Prepare a process; not by forking, since this one has threads."""
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(1, context, _begin, (self._sources, TRUSTED.get()))
        self._pools.add(pool)
        return pool


def _end(pool: ProcessPoolExecutor) -> None:
    """End the process of a pool, if it has been started."""
    for process in list((pool._processes or {}).values()):
        process.kill()


def _begin(sources: tuple[str, ...], trusted: bool) -> None:
    """Prepare a worker, in which every model is loaded once."""
    threading.Thread(target=_end_with_server, daemon=True).start()
    require_blas()
    TRUSTED.set(trusted)
    for source in sources:
        model = model_of(source)
        _MODELS[model.name] = model


def _end_with_server() -> None:
    """End this worker when the server is gone, killed or not."""
    server = multiprocessing.parent_process()
    if server is not None:
        server.join()
        os._exit(1)


def _answer(call: Call) -> Answer:
    """Evaluate a model in a worker."""
    try:
        return _MODELS[call.model].evaluate(call.vectors, call.config)
    except InputError as error:
        raise Refusal("InvalidInput", str(error)) from None
    except (Unsolved, ArithmeticError) as error:
        raise Refusal("ModelError", str(error)) from None
