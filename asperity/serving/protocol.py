"""The protocol of UM-Bridge: routes of HTTP with JSON, which check every question."""

import asyncio
import ipaddress
import json
import logging
import math
import reprlib
from collections.abc import Awaitable, Callable, Collection, Sequence
from typing import Any, NoReturn
from urllib.parse import urlsplit

from aiohttp import web
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from asperity.serving.models import Configuration, Model, Vectors
from asperity.serving.workers import Call, Refusal, Workers
from gen.runtime.terminal import printable

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

VERSION = 1.0  # version of the protocol
LARGEST = 2**20  # most bytes of a question, more than any has
SLOW = 60.0  # seconds in which a client has to send a question


class Body(BaseModel):
    """The body of a question; each route needs some of the keys, and "1" or true is no number."""

    model_config = ConfigDict(strict=True)

    name: str
    input: Vectors = Field(default=[])
    config: Configuration = Field(default=Configuration())
    out_wrt: int = Field(default=0, alias="outWrt")
    in_wrt: int = Field(default=0, alias="inWrt")
    in_wrt_1: int = Field(default=0, alias="inWrt1")
    in_wrt_2: int = Field(default=0, alias="inWrt2")


class Server:
    """The server's answers: names and sizes of models from this process, values from workers.

    `hosts` are the names of this server in addresses that are answered, IP addresses besides;
    without names every one is answered.
    """

    def __init__(
        self, models: Sequence[Model], workers: Workers, hosts: Collection[str] = ()
    ) -> None:
        self._models = {model.name: model for model in models}
        self._workers, self._hosts = workers, hosts

    def app(self) -> web.Application:
        """Return the application of aiohttp."""
        app = web.Application(
            middlewares=[_in_words, self._own_only], client_max_size=LARGEST
        )
        answers = {
            "/InputSizes": self._input_sizes,
            "/OutputSizes": self._output_sizes,
            "/ModelInfo": self._model_info,
            "/Evaluate": self._evaluate,
            "/Gradient": self._derivative,
            "/ApplyJacobian": self._derivative,
            "/ApplyHessian": self._derivative,
        }
        app.add_routes(
            [web.post(route, self._asked(each)) for route, each in answers.items()]
        )
        app.add_routes([web.get("/Info", self._info)])
        return app

    def _asked(
        self, answer: Callable[[Body], Awaitable[dict[str, Any]]]
    ) -> Callable[[web.Request], Awaitable[web.Response]]:
        """Wrap a method: its question is read in time and checked, its answer written."""

        async def handle(request: web.Request) -> web.Response:
            try:
                async with asyncio.timeout(SLOW):
                    text = await request.read()
            except TimeoutError:
                raise Refusal("InvalidInput", f"not sent within {SLOW:g} s") from None
            return web.json_response(await answer(_body(text)))

        return handle

    async def _info(self, _: web.Request) -> web.Response:
        """Tell the protocol's version and the models' names."""
        return web.json_response(
            {"protocolVersion": VERSION, "models": list(self._models)}
        )

    async def _input_sizes(self, body: Body) -> dict[str, Any]:
        """Tell the sizes of the input vectors."""
        return {"inputSizes": self._model(body).input_sizes}

    async def _output_sizes(self, body: Body) -> dict[str, Any]:
        """Tell the sizes of the output vectors."""
        return {"outputSizes": self._model(body).output_sizes(body.config)}

    async def _model_info(self, body: Body) -> dict[str, Any]:
        """List a model's operations: no model has derivatives for all pairs of its vectors."""
        self._model(body)
        derivatives = dict.fromkeys(("Gradient", "ApplyJacobian", "ApplyHessian"), False)
        return {"support": {"Evaluate": True, **derivatives}}

    async def _evaluate(self, body: Body) -> dict[str, Any]:
        """Evaluate a model."""
        wanted, given = (
            self._model(body).input_sizes,
            [len(vector) for vector in body.input],
        )
        if given != wanted:
            raise Refusal(
                "InvalidInput", f"input: vectors of {given} numbers, wanted {wanted}"
            )
        output = await self._workers.ask(Call(body.name, body.input, body.config))
        numbers = [number for vector in output for number in vector if number is not None]
        if not all(map(math.isfinite, numbers)):
            raise Refusal(
                "InvalidOutput", f"{output}: not finite, and JSON has no such number"
            )
        return {"output": output}

    async def _derivative(self, body: Body) -> NoReturn:
        """Refuse derivatives, after a check of the indices."""
        model = self._model(body)
        sizes = len(model.output_sizes(body.config)), *(len(model.input_sizes),) * 3
        indices = body.out_wrt, body.in_wrt, body.in_wrt_1, body.in_wrt_2
        for name, index, size in zip(
            ("outWrt", "inWrt", "inWrt1", "inWrt2"), indices, sizes, strict=True
        ):
            if not 0 <= index < size:
                raise Refusal(
                    "InvalidInput", f"{name} = {index!r:.30}; allowed: 0 to {size - 1}"
                )
        raise Refusal("UnsupportedFeature", f"{model.name} has no derivatives")

    def _model(self, body: Body) -> Model:
        """Return the model that a question names."""
        if body.name not in self._models:
            known = ", ".join(self._models)
            raise Refusal(
                "ModelNotFound", f"no model {body.name!r:.100}; there is {known}"
            )
        return self._models[body.name]

    @web.middleware
    async def _own_only(
        self, request: web.Request, handler: Handler
    ) -> web.StreamResponse:
        """Refuse questions to a name that is not this server's, and those of foreign web pages.

        A web page that a user looks at can let its own name point to this machine ("DNS
        rebinding"), and would read our answers. An IP address in a question cannot be such a name.
        Without that it cannot read them, but could keep us busy: browsers name its origin.
        """
        given = request.headers.get("Host", "")
        try:
            name = urlsplit(f"//{given}").hostname or ""
            if self._hosts and name not in self._hosts:
                ipaddress.ip_address(name)
        except ValueError:
            known = ", ".join(self._hosts)
            raise Refusal("InvalidInput", f"Host {given!r:.100}: ask {known}") from None
        origin = request.headers.get("Origin")
        if origin is not None and origin.lower() != f"http://{given.lower()}":
            raise Refusal(
                "InvalidInput", f"Origin {origin!r:.100}: web pages may not ask"
            )
        return await handler(request)


def _body(text: bytes) -> Body:
    """Read the body of a question."""
    try:
        return Body.model_validate(json.loads(text, parse_constant=_refused))
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        place = ".".join(map(str, fault["loc"])) or "body"
        given = reprlib.repr(fault["input"])
        raise Refusal(
            "InvalidInput", f"{printable(place)} = {given}: {fault['msg']}"
        ) from None
    except (ValueError, RecursionError) as error:
        raise Refusal("InvalidInput", f"the body is not JSON: {error}") from None


def _refused(constant: str) -> NoReturn:
    """Refuse NaN, Infinity and -Infinity, which Python reads."""
    raise ValueError(constant)


@web.middleware
async def _in_words(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer errors as the protocol wants them: JSON with a type and a message."""
    try:
        return await handler(request)
    except Refusal as refusal:
        kind, message, status = refusal.kind, refusal.message, refusal.status
    except web.HTTPException as error:  # an unknown route, a body that is too large
        kind, message, status = (
            "InvalidInput",
            f"{request.path}: {error.reason}",
            error.status,
        )
    except Exception as error:
        logging.getLogger(__name__).exception("a bug")
        kind, message, status = (
            "ModelError",
            f"a bug of the server: {type(error).__name__}",
            500,
        )
    return web.json_response({"error": {"type": kind, "message": message}}, status=status)
