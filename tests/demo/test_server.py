"""The server answers its own page alone, in JSON whatever it is sent, within bounds, and goes on."""

from __future__ import annotations

import asyncio
import gc
import json
import random
import re
import socket
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from layoutrl import InputError
from layoutrl.benchmarks.serving import connected, visited, waited
from layoutrl.demo import listening
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.room import MAIN_ITEM
from tests.commands import PROJECT
from tests.demo.conftest import served
from tests.test_fuzz import as_json, mutated_bytes, mutated_document, times

for extra in ("starlette", "uvicorn"):
    pytest.importorskip(extra, reason="the extra demo is not installed")
httpx = pytest.importorskip("httpx", reason="httpx is not installed")

HOST = "127.0.0.1:8765"
ROOMS = [room_to_dict(design_rooms(room_type, "test", 5, 1).rooms[0]) for room_type in MAIN_ITEM]
Talk = Callable[[Any], Awaitable[Any]]


def talked(answers: Any, talk: Talk, timeout: float = 60) -> Any:
    """What a conversation with the server in this process comes to."""
    from layoutrl.demo.server import application

    async def whole() -> Any:
        transport = httpx.ASGITransport(app=application(answers, HOST, timeout))
        async with httpx.AsyncClient(transport=transport, base_url=f"http://{HOST}") as client:
            return await talk(client)

    return asyncio.run(whole())


def test_every_answer_tells_browsers_to_keep_to_this_page(answers):
    async def talk(client: Any) -> list[Any]:
        return [await client.get(path) for path in ("/", "/app.js", "/style.css", "/icon.svg", "/api", "/nowhere")]

    *found, missing = talked(answers, talk)
    assert [response.status_code for response in found] == [200] * 5
    assert missing.status_code == 404
    assert missing.json() == {"error": "address: Not Found"}
    for response in (*found, missing):
        policy = response.headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'")
        assert "unsafe" not in policy
        assert response.headers["x-content-type-options"] == "nosniff"


def test_the_page_needs_nothing_from_elsewhere():
    from layoutrl.demo.server import page

    folder = PROJECT / "layoutrl" / "demo" / "page"
    assert {*page()} == {file.name for file in folder.iterdir()}
    for file in folder.iterdir():
        text = file.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?://|@import|<script>|\son\w+=|\sstyle=|innerHTML", text), file.name


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/%2e%2e/pyproject.toml", "/api/../../x", "/page/app.js", "//etc/passwd"]
)
def test_no_name_is_a_path(answers, path):
    async def talk(client: Any) -> Any:
        return await client.get(path)

    assert talked(answers, talk).status_code == 404


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"host": "localhost:8765"}, 200),
        ({"origin": "http://127.0.0.1:8765"}, 200),
        ({"host": "evil.example"}, 403),
        ({"host": "127.0.0.1"}, 403),
        ({"host": "127.0.0.1:80"}, 403),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": "https://127.0.0.1:8765"}, 403),
    ],
)
def test_only_this_machines_own_page_is_answered(answers, headers, status):
    async def talk(client: Any) -> list[Any]:
        return [
            await client.get("/api", headers=headers),
            await client.post("/api/look", json={"room": ROOMS[0]}, headers=headers),
        ]

    for response in talked(answers, talk):
        assert response.status_code == status
        assert (status == 200) == ("error" not in response.json())


def test_on_the_port_of_the_web_browsers_leave_out_the_port():
    from layoutrl.demo.server import Guard

    guard = Guard(None, "127.0.0.1:80")
    assert guard.hosts == {"127.0.0.1:80", "localhost:80", "127.0.0.1", "localhost"}
    assert "http://localhost" in guard.origins


def test_large_bodies_are_refused_before_they_are_read(answers):
    sent = 0

    async def parts() -> Any:
        nonlocal sent
        for _ in range(100):
            sent += 1
            yield b"[" * 200_000

    async def talk(client: Any) -> Any:
        return await client.post("/api/read", content=parts())

    response = talked(answers, talk)
    assert (response.status_code, response.json()) == (400, {"error": "body: expected at most 5 MB"})
    assert sent < 50


def test_a_file_is_read_in_a_unit_that_is_known(answers):
    units = ("auto", "m", "../in", "\n", "")

    async def talk(client: Any) -> list[Any]:
        asked = [client.post("/api/read", params={"unit": unit}, json=ROOMS[0]) for unit in units]
        return [await response for response in asked]

    *known, other, line, empty = talked(answers, talk)
    assert [response.status_code for response in known] == [200, 200]
    for response, got in ((other, "'../in'"), (line, r"'\n'"), (empty, "''")):
        assert response.status_code == 400
        assert response.json() == {"error": f"unit: expected one of auto, m, cm, mm, in, ft; got {got}"}


def test_a_home_that_can_be_read_is_taken_below_a_line_on_its_rooms(answers):
    rooms = json.dumps({"room": ROOMS[0], "others": []}).encode()

    async def talk(client: Any) -> list[Any]:
        return [await client.post("/api/home", content=rooms + b"\n" + size * b"P") for size in (5_000_000, 25_000_000)]

    largest, larger = (response.json()["error"] for response in talked(answers, talk))
    assert "body" not in largest
    assert larger == "body: expected at most 25 MB"


def test_homes_may_be_larger_than_what_is_no_zip(answers):
    line = json.dumps({"room": ROOMS[0]}).encode() + b"\n"
    asked = [("look", b"", 5), ("read", b"", 5), ("read", b"PK", 50), ("home", line, 25), ("home", line + b"PK", 70)]

    async def talk(client: Any) -> list[Any]:
        sizes = (0, 1_000_000)  # beyond
        return [
            [await client.post(f"/api/{what}", content=begin.ljust(most * 1_000_000 + more, b" ")) for more in sizes]
            for what, begin, most in asked
        ]

    for (_, _, most), (largest, larger) in zip(asked, talked(answers, talk), strict=True):
        assert "body" not in largest.json()["error"]
        assert larger.json() == {"error": f"body: expected at most {most} MB"}


def test_files_wait_for_their_turn_before_they_are_received(answers, monkeypatch):
    monkeypatch.setattr("layoutrl.demo.server.MOST_FILES", 1)
    received, begun, release = [], asyncio.Event(), asyncio.Event()

    async def first() -> Any:
        yield b"["
        begun.set()
        await release.wait()
        yield b"]"

    async def second() -> Any:
        received.append("second")
        yield json.dumps(ROOMS[0]).encode()

    async def talk(client: Any) -> list[Any]:
        one = asyncio.create_task(client.post("/api/read", content=first()))
        await begun.wait()
        other = asyncio.create_task(client.post("/api/read", content=second()))
        assert (await client.post("/api/look", json={"room": ROOMS[0]})).status_code == 200  # which is no file
        assert not received
        release.set()
        return [await one, await other]

    assert [response.status_code for response in talked(answers, talk)] == [400, 200]


def test_what_was_refused_is_not_kept_until_garbage_is_collected(answers, monkeypatch):
    kept = []

    def refuses(_: bytes) -> None:
        held = threading.Event()
        kept.append(weakref.ref(held))
        raise InputError("no")

    async def talk(client: Any) -> Any:
        return await client.post("/api/look", json={"room": ROOMS[0]})

    monkeypatch.setitem(answers.questions, "look", refuses)
    gc.disable()
    try:
        assert talked(answers, talk).json() == {"error": "no"}
        assert kept[0]() is None
    finally:
        gc.enable()


def test_an_answer_that_takes_long_is_given_up_and_others_go_on(answers, monkeypatch):
    release = threading.Event()
    monkeypatch.setitem(answers.questions, "furnish", lambda _: release.wait(10))

    async def talk(client: Any) -> Any:
        late = asyncio.create_task(client.post("/api/furnish", json={"room": {}}))
        others = [await client.post(f"/api/{what}", json={"room": room}) for what in ("look", "svg") for room in ROOMS]
        return await late, others, await client.post("/api/furnish", json={"room": {}})

    late, others, later = talked(answers, talk, timeout=0.5)
    release.set()
    assert (late.status_code, later.status_code) == (503, 503)
    assert late.json()["error"] == "time: the answer took over 0.5 seconds; expected fewer pieces or a smaller room"
    assert later.json()["error"] == "time: what was asked before took over 0.5 seconds; expected to ask again"
    assert {response.status_code for response in others} == {200}


def test_a_bug_is_a_line_and_no_traceback(answers, monkeypatch):
    monkeypatch.setitem(answers.questions, "look", lambda _: 1 / 0)

    async def talk(client: Any) -> list[Any]:
        return [await client.post("/api/look", json={"room": ROOMS[0]}), await client.get("/api")]

    broken, still = talked(answers, talk)
    assert broken.status_code == 500
    assert broken.json()["error"].startswith("bug: ZeroDivisionError")
    assert still.status_code == 200


@times(200, 1000)
def test_bad_bodies_are_answered_in_json(answers, count):
    dice = random.Random(1)

    def bad() -> tuple[str, bytes]:
        question = dice.choice(
            ("look", "look", "opening", "furnish", "values", "moves", "svg", "read", "read?unit=in", "home")
        )
        document: Any = json.loads(json.dumps(dice.choice(ROOMS)))
        if not question.startswith("read"):
            document = {"room": document, "item": 0, "movable": [0, 1], "kind": "door", "at": [1, 0], "width": 0.9}
        if dice.random() < 0.6:
            return question, as_json(mutated_document(document, dice), dice)
        return question, mutated_bytes(json.dumps(document).encode(), dice)

    async def talk(client: Any) -> tuple[list[Any], Any]:
        responses = []
        for _ in range(count):
            question, content = bad()
            responses.append((question, content, await client.post(f"/api/{question}", content=content)))
        return responses, await client.post("/api/look", json={"room": ROOMS[0]})

    responses, still = talked(answers, talk)
    refused = 0
    for question, content, response in responses:
        about = f"{question} {content[:500]!r}: {response.text[:500]}"
        assert response.status_code in (200, 400), about
        if response.status_code == 400:
            refused += 1
            line = response.json()["error"]
            assert line, about
            assert "\n" not in line, about
            assert "Traceback" not in line, about
    assert refused > count / 2
    assert still.status_code == 200


def test_bad_requests_over_the_socket_leave_it_serving(answers):
    with served(answers) as address:
        host, port = address.removeprefix("http://").split(":")
        long = b"POST /api/look HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n{"
        for content in (b"", b"\x00" * 1000, b"GET / HTTP/1.1\r\n\r\n", long, b"GET " + b"x" * 70_000):
            with socket.create_connection((host, int(port))) as connection:
                connection.sendall(content)
        for content in (b"{", b"[]", b"null", b'{"room": 1}', b"\xff\xfe", b"[" * 100_000):
            response = httpx.post(f"{address}/api/look", content=content)
            assert response.status_code == 400
            assert response.json()["error"]
        assert httpx.post(f"{address}/api/look", json={"room": ROOMS[0]}).status_code == 200


def test_who_goes_before_all_is_said_or_answered_is_no_bug(answers, capsys):
    body = json.dumps({"room": ROOMS[0]}).encode()
    with served(answers) as address:
        host, port = address.removeprefix("http://").split(":")
        for what in ("look", "furnish", "read", "home"):
            head = f"POST /api/{what} HTTP/1.1\r\nHost: {host}:{port}\r\n"
            for begin, sent in (
                (f"{head}Content-Length: {len(body)}\r\n\r\n", body[:99]),
                (f"{head}Content-Length: {len(body)}\r\n\r\n", body),
                (f"{head}Transfer-Encoding: chunked\r\n\r\n", b"5\r\n{"),
            ):
                with socket.create_connection((host, int(port))) as connection:
                    connection.sendall(begin.encode() + sent)
                    time.sleep(0.05)  # so that the server has begun
        assert httpx.post(f"{address}/api/look", json={"room": ROOMS[0]}).status_code == 200
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")


def test_fifty_at_once_are_all_answered(answers):
    def furnished(port: int, look: dict[str, Any]) -> float:
        with connected(port) as connection:
            return waited(connection, "furnish", look | {"movable": [0]})

    with served(answers) as address, ThreadPoolExecutor(50) as clients:
        port = int(address.rpartition(":")[2])
        looks = [{"room": ROOMS[k % len(ROOMS)], "item": 0} for k in range(50)]
        asked = [clients.submit(visited, port, look) for look in looks]
        asked += [clients.submit(furnished, port, look) for look in looks[:8]]
    assert all(done.result() for done in asked)


def test_a_port_that_is_taken_is_said_in_a_line():
    with listening(0) as listener:
        port = listener.getsockname()[1]
        assert listener.getsockname()[0] == "127.0.0.1"
        with pytest.raises(InputError, match=f"port: {port} cannot be had"):
            listening(port)


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as POSIX has it")
def test_no_part_of_an_answer_waits_for_word_of_another():
    with listening(0) as listener, socket.create_connection(listener.getsockname()):
        connection, _ = listener.accept()
        with connection:
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_the_command_serves_until_it_is_interrupted():
    command = [sys.executable, "-m", "layoutrl.demo", "port=0"]
    with subprocess.Popen(command, cwd=PROJECT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = line.split(" ")[0]
        assert httpx.get(address).status_code == 200
        process.send_signal(2)
        _, said = process.communicate(timeout=30)
    assert "Traceback" not in said
