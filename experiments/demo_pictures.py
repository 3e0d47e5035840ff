"""Screenshots of the demo in six states, for docs/demo.md:

    python experiments/demo_pictures.py [docs/figures]

Needs Chromium, and the extras demo and dev.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from kept import parser_of

from layoutrl import InputError
from layoutrl.benchmarks.serving import CHROMIUM, browser_of, served
from layoutrl.runs.commands import answers_errors

if TYPE_CHECKING:
    from playwright.sync_api import Page

DESK = {"width": 1200, "height": 860}
PHONE = {"width": 390, "height": 844}
OUTLINE = ((1, 1), (5, 1), (5, 3.2), (3.6, 3.2), (3.6, 4.6), (1, 4.6))


def settled(page: Page) -> None:
    """Wait until the page has found the faults of the layout on show, and all further choices."""
    for part in ("body[data-state=idle]", "#plan[aria-busy=false]", "#choices[aria-busy=false]"):
        page.locator(part).wait_for(state="attached")


def screen(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return the position on the screen, in pixels, of a point in metres."""
    where = page.evaluate(
        "([x, y]) => { const p = new DOMPoint(x, -y).matrixTransform(document.querySelector('#plan').getScreenCTM());"
        " return [p.x, p.y] }",
        [x, y],
    )
    return where[0], where[1]


def chosen(page: Page, room: str) -> None:
    """Take the first room of a type from the gallery."""
    page.locator("#gallery").get_by_role("button", name=room).first.click()
    page.locator("#title", has_text=room).wait_for()
    settled(page)


def begun(page: Page) -> None:
    """Show a room of the gallery."""
    chosen(page, "bedroom")


def furnished(page: Page) -> None:
    """Furnish a room, and show the choices."""
    chosen(page, "living room")
    page.locator("#furnish").click()
    settled(page)


def dragging(page: Page) -> None:
    """Drag an item until a fault and measurements show."""
    chosen(page, "bedroom")
    box = page.locator("#plan").get_by_role("button", name="bed").first.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 40, y + 20)
    page.mouse.move(x - 90, y + 45)
    page.locator("#plan .metres").first.wait_for(state="attached")
    settled(page)


def drawing(page: Page) -> None:
    """Draw an outline on the grid, up to its last corner."""
    page.locator("#building summary").click()
    page.locator("#kind").select_option("living_room")
    settled(page)
    page.locator("#draw").click()
    for x, y in OUTLINE[:5]:
        page.mouse.click(*screen(page, x, y))
    page.mouse.move(*screen(page, *OUTLINE[5]))


def own(page: Page) -> None:
    """Close the outline, add a door, a window and the usual furniture, and furnish the room."""
    drawing(page)
    page.mouse.click(*screen(page, *OUTLINE[5]))
    page.locator("#close").click()
    settled(page)
    for kind, x, y in (("door", 2.9, 4.6), ("window", 2.5, 1.0)):
        page.locator(f"#{kind}").click()
        page.mouse.click(*screen(page, x, y))
        settled(page)
    page.locator("#usual").click()
    settled(page)
    page.locator("#furnish").click()
    settled(page)
    page.evaluate("scrollTo(0, 0)")


def phone(page: Page) -> None:
    """Choose a table by a tap, as on a phone."""
    chosen(page, "dining room")
    page.locator("#plan").get_by_role("button", name="table").first.tap()
    settled(page)


STATES: dict[str, tuple[Any, dict[str, Any]]] = {
    "begin": (begun, {"viewport": DESK}),
    "choices": (furnished, {"viewport": DESK | {"height": 1060}}),
    "faults": (dragging, {"viewport": DESK}),
    "draw": (drawing, {"viewport": DESK}),
    "own": (own, {"viewport": DESK | {"height": 1060}, "color_scheme": "dark"}),
    "phone": (phone, {"viewport": PHONE, "color_scheme": "dark", "has_touch": True, "is_mobile": True}),
}


@answers_errors()
def main() -> None:
    """Write one PNG for each state."""
    parser = parser_of(__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("docs/figures"))
    folder = parser.parse_args().folder
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise InputError(
            "playwright: expected it to be installed, as by pip install '.[dev]' in the checkout"
        ) from None
    if (chromium := browser_of()) is None:
        raise InputError(f"no browser; expected one of {', '.join(CHROMIUM)}")
    with served() as (_, port), sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name, (state, looks) in STATES.items():
            page = browser.new_page(reduced_motion="reduce", **looks)
            page.set_default_timeout(60_000)
            page.goto(f"http://127.0.0.1:{port}")
            settled(page)
            state(page)
            page.screenshot(path=folder / f"demo_{name}.png")
            page.close()
            print(f"wrote {folder / f'demo_{name}.png'}")
        browser.close()


if __name__ == "__main__":
    main()
