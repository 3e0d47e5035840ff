"""The page's server, for this machine alone: JSON in, JSON out, and nothing kept in between.

It answers 127.0.0.1 and its own page only, and bounds bodies and times. No name that a client sends is a path.
"""

from __future__ import annotations

import asyncio
import json
import socket
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, nullcontext, suppress
from functools import partial
from importlib.resources import files
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from layoutrl import InputError
from layoutrl.demo.answers import LARGEST_LINE, Answers

LARGEST_FILE = 5_000_000  # bytes
LARGEST_HOME = 50_000_000  # bytes: most are models and textures, which nobody reads
MOST_FILES = 4  # that are received and read at once, for the sake of memory: others wait before they are received
LINE = LARGEST_LINE + 1  # bytes of the line of JSON above a home that is written back
LEFT = "Layoutrl-Left"  # header of a saved home: JSON of a message on rooms that it has as before, and their indices
KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def serve(answers: Answers, listener: socket.socket, timeout: float) -> None:
    """Serve the page at a socket until Ctrl-C; answers that take over `timeout` seconds are given up."""
    answers.warm()
    host, port = listener.getsockname()
    print(f"http://{host}:{port} shows the page; Ctrl-C ends it", flush=True)
    server_of(answers, listener, timeout).run([listener])


def server_of(answers: Answers, listener: socket.socket, timeout: float) -> uvicorn.Server:
    """Return the server of the page at a socket."""
    host, port = listener.getsockname()
    site = application(answers, f"{host}:{port}", timeout)
    return uvicorn.Server(uvicorn.Config(site, log_level="critical", access_log=False, server_header=False))


def application(answers: Answers, host: str, timeout: float) -> ASGIApp:
    """Return the ASGI app of the page at `host`, name:port; answers that take over `timeout` seconds are given up."""
    workers = Workers(timeout)

    async def begin(_: Request) -> Response:
        return said(answers.begin)

    async def read(request: Request) -> Response:
        asked = request.query_params
        work = partial(answers.read, unit=asked.get("unit", "auto"), called=asked.get("name", ""))
        return await workers.asking(work, "files")(request)

    async def home(request: Request) -> Response:
        work = partial(answers.home, called=request.query_params.get("name", ""))
        return await workers.asking(work, "files", LINE)(request)

    worker_of = {"look": "looks", "opening": "looks", "svg": "files"}
    asked: dict[str, Callable[[Request], Any]] = {
        question: workers.asking(partial(answers.answer, question), worker_of.get(question, "furnishes"))
        for question in answers.questions
    }
    routes = [Route("/" if name == "index.html" else f"/{name}", part) for name, part in page().items()]
    routes.append(Route("/api", begin))
    for name, answer in (asked | {"read": read, "home": home}).items():
        routes.append(Route(f"/api/{name}", answer, methods=["POST"]))
    handlers: Any = {HTTPException: lambda _, error: refused(error.status_code, f"address: {error.detail}")}
    handlers[ClientDisconnect] = lambda *_: refused(400, "body: it broke off")  # which nobody hears
    handlers[Exception] = lambda _, error: broken(error)
    return Guard(Starlette(routes=routes, lifespan=workers.lifespan, exception_handlers=handlers), host)


class Workers:
    """The threads that answer. They are separate: while a room is furnished, items can be dragged and files opened."""

    def __init__(self, timeout: float):
        self._timeout = timeout
        self._threads = {name: ThreadPoolExecutor(1, f"demo-{name}") for name in ("looks", "files", "furnishes")}
        self._places = asyncio.Semaphore(MOST_FILES)

    @asynccontextmanager
    async def lifespan(self, _: Starlette) -> Any:
        """Context of the app, at whose end the threads are let go."""
        yield
        for thread in self._threads.values():
            thread.shutdown(wait=False, cancel_futures=True)

    def asking(self, work: Callable[[bytes], Any], worker: str, line: int = 0) -> Callable[[Request], Any]:
        """Return what answers requests by `work` on their bodies, as `body_of` takes them, in the thread of a worker.

        An InputError is an answer, too; so is that the time is up.
        """

        async def answer(request: Request) -> Response:
            begun = False

            def begin_work(body: bytes) -> Any:
                nonlocal begun
                begun = True
                return work(body)

            try:
                return await asyncio.wait_for(self._answered(begin_work, worker, line, request), self._timeout)
            except InputError as error:
                error.__traceback__ = None  # it leads to the body and back to the error, so that both would stay
                return refused(400, str(error))
            except TimeoutError:  # a thread that has begun goes on, and the next answer waits for it
                took = "the answer" if begun else "what was asked before"
                mend = "fewer pieces or a smaller room" if begun else "to ask again"
                return refused(503, f"time: {took} took over {self._timeout:g} seconds; expected {mend}")

        return answer

    async def _answered(self, work: Callable[[bytes], Any], worker: str, line: int, request: Request) -> Response:
        async with self._places if worker == "files" else nullcontext():
            body = await body_of(request, line)
            return said(await asyncio.get_running_loop().run_in_executor(self._threads[worker], work, body))


def broken(error: Exception) -> Response:
    """Answer an unexpected error: its name goes to the page, its traceback to whoever runs the server."""
    traceback.print_exception(error)
    return refused(500, f"bug: {type(error).__name__}; the server goes on")


def page() -> dict[str, Callable[[Request], Any]]:
    """Return the function that answers with each file of the page, by name. The files are read once."""

    def showing(content: bytes, kind: str) -> Callable[[Request], Any]:
        async def show(_: Request) -> Response:
            return Response(content, media_type=kind)

        return show

    folder = files("layoutrl.demo") / "page"
    return {
        file.name: showing(file.read_bytes(), KINDS[file.name.rpartition(".")[2]])
        for file in folder.iterdir()
        if file.name.rpartition(".")[2] in KINDS
    }


async def body_of(request: Request, line: int) -> bytes:
    """Return the body of a request: a file, below a line of at most `line` bytes unless that is 0.

    Raises InputError as soon as it is too large. A home, which is a ZIP, may be larger than other files.
    """
    body, most = bytearray(), line + LARGEST_FILE
    async for part in request.stream():
        body += part
        if len(body) > most and body.startswith(b"PK", body.find(b"\n") + 1 if line else 0):
            most = line + LARGEST_HOME
        if len(body) > most:
            raise InputError(f"body: expected at most {most // 1_000_000} MB")
    return bytes(body)


def said(answer: Any) -> Response:
    """Respond with an answer as JSON; with the tuple of `Answers.home` as a file, what it has as before in a header."""
    if isinstance(answer, tuple):
        content, *left = answer
        headers = {LEFT: json.dumps(left)} if any(left) else {}
        return Response(content, headers=headers, media_type="application/octet-stream")
    return Response(json.dumps(answer, allow_nan=False), media_type="application/json")


def refused(status: int, line: str) -> Response:
    """What is wrong, as JSON."""
    return Response(json.dumps({"error": line}), status, media_type="application/json")


class Guard:
    """Middleware that lets only requests of this server's own page through, and adds security headers."""

    def __init__(self, inner: ASGIApp, host: str):
        self.inner = inner
        port = host.rpartition(":")[2]
        self.hosts = {host, f"localhost:{port}"}
        if port == "80":  # browsers leave it out
            self.hosts |= {name.rpartition(":")[0] for name in self.hosts}
        self.origins = {f"http://{name}" for name in self.hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.inner(scope, receive, send)
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        headers = Headers(scope=scope)
        if headers.get("host") not in self.hosts:
            await refused(403, "Host: expected this machine's own name")(scope, receive, with_headers)
        elif headers.get("origin", next(iter(self.origins))) not in self.origins:
            await refused(403, "Origin: expected the page of this server")(scope, receive, with_headers)
        else:
            with suppress(Exception):  # Starlette has answered it, and raises it again
                await self.inner(scope, receive, with_headers)
