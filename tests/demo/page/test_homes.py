"""Homes of Sweet Home 3D are opened and saved whole."""

from __future__ import annotations

import io
import random
import zipfile
from collections.abc import Sequence

import pytest

from layoutrl.rooms.documents import room_from_dict
from layoutrl.rooms.formats import opened
from layoutrl.rooms.room import Room
from tests.demo.page.browsing import (
    PRESS,
    SQUARE,
    download,
    dragged,
    expect,
    is_left,
    item,
    openly,
    room_of,
    saved,
    settled,
    shown,
    take,
    visited,
)
from tests.rooms.sources.test_sweethome3d import FLAT, home_file, piece


def test_a_home_of_sweet_home_3d_is_saved_opened_and_written_back(page, tmp_path):
    file = tmp_path / "file.sh3d"
    file.write_bytes(saved(page, "sh3d"))
    furniture = room_of(page)["furniture"]
    page.locator("#file").set_input_files(file)
    expect(page.locator("#title")).to_have_attribute("data-room", "file/bedroom")
    settled(page)
    assert [entry["category"] for entry in room_of(page)["furniture"]] == [entry["category"] for entry in furniture]
    dragged(page, item(page, "bed"), -0.5, 0)
    file.write_bytes(saved(page, "sh3d"))
    (room,) = opened(file).collection.rooms
    assert room.furniture[0].center == pytest.approx(room_of(page)["furniture"][0]["center"], abs=1e-3)
    item(page, "wardrobe").focus()
    page.keyboard.press("Delete")
    settled(page)
    page.locator("#save-sh3d").click()
    expect(page.locator("#verdict")).to_contain_text("home: expected the furniture that was read from it")


def entry_of(content: bytes, name: str) -> bytes:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return archive.read(name)


def test_a_room_is_saved_into_the_home_that_it_was_read_from(page, tmp_path):
    """Two versions of a home have rooms of the same names."""
    for version in (b"one", b"two"):
        openly(page, home_file(tmp_path / "home.sh3d", entries={"version": version}).read_bytes(), "file/Bedroom")
    bedrooms = page.locator("#gallery").get_by_title("file/Bedroom")
    expect(bedrooms).to_have_count(2)  # the first is of the version that was opened last
    for number, version in ((1, b"one"), (0, b"two")):
        bedrooms.nth(number).click()
        settled(page)
        assert entry_of(saved(page, "sh3d"), "version") == version
        page.locator("#undo").click()  # to a room of the other
        settled(page)
        assert entry_of(saved(page, "sh3d"), "version") != version
        page.locator("#redo").click()
        settled(page)


def test_a_home_is_saved_with_all_its_rooms_as_they_are_now(page, tmp_path):
    shelf = piece("bookcase", 300, 15, 80, 30, id="shelf", movable="false")
    openly(page, home_file(tmp_path / "home.sh3d", FLAT + shelf).read_bytes(), "file/Bedroom")
    expect(page.locator("#plan .item.locked")).to_have_count(1)  # what the home does not let move
    item(page, "bed").focus()
    page.keyboard.press("ArrowDown")
    settled(page)
    bedroom = room_of(page)
    page.locator("#gallery").get_by_title("file/room 2").click()
    expect(page.locator("#title")).to_contain_text("bathroom")
    settled(page)
    item(page, "toilet").focus()
    page.keyboard.press("ArrowDown")
    settled(page)
    (tmp_path / "saved.sh3d").write_bytes(saved(page, "sh3d"))
    rooms = opened(tmp_path / "saved.sh3d").collection.rooms
    assert [room.furniture for room in rooms] == [room_from_dict(room).furniture for room in (bedroom, room_of(page))]
    page.locator("#gallery").get_by_title("file/Bedroom").click()
    expect(page.locator("#title")).to_contain_text("bedroom")
    settled(page)
    assert room_of(page) == bedroom
    expect(page.locator("#plan .item.locked")).to_have_count(1)


def test_a_room_of_which_nothing_tells_the_type_is_a_bedroom_until_another_is_chosen(still, tmp_path, browser):
    untold = FLAT.replace("Bedroom", "Xyz").replace("bed140x190", "whatsit")
    openly(still, content := home_file(tmp_path / "home.sh3d", untold).read_bytes(), "file/Xyz")
    note = "file/Xyz: nothing tells its type; it is taken for a bedroom"
    for _ in range(2):
        expect(still.locator("#lines li").filter(has_text=note)).to_have_count(1)
        expect(still.locator("#type")).to_have_value("bedroom")
        take(still, "bathroom")
        expect(still.locator("#lines li")).to_have_count(0)
        still.locator("#gallery").get_by_title("file/Xyz").click()
        expect(still.locator("#title")).to_have_attribute("data-room", "file/Xyz")
    before = room_of(still)
    still.locator("#type").select_option("dining_room")
    settled(still)
    expect(still.locator("#title")).to_contain_text("dining room")
    expect(still.locator("#gallery").get_by_title("file/Xyz")).to_contain_text("dining room")
    expect(still.locator("#lines li")).to_have_count(0)
    assert not is_left(still)
    assert room_of(still) == before | {"room_type": "dining_room"}
    still.locator("#undo").click()
    settled(still)
    assert room_of(still) == before
    still.locator("#redo").click()
    settled(still)
    assert saved(still, "sh3d") == content  # in which nothing moved
    still.locator("#adding summary").click()
    still.locator("#palette").get_by_role("button", name="sideboard").first.click()
    settled(still)
    with still.expect_request("**/api/furnish") as asked:
        still.locator("#furnish").click()
    assert asked.value.post_data_json["room"]["room_type"] == "dining_room"
    settled(still)
    still.locator("#saving").evaluate("node => { node.open = true }")
    still.locator("#share").click()
    expect(still.locator("#link")).not_to_have_value("")
    other = next(pages := visited(browser, still.locator("#link").input_value()))
    expect(other.locator("#type")).to_have_value("dining_room")
    assert next(pages, None) is None


def test_the_type_is_chosen_in_turn_and_put_back_where_the_server_does_not_answer(page):
    shown(page, SQUARE)
    item(page, "stool").focus()
    settled(page)
    choose = "document.querySelector('#type').value = 'kitchen'; document.querySelector('#type').onchange()"
    page.evaluate(f"keys => {{ ({PRESS})(keys); {choose} }}", ["ArrowRight"])
    settled(page)
    page.locator("#undo").click()
    settled(page)
    room = room_of(page)
    assert (room["furniture"][0]["center"], room["room_type"]) == ([1.55, 1.5], "study")
    page.route("**/api/look", lambda route: route.fulfill(status=400, body='{"error": "gone"}'))
    page.locator("#type").select_option("kitchen")
    expect(page.locator("#verdict")).to_have_text("gone")
    settled(page)
    expect(page.locator("#type")).to_have_value("study")
    page.unroute("**/api/look")
    assert room_of(page) == room


def test_rooms_of_a_home_are_called_as_its_file_and_saved_into_it(page, tmp_path):
    content, ids = home_file(tmp_path / "home.sh3d").read_bytes(), []
    for called in ("my flat", "the: other one"):
        name = called.replace(":", "_")
        openly(page, content, f"{name}/Bedroom", f"{called}.sh3d")
        expect(page.locator("#gallery .id").first).to_have_text("Bedroom")
        item(page, "bed").focus()
        page.keyboard.press("ArrowDown")
        settled(page)
        document = room_of(page)
        assert document["group"] == name
        ids.append(document["id"])
        (tmp_path / f"{name}.sh3d").write_bytes(saved(page, "sh3d"))
        assert opened(tmp_path / f"{name}.sh3d").collection.rooms[0] == room_from_dict(document)
        assert download(page, "svg").suggested_filename == f"{name}_Bedroom.svg".replace(" ", "_")
    assert ids == ["my flat/Bedroom", "the_ other one/Bedroom"]


def test_a_home_with_large_models_is_opened_and_saved_and_other_files_stay_small(page, tmp_path):
    models = {"model.obj": b"v 0 0 0\n" + random.Random(1).randbytes(6_000_000)}
    openly(page, home_file(tmp_path / "home.sh3d", entries=models).read_bytes(), "file/Bedroom")
    item(page, "bed").focus()
    page.keyboard.press("ArrowDown")
    settled(page)
    assert entry_of(saved(page, "sh3d"), "model.obj") == models["model.obj"]
    for name, begin, most in (("a.json", b"[", 5), ("b.sh3d", b"PK", 50)):
        file = tmp_path / name
        file.write_bytes(begin.ljust(most * 1_000_000 + 1))
        page.locator("#file").set_input_files(file)
        expect(page.locator("#verdict")).to_have_text(f"{name} is larger than {most} MB.")


def test_a_room_with_other_furniture_keeps_no_other_room_from_being_saved(page, tmp_path):
    (tmp_path / "saved.sh3d").write_bytes(content := home_file(tmp_path / "home.sh3d").read_bytes())
    before = opened(tmp_path / "saved.sh3d").collection.rooms[0]
    openly(page, content, "file/Bedroom")
    item(page, "bed").focus()
    page.keyboard.press("Delete")
    settled(page)
    take(page, "bathroom")
    item(page, "toilet").focus()
    page.keyboard.press("ArrowDown")
    settled(page)
    (tmp_path / "saved.sh3d").write_bytes(saved(page, "sh3d"))
    expect(page.locator("#verdict")).to_contain_text("home: saved, but as it was before in 'file/Bedroom'")
    bedroom, bathroom = opened(tmp_path / "saved.sh3d").collection.rooms
    assert bedroom.furniture == before.furniture
    assert bathroom.furniture == room_from_dict(room_of(page)).furniture


def test_what_a_saved_home_does_not_keep_is_said(page, tmp_path):
    shown(page, SQUARE)
    page.locator("#clear").click()
    settled(page)
    saved(page, "sh3d")
    said = "home: saved, but what has no place stands beside the room there: stool"
    expect(page.locator("#verdict")).to_have_text(said)
    openly(page, content := home_file(tmp_path / "home.sh3d").read_bytes(), "file/Bedroom")
    page.locator("#clear").click()
    settled(page)
    take(page, "bathroom")
    page.locator("#clear").click()
    settled(page)
    assert saved(page, "sh3d") == content
    said = "home: saved, but what has no place stays there where it stood: toilet, bed"
    expect(page.locator("#verdict")).to_have_text(said)
    for _ in range(3):  # until the bed is back
        page.locator("#undo").click()
        settled(page)
    page.locator("#type").select_option("study")
    settled(page)
    assert saved(page, "sh3d") == content
    said = "home: saved, but the type that you chose is not in it: JSON keeps that"
    expect(page.locator("#verdict")).to_have_text(said)
    assert not is_left(page)
    page.locator("#undo").click()
    settled(page)
    assert saved(page, "sh3d") == content
    assert is_left(page)
    page.locator("#redo").click()
    settled(page)
    saved(page, "json")
    assert is_left(page)


def test_what_is_said_of_a_saved_home_is_of_rooms_that_are_saved_in_it(page, tmp_path):
    openly(page, home_file(tmp_path / "home.sh3d").read_bytes(), "file/Bedroom")
    item(page, "bed").focus()
    page.keyboard.press("Delete")
    settled(page)
    page.locator("#adding summary").click()
    page.locator("#palette").get_by_role("button", name="wardrobe").first.click()
    settled(page)
    page.locator("#type").select_option("study")
    settled(page)
    take(page, "bathroom")
    item(page, "toilet").focus()
    page.keyboard.press("ArrowDown")
    settled(page)
    saved(page, "sh3d")
    expect(page.locator("#verdict")).to_contain_text("home: saved, but as it was before in 'file/Bedroom'")
    expect(page.locator("#verdict")).not_to_contain_text("; home")
    assert not is_left(page)


def test_only_rooms_that_were_changed_are_sent_with_the_one_that_is_saved(page, tmp_path, monkeypatch):
    from layoutrl.demo import answers, home

    def written(room: Room, content: bytes, others: Sequence[Room], name: str) -> tuple[bytes, list[str]]:
        sent.append([other.id for other in others])
        return home.written_back(room, content, others, name)

    sent: list[list[str]] = []
    monkeypatch.setattr(answers, "written_back", written)
    openly(page, home_file(tmp_path / "home.sh3d").read_bytes(), "file/Bedroom")
    take(page, "bathroom")
    saved(page, "sh3d")
    item(page, "toilet").focus()
    page.keyboard.press("ArrowDown")
    settled(page)
    page.locator("#gallery").get_by_title("file/Bedroom").click()
    expect(page.locator("#title")).to_have_attribute("data-room", "file/Bedroom")
    settled(page)
    saved(page, "sh3d")
    assert sent == [[], ["file/room 2"]]
