"""What stands beside the code agrees with it: version, citation, changelog, workflow, pages for contributors."""

from __future__ import annotations

import datetime
import importlib.util
import pkgutil
import re
import tomllib
import warnings
from pathlib import Path
from types import ModuleType

import pytest
import yaml

import layoutrl

PROJECT = Path(__file__).resolve().parents[1]
PAGES = [PROJECT / "CONTRIBUTING.md", PROJECT / "CHANGELOG.md", *(PROJECT / "docs/contributing").glob("*.md")]
INVENTED = ("nursery", "boxes", "mean_place")  # what the pages add


def read(name: str) -> str:
    return (PROJECT / name).read_text(encoding="utf-8")


def test_the_version_is_said_once_and_cited() -> None:
    project = tomllib.loads(read("pyproject.toml"))
    assert "version" in project["project"]["dynamic"]
    assert project["tool"]["hatch"]["version"]["path"] == "layoutrl/__init__.py"
    citation = yaml.safe_load(read("CITATION.cff"))
    assert citation["version"] == layoutrl.__version__
    assert citation["license"] == project["project"]["license"]
    assert citation["references"][0]["url"].endswith("2101.07462")


def test_the_changelog_begins_with_what_is_not_released_and_goes_on_with_this_version() -> None:
    first, *released = re.findall(r"^## \[(.*?)\](?: - (.*))?$", read("CHANGELOG.md"), flags=re.MULTILINE)
    assert first == ("Unreleased", "")
    date = yaml.safe_load(read("CITATION.cff"))["date-released"]
    assert released[0] == (layoutrl.__version__, date.isoformat())
    assert released == sorted(released, key=lambda entry: [int(n) for n in entry[0].split(".")], reverse=True)
    assert all(datetime.date.fromisoformat(date) for _, date in released)
    kinds = set(re.findall(r"^### (.*)$", read("CHANGELOG.md"), flags=re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_what_is_imported_from_another_place_now_is_there() -> None:
    rows = re.findall(r"^ *\| `layoutrl.* \| (.*) \|$", read("CHANGELOG.md"), flags=re.MULTILINE)
    assert len(rows) > 10
    for row in rows:
        module, _, names = row.partition(": ")  # or places alone
        for place in re.findall(r"`([\w.]+\w)[.*]*`", module):
            pkgutil.resolve_name(place)
            for name in re.findall(r"`([\w.]+)`", names):
                pkgutil.resolve_name(f"{place}:{name}")


def test_the_workflow_calls_what_must_pass_on_three_systems() -> None:
    job = yaml.safe_load(read(".github/workflows/ci.yml"))["jobs"]["run"]
    matrix = job["strategy"]["matrix"]
    assert [name.partition("-")[0] for name in matrix["os"]] == ["ubuntu", "macos", "windows"]
    assert matrix["python"] == ["3.11", "3.12", "3.13"]
    assert job["defaults"]["run"]["shell"] == "bash"
    checks, slow = (step for step in job["steps"] if "run" in step)
    assert (checks["run"], "if" in checks) == (".ci/run", False)
    assert slow["run"].partition("#")[0].endswith(" -m slow")
    assert slow["if"] == "runner.os == 'Linux'"


def test_a_commit_is_held_to_what_lint_asks_for() -> None:
    ((hook,),) = [repo["hooks"] for repo in yaml.safe_load(read(".pre-commit-config.yaml"))["repos"]]
    assert (hook["language"], hook["entry"]) == ("system", "make lint")
    lint = re.search(r"^lint:.*\n((?:\t.*\n)+)", read("Makefile"), flags=re.MULTILINE)
    assert lint is not None
    assert [name for name in ("ruff check", "ruff format", "mypy") if name in lint[1]] == [
        "ruff check",
        "ruff format",
        "mypy",
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_the_pages_for_contributors_name_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (page.parent / link).exists(), link
    if page.name == "CHANGELOG.md":
        return
    for path in re.findall(r"(?<![\w/.])((?:layoutrl|tests|experiments|conf|docs)/[\w/]+\.\w+)", text):
        assert (PROJECT / path).exists() or any(name in path for name in INVENTED), path
    for target in re.findall(r"(?:^ {4}|`)make (\w+)", text, flags=re.MULTILINE):
        assert re.search(rf"^{target}:", read("Makefile"), flags=re.MULTILINE), target
    tests = "".join(path.read_text(encoding="utf-8") for path in (PROJECT / "tests").rglob("test_*.py"))
    for name in re.findall(r"`(test_\w+)`", text):
        assert f"def {name}(" in tests, name


@pytest.fixture
def reference() -> ModuleType:
    """The script that builds the API reference."""
    pytest.importorskip("pdoc", reason="pdoc is not installed")
    spec = importlib.util.spec_from_file_location("reference", PROJECT / "docs/reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_module_has_a_page_in_the_api_reference(reference: ModuleType, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reference.main(tmp_path)
    written = {".".join(page.relative_to(tmp_path).with_suffix("").parts) for page in tmp_path.rglob("*.html")}
    assert written - {"index", "search"} == set(reference.modules())
    assert "MAIN_ITEM" in (tmp_path / "layoutrl/rooms/room.html").read_text(encoding="utf-8")
