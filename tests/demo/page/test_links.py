"""Links to a room, and looks: dark, light, on a phone, and for who cannot see or uses a finger."""

from __future__ import annotations

import json
from functools import partial
from typing import Any

import pytest

from tests.demo.page.browsing import (
    DROP,
    SQUARE,
    Page,
    dragged,
    expect,
    item,
    middle,
    room_of,
    settled,
    shown,
    take,
    until,
    visited,
)

LOOKS = {
    "light": {},
    "dark": {"color_scheme": "dark"},
    "phone": {"viewport": {"width": 360, "height": 740}, "has_touch": True, "is_mobile": True},
}


def link_of(page: Page) -> str:
    """The link of the room that the page shows, in which the bed was moved, and is locked."""
    dragged(page, item(page, "bed"), -0.3, 0)
    page.locator("#lock").click()
    page.locator("#saving summary").click()
    page.locator("#share").click()
    expect(page.locator("#link")).not_to_have_value("")
    return page.locator("#link").input_value()


def test_a_link_holds_the_room_and_what_is_locked(page, browser):
    link = link_of(page)
    assert "#room=" in link
    other = next(pages := visited(browser, link))
    assert room_of(other) == room_of(page)
    expect(other.locator("#plan .item.locked")).to_have_count(1)
    assert next(pages, None) is None


def test_a_link_goes_when_the_room_is_no_longer_that_which_it_holds(page):
    link_of(page)
    expect(page.locator("#link")).to_be_visible()
    take(page, "bathroom")
    expect(page.locator("#link")).to_be_hidden()
    page.locator("#share").click()
    expect(page.locator("#link")).to_be_visible()
    item(page, "toilet").click()
    expect(page.locator("#gaps")).not_to_be_empty()
    expect(page.locator("#link")).to_be_visible()
    dragged(page, item(page, "toilet"), 0, 0.2)
    expect(page.locator("#link")).to_be_hidden()


def test_a_link_and_a_file_are_opened_when_the_page_has_furnished(still):
    link = link_of(still)
    linked, held = room_of(still), []
    still.evaluate("history.replaceState(null, '', '#')")
    still.route("**/api/furnish", lambda route: held.append(route))
    for opens, what, room in (("link => { location.href = link }", link, linked), (DROP, json.dumps(SQUARE), SQUARE)):
        take(still, "bathroom")
        still.locator("#furnish").click()
        expect(still.locator("body")).to_have_attribute("data-state", "asking")
        with still.expect_request("**/api/look"):
            still.evaluate(opens, what)
        while not held:
            still.evaluate("0")  # lets it be asked
        expect(still.locator("#title")).to_contain_text("bathroom")
        held.pop().fulfill(status=400, body='{"error": "busy"}')
        expect(still.locator("#title")).to_have_attribute("data-room", room["id"])
        settled(still)
        assert room_of(still)["furniture"][0]["center"] == room["furniture"][0]["center"]


def test_a_room_of_a_link_is_kept_in_the_strip(page, browser):
    other = next(pages := visited(browser, link_of(page)))
    dragged(other, item(other, "wardrobe"), -0.2, -0.3)
    left = room_of(other)
    take(other, "kitchen")
    other.locator("#gallery button").first.click()
    expect(other.locator("#title")).to_contain_text("bedroom")
    settled(other)
    assert room_of(other) == left
    expect(other.locator("#plan .item.locked")).to_have_count(1)
    assert next(pages, None) is None


def test_a_link_that_is_broken_is_said(browser, address):
    page = next(pages := visited(browser, f"{address}/#room=nonsense"))
    expect(page.locator("#verdict")).to_have_text("The link holds no whole room.")
    expect(page.locator("#plan .item").first).to_be_attached()
    assert next(pages, None) is None


def hold(held: list[Any], route: Any) -> None:
    """Keep the first two questions, and let others through."""
    if len(held) < 2:
        held.append(route)
    else:
        route.continue_()


def test_a_second_link_is_opened_while_the_first_is(page, browser, address):
    packed = """async room => (await import("/store.js")).packed(JSON.stringify({ room, locked: [] }))"""
    links = [f"{address}/#room={page.evaluate(packed, SQUARE | {'id': name})}" for name in ("one", "two")]
    for first in (0, 1):  # that is answered
        held = []
        other = browser.new_page()
        other.route("**/api/look", partial(hold, held))
        other.goto(links[0])
        until(other, partial(len, held))
        other.evaluate("link => { location.href = link }", links[1])
        until(other, lambda kept=held: len(kept) == 2)
        for k in (first, 1 - first):
            held[k].continue_()
        expect(other.locator("#title")).to_have_attribute("data-room", "two")
        settled(other)
        expect(other.locator("#title")).to_have_attribute("data-room", "two")
        other.close()


def test_a_link_without_what_is_locked_is_opened(page, browser):
    page.evaluate(
        """async room => {
          const { packed } = await import("/store.js");
          location.href = `#room=${await packed(JSON.stringify({ room, locked: null }))}`;
        }""",
        SQUARE,
    )
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    settled(page)


@pytest.mark.parametrize("looks", LOOKS.values(), ids=LOOKS)
def test_axe_finds_nothing(browser, address, looks):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="no axe-playwright-python")
    page = next(pages := visited(browser, address, reduced_motion="reduce", **looks))
    page.locator("#furnish").click()
    settled(page)
    for name in ("adding", "building", "saving"):
        page.locator(f"#{name} summary").click()
    page.locator("#furniture").get_by_role("button", name="bed").click()
    settled(page)
    page.locator("#heat").check()
    page.locator("#arrows").check()
    expect(page.locator("#plan .arrow")).to_have_count(2)
    found = axe.Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    panel, field = (page.locator(name).bounding_box() for name in ("#saving", "#file"))
    assert field["x"] + field["width"] < panel["x"] + panel["width"]
    page.locator("#draw").click()
    found = axe.Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert next(pages, None) is None


def test_dark_and_light_differ(browser, address):
    colors = []
    for scheme in ("light", "dark"):
        page = next(pages := visited(browser, address, color_scheme=scheme))
        colors.append(page.evaluate("getComputedStyle(document.body).backgroundColor"))
        assert next(pages, None) is None
    assert colors == ["rgb(255, 255, 255)", "rgb(20, 24, 29)"]


def test_on_a_phone_what_is_said_and_drawn_is_in_view(browser, address):
    page = next(pages := visited(browser, address, **LOOKS["phone"]))
    page.locator("#saving summary").click()
    page.locator("#saving").scroll_into_view_if_needed()
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    page.evaluate(DROP, "no room")
    expect(page.locator("#verdict")).to_contain_text("expected JSON")
    expect(page.locator("#verdict")).to_be_in_viewport()
    page.locator("#building summary").click()
    page.locator("#draw").click()
    expect(page.locator("#plan")).to_be_in_viewport(ratio=0.9)
    assert next(pages, None) is None


def test_on_a_phone_all_that_is_wrong_can_be_read_by_keyboard(browser, address):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="no axe-playwright-python")
    page = next(pages := visited(browser, address, **LOOKS["phone"]))
    wardrobe = {"category": "wardrobe", "size": [0.6, 1.8], "center": [1.5, 1.5], "rotation": 0}
    shown(page, SQUARE | {"furniture": [wardrobe] * 8})
    verdict = page.locator("#verdict")
    assert verdict.evaluate("node => node.scrollHeight > node.clientHeight && node.tabIndex === 0")
    found = axe.Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    shown(page, SQUARE | {"id": "other"})
    expect(verdict).not_to_have_attribute("tabindex", "0")
    assert next(pages, None) is None


def test_a_finger_on_furniture_puts_in_a_window_there(browser, address):
    page = next(pages := visited(browser, address, **LOOKS["phone"]))
    shown(
        page,
        SQUARE | {"furniture": [{"category": "wardrobe", "size": [0.6, 1.8], "center": [0.3, 1.5], "rotation": 0}]},
    )
    page.locator("#building summary").click()
    page.locator("#window").click()
    page.touchscreen.tap(*middle(page.locator("#plan [data-item='0']")))
    settled(page)
    expect(page.locator("#plan .window")).to_have_count(1)
    assert next(pages, None) is None


def test_a_finger_drags_furniture(browser, address):
    """Up and down, too, where it would scroll the page; on the floor and beside the plan it does."""
    page = next(pages := visited(browser, address, **LOOKS["phone"]))
    before = room_of(page)["furniture"][0]["center"]
    item(page, "bed").scroll_into_view_if_needed()
    x, y = middle(item(page, "bed"))
    finger = page.context.new_cdp_session(page)

    def swiped(*points: tuple[float, float]) -> None:
        for k, (x, y) in enumerate(points):
            kind = "touchMove" if k else "touchStart"
            finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
        finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def to_top() -> None:
        page.wait_for_timeout(500)  # the page rolls on
        until(page, lambda: page.evaluate("scrollTo(0, 0)") or page.evaluate("scrollY") == 0)

    scrolled = page.evaluate("scrollY")
    swiped(*((x, y - 3 * k) for k in range(13)), (x - 20, y - 36), (x - 40, y - 36))
    settled(page)
    assert page.evaluate("scrollY") == scrolled
    x, y = middle(page.locator("#keys"))
    swiped(*((x, y - 10 * k) for k in range(13)))
    until(page, lambda: page.evaluate("scrollY") > scrolled)
    to_top()
    page.locator("#furniture").get_by_role("button", name="bed").click()
    expect(page.locator("#selected")).to_be_visible()
    to_top()
    plan = page.locator("#plan").bounding_box()
    x, y = plan["x"] + plan["width"] / 2, plan["y"] + 0.97 * plan["height"]
    assert page.evaluate("([x, y]) => document.elementFromPoint(x, y).closest('.item')", [x, y]) is None
    swiped(*((x, y - 10 * k) for k in range(13)))
    until(page, lambda: page.evaluate("scrollY") > 0)
    expect(page.locator("#selected")).to_be_visible()  # its tools are what one scrolls to
    to_top()
    page.touchscreen.tap(x, y)
    expect(page.locator("#selected")).to_be_hidden()
    page.touchscreen.tap(*middle(page.locator("#plan .door").first))
    expect(page.locator("#name")).to_have_text("door")
    after = room_of(page)["furniture"][0]["center"]
    assert after[0] < before[0] - 0.2
    assert after[1] > before[1] + 0.2
    assert next(pages, None) is None
