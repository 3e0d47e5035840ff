"""Files are opened and rooms saved."""

from __future__ import annotations

import io
import json
from xml.etree import ElementTree

import pytest
from PIL import Image

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.formats import opened
from layoutrl.rooms.units import UNITS
from tests.demo.page.browsing import (
    DROP,
    OWN,
    SQUARE,
    corner,
    download,
    dragged,
    drawn,
    expect,
    is_left,
    item,
    openly,
    room_of,
    saved,
    settled,
    shown,
    take,
)
from tests.rooms.sources.test_sweethome3d import home_file


def test_a_file_is_opened_again(page, tmp_path):
    """A browser says so of a file only where another was chosen before, or none."""
    file = tmp_path / "room.json"
    page.locator("#saving summary").click()
    for text, said in (("no room", "expected JSON"), (json.dumps(SQUARE), "Nothing is wrong.")):
        file.write_text(text)
        with page.expect_file_chooser() as chooser:
            page.locator("#file").click()
        expect(page.locator("#file")).to_have_value("")
        chooser.value.set_files(file)
        expect(page.locator("#verdict")).to_contain_text(said)
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])


def test_files_are_opened_and_dropped(page, tmp_path):
    other = OWN | {"id": "another"}
    file = tmp_path / "rooms.jsonl"
    file.write_text(f"{json.dumps(OWN)}\n{json.dumps(other)}\n{{}}\n")
    page.locator("#saving summary").click()
    page.locator("#file").set_input_files(file)
    expect(page.locator("#title")).to_have_attribute("data-room", "my own study")
    settled(page)
    expect(page.locator("#lines")).to_contain_text("line:3: id: missing")
    expect(page.locator("#gallery").get_by_title("another")).to_be_visible()
    page.evaluate(DROP, json.dumps(OWN | {"id": "dropped"}))
    expect(page.locator("#title")).to_have_attribute("data-room", "dropped")
    page.evaluate(DROP, "no room")
    expect(page.locator("#verdict")).to_contain_text("room.json: line:1: column 1: expected JSON")
    expect(page.locator("#title")).to_have_attribute("data-room", "dropped")


def test_many_lines_on_a_file_take_no_more_space_than_ten_and_can_all_be_read(page):
    page.evaluate(DROP, json.dumps([SQUARE | {"id": "many"}, *[{}] * 30]))
    expect(page.locator("#lines li")).to_have_count(30)
    height, line, whole = page.locator("#lines").evaluate(
        "node => [node.clientHeight, parseFloat(getComputedStyle(node).lineHeight), node.scrollHeight]"
    )
    assert height <= 10 * line + 1 < whole
    page.locator("#lines li").last.scroll_into_view_if_needed()
    expect(page.locator("#lines li").last).to_be_in_viewport()


def test_what_went_wrong_is_said_until_something_changes(page):
    page.evaluate(DROP, "no room")
    expect(page.locator("#verdict")).to_contain_text("expected JSON")
    page.set_viewport_size({"width": 1000, "height": 800})
    page.evaluate("new Promise(requestAnimationFrame)")
    expect(page.locator("#verdict")).to_contain_text("expected JSON")
    item(page, "bed").focus()
    expect(page.locator("#verdict")).to_have_text("Nothing is wrong.")


def test_a_file_that_is_no_file_of_rooms_is_told_by_its_name(page):
    page.evaluate(DROP.replace("room.json", "plan.pdf"), "%PDF-1.7")
    expect(page.locator("#verdict")).to_have_text("plan.pdf: expected a file of rooms: .json, .jsonl, .sh3d, .sh3x")
    page.evaluate(DROP.replace("room.json", "ROOM.JSON"), json.dumps(SQUARE))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])


def test_a_room_that_is_read_but_not_shown_is_said(page):
    page.route("**/api/look", lambda route: route.fulfill(status=400, body='{"error": "busy"}'))
    page.evaluate(DROP, json.dumps(SQUARE))
    expect(page.locator("#verdict")).to_have_text("busy")
    expect(page.locator("#title")).not_to_have_attribute("data-room", SQUARE["id"])
    page.unroute("**/api/look")
    page.locator("#gallery").get_by_title(SQUARE["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])


def test_while_a_file_is_read_the_page_says_so(page):
    held = []
    page.route("**/api/read*", lambda route: held.append(route))
    with page.expect_request("**/api/read*"):
        page.evaluate(DROP, "no room")
    expect(page.locator("#verdict")).to_have_text("room.json is being read.")
    while not held:
        page.wait_for_timeout(10)
    held[0].continue_()
    expect(page.locator("#verdict")).to_contain_text("room.json: line:1: column 1: expected JSON")
    expect(page.locator("#lines")).to_be_empty()


def test_rooms_of_the_gallery_of_a_file_and_drawn_ones_are_taken_up_as_they_were_left(page):
    page.evaluate(DROP, json.dumps([OWN, SQUARE]))
    expect(page.locator("#title")).to_have_attribute("data-room", OWN["id"])
    take(page, "bedroom")  # the first that is shown, of the gallery
    dragged(page, item(page, "bed"), -0.3, 0)
    edited = {room_of(page)["id"]: room_of(page)["furniture"]}
    page.locator("#gallery").get_by_title(SQUARE["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    settled(page)
    dragged(page, item(page, "stool"), 0.5, 0)
    edited[SQUARE["id"]] = room_of(page)["furniture"]
    drawn(page, ((1, 1), (4, 1), (4, 4), (1, 4)))
    page.locator("#palette").get_by_role("button").first.click()
    settled(page)
    edited[room_of(page)["id"]] = room_of(page)["furniture"]
    assert len(edited) == 3
    expect(page.locator("#gallery li").first.locator(".item")).to_have_count(1)  # the strip shows it as it is now
    for name, furniture in edited.items():
        page.locator("#gallery").get_by_title(name, exact=True).click()
        expect(page.locator("#title")).to_have_attribute("data-room", name)
        settled(page)
        assert room_of(page)["furniture"] == furniture


def test_a_file_is_read_anew_in_the_unit_that_is_chosen(page):
    inches = SQUARE | {"outline": [[0, 0], [144, 0], [144, 120], [0, 120]], "furniture": []}
    inches |= {"doors": [{"polygon": [[20, -8], [56, -8], [56, 0], [20, 0]]}]}
    count = page.locator("#gallery li").count()
    page.evaluate(DROP, json.dumps(inches))
    expect(page.locator("#lines")).to_contain_text("choose unit in if lengths are inches")
    page.locator("#saving summary").click()
    assert page.locator("#unit option").all_inner_texts() == ["auto", *UNITS]
    page.locator("#unit").select_option("in")
    expect(page.locator("#title")).to_contain_text("11.1 m²")
    settled(page)
    expect(page.locator("#lines li")).to_have_count(0)
    expect(page.locator("#gallery li")).to_have_count(count + 1)


def test_a_room_that_was_read_in_another_unit_is_saved_and_opened_in_metres(page, tmp_path):
    inches = SQUARE | {"outline": [[0, 0], [144, 0], [144, 120], [0, 120]], "furniture": []}
    inches |= {"doors": [{"polygon": [[20, -8], [56, -8], [56, 0], [20, 0]]}]}
    page.locator("#saving summary").click()
    page.locator("#unit").select_option("in")
    shown(page, inches)
    file = tmp_path / "room.json"
    file.write_bytes(saved(page, "json"))
    expect(page.locator("#unit")).to_have_value("auto")
    take(page, "bedroom")
    page.locator("#file").set_input_files(file)
    expect(page.locator("#title")).to_contain_text("11.1 m²")


def test_who_edited_a_file_is_asked_before_it_is_read_anew(page):
    asked = []
    page.evaluate(DROP, json.dumps(SQUARE))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    before = item(page, "stool").get_attribute("transform")
    dragged(page, item(page, "stool"), 0.5, 0)
    page.once("dialog", lambda dialog: asked.append(dialog.message) or dialog.dismiss())
    page.locator("#saving summary").click()
    page.locator("#unit").select_option("m")
    expect(page.locator("#unit")).to_have_value("auto")
    assert asked == ["Read room.json anew? Edits in it that are not saved are lost."]
    assert room_of(page)["furniture"][0]["center"][0] == pytest.approx(2, abs=0.03)  # which saves it
    dragged(page, item(page, "stool"), -0.2, 0)
    assert not is_left(page)
    page.once("dialog", lambda dialog: dialog.accept())
    page.locator("#unit").select_option("m")
    expect(item(page, "stool")).to_have_attribute("transform", before)
    settled(page)
    assert is_left(page)
    assert room_of(page)["furniture"][0]["center"] == SQUARE["furniture"][0]["center"]
    page.locator("#undo").click()  # to the room before the file
    settled(page)
    expect(page.locator("#title")).not_to_have_attribute("data-room", SQUARE["id"])
    assert is_left(page)


def test_rooms_of_a_file_of_several_have_their_names_in_the_strip(page, tmp_path):
    long = SQUARE | {"id": "the guests' study on the second floor"}
    page.evaluate(DROP, json.dumps([OWN, long]))
    expect(page.locator("#gallery .id")).to_have_text([OWN["id"], long["id"]])
    widths = page.locator("#gallery .id").evaluate_all("nodes => nodes.map((node) => node.clientWidth)")
    assert max(widths) <= page.locator("#gallery button").first.evaluate("node => node.clientWidth")
    page.evaluate(DROP, json.dumps(OWN | {"id": "alone"}))
    expect(page.locator("#title")).to_have_attribute("data-room", "alone")
    expect(page.locator("#gallery .id")).to_have_count(2)
    openly(page, home_file(tmp_path / "home.sh3d").read_bytes(), "file/Bedroom")
    expect(page.locator("#gallery .id").first).to_have_text("Bedroom")


def test_what_stands_in_a_room_of_a_file_stays_where_the_rest_is_placed(still, tmp_path):
    furniture = [dict(entry) for entry in OWN["furniture"]]
    for field in ("center", "rotation"):
        del furniture[1][field]
    file = tmp_path / "room.json"
    file.write_text(json.dumps(OWN | {"furniture": furniture}))
    still.locator("#saving summary").click()
    still.locator("#file").set_input_files(file)
    expect(still.locator("#title")).to_have_attribute("data-room", "my own study")
    settled(still)
    expect(still.locator("#plan .item.locked")).to_have_count(len(furniture) - 1)
    still.locator("#furnish").click()
    settled(still)
    after = room_of(still)["furniture"]
    assert after[1]["center"]
    assert [after[k] for k in range(len(after)) if k != 1] == [furniture[k] for k in range(len(after)) if k != 1]


def test_a_room_is_saved_as_it_is_read(page):
    document = room_of(page)
    assert room_to_dict(room_from_dict(json.loads(json.dumps(document)))) == document


def test_a_file_of_several_rooms_is_saved_with_all_of_them_as_they_are_now(page, tmp_path):
    kitchen = room_to_dict(design_rooms("kitchen", "test", 8, 1).rooms[0])
    page.evaluate(DROP, json.dumps([OWN, SQUARE, kitchen]))
    expect(page.locator("#title")).to_have_attribute("data-room", OWN["id"])
    page.locator("#gallery").get_by_title(SQUARE["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    dragged(page, item(page, "stool"), 0.5, 0)
    page.locator("#gallery").get_by_title(OWN["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", OWN["id"])
    settled(page)
    file = tmp_path / "rooms.json"
    file.write_bytes(saved(page, "json"))
    collection = opened(file).collection
    assert collection.left_out == []
    own, square, last = collection.rooms
    assert [own, last] == [room_from_dict(OWN), room_from_dict(kitchen)]
    assert square.furniture[0].center == (pytest.approx(2, abs=0.03), pytest.approx(1.5, abs=0.03))


def test_what_is_locked_is_locked_in_json(page, tmp_path):
    page.evaluate(DROP, json.dumps([SQUARE, OWN | {"furniture": [OWN["furniture"][0] | {"locked": True}]}]))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    item(page, "stool").focus()
    page.keyboard.press("l")
    expect(page.locator("#lock")).to_have_attribute("aria-pressed", "true")

    def locked() -> list[bool]:
        return ["locked" in room["furniture"][0] for room in json.loads(saved(page, "json"))]

    assert locked() == [True, True]  # the second was not looked at
    page.locator("#gallery").get_by_title(OWN["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", OWN["id"])
    expect(page.locator("#plan .item.locked")).to_have_count(1)
    page.locator("#plan [data-item='0']").focus()
    page.keyboard.press("l")
    expect(page.locator("#plan .item.locked")).to_have_count(0)
    assert locked() == [True, False]


def test_what_the_page_locks_is_not_locked_in_json(page):
    stands, waits = ({"category": "stool", "size": [0.5, 0.5]} | more for more in ({"center": [1, 2]}, {}))
    furniture = [stands, stands | {"center": [2, 2], "locked": True}, stands | {"center": [2, 1]}, waits]
    page.evaluate(DROP, json.dumps(SQUARE | {"furniture": furniture}))
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    settled(page)

    def locked() -> list[bool]:
        return ["locked" in entry for entry in json.loads(saved(page, "json"))["furniture"]]

    expect(page.locator("#plan .item.locked")).to_have_count(3)
    assert locked() == [False, True, False, False]
    page.locator("#plan [data-item='2']").focus()
    expect(page.locator("#lock")).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("l")
    expect(page.locator("#plan .item.locked")).to_have_count(2)
    page.keyboard.press("l")
    expect(page.locator("#plan .item.locked")).to_have_count(3)
    assert locked() == [False, True, True, False]


def test_who_leaves_the_page_is_asked_where_edits_are_not_saved(page):
    page.evaluate(DROP, json.dumps([OWN, SQUARE]))
    expect(page.locator("#title")).to_have_attribute("data-room", OWN["id"])
    assert is_left(page)
    page.locator("#gallery").get_by_title(SQUARE["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", SQUARE["id"])
    dragged(page, item(page, "stool"), 0.5, 0)
    assert not is_left(page)
    page.locator("#undo").click()
    settled(page)
    assert is_left(page)
    page.locator("#redo").click()
    settled(page)
    take(page, "bedroom", 0)
    assert not is_left(page)
    saved(page, "json")  # of another room
    assert not is_left(page)
    page.locator("#gallery").get_by_title(OWN["id"]).click()
    expect(page.locator("#title")).to_have_attribute("data-room", OWN["id"])
    saved(page, "json")
    assert is_left(page)


def test_what_is_edited_while_a_file_is_made_is_not_saved(page):
    shown(page, SQUARE)
    held = []
    page.route("**/api/home*", lambda route: held.append(route))
    page.locator("#saving summary").click()
    with page.expect_request("**/api/home*"):
        page.locator("#save-sh3d").click()
    dragged(page, item(page, "stool"), 0.5, 0)
    with page.expect_download():
        held.pop().continue_()
    assert not is_left(page)
    page.locator("#undo").click()
    settled(page)
    assert is_left(page)
    item(page, "stool").focus()
    settled(page)
    page.evaluate(
        "() => { const Real = CompressionStream; window.CompressionStream = function (format) {"
        "document.querySelector('#lock').click(); return new Real(format); } }"
    )
    page.locator("#share").click()
    expect(page.locator("#link")).not_to_have_value("")
    settled(page)
    expect(page.locator("#plan .item.locked")).to_have_count(1)
    assert not is_left(page)


def test_an_outline_that_is_left_waits_and_who_leaves_the_page_is_asked(page):
    draw, corners = page.locator("#draw"), page.locator("#plan .corner")
    page.locator("#building summary").click()
    draw.click()
    for x, y in ((1, 1), (4, 1), (4, 4)):
        page.mouse.click(*corner(page, x, y))
    expect(corners).to_have_count(3)
    page.keyboard.press("Escape")
    expect(corners).to_have_count(0)
    assert not is_left(page)
    take(page, "bathroom")
    for leave in (lambda: draw.click(), lambda: take(page, "bedroom")):
        expect(draw).to_have_text("Go on with the outline")
        draw.click()
        expect(corners).to_have_count(3)
        leave()
    draw.click()
    page.locator("#close").click()
    expect(draw).to_have_text("Draw an outline")
    settled(page)
    assert not is_left(page)
    assert room_of(page)["outline"] == [[1, 1], [4, 1], [4, 4]]  # which saves it
    assert is_left(page)


def test_a_saved_file_is_named_in_the_letters_of_the_room(page):
    page.evaluate(DROP, json.dumps(SQUARE | {"id": "Küche 2/卧室 हिन्दी"}))
    expect(page.locator("#title")).to_contain_text("study")
    assert download(page, "json").suggested_filename == "Küche_2_卧室_हिन्दी.json"


def test_a_room_is_saved_as_drawings(page):
    drawing = ElementTree.fromstring(saved(page, "svg"))
    items = [node for node in drawing.iter() if "data-id" in node.attrib]
    assert len(items) == len(room_of(page)["furniture"])
    picture = Image.open(io.BytesIO(saved(page, "png"))).convert("RGB")
    assert max(picture.size) == 1600
    assert len(set(picture.resize((100, 80)).getdata())) > 5


def test_what_is_printed_is_the_plan_and_what_is_wrong(page):
    page.emulate_media(media="print", color_scheme="dark")
    for name in ("#plan", "#title", "#verdict"):
        expect(page.locator(name)).to_be_visible()
    for name in ("nav", "aside", "#furnish", "#undo", "#keys"):
        expect(page.locator(name)).to_be_hidden()
    assert page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--floor')") == "#ffffff"
