"""Rooms are drawn, get doors, windows and furniture."""

from __future__ import annotations

import json
import re

import pytest

from layoutrl.rooms.documents import room_from_dict
from layoutrl.rooms.faults import faults
from tests.demo.page.browsing import (
    SQUARE,
    corner,
    dragged,
    drawn,
    expect,
    item,
    room_of,
    saved,
    settled,
    shown,
)


def test_a_room_is_drawn_gets_doors_and_windows_and_is_furnished(still):
    page = still
    page.locator("#building summary").click()
    page.locator("#kind").select_option("study")
    settled(page)
    drawn(page, ((1, 1), (4.02, 1), (4, 4.03), (1, 4)))
    room = room_of(page)
    assert (room["room_type"], room["outline"]) == ("study", [[1, 1], [4, 1], [4, 4], [1, 4]])
    page.locator("#door").click()
    page.mouse.click(*corner(page, 2, 0.95))
    settled(page)
    page.locator("#wide").fill("1.5")
    page.locator("#window").click()
    page.mouse.click(*corner(page, 2.5, 4.1))
    settled(page)
    room = room_from_dict(json.loads(saved(page, "json")))
    assert [o.kind for o in room.openings] == ["door", "window"]
    assert room.openings[1].shape.bounds == pytest.approx((1.75, 4, 3.25, 4.2))
    page.locator("#usual").click()
    settled(page)
    expect(page.locator("#verdict")).to_contain_text("to be placed")
    page.locator("#furnish").click()
    settled(page)
    room = room_from_dict(json.loads(saved(page, "json")))
    assert all(entry.center for entry in room.furniture)
    assert not faults(room)
    page.locator("#plan .window").click()
    page.locator("#delete").click()
    settled(page)
    expect(page.locator("#plan .window")).to_have_count(0)


def test_a_width_that_is_cleared_is_the_usual_one(page):
    page.locator("#building summary").click()
    page.locator("#wide").fill("")
    page.locator("#wide").blur()
    expect(page.locator("#wide")).to_have_value("0.9")


def test_a_room_is_drawn_by_keyboard(page):
    page.locator("#building summary").click()
    page.locator("#draw").click()
    keys = ["Enter", *["Shift+ArrowRight"] * 3, "Enter", "ArrowUp", "Enter", "Backspace", *["Shift+ArrowUp"] * 4]
    for key in (*keys, "Enter", *["Shift+ArrowLeft"] * 3, "Enter", "ArrowLeft"):
        page.keyboard.press(key)
    page.locator("#close").click()
    settled(page)
    assert room_of(page)["outline"] == [[1, 1], [4, 1], [4, 5.1], [1, 5.1]]
    page.locator("#door").click()
    for key in (*["Shift+ArrowDown"] * 3, "Enter"):
        page.keyboard.press(key)
    settled(page)
    expect(page.locator("#plan .door")).to_have_count(1)
    page.locator("#plan .door").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Delete")
    settled(page)
    expect(page.locator("#plan .door")).to_have_count(0)


def test_an_outline_is_closed_once_however_often_that_is_asked(page):
    page.locator("#building summary").click()
    page.locator("#draw").click()
    for key in ("Enter", *["Shift+ArrowRight"] * 3, "Enter", *["Shift+ArrowUp"] * 3, "Enter"):
        page.keyboard.press(key)
    before = page.locator("#gallery li").count()
    page.evaluate("for (let k = 0; k < 3; k++) document.getElementById('close').click()")
    settled(page)
    expect(page.locator("#gallery li")).to_have_count(before + 1)
    expect(page.locator("#draw")).to_have_text("Draw an outline")


PRESSED = """([key, altKey]) => document.getElementById("plan").dispatchEvent(
  new KeyboardEvent("keydown", { key, altKey, bubbles: true, cancelable: true }))"""  # false if it is taken


def test_a_browsers_keys_are_left_to_it_while_an_outline_is_drawn(page):
    page.locator("#building summary").click()
    page.locator("#draw").click()
    for key, taken in (("Alt+ArrowLeft", False), ("ArrowLeft", True)):
        goes_on = page.evaluate(PRESSED, [key.rpartition("+")[2], "Alt" in key])
        assert goes_on != taken


def test_undo_takes_back_a_corner_while_an_outline_is_drawn(page):
    for dx in (-0.3, -0.2):
        dragged(page, item(page, "bed"), dx, 0)
    before = room_of(page)
    page.locator("#undo").click()
    settled(page)
    page.locator("#building summary").click()
    page.locator("#draw").click()
    for name in ("undo", "redo", "door", "window"):
        expect(page.locator(f"#{name}")).to_be_disabled()
    for x, y in ((1, 1), (4, 1), (4, 4)):
        page.mouse.click(*corner(page, x, y))
    corners = page.locator("#plan .corner")
    expect(corners).to_have_count(3)
    for count, undo in ((2, lambda: page.locator("#undo").click()), (1, lambda: page.keyboard.press("Control+z"))):
        undo()
        expect(corners).to_have_count(count)
    page.keyboard.press("Control+y")
    expect(page.locator("#draw")).to_have_text("Cancel")
    page.locator("#draw").click()
    page.locator("#redo").click()
    settled(page)
    assert room_of(page) == before


def test_as_large_a_room_is_drawn_as_is_taken_and_all_of_it_is_shown(page):
    page.locator("#building summary").click()
    page.locator("#draw").click()
    x, y = corner(page, 9, 7)
    page.mouse.click(x + 30, y)  # beside the grid
    expect(page.locator("#plan .corner")).to_have_attribute("cx", "9")
    page.locator("#back").click()
    page.locator("#grid").select_option("24 24")
    for x, y in ((0, 0), (24, 0), (24, 20), (0, 20)):
        page.mouse.click(*corner(page, x, y))
    page.locator("#grid").select_option("9 7")
    box = page.locator("#plan").bounding_box()
    for x, y in (corner(page, 0, 0), corner(page, 24, 20)):
        assert 0 < x - box["x"] < box["width"]
        assert 0 < y - box["y"] < box["height"]
    page.mouse.click(*corner(page, 0.1, 0.1))  # as near to the first corner as one sees
    expect(page.locator("#plan .corner")).to_have_count(0)
    settled(page)
    assert room_of(page)["outline"] == [[0, 0], [24, 0], [24, 20], [0, 20]]


def test_an_outline_that_crosses_itself_is_refused_and_goes_on(page):
    page.locator("#building summary").click()
    page.locator("#draw").click()
    for x, y in ((1, 1), (4, 4), (4, 1), (1, 4)):
        page.mouse.click(*corner(page, x, y))
    page.locator("#close").click()
    expect(page.locator("#verdict")).to_contain_text("The outline crosses itself")
    page.locator("#back").click()
    expect(page.locator("#plan .corner")).to_have_count(3)
    page.keyboard.press("Escape")


def test_furniture_of_the_palette_stands_in_the_room(page):
    page.locator("#adding summary").click()
    count = page.locator("#plan .item").count()
    page.locator("#palette").get_by_role("button", name="desk").click()
    settled(page)
    expect(page.locator("#plan .item")).to_have_count(count + 1)
    expect(page.locator("#name")).to_have_text("desk")
    assert room_of(page)["furniture"][-1]["category"] == "desk"


def test_furniture_that_does_not_fit_in_the_middle_is_to_be_placed(still):
    page = still
    room = {
        "id": "narrow",
        "room_type": "living_room",
        "outline": [[0, 0], [3, 0], [3, 1.3], [0, 1.3]],
        "furniture": [],
    }
    shown(page, SQUARE | room)
    page.locator("#adding summary").click()
    page.locator("#palette").get_by_role("button", name=re.compile("^sofa")).first.click()
    settled(page)
    expect(page.locator("#verdict")).to_have_text("1 to be placed")
    expect(page.locator("#name")).to_have_text("sofa")
    (sofa,) = room_of(page)["furniture"]
    assert "center" not in sofa
    for field, value in (("width", "0.9"), ("depth", "0.8")):
        page.locator(f"#{field}").fill(value)
        page.locator(f"#{field}").blur()
        settled(page)
    page.locator("#place").click()
    settled(page)
    expect(page.locator("#plan .item")).to_have_count(1)  # what fits then is taken


def test_furniture_that_the_server_refuses_is_taken_out_again(page):
    full = [{"category": "stool", "size": [0.5, 0.5]}] * 40
    shown(page, SQUARE | {"furniture": full, "target": 3})
    before = room_of(page)
    page.locator("#adding summary").click()
    for row, press in enumerate((page.locator("#palette button").first, page.locator("#usual"))):
        press.click()
        expect(page.locator("#verdict")).to_contain_text("expected at most 40 pieces; got 4")
        settled(page)
        assert room_of(page) == before
        expect(page.locator("#furniture li")).to_have_count(40)
        page.locator("#furniture button").nth(row).click()
        expect(page.locator("#verdict")).to_have_text("40 to be placed")
    page.locator("#undo").click()  # to the room before the file
    settled(page)
    expect(page.locator("#title")).to_contain_text("bedroom")


def test_what_is_usual_is_added_where_it_is_not_there_yet(page, answers):
    usual = [entry for entry in answers.begin["palette"]["dining_room"] if entry["usual"]]
    (table,) = (entry["item"] for entry in usual if entry["item"]["category"] == "table")
    number = sum(entry["usual"] for entry in usual)
    stands = [table | {"center": [1.5, 1.5], "rotation": 0}, table | {"size": [0.5, 0.5], "shape": "circle"}]
    shown(page, SQUARE | {"room_type": "dining_room", "furniture": stands})
    page.locator("#adding summary").click()
    page.locator("#usual").click()
    settled(page)
    expect(page.locator("#furniture li")).to_have_count(2 + number - 1)  # a round table is another
    before = room_of(page)
    page.locator("#usual").click()
    expect(page.locator("#verdict")).to_have_text("All that is usual is there.")
    settled(page)
    assert room_of(page) == before


def test_what_is_taken_out_is_put_back_where_the_server_does_not_answer(page):
    before = room_of(page)
    page.route("**/api/look", lambda route: route.fulfill(status=400, body='{"error": "gone"}'))
    page.locator("#clear").click()
    expect(page.locator("#verdict")).to_have_text("gone")
    settled(page)
    page.unroute("**/api/look")
    expect(page.locator("#undo")).to_be_disabled()
    assert room_of(page) == before
