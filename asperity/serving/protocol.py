"""The protocol of UM-Bridge: HTTP routes that take and return JSON, and check every question."""

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
"""Handler of a request in aiohttp."""

VERSION = 1.0
"""Version of the protocol that the server speaks."""

LARGEST = 2**20
"""Largest size of a question [bytes]; useful questions are far smaller."""

SLOW = 60.0
"""Time that a client has to send a question, and after which a silent connection is closed [s]."""


class Body(BaseModel):
    """The body of a question, of which each route uses some keys.

    Numbers have to be JSON numbers: "1" and true are refused.
    """

    model_config = ConfigDict(strict=True)

    name: str  # of the model
    input: Vectors = Field(default=[])
    config: Configuration = Field(default=Configuration())
    # Indices of the output vector of a derivative, and of the input vectors: one, or two of a
    # second derivative.
    out_wrt: int = Field(default=0, alias="outWrt")
    in_wrt: int = Field(default=0, alias="inWrt")
    in_wrt_1: int = Field(default=0, alias="inWrt1")
    in_wrt_2: int = Field(default=0, alias="inWrt2")


class Server:
    """The answers to questions: names and sizes of models from this process, values from workers.

    Parameters
    ----------
    models : sequence of Model
        The models, with different names.
    workers : Workers
        The processes that evaluate the models.
    hosts : collection of str
        Names of this server, in lower case, under which questions are answered. Questions to IP
        addresses are answered too. Without names all questions are answered.
    """

    def __init__(
        self, models: Sequence[Model], workers: Workers, hosts: Collection[str] = ()
    ) -> None:
        self._models = {model.name: model for model in models}
        self._workers = workers
        self._hosts = hosts

    def app(self) -> web.Application:
        """Return the application of aiohttp with all routes of the protocol."""
        app = web.Application(
            middlewares=[_errors_as_json, self._refuse_foreign], client_max_size=LARGEST
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
            [web.post(route, _handler(answer)) for route, answer in answers.items()]
        )
        app.add_routes([web.get("/Info", self._info)])
        return app

    async def _info(self, _: web.Request) -> web.Response:
        """Answer with the protocol's version and the names of the models."""
        return web.json_response(
            {"protocolVersion": VERSION, "models": list(self._models)}
        )

    async def _input_sizes(self, body: Body) -> dict[str, Any]:
        """Answer with the sizes of the input vectors."""
        return {"inputSizes": self._model(body).input_sizes}

    async def _output_sizes(self, body: Body) -> dict[str, Any]:
        """Answer with the sizes of the output vectors under the client's settings."""
        return {"outputSizes": self._model(body).output_sizes(body.config)}

    async def _model_info(self, body: Body) -> dict[str, Any]:
        """Answer which operations a model supports: evaluation alone.

        No model has derivatives for all pairs of its vectors.
        """
        self._model(body)  # refuses an unknown model
        derivatives = dict.fromkeys(("Gradient", "ApplyJacobian", "ApplyHessian"), False)
        return {"support": {"Evaluate": True, **derivatives}}

    async def _evaluate(self, body: Body) -> dict[str, Any]:
        """Answer with the output of a model, which a worker evaluates.

        Raises Refusal for vectors of wrong sizes, for an output that is not finite, and as
        `Workers.ask` does.
        """
        input_sizes = self._model(body).input_sizes
        sizes = [len(vector) for vector in body.input]
        if sizes != input_sizes:
            raise Refusal(
                "InvalidInput", f"input: vectors of {sizes} numbers, wanted {input_sizes}"
            )
        output = await self._workers.ask(Call(body.name, body.input, body.config))
        for vector in output:
            for number in vector:
                if number is not None and not math.isfinite(number):
                    raise Refusal(
                        "InvalidOutput",
                        f"{output}: not finite, and JSON has no such number",
                    )
        return {"output": output}

    async def _derivative(self, body: Body) -> NoReturn:
        """Refuse a derivative: for a wrong index, or else because no model has derivatives."""
        model = self._model(body)
        inputs = len(model.input_sizes)
        outputs = len(model.output_sizes(body.config))
        _require_index("outWrt", body.out_wrt, outputs)
        _require_index("inWrt", body.in_wrt, inputs)
        _require_index("inWrt1", body.in_wrt_1, inputs)
        _require_index("inWrt2", body.in_wrt_2, inputs)
        raise Refusal("UnsupportedFeature", f"{model.name} has no derivatives")

    def _model(self, body: Body) -> Model:
        """Return the model that a question names; refuse an unknown one."""
        if body.name not in self._models:
            names = ", ".join(self._models)
            raise Refusal(
                "ModelNotFound", f"no model {body.name!r:.100}; there is {names}"
            )
        return self._models[body.name]

    @web.middleware
    async def _refuse_foreign(
        self, request: web.Request, handler: Handler
    ) -> web.StreamResponse:
        """Refuse questions to a name that is not this server's, and questions of web pages.

        A web page that a user looks at can let the page's own name point to this machine ("DNS
        rebinding"), and would then read the answers. This name is in the header "Host" of the
        question. An IP address cannot be made to point elsewhere, and is allowed. A page that
        cannot read the answers could still keep the server busy: browsers name the page in the
        header "Origin".
        """
        host = request.headers.get("Host", "")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            if self._hosts and name not in self._hosts:
                ipaddress.ip_address(name)  # raises ValueError for all but IP addresses
        except ValueError:
            names = ", ".join(self._hosts)
            raise Refusal("InvalidInput", f"Host {host!r:.100}: ask {names}") from None
        origin = request.headers.get("Origin")
        # A page of this server itself may ask.
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            raise Refusal(
                "InvalidInput", f"Origin {origin!r:.100}: web pages may not ask"
            )
        return await handler(request)


def _require_index(key: str, index: int, size: int) -> None:
    """Refuse an index, given under a key of the body, that is not between 0 and `size` - 1."""
    if not 0 <= index < size:
        raise Refusal("InvalidInput", f"{key} = {index!r:.30}; allowed: 0 to {size - 1}")


def _handler(
    answer: Callable[[Body], Awaitable[dict[str, Any]]],
) -> Callable[[web.Request], Awaitable[web.Response]]:
    """Return the handler of a route, which reads a question, checks it, and writes the answer.

    `answer` takes the body of a question, and returns the body of its answer as a dictionary for
    JSON. The handler refuses a question that is not sent within `SLOW`.
    """

    async def handle(request: web.Request) -> web.Response:
        """Answer one question."""
        try:
            async with asyncio.timeout(SLOW):
                text = await request.read()
        except TimeoutError:
            raise Refusal("InvalidInput", f"not sent within {SLOW:g} s") from None
        return web.json_response(await answer(_body(text)))

    return handle


def _body(text: bytes) -> Body:
    """Parse the body of a question; refuse a body that is no JSON, or has a wrong value."""
    try:
        return Body.model_validate(json.loads(text, parse_constant=_refuse_constant))
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        place = ".".join(map(str, fault["loc"])) or "body"
        value = reprlib.repr(fault["input"])
        raise Refusal(
            "InvalidInput", f"{printable(place)} = {value}: {fault['msg']}"
        ) from None
    except (ValueError, RecursionError) as error:
        raise Refusal("InvalidInput", f"the body is not JSON: {error}") from None


def _refuse_constant(constant: str) -> NoReturn:
    """Refuse NaN, Infinity and -Infinity, which Python reads and JSON does not have."""
    raise ValueError(constant)


@web.middleware
async def _errors_as_json(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Turn errors of a handler into answers of the protocol: JSON with a type and a message.

    Errors that are no refusals are bugs, which are also logged with their tracebacks.
    """
    try:
        return await handler(request)
    except Refusal as refusal:
        return _error(refusal.kind, refusal.message, refusal.status)
    except web.HTTPException as error:  # aiohttp's: an unknown route, or too large a body
        message = f"{request.path}: {error.reason}"
        return _error("InvalidInput", message, error.status)
    except Exception as error:
        logging.getLogger(__name__).exception("a bug")
        return _error("ModelError", f"a bug of the server: {type(error).__name__}", 500)


def _error(kind: str, message: str, status: int) -> web.Response:
    """Return the answer for an error with its type in the protocol, one line, and HTTP status."""
    return web.json_response({"error": {"type": kind, "message": message}}, status=status)
