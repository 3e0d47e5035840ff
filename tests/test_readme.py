"""What the README and docs/ say works: their Python, their commands' options, the room, the tests that they name."""

from __future__ import annotations

import json
import re
from pathlib import Path
from textwrap import dedent
from typing import Any

import ablation
import pytest

from layoutrl.runs.config import composed
from tests.commands import layoutrl

PROJECT = Path(__file__).resolve().parents[1]
README = (PROJECT / "README.md").read_text(encoding="utf-8")
PAGES = {path: path.read_text(encoding="utf-8") for path in (PROJECT / "README.md", *(PROJECT / "docs").glob("*.md"))}
BLOCKS = [dedent(block) for block in re.findall(r"(?:^    .*\n(?:\n(?=    ))?)+", README, flags=re.MULTILINE)]
COMMANDS = sorted(
    {command for page in PAGES.values() for command in re.findall(r"python -m layoutrl\.([\w.]+) ([^#\n]*)", page)}
)


(EXAMPLE,) = (block for block in BLOCKS if block.startswith('{"id"'))


def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    room = json.loads(EXAMPLE.partition("\n\n")[0])
    monkeypatch.chdir(tmp_path)
    programs = [block for block in BLOCKS if "import " in block]
    assert len(programs) == 4
    for code in programs:
        furnishes, names = "import furnish" in code, dict[str, Any]()
        furniture = [item if furnishes else {"center": [3, 3]} | item for item in room["furniture"]]
        (tmp_path / "my_rooms.jsonl").write_text(json.dumps(room | {"furniture": furniture}))
        exec(compile(code, "README.md", "exec"), names)
        if furnishes:
            assert re.findall(r"^b-17, choice (\d): 1 of 1 placed", capsys.readouterr().out, re.M) == ["1", "2", "3"]
        elif "my_rooms.jsonl" in code:
            assert [room.id for room in names["env"].unwrapped.simulator.rooms] == ["b-17"]


def test_the_first_command_places_what_the_room_lacks(tmp_path: Path) -> None:
    room, commands = EXAMPLE.split("\n\n")
    (tmp_path / "my_rooms.jsonl").write_text(json.dumps(json.loads(room)))
    module, *arguments = commands.splitlines()[0].removeprefix("python -m layoutrl.").split()
    done = layoutrl(module, *arguments, "device=cpu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"b-17, choice 3: 1 of 1 placed( by the search)?; ", done.stdout)
    assert "wrote my_rooms-placed.jsonl" in done.stdout.replace(f"{tmp_path}/", "")
    assert len(list((tmp_path / "pictures").iterdir())) == 3


@pytest.mark.parametrize(("entry_point", "options"), COMMANDS)
def test_the_commands_options_exist(entry_point: str, options: str) -> None:
    given = [option.replace("<name>", "name") for option in options.partition("#")[0].split()]
    if "-m" in given:  # a sweep: its first run
        given = [option.split(",")[0] for option in given if option != "-m"]
    assert composed(entry_point.removesuffix(".train"), *given)


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


def test_a_reader_sees_one_animation_one_figure_and_one_narrow_table_first() -> None:
    first = README.partition("## How it works")[0]
    assert len(re.findall(r"!\[|<img", first)) == 2
    (table,) = tables(first)
    assert table.splitlines()[0].count("|") - 1 <= 6
    assert re.findall(r"^    make (\w+)", first, flags=re.MULTILINE) == ["train", "test"]


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
    rows = re.findall(r"^\| .* \| (`test_\w+\.py`.*) \|$", README, flags=re.MULTILINE)
    assert len(rows) > 5
    for row in rows:
        file, *names = re.findall(r"`([\w.]+)`", row)
        (found,) = (PROJECT / "tests").rglob(file)
        assert all(re.search(rf"def test_\w*{name}", found.read_text(encoding="utf-8")) for name in names), row
