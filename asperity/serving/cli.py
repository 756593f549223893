"""The command `asperity serve`."""

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

PATIENCE = (
    5.0  # seconds that clients get to take their last answers after a second Ctrl-C
)

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
    typer.Option(min=1, max=1024, help="Questions answered at once; all cores if none."),
]


def main(arguments: Sequence[str], name: str) -> int:
    """Run the command line and return its exit code."""
    return command_line.main(app, arguments, name, single_process=True)


@app.command()
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
    from aiohttp import web

    from asperity.serving.models import model_of
    from asperity.serving.protocol import SLOW, Server
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

    def tell(*_: object) -> None:
        echo(f"serving {', '.join(names)} at http://{host}:{port} until Ctrl-C")
        for model in models:
            if model.remark:
                echo(f"{model.name}: {model.remark}")

    ctrl_c = _CtrlC(workers.close)

    async def stop(_: web.Application) -> None:
        echo(
            "stopping: questions under way are answered first; Ctrl-C again ends at once"
        )

    everywhere = host in {
        "0.0.0.0",
        "::",
    }  # whoever lets others in knows better how they call us
    own = () if everywhere else ("localhost", host.lower(), socket.gethostname().lower())
    served = Server(models, workers, own).app()
    served.on_startup.append(ctrl_c.listen)
    served.on_shutdown.append(stop)
    try:
        web.run_app(
            served,
            host=host,
            port=port,
            print=tell,
            access_log=None,
            handler_cancellation=True,  # of clients that are gone
            keepalive_timeout=SLOW,
            lingering_time=1.0,  # for the rest of a question that was refused
            auto_decompress=False,  # a small question could become a large one
        )
    except OSError as error:
        raise InputError(f"http://{host}:{port}: {error.strerror or error}") from None
    finally:
        workers.close()
    if ctrl_c.presses > 1:
        raise typer.Exit(128 + signal.SIGINT)


class _CtrlC:
    """Handling of Ctrl-C: the first lets the server shut down, the second ends its workers.

    Their questions are then answered with an error, so that the shutdown has nothing to wait for.
    """

    def __init__(self, end_workers: Callable[[], None]) -> None:
        self.presses = 0
        self._end_workers = end_workers

    async def listen(self, _: "web.Application") -> None:
        """Take Ctrl-C from aiohttp, whose second one would leave its tasks unfinished."""
        asyncio.get_running_loop().add_signal_handler(signal.SIGINT, self._press)

    def _press(self) -> None:
        from aiohttp import web

        self.presses += 1
        if self.presses == 1:
            raise web.GracefulExit
        self._end_workers()
        asyncio.get_running_loop().call_later(PATIENCE, os._exit, 128 + signal.SIGINT)
