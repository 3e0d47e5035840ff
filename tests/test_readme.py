"""What the README and docs/ say works: their Python, their commands' options, the room, the tests that they name."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from textwrap import dedent
from typing import Any

import ablation
import pytest

from layoutrl.rooms.files import read_rooms
from layoutrl.runs.config import composed
from layoutrl.runs.pretrained import cards
from tests.commands import layoutrl

PROJECT = Path(__file__).resolve().parents[1]
PAGES = {path: path.read_text(encoding="utf-8") for path in (PROJECT / "README.md", *(PROJECT / "docs").glob("*.md"))}
README, PLACE = (PAGES[PROJECT / name] for name in ("README.md", "docs/place.md"))
COMMAND = re.compile(r"(?:python -m layoutrl\.|^    layoutrl )([\w.]+) ([^#\n]*)", re.MULTILINE)
NO_RIVALS = ("designer", "agent")
COMMANDS = sorted({command for page in PAGES.values() for command in COMMAND.findall(page)})


def blocks(page: str) -> list[str]:
    """What is set off as code."""
    return [dedent(block) for block in re.findall(r"(?:^    .*\n(?:\n(?=    ))?)+", page, flags=re.MULTILINE)]


(EXAMPLE,) = (block for block in blocks(README) if block.startswith('{"id"'))


def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "my_rooms.json").write_text(EXAMPLE)
    monkeypatch.chdir(tmp_path)
    programs = [block for page in (README, PLACE) for block in blocks(page) if "import " in block]
    assert len(programs) == 5
    for code in programs:
        names = dict[str, Any]()
        exec(compile(code, "a page", "exec"), names)
        if "import furnish" in code:
            assert re.findall(r"^b-17, choice (\d): 1 of 1 placed", capsys.readouterr().out, re.M) == ["1", "2", "3"]
        elif "my_rooms.json" in code:
            assert [room.id for room in names["env"].unwrapped.simulator.rooms] == ["b-17"]


def test_the_python_of_the_list_of_names_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = (block for block in blocks(PAGES[PROJECT / "docs/python.md"]) if "import " in block)
    names = dict[str, Any]()
    exec(compile(code, "a page", "exec"), names)
    read, layouts = read_rooms("bedrooms.json").rooms, names["layouts"]
    assert [room.furniture for room in read] == [layout.furniture for layout in layouts]
    assert (tmp_path / "bedroom.svg").read_text(encoding="utf-8").startswith("<svg")


def test_the_rooms_commands_work_one_after_the_other(tmp_path: Path) -> None:
    (tmp_path / "my_rooms.json").write_text(EXAMPLE)
    commands = [options for page in (README, PLACE) for name, options in COMMAND.findall(page) if name == "place"]
    here = [options for options in commands if "rooms=my_rooms.json" in options and "run=" not in options]
    first, same, *others = here
    assert same == "rooms=my_rooms.json"  # which wants a name of its own once the first has run
    (answer,) = (block for block in blocks(README) if block.startswith("b-17"))
    for options in (first, *others):
        done = layoutrl("place", *options.split(), "device=cpu", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        choices = 3 if "choices=3" in options else 1
        assert len(re.findall(r"^b-17(?:, choice \d)?: 1 of 1 placed", done.stdout, re.MULTILINE)) == choices
        if options == first:
            assert done.stdout.startswith(answer)
            assert "wrote my_rooms-placed.jsonl" in done.stdout.replace(f"{tmp_path}/", "")
    assert len(list((tmp_path / "pictures").iterdir())) == 1
    assert len(list((tmp_path / "three").iterdir())) == 3


def test_the_answer_that_is_explained_is_the_one_that_is_given(tmp_path: Path) -> None:
    section = PLACE.partition("\n## What is said of a layout\n")[2].partition("\n| fault |")[0]
    answer, written = blocks(section)
    room, more = json.loads(EXAMPLE), re.findall(r"`(\{.+?\})`", section)
    room["furniture"] += map(json.loads, more)
    (tmp_path / "my_rooms.json").write_text(json.dumps(room))
    done = layoutrl("place", "rooms=my_rooms.json", "device=cpu", cwd=tmp_path)
    assert (len(more), done.returncode) == (2, 2)
    *told, error = answer.splitlines()
    assert done.stdout.replace(f"{tmp_path}/", "").splitlines() == told
    assert done.stderr.splitlines()[-1] == error
    (placed,) = map(json.loads, (tmp_path / "my_rooms-placed.jsonl").read_text().splitlines())
    assert placed["furniture"][-1] == json.loads(written)


@pytest.mark.parametrize(("entry_point", "options"), COMMANDS)
def test_the_commands_options_exist(entry_point: str, options: str) -> None:
    given = [option.replace("<name>", "name") for option in shlex.split(options.partition("#")[0])]
    if "-m" in given:  # a sweep: its first run
        given = [option.split(",")[0] for option in given if option != "-m"]
    assert composed(entry_point.removesuffix(".train"), *given)


def test_the_furniture_that_is_placed_is_told() -> None:
    _, section = PLACE.split("### Which furniture in which room")
    told = re.findall(r"^\| `(\w+)` \| (.+) \|$", section.partition("\n## ")[0], re.MULTILINE)
    assert {room_type: categories.split(", ") for room_type, categories in told} == {
        room_type: card["categories"] for room_type, card in cards().items()
    }


def test_the_scripts_and_pages_that_are_named_are_there() -> None:
    for path, page in PAGES.items():
        for script in re.findall(r"python (experiments/\w+\.py)", page):
            assert (PROJECT / script).is_file()
        for link, heading in re.findall(r"\]\(([^)#:]+)(?:#([^)]+))?\)", page):
            assert (path.parent / link).exists(), link
            assert not heading or heading in anchors(path.parent / link), heading
        for image in re.findall(r'src="([^"]+)"', page):
            assert (path.parent / image).is_file(), image


def anchors(page: Path) -> set[str]:
    """What GitHub calls the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def tables(text: str) -> list[str]:
    return re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)


def test_a_reader_sees_one_animation_one_figure_and_two_narrow_tables_before_trainings() -> None:
    first, _, later = README.partition("## Train, watch, score")
    assert len(re.findall(r"!\[|<img", first)) == 2
    rooms, items = tables(first)
    assert all(table.splitlines()[0].count("|") - 1 <= 6 for table in (rooms, items))
    assert re.findall(r"^    make (\w+)", later, flags=re.MULTILINE) == ["train", "test"]
    assert README.index("## Your own rooms") < README.index("## Results")


def test_the_table_of_whole_rooms_has_the_numbers_of_table_3() -> None:
    page = PAGES[PROJECT / "docs/whole_rooms_results.md"].partition("<!-- table3-best -->")[2]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in tables(page)[0].splitlines()[2:]]
    of = {(row[0], row[1]): (row[2].split()[0], row[5].split()[0]) for row in rows}
    shown = [[cell.strip(" *") for cell in line.split("|")[1:-1]] for line in tables(README)[0].splitlines()[2:]]
    assert len(shown) == 8
    for room_type, iou, faultless, rival, its_iou, its_faultless in shown:
        assert of[room_type, "agent"] == (iou, faultless)
        assert of[room_type, rival] == (its_iou, its_faultless)
        assert its_iou == max(of[row[0], row[1]][0] for row in rows if row[0] == room_type and row[1] not in NO_RIVALS)


def test_no_table_is_wider_than_eight_columns() -> None:
    for path, page in PAGES.items():
        for table in tables(page):
            assert table.splitlines()[0].count("|") - 1 <= 8, (path, table)


def test_every_page_is_in_the_index() -> None:
    index = (PROJECT / "docs" / "README.md").read_text(encoding="utf-8")
    assert all(f"({page.name}" in index for page in (PROJECT / "docs").glob("*.md") if page.name != "README.md")


def test_the_pages_show_every_table_of_the_results_as_it_is() -> None:
    folder = PROJECT / "experiments/results"
    results = [path.read_text(encoding="utf-8") for path in folder.glob("default/*.md")]
    results += [ablation.table(json.loads(path.read_text())).markdown() for path in folder.glob("ablation/*.json")]
    measured = [table for text in results for table in tables(text)]
    headers = {table.splitlines()[0] for table in measured}
    shown = [table for page in PAGES.values() for table in tables(page) if table.splitlines()[0] in headers]
    assert sorted(shown) == sorted(measured)
    (cells,) = re.findall(r"\d+ cells, \d+ minutes", (folder / "default/table1.md").read_text(encoding="utf-8"))
    assert cells in PAGES[PROJECT / "docs" / "results.md"]


def test_the_tests_that_promises_name_are_there() -> None:
    promises = PAGES[PROJECT / "docs/promises.md"]
    rows = re.findall(r"^\| .* \| (`test_\w+\.py`.*) \|$", promises, flags=re.MULTILINE)
    assert len(rows) > 5
    for row in rows:
        file, *names = re.findall(r"`([\w.]+)`", row)
        (found,) = (PROJECT / "tests").rglob(file)
        assert all(re.search(rf"def test_\w*{name}", found.read_text(encoding="utf-8")) for name in names), row
