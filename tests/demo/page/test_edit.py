"""Rooms are shown; furniture is moved, turned, locked and deleted by mouse, finger, keyboard and in fields."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from layoutrl.rooms.documents import room_from_dict
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import MAIN_ITEM
from tests.demo.page.browsing import (
    DROP,
    PRESS,
    SQUARE,
    Page,
    corner,
    drag,
    dragged,
    expect,
    item,
    middle,
    room_of,
    saved,
    settled,
    shown,
    take,
    until,
    visited,
)

LABELS = "nodes => nodes.map(({ dataset: { item, opening } }) => item ? `item ${item}` : `opening ${opening}`)"
HOLD = """([key, times]) => {
  for (let k = 0; k < times; k++)
    document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key, repeat: k > 0, bubbles: true }));
}"""


def test_it_begins_with_a_room_and_a_gallery_of_all_types(page):
    expect(page.get_by_role("heading", level=1)).to_have_text("Furnish a room")
    names = page.locator("#gallery").get_by_role("button").all_inner_texts()
    assert {name.strip() for name in names} == {room_type.replace("_", " ") for room_type in MAIN_ITEM}
    for shape in (".wall", ".door", ".window", ".swing", ".item .front", ".item .label"):
        expect(page.locator(f"#plan {shape}").first).to_be_attached()
    expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")


def test_nothing_can_be_used_before_a_room_is_shown(browser, address):
    page, held = browser.new_page(), []
    page.route("**/api/look", lambda route: held.append(route))
    page.goto(address)
    until(page, lambda: held)
    for name in ("furnish", "undo", "redo"):
        expect(page.locator(f"#{name}")).to_be_disabled()
    tools = ("nav", "aside", "#type")
    assert all(page.locator(name).evaluate("node => node.inert") for name in tools)
    held.pop().continue_()
    settled(page)
    expect(page.locator("#furnish")).to_be_enabled()
    assert not any(page.locator(name).evaluate("node => node.inert") for name in tools)
    page.close()


def test_another_room_can_be_shown_where_the_first_is_not(browser, address):
    page = browser.new_page()
    page.route("**/api/look", lambda route: route.fulfill(status=503, body='{"error": "busy"}'))
    page.goto(address)
    expect(page.locator("#verdict")).to_have_text("busy")
    page.unroute("**/api/look")
    page.locator("#gallery").get_by_role("button", name="kitchen").first.click()
    settled(page)
    expect(page.locator("#title")).to_contain_text("kitchen")
    expect(page.locator("#furnish")).to_be_enabled()
    page.close()


def test_of_two_rooms_the_last_is_shown_however_late_the_first_is(page):
    held = []
    page.route("**/api/look", lambda route: held.append(route) if not held else route.continue_())
    for name in ("bathroom", "kitchen"):
        page.locator("#gallery").get_by_role("button", name=name).first.click()
    until(page, lambda: held)
    page.wait_for_timeout(200)  # the second could be answered by now
    held[0].continue_()
    expect(page.locator("#title")).to_contain_text("kitchen")
    settled(page)
    expect(page.locator("#title")).to_contain_text("kitchen")
    current = page.locator("#gallery [aria-current]")
    expect(current).to_have_count(1)
    expect(current).to_have_text("kitchen")


def test_a_room_that_is_refused_keeps_no_other_from_being_shown(page):
    held = []
    page.route("**/api/look", lambda route: held.append(route) if not held else route.continue_())
    page.locator("#gallery").get_by_role("button", name="kitchen").first.click()
    until(page, lambda: held)
    link = "link => { location.href = link }"
    page.evaluate(link, "#room=nonsense")
    expect(page.locator("#verdict")).to_have_text("The link holds no whole room.")
    held[0].continue_()
    expect(page.locator("#title")).to_contain_text("kitchen")
    settled(page)


def test_what_nobody_answers_of_a_room_is_not_said_of_another(page):
    held = []
    page.route("**/api/look", lambda route: held.append(route) if not held else route.continue_())
    item(page, "bed").focus()
    until(page, lambda: held)
    page.locator("#gallery").get_by_role("button", name="kitchen").first.click()
    expect(page.locator("#title")).to_contain_text("kitchen")
    held[0].fulfill(status=400, body='{"error": "busy"}')
    settled(page)
    expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")


def test_what_is_no_answer_is_no_fault_of_the_chosen_item(page):
    answer = {}
    page.route("**/api/look", lambda route: route.fulfill(**answer))
    for faulty, told in ((0, {"body": "cut off"}), (1, {"status": 400, "body": '{"error": "furniture: too much"}'})):
        answer |= told
        item(page, "bed").focus()
        page.keyboard.press("Escape")
        item(page, "bed").focus()
        expect(page.locator("#plan")).to_have_attribute("aria-busy", "false")
        expect(page.locator("#verdict.bad")).to_be_visible()
        expect(page.locator("#plan .item.faulty")).to_have_count(faulty)
        expect(page.locator("#wrong")).to_have_text("furniture: too much" if faulty else "")


def test_a_room_of_each_type_is_shown(page):
    for room_type in MAIN_ITEM:
        take(page, room_type.replace("_", " "))
        room = room_from_dict(json.loads(saved(page, "json")))
        assert room.room_type == room_type
        expect(page.locator("#plan .item")).to_have_count(len(room.furniture))
        expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")


def test_a_second_finger_moves_nothing(page):
    page.evaluate(DROP, json.dumps(SQUARE))
    settled(page)
    before = room_of(page)
    assert before["id"] == "square"
    page.evaluate(
        """() => {
          const body = document.querySelector("#plan [data-item]");
          const { x, y, width, height } = body.getBoundingClientRect();
          const at = { button: 0, bubbles: true, clientX: x + width / 2, clientY: y + height / 2 };
          const plan = document.getElementById("plan");
          plan.setPointerCapture = () => {};
          body.dispatchEvent(new PointerEvent("pointerdown", { ...at, pointerId: 5 }));
          const other = { ...at, clientX: at.clientX + 90, pointerId: 6 };
          for (const target of [plan, body]) target.dispatchEvent(new PointerEvent("pointerdown", other));
          plan.dispatchEvent(new PointerEvent("pointermove", other));
          plan.dispatchEvent(new PointerEvent("pointerup", other));
        }"""
    )
    settled(page)
    assert room_of(page) == before
    page.evaluate(  # the first is still down, and does
        """() => {
          const { x, y, width, height } = document.querySelector("#plan [data-item]").getBoundingClientRect();
          const to = { bubbles: true, pointerId: 5, clientX: x + width / 2 + 30, clientY: y + height / 2 };
          for (const what of ["pointermove", "pointerup"])
            document.getElementById("plan").dispatchEvent(new PointerEvent(what, to));
        }"""
    )
    settled(page)
    assert room_of(page) != before


def test_furniture_is_dragged_undone_and_done_again(page):
    before = room_of(page)
    dragged(page, item(page, "bed"), -0.5, 0)
    after = room_of(page)
    (x0, y0), (x1, y1) = before["furniture"][0]["center"], after["furniture"][0]["center"]
    assert (x1 - x0, y1 - y0) == (pytest.approx(-0.5, abs=0.03), pytest.approx(0, abs=0.03))
    page.locator("#undo").click()
    settled(page)
    assert room_of(page) == before
    expect(page.locator("#undo")).to_be_disabled()
    page.locator("#redo").click()
    settled(page)
    assert room_of(page) == after
    page.keyboard.press("Control+z")
    settled(page)
    assert room_of(page) == before


def test_faults_are_marked_while_dragging_with_words(page):
    stand, bed = item(page, "nightstand"), item(page, "bed")
    (x0, y0), (x1, y1) = middle(stand), middle(bed)
    scale = page.evaluate("document.querySelector('#plan').getScreenCTM().a")
    drag(page, stand, (x1 - x0) / scale, (y0 - y1) / scale)
    expect(page.locator("#verdict")).to_contain_text("nightstand (1 of 2) overlaps something")
    expect(page.locator("#verdict")).to_contain_text("bed overlaps something")
    expect(page.locator("#plan .item.faulty")).to_have_count(2)
    expect(page.locator("#plan .hatch")).to_have_count(2)
    expect(item(page, "nightstand; nightstand \\(1 of 2\\) overlaps something")).to_be_attached()
    expect(page.locator("#furniture li").filter(has_text="bed overlaps something")).to_be_visible()
    page.mouse.up()
    settled(page)
    room = room_from_dict(json.loads(saved(page, "json")))
    assert {name for _, name in faults(room)} >= {"overlaps"}


def test_a_name_lies_alike_in_what_is_turned_by_as_much_the_other_way(page):
    names = []
    for degrees in (90, -270, 270, -90):
        bookcase = {"category": "bookcase", "size": [0.3, 1.6], "center": [1.5, 1.5], "rotation": degrees}
        shown(page, SQUARE | {"id": f"turned by {degrees}", "furniture": [bookcase]})
        names.append(page.locator("#plan .item .label").bounding_box())
    assert all(name == names[0] for name in names)


def test_a_chair_under_a_table_lies_on_the_rug(page: Page) -> None:
    furniture = [
        {"category": "table", "size": [1.0, 1.0], "center": [1.5, 1.5], "rotation": 0},
        {"category": "chair", "size": [0.5, 0.5], "center": [0.9, 1.5], "rotation": 0, "tucked": True},
        {"category": "rug", "size": [2.0, 2.0], "center": [1.5, 1.5], "rotation": 0},
    ]
    page.evaluate(DROP, json.dumps(SQUARE | {"furniture": furniture}))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    drawn = page.locator("#plan [data-item]").evaluate_all("nodes => nodes.map((node) => node.dataset.item)")
    assert drawn == ["2", "1", "0"]  # what comes later lies on top


def test_tab_goes_through_the_plan_and_back(page):
    page.locator("#plan").focus()
    wanted = page.locator("#plan [data-item], #plan [data-opening]").evaluate_all(LABELS)
    assert len(wanted) > 5
    for step, way in (("Tab", wanted), ("Shift+Tab", wanted[-2::-1])):
        found = []
        for _ in way:
            page.keyboard.press(step)
            settled(page)  # what has the focus is chosen, and all is drawn anew
            found += page.locator("#plan :focus").evaluate_all(LABELS)
        assert found == way
    for _ in wanted:
        page.keyboard.press("Tab")
        settled(page)
    expect(page.locator("aside :focus")).to_be_attached()  # behind the last


def test_who_uses_the_keyboard_gets_past_the_rooms(page):
    page.keyboard.press("Tab")
    expect(page.get_by_role("button", name="past the rooms")).to_be_focused()
    expect(page.get_by_role("button", name="past the rooms")).to_be_in_viewport()
    page.keyboard.press("Enter")
    expect(page.locator("#plan")).to_be_focused()


def test_the_chosen_item_lies_on_top_and_is_dragged_there(page):
    furniture = [
        {"category": "table", "size": [1.0, 1.0], "center": [1.5, 1.5], "rotation": 0},
        {"category": "chair", "size": [0.5, 0.5], "center": [0.9, 1.5], "rotation": 0, "tucked": True},
    ]
    shown(page, SQUARE | {"furniture": furniture})
    covered = corner(page, 1.1, 1.5)
    page.mouse.click(*covered)
    expect(page.locator("#name")).to_have_text("table")
    page.locator("#furniture [data-row='1']").click()
    expect(page.locator("#name")).to_have_text("chair")
    settled(page)
    x, y = covered
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 30, y)
    page.mouse.move(x - 60, y)
    page.mouse.up()
    settled(page)
    table, chair = room_of(page)["furniture"]
    assert table == furniture[0]
    assert chair["center"][0] < 0.7


def test_a_door_that_is_blocked_is_said(page):
    page.evaluate(DROP, json.dumps(SQUARE))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    dragged(page, item(page, "stool"), 0, -1.2)
    expect(page.locator("#verdict")).to_contain_text("stool blocks a door or window")


def test_furniture_that_leaves_the_room_is_put_back(page):
    before = room_of(page)
    drag(page, item(page, "bed"), 0, 9)
    expect(page.locator("#verdict")).to_have_text("The bed would reach beyond the walls")
    page.mouse.up()
    settled(page)
    expect(page.locator("#verdict")).to_have_text("The bed would reach beyond the walls. It is back as it was.")
    assert room_of(page) == before


def test_quick_steps_are_judged_one_by_one_and_those_out_of_the_room_are_put_back(page):
    stool = SQUARE["furniture"][0] | {"center": [1.5, 2.9], "rotation": 0}
    page.evaluate(DROP, json.dumps(SQUARE | {"furniture": [stool]}))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    for keys, rotation in ((["ArrowUp"] * 9, 0), (["r"] + ["ArrowUp"] * 5, 90)):
        item(page, "stool").focus()
        settled(page)
        page.evaluate(PRESS, keys)
        settled(page)
        expect(page.locator("#verdict")).to_have_text("The stool would reach beyond the walls. It is back as it was.")
        assert room_of(page)["furniture"] == [stool | {"center": [1.5, 2.95], "rotation": rotation}]


def test_a_key_that_is_held_waits_for_the_server(page):
    stool = SQUARE["furniture"][0] | {"rotation": 0}
    shown(page, SQUARE | {"furniture": [stool]})
    item(page, "stool").focus()
    settled(page)
    page.evaluate(HOLD, ["ArrowUp", 6])
    settled(page)
    assert room_of(page)["furniture"] == [stool | {"center": [1.5, 1.55]}]


def test_what_is_dragged_is_not_locked_and_not_turned(page):
    shown(page, SQUARE)
    drag(page, item(page, "stool"), 0.5, 0)
    for key in ("l", "r"):
        page.keyboard.press(key)
    page.mouse.up()
    settled(page)
    expect(page.locator("#lock")).to_have_attribute("aria-pressed", "false")
    assert room_of(page)["furniture"][0].get("rotation", 0) == 0


def test_what_is_done_before_a_step_is_judged_waits_for_it(page):
    stools = [SQUARE["furniture"][0] | {"center": [x, 2.95], "rotation": 0} for x in (0.5, 2.5)]
    page.evaluate(DROP, json.dumps(SQUARE | {"furniture": stools}))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    page.locator("#plan [data-item='0']").focus()
    settled(page)
    page.evaluate(PRESS, ["ArrowUp", "l", "ArrowDown"])  # out of the room; locked; locked things stay
    settled(page)
    expect(page.locator("#lock")).to_have_attribute("aria-pressed", "true")
    assert room_of(page)["furniture"] == stools
    page.locator("#plan [data-item='0']").focus()
    page.evaluate(PRESS, ["l", "ArrowUp", "Delete"])
    settled(page)
    assert room_of(page)["furniture"] == stools[1:]
    page.locator("#undo").click()
    settled(page)
    assert room_of(page)["furniture"] == stools  # not with the step that was refused


def test_undo_waits_for_what_was_done_before(page):
    shown(page, SQUARE)
    item(page, "stool").focus()
    page.keyboard.press("ArrowRight")
    settled(page)
    page.evaluate(f"keys => {{ ({PRESS})(keys); document.querySelector('#undo').click() }}", ["ArrowUp"])
    settled(page)
    assert room_of(page)["furniture"][0]["center"] == [1.55, 1.5]
    page.locator("#redo").click()
    settled(page)
    assert room_of(page)["furniture"][0]["center"] == [1.55, 1.55]


@pytest.mark.parametrize("button", ["#furnish", "#only", "#save-json"])
def test_what_is_done_with_a_room_waits_for_what_was_done_before(still, button):
    stool = SQUARE["furniture"][0] | {"center": [1.5, 2.95], "rotation": 0}
    shown(still, SQUARE | {"furniture": [stool]})
    item(still, "stool").focus()
    settled(still)
    at_once = f"keys => {{ ({PRESS})(keys); setTimeout(() => document.querySelector('{button}').click()) }}"
    if button == "#save-json":
        with still.expect_download() as begun:
            still.evaluate(at_once, ["ArrowUp"])  # out of the room
        room = json.loads(Path(begun.value.path()).read_bytes())
    else:
        with still.expect_request("**/api/furnish") as asked:
            still.evaluate(at_once, ["ArrowUp"])
        room = asked.value.post_data_json["room"]
    settled(still)
    assert room["furniture"] == [stool]


def test_undo_that_the_server_does_not_answer_is_said_and_shown(page):
    shown(page, SQUARE)
    before = item(page, "stool").get_attribute("transform")
    dragged(page, item(page, "stool"), 0.5, 0)
    page.route("**/api/look", lambda route: route.fulfill(status=400, body='{"error": "gone"}'))
    page.locator("#undo").click()
    expect(page.locator("#verdict")).to_have_text("gone")
    expect(item(page, "stool")).to_have_attribute("transform", before)
    expect(page.locator("#redo")).to_be_enabled()
    page.locator("#building summary").click()
    page.locator("#door").click()
    expect(page.locator("#verdict")).to_contain_text("Click a wall")
    page.locator("#undo").click()
    expect(page.locator("#verdict")).to_have_text("gone")
    page.locator("#door").click()
    page.unroute("**/api/look")
    page.locator("#redo").click()
    settled(page)
    page.locator("#redo").click()
    settled(page)
    expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")


@pytest.mark.parametrize("ends", ["Delete", "Control+z"])
def test_what_is_deleted_or_undone_while_it_is_dragged_is_dragged_no_more(page, ends):
    """What has its place in the list then stays."""
    stools = [SQUARE["furniture"][0] | {"center": [x, 1.5], "rotation": 0} for x in (0.5, 2.5)]
    shown(page, SQUARE | {"furniture": stools})
    item(page, "stool", 1).focus()
    page.keyboard.press("ArrowUp")
    settled(page)
    drag(page, page.locator("#plan [data-item='0']"), 0, 0.5)
    page.keyboard.press(ends)
    settled(page)
    page.mouse.move(500, 500)
    page.mouse.up()
    settled(page)
    assert room_of(page)["furniture"] == (stools if ends == "Control+z" else [stools[1] | {"center": [2.5, 1.55]}])


def test_measurements_show_while_dragging(page):
    expect(page.locator("#plan .metres")).to_have_count(0)
    drag(page, item(page, "bed"), -0.6, 0)
    expect(page.locator("#plan .metres").first).to_be_attached()
    expect(page.locator("#gaps")).to_contain_text(re.compile(r"Free beside it: \d\.\d\d m"))
    first = page.locator("#gaps").inner_text()
    x, y = middle(item(page, "bed"))
    page.mouse.move(x - 30, y)
    expect(page.locator("#gaps")).not_to_have_text(first)
    page.mouse.up()
    settled(page)


def test_the_keyboard_moves_turns_locks_and_deletes(page):
    item(page, "bed").focus()
    settled(page)
    before = room_of(page)["furniture"]
    page.locator("#plan [data-item='0']").focus()
    for key in ("ArrowLeft", "ArrowLeft", "Shift+ArrowDown", "r"):
        page.keyboard.press(key)
        settled(page)
    after = room_of(page)["furniture"]
    (x0, y0), (x1, y1) = before[0]["center"], after[0]["center"]
    assert (x1 - x0, y1 - y0) == (pytest.approx(-0.1), pytest.approx(-0.01))
    assert (after[0]["rotation"] - before[0]["rotation"]) % 360 == 90
    page.locator("#plan [data-item='0']").focus()
    page.keyboard.press("l")
    expect(page.locator("#lock")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#delete")).to_be_disabled()
    for key in ("ArrowLeft", "r", "Delete", "Backspace"):
        page.keyboard.press(key)
        expect(page.locator("#verdict")).to_have_text("The bed is locked. Unlock it first.")
        page.keyboard.press("Escape")
        expect(page.locator("#verdict")).not_to_contain_text("locked")
        page.locator("#plan [data-item='0']").focus()
    page.keyboard.press("Escape")
    settled(page)
    assert room_of(page)["furniture"] == after
    expect(page.locator("#selected")).to_be_hidden()
    page.locator("#plan [data-item='0']").focus()
    page.keyboard.press("l")
    for _ in range(2):  # the second finds nothing chosen
        page.keyboard.press("Delete")
        settled(page)
    assert room_of(page)["furniture"] == after[1:]
    expect(page.locator("#plan .item")).to_have_count(len(after) - 1)


def test_the_chosen_item_has_buttons_for_all_of_it(page):
    page.locator("#furniture").get_by_role("button", name="bed").click()
    settled(page)
    page.locator("#turn").click()
    settled(page)
    page.locator("#width").fill("1.4")
    page.locator("#width").blur()
    settled(page)
    page.locator("#degrees").fill("45")
    page.locator("#degrees").blur()
    settled(page)
    bed = room_of(page)["furniture"][0]
    assert (bed["size"][1], bed["rotation"]) == (1.4, 45)
    page.locator("#delete").click()
    settled(page)
    assert "bed" not in {entry["category"] for entry in room_of(page)["furniture"]}
    expect(page.locator("#selected")).to_be_hidden()


def test_a_field_that_is_cleared_says_again_what_is_so(page):
    stool = SQUARE["furniture"][0] | {"size": [0.5, 0.6], "rotation": 45}
    shown(page, SQUARE | {"furniture": [stool]})
    page.locator("#furniture [data-row='0']").click()
    settled(page)
    for field, value in (("degrees", "45"), ("depth", "0.5"), ("width", "0.6")):
        for leave in ("Enter", "Tab"):
            page.locator(f"#{field}").fill("")
            page.keyboard.press(leave)
            settled(page)
            expect(page.locator(f"#{field}")).to_have_value(value)
    expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")
    assert room_of(page)["furniture"] == [stool]


def test_a_field_whose_number_is_refused_says_again_what_is_so(page):
    stools = [SQUARE["furniture"][0] | {"center": [x, 1.5], "rotation": 0} for x in (0.5, 2.5)]
    shown(page, SQUARE | {"furniture": stools})
    page.locator("#furniture [data-row='1']").click()
    settled(page)
    page.locator("#depth").fill("9")
    page.keyboard.press("Enter")
    said = "The stool (2 of 2) would reach beyond the walls. It is back as it was."
    expect(page.locator("#verdict")).to_have_text(said)
    expect(page.locator("#depth")).to_have_value("0.5")
    expect(page.locator("#depth")).to_be_focused()
    page.locator("#depth").fill("0")
    page.keyboard.press("Enter")
    expect(page.locator("#depth")).to_have_value("0.1")  # the least that it takes
    settled(page)
    assert room_of(page)["furniture"] == [stools[0], stools[1] | {"size": [0.1, 0.5]}]


def test_degrees_of_more_than_a_turn_are_those_of_less(page):
    page.locator("#furniture").get_by_role("button", name="bed").click()
    page.locator("#degrees").fill("725")
    page.locator("#degrees").blur()
    settled(page)
    expect(page.locator("#degrees")).to_have_value("5")
    assert room_of(page)["furniture"][0]["rotation"] == 5


def test_what_is_typed_in_a_field_is_of_the_item_that_was_chosen(page):
    """Whatever is clicked next: the floor, another item, or its row of the list."""
    stools = [SQUARE["furniture"][0] | {"center": [x, 1.5], "rotation": 0} for x in (0.75, 2.25)]
    shown(page, SQUARE | {"furniture": stools})

    def typed(field: str, value: str) -> None:
        page.locator("#plan [data-item='0']").focus()
        page.locator(f"#{field}").fill(value)

    typed("degrees", "45")
    page.mouse.click(*corner(page, 1.5, 2.5))
    settled(page)
    expect(page.locator("#selected")).to_be_hidden()
    typed("depth", "0.6")
    page.mouse.click(*middle(page.locator("#plan [data-item='1']")))
    settled(page)
    expect(page.locator("#furniture [data-row='1']")).to_have_attribute("aria-pressed", "true")
    typed("width", "1.4")
    rows = page.locator("#furniture [data-row]")
    page.mouse.move(*middle(rows.nth(1)))
    page.mouse.down()
    expect(rows.first).to_contain_text("1.40 m")  # it is drawn anew
    settled(page)
    page.mouse.up()
    expect(rows.nth(1)).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#width")).to_have_value("0.5")
    assert room_of(page)["furniture"] == [stools[0] | {"size": [0.6, 1.4], "rotation": 45}, stools[1]]


def test_the_list_stays_where_it_is_when_gaps_are_known(page):
    """Who presses a row meanwhile means that one."""
    shown(page, SQUARE)
    asked = []
    page.route("**/api/look", lambda route: asked.append(route))
    page.locator("#plan [data-item='0']").focus()
    expect(page.locator("#selected")).to_be_visible()
    expect(page.locator("#gaps")).to_be_empty()
    before = middle(page.locator("#furniture [data-row='0']"))
    asked.pop().continue_()
    expect(page.locator("#gaps")).to_contain_text("m, ")
    assert middle(page.locator("#furniture [data-row='0']")) == before


def test_what_is_wrong_is_told_once(page):
    """A screen reader reads out whatever is put there."""
    shown(page, SQUARE)
    page.evaluate(
        "() => { window.told = []; new MutationObserver((all) => told.push(...all)).observe(document.querySelector"
        "('#verdict'), { childList: true, characterData: true, subtree: true }) }"
    )
    item(page, "stool").focus()
    for _ in range(3):
        page.keyboard.press("ArrowUp")
        settled(page)
    expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")
    assert page.evaluate("told.length") == 0
    dragged(page, item(page, "stool"), 0, -1.2)
    expect(page.locator("#verdict")).to_contain_text("stool blocks a door or window")
    assert page.evaluate("told.length") > 0


def test_nothing_moves_under_the_pointer(browser, address):
    """When an item is chosen, and when it is said what is wrong with it."""
    page = next(pages := visited(browser, address, viewport={"width": 390, "height": 844}))
    stools = [SQUARE["furniture"][0] | {"center": at, "rotation": 0} for at in ([0.7, 1.5], [1.5, 1.5], [1.5, 2.05])]
    shown(page, SQUARE | {"furniture": stools})

    def places(*names: str) -> list[int]:
        """On the page, however it is scrolled: a browser does that, too, so that what is seen stays."""
        down = "node => Math.round(node.getBoundingClientRect().y + scrollY)"
        return [page.locator(name).evaluate(down) for name in names]

    row = page.locator("#furniture [data-row='2']")
    row.scroll_into_view_if_needed()
    before = places("#furniture [data-row='2']", "#plan")
    row.click()
    expect(page.locator("#selected")).to_be_visible()
    settled(page)
    assert places("#furniture [data-row='2']", "#plan") == before
    page.locator("#delete").scroll_into_view_if_needed()
    before = places("#plan", "#turn", "#delete")
    for _ in range(2):
        page.keyboard.press("ArrowDown")
        settled(page)
    expect(page.locator("#wrong")).not_to_be_empty()
    expect(page.locator("#plan .item.faulty")).to_have_count(2)  # which is said in two lines
    assert places("#plan", "#turn", "#delete") == before
    assert next(pages, None) is None


def test_keys_on_a_row_of_the_list_are_as_on_the_plan(page):
    stools = [SQUARE["furniture"][0] | {"center": [x, 1.5], "rotation": 0} for x in (0.5, 2.5)]
    shown(page, SQUARE | {"furniture": stools})
    rows = page.locator("#furniture [data-row]")
    rows.nth(1).click()
    for key in ("ArrowUp", "Shift+ArrowLeft", "r", "l", "ArrowUp"):
        page.keyboard.press(key)
        settled(page)
        expect(rows.nth(1)).to_be_focused()
    expect(rows.nth(1)).to_contain_text("locked")
    expect(page.locator("#verdict")).to_have_text("The stool is locked. Unlock it first.")
    page.keyboard.press("Shift+Tab")  # what has the focus is chosen
    expect(rows.first).to_be_focused()
    page.keyboard.press("ArrowDown")
    settled(page)
    moved = [stools[0] | {"center": [0.5, 1.45]}, stools[1] | {"center": [2.49, 1.55], "rotation": 90}]
    assert room_of(page)["furniture"] == moved
    rows.first.focus()
    page.keyboard.press("Escape")
    expect(page.locator("#selected")).to_be_hidden()
    expect(rows.first).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("#selected")).to_be_visible()
    page.keyboard.press("Delete")
    settled(page)
    expect(rows).to_have_count(1)
    page.keyboard.press("Delete")  # nothing is chosen
    settled(page)
    assert room_of(page)["furniture"] == moved[1:]


def test_undo_in_a_field_is_the_fields_own(page):
    page.locator("#furniture").get_by_role("button", name="bed").click()
    settled(page)
    dragged(page, item(page, "bed"), -0.3, 0)
    before = room_of(page)
    depth = page.locator("#depth")
    first = depth.input_value()
    depth.focus()
    page.keyboard.press("Control+a")
    page.keyboard.type("3")
    page.keyboard.press("Control+z")
    expect(depth).to_have_value(first)
    assert room_of(page) == before


def test_undo_works_after_a_box_was_ticked(page):
    before = room_of(page)
    item(page, "bed").focus()
    page.keyboard.press("ArrowLeft")
    settled(page)
    page.locator("#arrows").click()
    expect(page.locator("#arrows")).to_be_focused()
    page.keyboard.press("Control+z")
    settled(page)
    assert room_of(page) == before
