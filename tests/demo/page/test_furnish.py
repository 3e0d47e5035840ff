"""Furnishing, choices, and what the agent thinks."""

from __future__ import annotations

import json
from typing import Any

import pytest

from layoutrl.rooms.documents import room_from_dict
from layoutrl.rooms.faults import OVERLAPS, faults
from layoutrl.rooms.oddities import IN_SWING, OFF_ITS_WALL
from tests.demo.page.browsing import (
    DROP,
    OWN,
    PRESS,
    SQUARE,
    corner,
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
)


def test_furnish_plays_moves_offers_choices_and_skips(page):
    page.locator("#clear").click()
    settled(page)
    expect(page.locator("#verdict")).to_have_text("4 to be placed")
    expect(page.locator("#plan .item")).to_have_count(0)
    page.locator("#speed").select_option("slow")
    page.locator("#furnish").click()
    expect(page.locator("body")).to_have_attribute("data-state", "playing")
    expect(page.locator("#plan .item").first).to_be_attached()
    expect(page.locator("#furnish")).to_be_disabled()
    page.locator("#skip").click()
    settled(page)
    expect(page.locator("#plan .item")).to_have_count(4)
    choices = page.locator("#choices").get_by_role("button")
    assert 2 <= choices.count() <= 3  # as many as the search finds that differ
    expect(choices.first).to_have_attribute("aria-pressed", "true")
    first = room_of(page)["furniture"]
    choices.last.click()
    settled(page)
    assert room_of(page)["furniture"] != first
    expect(choices.last).to_have_attribute("aria-pressed", "true")
    page.locator("#undo").click()
    settled(page)
    assert room_of(page)["furniture"] == first


def test_choices_count_oddities_apart_from_faults(still):
    wrong = [[0, name, "in words"] for name in (OFF_ITS_WALL, IN_SWING, OVERLAPS)]
    found = [wrong[:2], wrong, [*wrong[1:], wrong[2]], []]
    furniture = room_of(still)["furniture"]
    choices = [{"furniture": furniture, "path": [], "faults": told} for told in found]
    answer = json.dumps({"lines": [], "choices": choices})
    still.route("**/api/furnish", lambda route: route.fulfill(body=answer))
    still.locator("#furnish").click()
    said = ["2 oddities", "1 fault, 2 oddities", "2 faults, 1 oddity", "no fault"]
    labels = [f"Choice {k}: {text}" for k, text in enumerate(said, 1)]
    expect(still.locator("#choices").get_by_role("button")).to_have_text(labels)
    settled(still)


def test_why_there_are_no_other_choices_is_said(still):
    choice = {"furniture": room_of(still)["furniture"], "path": [], "faults": []}
    first = json.dumps({"lines": ["the harp stays"], "choices": [choice]})

    def busy(route: Any) -> None:
        if "choices" in route.request.post_data_json:
            route.fulfill(body=first)
        else:
            route.fulfill(status=400, body='{"error": "busy: ask again"}')

    still.route("**/api/furnish", busy)
    still.locator("#furnish").click()
    said = ["the harp stays", "No other choices: busy: ask again"]
    expect(still.locator("#lines li")).to_have_text(said)
    settled(still)
    expect(still.locator("#choices").get_by_role("button")).to_have_count(1)


def test_the_page_is_used_while_other_choices_are_found(still):
    first, held, choices = [], [], still.locator("#choices").get_by_role("button")

    def hold(route: Any) -> None:
        if "choices" in route.request.post_data_json:
            first.append(route)
            route.continue_()
        else:
            held.append(route)  # others

    def furnished() -> None:
        while not held:
            still.evaluate("0")  # lets it be asked
        expect(still.locator("body")).to_have_attribute("data-state", "idle")
        expect(choices).to_have_count(1)
        expect(still.locator("#choices")).to_have_attribute("aria-busy", "true")

    still.route("**/api/furnish", hold)
    still.locator("#furnish").click()
    furnished()
    still.locator("#furniture [data-row='1']").click()
    still.locator("#lock").click()
    expect(still.locator("#plan .item.locked")).to_have_count(1)
    held.pop().continue_()
    settled(still)
    assert 2 <= choices.count() <= 3
    expect(still.locator("#plan .item.locked")).to_have_count(1)
    still.locator("#furnish").click()
    furnished()
    still.locator("#furnish").click()
    expect(still.locator("body")).to_have_attribute("data-state", "asking")
    still.evaluate("0")
    assert len(first) == 2  # the third is not asked before the others are known
    held.pop().continue_()
    furnished()
    still.locator("#undo").click()
    expect(choices).to_have_count(0)
    held.pop().continue_()
    settled(still)
    expect(choices).to_have_count(0)  # they are of another room


@pytest.mark.parametrize("kind", ["door", "window"])
def test_furnishing_ends_that_doors_or_windows_are_put_in(page, kind):
    page.locator("#building summary").click()
    page.locator(f"#{kind}").click()
    count = page.locator(f"#plan .{kind}").count()
    page.locator("#speed").select_option("slow")
    page.locator("#furnish").click()
    expect(page.locator("body")).to_have_attribute("data-state", "playing")
    page.mouse.click(*corner(page, 0, 2.5))
    page.locator("#skip").dispatch_event("click")  # or it is done already
    settled(page)
    expect(page.locator(f"#plan .{kind}")).to_have_count(count)
    expect(page.locator("#verdict")).not_to_contain_text("Looking")
    expect(page.locator(f"#{kind}")).to_have_attribute("aria-pressed", "false")


def test_doors_and_windows_are_put_in_and_taken_out_in_turn(page):
    shown(page, SQUARE)
    page.locator("#building summary").click()
    page.locator("#adding summary").click()
    page.locator("#door").click()
    held, holds = [], [True]
    page.route("**/api/opening", lambda route: held.append(route) if holds else route.continue_())
    with page.expect_request("**/api/opening"):
        page.mouse.click(*corner(page, 0, 1))
    page.mouse.click(*corner(page, 3, 2))
    page.locator("#palette button").first.click()
    holds.clear()
    for route in held:
        route.continue_()
    expect(page.locator("#plan .door")).to_have_count(3)
    settled(page)
    room = room_of(page)
    assert (len(room["doors"]), len(room["furniture"])) == (3, 2)
    page.locator("#plan [data-opening='0']").press("Enter")
    settled(page)
    page.evaluate(PRESS, ["Delete", "Delete"])  # the second finds it gone
    settled(page)
    assert room_of(page)["doors"] == room["doors"][1:]


def test_the_moves_end_by_themselves(page):
    page.locator("#speed").select_option("fast")
    before = [middle(page.locator(name)) for name in ("#furnish", "#speed")]
    page.locator("#furnish").click()
    expect(page.locator("body")).to_have_attribute("data-state", "playing")
    assert [middle(page.locator(name)) for name in ("#furnish", "#speed")] == before  # beside "Skip"
    settled(page)
    expect(page.locator("#skip")).to_be_hidden()
    assert not faults(room_from_dict(json.loads(saved(page, "json"))))


def test_what_is_locked_stays(still):
    item(still, "wardrobe").focus()
    still.keyboard.press("l")
    settled(still)
    before = room_of(still)["furniture"]
    still.locator("#furnish").click()
    settled(still)
    after = room_of(still)["furniture"]
    assert after[1] == before[1]
    assert after[0] != before[0]
    expect(still.locator("#plan .item.locked .padlock")).to_have_count(1)


def test_what_is_locked_stays_whichever_choice_is_taken(still):
    still.locator("#furnish").click()
    settled(still)
    item(still, "bed").focus()
    still.keyboard.press("l")
    settled(still)
    before = room_of(still)["furniture"]
    choices = still.locator("#choices").get_by_role("button")
    expect(choices.first).to_contain_text("Choice 1: ")  # the bed is where it was
    for k in range(1, choices.count()):
        expect(choices.nth(k)).to_have_text(f"Choice {k + 1}")  # nobody has looked at it with the bed there
        choices.nth(k).click()
        settled(still)
        after = room_of(still)["furniture"]
        assert after[0] == before[0]
        assert after[1:] != before[1:]
    item(still, "bed").focus()
    still.keyboard.press("l")
    expect(choices.last).to_contain_text(":")


def test_choices_come_back_with_what_is_done_again(still):
    choices = still.locator("#choices").get_by_role("button")
    still.locator("#furnish").click()
    settled(still)
    count = choices.count()
    choices.last.click()
    settled(still)
    furniture = room_of(still)["furniture"]
    for name, times in (("undo", 2), ("redo", 2)):
        for _ in range(times):
            still.locator(f"#{name}").click()
            settled(still)
    assert room_of(still)["furniture"] == furniture
    expect(choices).to_have_count(count)
    expect(choices.last).to_have_attribute("aria-pressed", "true")


def test_a_choice_stays_where_it_is_pressed(still):
    """Not drawn anew when the server answers: a press on it would be lost."""
    still.locator("#furnish").click()
    settled(still)
    still.evaluate("window.pressed = document.querySelector('#choices').lastChild")
    item(still, "bed").focus()
    still.keyboard.press("ArrowUp")
    settled(still)
    assert still.evaluate("window.pressed.isConnected")
    take(still, "bathroom")
    assert not still.evaluate("window.pressed.isConnected")


def test_what_has_the_focus_by_then_keeps_it(still):
    held = []
    still.route("**/api/furnish", lambda route: held.append(route))
    still.locator("#furnish").click()
    expect(still.locator("body")).to_have_attribute("data-state", "asking")
    still.locator("#speed").focus()
    until(still, lambda: held)
    held.pop().fulfill(status=400, body='{"error": "busy"}')
    settled(still)
    expect(still.locator("#speed")).to_be_focused()


def test_only_this_item_moves(still):
    dragged(still, item(still, "wardrobe"), 0.6, -0.8)
    before = room_of(still)["furniture"]
    still.locator("#only").click()
    settled(still)
    after = room_of(still)["furniture"]
    assert [k for k in range(len(after)) if after[k] != before[k]] == [1]


def test_what_cannot_be_placed_is_said(still):
    still.locator("#furniture").get_by_role("button", name="wardrobe").click()
    still.locator("#depth").fill("9")
    still.locator("#depth").blur()
    settled(still)
    still.locator("#clear").click()
    settled(still)
    still.locator("#furniture").get_by_role("button", name="wardrobe").click()
    settled(still)
    still.locator("#depth").fill("9")
    still.locator("#depth").blur()
    settled(still)
    still.locator("#furnish").click()
    settled(still)
    expect(still.locator("#lines")).to_contain_text("the wardrobe of 9 by 1.8 m is not placed")
    expect(still.locator("#verdict")).to_contain_text("1 to be placed")
    expect(still.locator("#choices button").first).to_be_visible()
    still.locator("#building summary").click()
    still.locator("#draw").click()
    expect(still.locator("#lines")).to_be_hidden()
    expect(still.locator("#choices")).to_be_hidden()
    still.locator("#draw").click()
    expect(still.locator("#lines")).to_be_visible()
    still.locator("#window").click()
    still.mouse.click(*middle(still.locator("#plan .window").first))
    expect(still.locator("#verdict")).to_contain_text("there is one already")
    still.keyboard.press("Escape")
    still.locator("#plan .window").first.click()
    still.locator("#delete").click()
    settled(still)
    expect(still.locator("#lines li")).to_have_count(0)


def test_what_was_said_of_a_furnishing_or_a_file_goes_with_it(still):
    still.evaluate(DROP, json.dumps([OWN, {}]))
    expect(still.locator("#lines")).to_contain_text("id: missing")
    still.evaluate(DROP, "no room")
    expect(still.locator("#verdict")).to_contain_text("expected JSON")
    expect(still.locator("#lines li")).to_have_count(0)
    still.evaluate(DROP, json.dumps([SQUARE, {}]))
    expect(still.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    expect(still.locator("#lines li")).to_have_count(1)
    take(still, "bedroom")
    expect(still.locator("#lines li")).to_have_count(0)
    still.locator("#furnish").click()
    settled(still)
    expect(still.locator("#choices button").first).to_be_visible()
    still.route("**/api/furnish", lambda route: route.fulfill(status=400, body='{"error": "busy"}'))
    still.locator("#furnish").click()
    settled(still)
    expect(still.locator("#verdict")).to_have_text("busy")
    expect(still.locator("#choices")).to_be_hidden()


def test_what_the_agent_thinks_is_a_map_and_arrows(page):
    item(page, "bed").focus()
    settled(page)
    expect(page.locator("#thinking")).to_be_visible()
    page.locator("#heat").check()
    expect(page.locator("#plan .value").nth(50)).to_be_attached()
    expect(page.locator("#scale")).to_be_visible()
    see_through = page.locator("#plan #chosen .body").evaluate("node => getComputedStyle(node).fillOpacity")
    assert float(see_through) < 0.5  # what lies under it shows
    page.locator("#arrows").check()
    expect(page.locator("#plan .arrow")).to_have_count(2)
    expect(page.locator("#moves li")).to_have_text(["left: 2.0", "down: 1.0"])
    page.locator("#heat").uncheck()
    expect(page.locator("#plan .value")).to_have_count(0)
    page.locator("#furnish").click()
    settled(page)
    expect(page.locator("#plan .arrow")).to_have_count(2)  # from where the item is now
    page.locator("#undo").click()
    settled(page)
    expect(page.locator("#plan .arrow")).to_have_count(2)
    page.locator("#building summary").click()
    page.locator("#draw").click()
    expect(page.locator("#thinking")).to_be_hidden()
    page.locator("#draw").click()
    rug = {"category": "rug", "size": [1, 1], "center": [1.5, 1.5]}
    page.evaluate(DROP, json.dumps(SQUARE | {"furniture": [rug]}))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    expect(page.locator("#thinking")).to_be_hidden()
    item(page, "rug").focus()
    expect(page.locator("#verdict")).to_contain_text("nobody places a rug in a study")


def test_values_are_asked_for_one_after_the_other(page):
    """The server furnishes none the later for those that are outdated."""
    held = []
    page.route("**/api/values", lambda route: held.append(route))

    def asked(times: int) -> None:
        while len(held) < times:
            page.evaluate("0")

    item(page, "bed").focus()
    page.locator("#heat").check()
    asked(1)
    page.locator("#plan [data-item='0']").focus()
    for _ in range(3):
        page.keyboard.press("ArrowLeft")
        settled(page)
    assert len(held) == 1
    held[0].continue_()
    asked(2)
    expect(page.locator("#plan .value")).to_have_count(0)  # the first are outdated
    centers = [route.request.post_data_json["room"]["furniture"][0]["center"] for route in held]
    assert centers[1][0] == pytest.approx(centers[0][0] - 0.15)
    held[1].continue_()
    expect(page.locator("#plan .value").nth(50)).to_be_attached()
    assert len(held) == 2
