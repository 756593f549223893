"""The protocol of UM-Bridge: routes of HTTP with JSON, which check every question."""

import json
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from aiohttp import web
from pydantic import BaseModel, Field, ValidationError

from asperity.serving.models import Model
from asperity.serving.questions import Vectors
from asperity.serving.workers import Call, Refusal, Workers

VERSION = 1.0
"""Version of the protocol."""

LARGEST = 2**20
"""Most bytes of a question, more than any has."""


class Body(BaseModel):
    """The body of a question; each route needs some of the keys."""

    name: str
    input: Vectors = Field(default=[])
    config: dict[str, Any] = Field(default={})
    out_wrt: int = Field(default=0, alias="outWrt")
    in_wrt: int = Field(default=0, alias="inWrt")
    sens: list[float] = Field(default=[])
    vec: list[float] = Field(default=[])


class Server:
    """The server's answers.

    Parameters
    ----------
    models : sequence of Model
        Models, whose names and sizes this process tells.
    workers : Workers
        Processes that evaluate them.
    """

    def __init__(self, models: Sequence[Model], workers: Workers) -> None:
        self._models = {model.name: model for model in models}
        self._workers = workers

    def app(self) -> web.Application:
        """Return the application of aiohttp."""
        app = web.Application(middlewares=[_in_words], client_max_size=LARGEST)
        answers = {
            "/InputSizes": self._input_sizes,
            "/OutputSizes": self._output_sizes,
            "/ModelInfo": self._model_info,
            "/Evaluate": self._evaluate,
            "/Gradient": self._gradient,
            "/ApplyJacobian": self._apply_jacobian,
            "/ApplyHessian": self._apply_hessian,
        }
        app.add_routes([web.post(route, _asked(answer)) for route, answer in answers.items()])
        app.add_routes([web.get("/Info", self._info)])
        return app

    async def _info(self, _: web.Request) -> web.Response:
        """Tell the protocol's version and the models' names."""
        return web.json_response({"protocolVersion": VERSION, "models": list(self._models)})

    async def _input_sizes(self, body: Body) -> dict[str, Any]:
        """Tell the sizes of the input vectors."""
        return {"inputSizes": self._model(body).input_sizes}

    async def _output_sizes(self, body: Body) -> dict[str, Any]:
        """Tell the sizes of the output vectors."""
        return {"outputSizes": self._model(body).output_sizes}

    async def _model_info(self, body: Body) -> dict[str, Any]:
        """Tell what a model can do."""
        derivatives = self._model(body).derivatives
        support = {"Evaluate": True, "Gradient": derivatives, "ApplyJacobian": derivatives}
        return {"support": {**support, "ApplyHessian": False}}

    async def _evaluate(self, body: Body) -> dict[str, Any]:
        """Evaluate a model."""
        self._require_inputs(body)
        arguments = body.input, body.config
        return {"output": await self._workers.ask(Call(body.name, "evaluate", arguments))}

    async def _gradient(self, body: Body) -> dict[str, Any]:
        """Multiply the sensitivity of an output by its derivative."""
        return {"output": await self._times_slope(body, body.sens, "sens")}

    async def _apply_jacobian(self, body: Body) -> dict[str, Any]:
        """Multiply a change of an input by the derivative of an output."""
        return {"output": await self._times_slope(body, body.vec, "vec")}

    async def _apply_hessian(self, body: Body) -> dict[str, Any]:
        """Refuse second derivatives."""
        raise Refusal("UnsupportedFeature", f"{self._model(body).name} has no second derivatives")

    async def _times_slope(self, body: Body, factor: list[float], name: str) -> list[float]:
        """Multiply a vector of one number by a derivative of one number by one number."""
        self._require_inputs(body)
        arguments = body.out_wrt, body.in_wrt, body.input, body.config
        slope = await self._workers.ask(Call(body.name, "slope", arguments))
        if len(factor) != 1:
            raise Refusal("InvalidInput", f"{name}: has {len(factor)} numbers, wanted 1")
        return [factor[0] * slope]

    def _model(self, body: Body) -> Model:
        """Return the model that a question names."""
        if body.name not in self._models:
            known = ", ".join(self._models)
            raise Refusal("ModelNotFound", f"no model {body.name!r:.100}; there is {known}")
        return self._models[body.name]

    def _require_inputs(self, body: Body) -> None:
        """Refuse inputs of other sizes than the model's."""
        wanted, given = self._model(body).input_sizes, [len(vector) for vector in body.input]
        if given != wanted:
            raise Refusal("InvalidInput", f"input: vectors of {given} numbers, wanted {wanted}")


def _asked(
    answer: Callable[[Body], Awaitable[dict[str, Any]]],
) -> Callable[[web.Request], Awaitable[web.Response]]:
    """Wrap a method of the server: its question is read and checked, its answer written."""

    async def handle(request: web.Request) -> web.Response:
        return web.json_response(await answer(_body(await request.read())))

    return handle


def _body(text: bytes) -> Body:
    """Read the body of a question."""
    try:
        return Body.model_validate(json.loads(text))
    except ValidationError as error:
        fault = error.errors()[0]
        place = ".".join(map(str, fault["loc"])) or "body"
        raise Refusal("InvalidInput", f"{place}: {fault['msg']}") from None
    except (ValueError, RecursionError) as error:
        raise Refusal("InvalidInput", f"the body is not JSON: {error}") from None


@web.middleware
async def _in_words(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer errors as the protocol wants them: JSON with a type and a message."""
    try:
        return await handler(request)
    except Refusal as refusal:
        kind, message = refusal.kind, refusal.message
        status = 500 if kind == "ModelError" else 400
    except web.HTTPException as error:  # an unknown route, a body that is too large
        kind, message, status = "InvalidInput", f"{request.path}: {error.reason}", error.status
    return web.json_response({"error": {"type": kind, "message": message}}, status=status)
