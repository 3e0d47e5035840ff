"""What the tests of the page in a real browser have in common: Chromium, found by ids and roles."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from layoutrl.benchmarks.serving import browser_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_to_dict

for extra in ("starlette", "uvicorn"):
    pytest.importorskip(extra, reason="the extra demo is not installed")
playwright = pytest.importorskip("playwright.sync_api", reason="no playwright: the page is not tried in a browser")
CHROMIUM = browser_of()
if CHROMIUM is None:
    pytest.skip("no Chromium: the page is not tried in a browser", allow_module_level=True)
expect = playwright.expect
expect.set_options(timeout=60_000)
Page = Any
OWN = room_to_dict(design_rooms("study", "test", 8, 1).rooms[0]) | {"id": "my own study"}
SQUARE = {
    "id": "square", "room_type": "study", "outline": [[0, 0], [3, 0], [3, 3], [0, 3]], "windows": [],
    "doors": [{"polygon": [[1, -0.2], [2, -0.2], [2, 0], [1, 0]]}],
    "furniture": [{"category": "stool", "size": [0.5, 0.5], "center": [1.5, 1.5]}],
}  # fmt: skip
DROP = """text => {
  const data = new DataTransfer();
  data.items.add(new File([text], "room.json"));
  document.body.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
}"""
PRESS = """keys => {
  for (const key of keys) document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
}"""  # sooner than the server can answer


def visited(browser: Any, address: str, **looks: Any) -> Iterator[Page]:
    """The page, as it is first shown; it may say nothing in the browser's console, and ask nobody else."""
    context = browser.new_context(**{"viewport": {"width": 1200, "height": 900}} | looks)
    context.set_default_timeout(60_000)
    page, said, asked = context.new_page(), [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(address)
    settled(page)
    yield page
    context.close()
    assert all(url.startswith((address.split("#")[0], "blob:")) and "#room" not in url for url in asked)
    assert not [line for line in said if "status of 400" not in line]  # which Chromium says of every such answer


def settled(page: Page) -> None:
    """Wait until the page shows what is wrong with what it shows, and no other choices are being found."""
    expect(page.locator("body")).to_have_attribute("data-state", "idle")
    expect(page.locator("#plan")).to_have_attribute("aria-busy", "false")
    expect(page.locator("#choices")).to_have_attribute("aria-busy", "false")


def room_of(page: Page) -> dict[str, Any]:
    """The room that the page shows, as it saves it but for what is locked."""
    document = json.loads(saved(page, "json"))
    rooms = document if isinstance(document, list) else [document]
    shown = page.locator("#title").get_attribute("data-room")
    (room,) = (room for room in rooms if room["id"] == shown)
    return room | {
        "furniture": [{name: entry[name] for name in entry if name != "locked"} for entry in room["furniture"]]
    }


def saved(page: Page, kind: str) -> bytes:
    return Path(download(page, kind).path()).read_bytes()


def download(page: Page, kind: str) -> Any:
    page.locator("#saving").evaluate("node => { node.open = true }")
    with page.expect_download() as begun:
        page.locator(f"#save-{kind}").click()
    assert begun.value.suggested_filename.endswith(f".{kind}")
    return begun.value


def item(page: Page, name: str, number: int = 0) -> Any:
    """A piece of furniture in the plan."""
    return page.locator("#plan").get_by_role("button", name=re.compile(f"^{name}")).nth(number)


def take(page: Page, name: str, number: int = 0) -> Any:
    """Choose a room of the gallery."""
    page.locator("#gallery").get_by_role("button", name=name).nth(number).click()
    expect(page.locator("#title")).to_contain_text(name)
    settled(page)


def shown(page: Page, room: dict[str, Any]) -> None:
    """Drop a room on the page, which shows it then."""
    page.evaluate(DROP, json.dumps(room))
    expect(page.locator("#title")).to_have_attribute("data-room", room["id"])
    settled(page)


def middle(target: Any) -> tuple[float, float]:
    while (box := target.bounding_box()) is None:  # it is being drawn anew
        expect(target).to_be_visible()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page: Page, what: Any, dx: float, dy: float) -> None:
    """By so many metres, y up."""
    x, y = middle(what)
    scale = page.evaluate("document.querySelector('#plan').getScreenCTM().a")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + dx * scale / 2, y - dy * scale / 2)
    page.mouse.move(x + dx * scale, y - dy * scale)


def dragged(page: Page, what: Any, dx: float, dy: float) -> None:
    drag(page, what, dx, dy)
    page.mouse.up()
    settled(page)


def corner(page: Page, x: float, y: float) -> tuple[float, float]:
    """Where a point in metres is on the screen."""
    page.locator("#plan").evaluate("plan => plan.scrollIntoView({ block: 'center' })")
    return tuple(
        page.evaluate(
            "([x, y]) => { const p = new DOMPoint(x, -y).matrixTransform(document.querySelector('#plan')"
            ".getScreenCTM()); return [p.x, p.y] }",
            [x, y],
        )
    )


def drawn(page: Page, corners: Sequence[tuple[float, float]]) -> None:
    """Draw an outline, and close it."""
    page.locator("#building").evaluate("node => { node.open = true }")
    page.locator("#draw").click()
    for x, y in corners:
        page.mouse.click(*corner(page, x, y))
    expect(page.locator("#plan .corner")).to_have_count(len(corners))
    page.mouse.click(*corner(page, *corners[0]))
    expect(page.locator("#plan .corner")).to_have_count(0)
    settled(page)


def until(page: Page, holds: Callable[[], Any]) -> None:
    """Wait until something holds, a minute at most."""
    last = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < last
        page.wait_for_timeout(10)


def is_left(page: Page) -> bool:
    """Whether who leaves the page is not asked first."""
    return page.evaluate("dispatchEvent(new Event('beforeunload', { cancelable: true }))")


def openly(page: Page, content: bytes, room: str, name: str = "file.sh3d") -> None:
    """Open a file, of which that room is shown."""
    page.locator("#saving").evaluate("node => { node.open = true }")
    count = page.locator("#gallery li").count()
    page.locator("#file").set_input_files({"name": name, "mimeType": "application/zip", "buffer": content})
    expect(page.locator("#gallery li").nth(count)).to_be_attached()
    expect(page.locator("#title")).to_have_attribute("data-room", room)
    settled(page)
