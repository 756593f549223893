"""Processes that answer for the models, so that several clients are served at once."""

import asyncio
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, NamedTuple

from asperity.serving.models import Model, Unsolved, Unsupported, model_of
from gen.runtime.errors import InputError

ATTEMPTS = 2
"""Times that a question is asked; a worker that was killed is replaced in between."""


class Refusal(Exception):
    """An answer that is an error of the protocol.

    Parameters
    ----------
    kind : str
        Type of the error: "InvalidInput", "UnsupportedFeature" or "ModelError".
    message : str
        One line for the client.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(kind, message)  # both, so that it can be pickled
        self.kind, self.message = kind, message


class Call(NamedTuple):
    """A question to a model.

    Attributes
    ----------
    model : str
        Name of the model.
    method : {"evaluate", "slope"}
        Method to call.
    arguments : tuple
        Its arguments.
    """

    model: str
    method: str
    arguments: tuple[Any, ...]


_MODELS: dict[str, Model] = {}
"""Models of this worker by their names."""


class Workers:
    """A pool of processes which all have all models.

    Parameters
    ----------
    sources : sequence of str
        Scenes and surrogates, see `model_of`.
    number : int
        Number of processes.
    """

    def __init__(self, sources: Sequence[str], number: int) -> None:
        self._sources, self._number = tuple(sources), number
        self._pool = self._new_pool()
        self._closed = False

    async def ask(self, call: Call) -> Any:
        """Answer a question on a free process.

        Raises
        ------
        Refusal
            If the model refuses the question, no process lives long enough to answer, or the
            processes are ended meanwhile.
        """
        for _ in range(ATTEMPTS):
            if self._closed:
                break
            pool = self._pool
            try:
                with _deaf():  # processes that this starts inherit it: Ctrl-C is the server's
                    future = pool.submit(_answer, call)
                return await asyncio.wrap_future(future)
            except BrokenProcessPool:
                if pool is self._pool and not self._closed:  # the first of all calls that notice
                    self._pool = self._new_pool()
                    pool.shutdown(wait=False)
            except asyncio.CancelledError:
                if not self._closed:  # the client is gone
                    raise
        who = "server" if self._closed else "process that computed the answer"
        raise Refusal("ModelError", f"the {who} was ended")

    def close(self) -> None:
        """End all processes; questions that they have not answered are refused."""
        self._closed = True
        for process in list((self._pool._processes or {}).values()):
            process.terminate()
        self._pool.shutdown(cancel_futures=True)  # waits: a thread left behind complains at exit

    def _new_pool(self) -> ProcessPoolExecutor:
        """Start processes; not by forking, since this one has threads."""
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self._number, context, _begin, (self._sources,))


@contextmanager
def _deaf() -> Iterator[None]:
    """Hold Ctrl-C back, where the system can."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(sources: tuple[str, ...]) -> None:
    """Prepare a worker: Ctrl-C is the server's, and every model is loaded once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_server, daemon=True).start()
    for source in sources:
        model = model_of(source)
        _MODELS[model.name] = model


def _end_with_server() -> None:
    """End this worker when the server is gone, killed or not."""
    server = multiprocessing.parent_process()
    if server is not None:
        server.join()
        os._exit(1)


def _answer(call: Call) -> Any:
    """Call a model's method in a worker."""
    try:
        return getattr(_MODELS[call.model], call.method)(*call.arguments)
    except InputError as error:
        raise Refusal("InvalidInput", str(error)) from None
    except Unsupported as error:
        raise Refusal("UnsupportedFeature", str(error)) from None
    except (Unsolved, ArithmeticError) as error:
        raise Refusal("ModelError", str(error)) from None
