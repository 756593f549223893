"""The command `asperity serve`."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from gen.runtime import command_line
from gen.runtime.command_line import Trust, Version
from gen.runtime.errors import InputError
from gen.runtime.terminal import echo

if TYPE_CHECKING:
    from aiohttp import web

    from asperity.serving.models import Model

PATIENCE = 5.0
"""Time after a second Ctrl-C for sending the last answers [s]; then the process ends."""

ALL_ADDRESSES = {"0.0.0.0", "::"}
"""Values of --host with which the server listens on every address of the machine."""

app = typer.Typer(add_completion=False, rich_markup_mode=None)

Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="MODEL...", help="Scenes (a name or a file) and surrogates to serve."
    ),
]
Port = Annotated[int, typer.Option(min=1, max=65535, help="Port to listen on.")]
Host = Annotated[
    str,
    typer.Option(metavar="ADDRESS", help="Address to listen on; 0.0.0.0 lets others in."),
]
Processes = Annotated[
    int | None,
    typer.Option(
        min=1, max=1024, help="Questions answered at once; one for each core if left out."
    ),
]


def main(arguments: Sequence[str], name: str) -> int:
    """Run a command line of `asperity serve`.

    Parameters
    ----------
    arguments : sequence of str
        Words after the program's name.
    name : str
        Name of the program in messages, as "asperity serve".

    Returns
    -------
    int
        Exit code.
    """
    return command_line.main(app, arguments, name, single_process=True)


@app.command(cls=command_line.Command)
def serve(
    sources: Sources,
    port: Port = 4242,
    host: Host = "127.0.0.1",
    processes: Processes = None,
    trust: Trust = False,
    *,
    version: Version = False,
) -> None:
    """Serve solver and surrogates to UM-Bridge's clients until Ctrl-C.

    The model of a scene takes the parameters that the scene draws and a load, and returns area,
    force and Delta; the model of a surrogate predicts its targets. Clients may send `surface`,
    `seed`, `nodes` and `stiffness`.
    """
    from asperity.serving.models import model_of
    from asperity.serving.protocol import Server
    from asperity.serving.workers import Workers
    from bem.threads import cores

    if not host.strip():
        raise InputError(
            f"--host {host!r}: give an address; 0.0.0.0 lets other machines ask"
        )
    models = [model_of(source) for source in sources]
    names = [model.name for model in models]
    if len(set(names)) < len(names):
        raise InputError(f"{', '.join(names)}: models of one name; rename a file")
    workers = Workers(sources, processes or cores())
    server = Server(models, workers, _own_names(host))
    ctrl_c = _CtrlC(workers.close)
    try:
        _run_server(server.app(), models, ctrl_c, host, port)
    except OSError as error:
        raise InputError(f"http://{host}:{port}: {error.strerror or error}") from None
    finally:
        workers.close()
    if ctrl_c.presses > 1:
        # the exit code of a program that Ctrl-C ends
        raise typer.Exit(128 + signal.SIGINT)


def _own_names(host: str) -> tuple[str, ...]:
    """Return the names under which clients reach a server that listens on an address, `host`.

    They are empty if it listens on all addresses: other machines may have names for this one that
    the server does not know, so that it cannot check names.
    """
    if host in ALL_ADDRESSES:
        return ()
    return ("localhost", host.lower(), socket.gethostname().lower())


def _run_server(
    app: web.Application, models: Sequence[Model], ctrl_c: _CtrlC, host: str, port: int
) -> None:
    """Serve until Ctrl-C, and print the models as soon as the server listens.

    Adds to `app` what is done at its start and at its shutdown. Raises OSError if the server cannot
    listen on the address and port.
    """
    from aiohttp import web

    from asperity.serving.protocol import SLOW

    def print_models(*_: object) -> None:
        """Print names and address; aiohttp calls this with a text of its own."""
        names = ", ".join(model.name for model in models)
        echo(f"serving {names} at http://{host}:{port} until Ctrl-C")
        for model in models:
            if model.remark:
                echo(f"{model.name}: {model.remark}")

    async def print_stop(_: web.Application) -> None:
        """Print that the server is stopping."""
        echo(
            "stopping: questions under way are answered first; Ctrl-C again ends at once"
        )

    app.on_startup.append(ctrl_c.install_handler)
    app.on_shutdown.append(print_stop)
    web.run_app(
        app,
        host=host,
        port=port,
        print=print_models,
        access_log=None,
        handler_cancellation=True,  # ends the questions of clients that are gone
        keepalive_timeout=SLOW,
        lingering_time=1.0,  # time to read the rest of a question that was refused [s]
        auto_decompress=False,  # compressed, a small question could become a large one
    )


class _CtrlC:
    """The handling of Ctrl-C: the first lets the server shut down, the second ends its workers.

    When workers are ended, their questions are answered with an error, so that the shutdown has
    nothing to wait for.
    """

    def __init__(self, end_workers: Callable[[], None]) -> None:
        self.presses = 0  # number of times that Ctrl-C was pressed
        self._end_workers = end_workers

    async def install_handler(self, _: web.Application) -> None:
        """Handle Ctrl-C in place of aiohttp, whose second Ctrl-C leaves its tasks unfinished."""
        asyncio.get_running_loop().add_signal_handler(signal.SIGINT, self._press)

    def _press(self) -> None:
        """Handle one Ctrl-C, and count it in `presses`.

        At the first one, raise GracefulExit, with which aiohttp shuts the server down. At a further
        one, end the workers, and end this process `PATIENCE` later.
        """
        from aiohttp import web

        self.presses += 1
        if self.presses == 1:
            raise web.GracefulExit
        self._end_workers()
        asyncio.get_running_loop().call_later(PATIENCE, os._exit, 128 + signal.SIGINT)
