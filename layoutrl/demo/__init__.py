"""python -m layoutrl.demo [port=8765]

A page to furnish rooms on, at http://127.0.0.1:8765. Nothing leaves this machine.
"""

from __future__ import annotations

import socket
from importlib.util import find_spec

from layoutrl import InputError
from layoutrl.runs.commands import command
from layoutrl.runs.config import DemoConfig


def run(config: DemoConfig) -> None:
    """Serve the page until Ctrl-C. Raises InputError where the extra or the port is missing."""
    if missing := [name for name in ("starlette", "uvicorn") if find_spec(name) is None]:
        raise InputError(f"demo: {' and '.join(missing)} missing; in the checkout, pip install '.[demo]'")
    from layoutrl.demo.answers import Answers
    from layoutrl.demo.furnisher import staff_of
    from layoutrl.demo.server import serve

    with listening(config.port) as listener:
        serve(Answers(staff_of(config.search)), listener, config.timeout)


def listening(port: int) -> socket.socket:
    """Return a socket that listens on a port of 127.0.0.1. Raises InputError if the port cannot be used."""
    try:
        listener = socket.create_server(("127.0.0.1", port))
    except OSError as error:
        raise InputError(f"port: {port} cannot be had ({error.strerror}); expected a free one, as port=8766") from None
    # Connections inherit it. An answer is sent in two parts: the second would wait 40 ms for the ACK of the first.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener


main = command("demo", DemoConfig, run)
