"""How fast a server of the demo answers on this machine: a client that drags, many clients, many answers in a row."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from http.client import HTTPConnection, HTTPException
from importlib.util import find_spec
from statistics import median
from typing import Any

import torch

from layoutrl import InputError
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.room import Room
from layoutrl.runs import pretrained
from layoutrl.runs.config import BenchConfig
from layoutrl.runs.machine import resident_bytes

CHROMIUM = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")  # the first takes half the time
ASKED = 10  # rooms that are furnished, for the time to the first move
ANSWERS = 3  # times that each of many clients asks


def check_served(config: BenchConfig) -> None:
    """Raise InputError if the server's packages are not installed, or no agent in the package furnishes the rooms."""
    if lacking := [name for name in ("starlette", "uvicorn") if find_spec(name) is None]:
        raise InputError(f"parts: demo needs {' and '.join(lacking)}; in the checkout, pip install '.[demo]'")
    pretrained.agent(config.room.type, torch.device("cpu"))


def serving(config: BenchConfig, rooms: Sequence[Room], _: Sequence[Room], __: torch.device) -> dict[str, Any]:
    """Measure answers a second, time to first picture and move, many clients at once, and memory over many answers.

    The picture needs Chromium and playwright; it is left out without them.
    """
    looks: list[dict[str, Any]] = [{"room": room_to_dict(room), "item": 0} for room in rooms]
    # The page's first question: for one layout, which it plays while the others are found.
    furnishing = [
        look | {"movable": list(range(len(look["room"]["furniture"]))), "choices": 1}
        for look in looks[: min(ASKED, config.requests)]
    ]
    with served() as (process, port):
        with connected(port) as connection:
            waited(connection, "furnish", furnishing[0])  # not timed: it waits until the agent is loaded
        picture = {} if (seconds := first_picture(port)) is None else {"picture_seconds": seconds}
        with connected(port) as connection:
            moves = [waited(connection, "furnish", asked) for asked in furnishing]
            before = resident_bytes(process.pid)
            began = time.perf_counter()
            answers = [waited(connection, "look", looks[k % len(looks)]) for k in range(config.requests)]
            a_second = config.requests / (time.perf_counter() - began)
            after = resident_bytes(process.pid)
        with ThreadPoolExecutor(config.clients) as clients:
            found = list(clients.map(lambda k: visited(port, looks[k % len(looks)]), range(config.clients)))
    slowest = [max(seconds) for seconds in found if seconds]
    memory = (
        {}
        if before is None or after is None
        else {"megabytes": {f"after {config.requests} answers": after / 1e6, "before": before / 1e6}}
    )
    return (
        picture
        | {
            "move_seconds": median(moves),
            "look_milliseconds": 1000 * median(answers),
            "looks_a_second": a_second,
            "share_answered": len(slowest) / config.clients,
            "slowest_seconds": max(slowest, default=None),
        }
        | memory
    )


def connected(port: int) -> closing[HTTPConnection]:
    """A connection to the server, for as long as a `with` lasts."""
    return closing(HTTPConnection("127.0.0.1", port, timeout=120))


def waited(connection: HTTPConnection, question: str, asked: dict[str, Any]) -> float:
    """Return the seconds that an answer takes. Raises InputError if it is an error, and OSError if none comes."""
    body, began = json.dumps(asked), time.perf_counter()
    connection.request("POST", f"/api/{question}", body, {"Content-Type": "application/json"})
    response = connection.getresponse()
    said = response.read()
    if response.status != 200:
        raise InputError(f"the demo answered {question} with {response.status} {said[:200]!r}; expected an answer")
    return time.perf_counter() - began


def visited(port: int, look: dict[str, Any]) -> list[float] | None:
    """Return the seconds that a client waits for each of ANSWERS answers; None if one of them fails."""
    try:
        with connected(port) as connection:
            return [waited(connection, "look", look) for _ in range(ANSWERS)]
    except (InputError, OSError, HTTPException):
        return None


@contextmanager
def served() -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run a server in a process of its own; yield the process and its port."""
    command = [sys.executable, "-m", "layoutrl.demo", "port=0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            if not (found := re.search(r"127\.0\.0\.1:(\d+)", process.stdout.readline())):
                raise InputError("demo: the server did not begin; python -m layoutrl.demo says why")
            yield process, int(found[1])
        finally:
            process.terminate()


def first_picture(port: int) -> float | None:
    """Seconds until a browser that is running shows the furniture of the first room; None without a browser."""
    if (chromium := browser_of()) is None or find_spec("playwright") is None:
        return None
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page()
        began = time.perf_counter()
        page.goto(f"http://127.0.0.1:{port}")
        page.wait_for_selector("#plan .item")
        seconds = time.perf_counter() - began
        browser.close()
    return seconds


def browser_of() -> str | None:
    """The path of Chromium, if there is one."""
    return next(filter(None, map(shutil.which, CHROMIUM)), None)
