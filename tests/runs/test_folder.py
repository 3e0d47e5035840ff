"""Each run has a folder of its own; its configuration is read as it was written, or refused in a line."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from layoutrl import InputError
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.config import PlanitConfig, TrainConfig, composed, narrowed
from layoutrl.runs.files import check_writable
from layoutrl.runs.folder import LARGEST, NOT_COMPARED, differences, folders_of, load_config, make_folder, new_folder
from tests.test_fuzz import answered, times

WHOLE = OmegaConf.to_yaml(OmegaConf.structured(narrowed(composed("train", "room=bedroom"), TrainConfig)))
LAUGHS = "\n".join(["a0: &a0 [x, x]", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12))])


def read(folder: Path, text: str) -> TrainConfig:
    (folder / "config.yaml").write_text(text)
    return load_config(folder, TrainConfig)


def test_nothing_is_made_behind_a_link_to_nothing(tmp_path: Path) -> None:
    link = tmp_path / "runs"
    link.symlink_to(tmp_path / "disk that is not there")
    with pytest.raises(InputError, match=r"runs: cannot create .*bedroom/one"):
        make_folder(link / "bedroom" / "one")
    with pytest.raises(InputError, match=r"runs: .* cannot be written to"):
        check_writable(link / "bedroom", "runs")


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_what_is_written_is_resolved_and_read_again(room_type: str, tmp_path: Path) -> None:
    for method in ("geometric", "paper"):
        config = narrowed(composed("train", f"room={room_type}", f"method={method}", f"runs={tmp_path}"), TrainConfig)
        folder = new_folder(config)
        text = (folder / "config.yaml").read_text()
        assert "${" not in text
        assert len(text) < LARGEST / 5
        assert load_config(folder, TrainConfig) == config
    rival = narrowed(composed("planit", f"room={room_type}", f"runs={tmp_path}"), PlanitConfig)
    assert load_config(new_folder(rival), PlanitConfig) == rival


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAUGHS, "line 1 has an anchor or an alias, a0"),
        (WHOLE.replace("seed: 0", "seed: &s 0", 1), "has an anchor or an alias, s"),
        (WHOLE + "name: *s\n", "has an anchor or an alias, s"),
        (WHOLE.replace("name: null", "name: ${oc.env:HOME}"), r"has an interpolation, \$\{oc\.env:HOME\}"),
        (WHOLE.replace("name: null", 'name: "\\x24{seed}"'), r"has an interpolation, \$\{seed\}"),
        (WHOLE.replace("name: null", "name: a${budget.name}b"), "has an interpolation"),
        (WHOLE + "# " + "x" * LARGEST, f"is larger than {LARGEST} bytes"),
        (WHOLE + "# " + "é" * (LARGEST // 2), f"is larger than {LARGEST} bytes"),
        ("{a: " * 11, "line 1 is nested deeper than 10 levels"),
        ("[" * 9_000, "line 1 is nested deeper than 10 levels"),
        (WHOLE + "colour: red\n", "colour: unknown"),
        (WHOLE.replace("  discount:", "  discuont:"), r"method\.discuont: unknown"),
        ("{}", r"room\.type: lacking"),
        ("", r"room\.type: lacking"),
        (WHOLE.replace("\nseed: 0", "\nseed: x"), "seed: expected a whole number"),
        (WHOLE.replace("smoke: ", "smoke: x"), r"method\.updates\.smoke: expected a whole number"),
        ("[]", "a section: expected names with values"),
        (WHOLE.replace("\nseed: 0", "\nseed: -1"), "seed: expected 0 or more; got -1"),
    ],
)
def test_what_no_run_writes_is_refused_in_a_line_and_soon(text: str, said: str, tmp_path: Path) -> None:
    def reader() -> None:
        with pytest.raises(InputError, match=rf"^run: {tmp_path}/config\.yaml is damaged, .* \(.*{said}.*\); expected"):
            read(tmp_path, text)

    assert text != WHOLE
    answered(reader, (), text)


@pytest.mark.parametrize(
    ("now", "then"),
    [
        ("unit: auto", "unit: cm"),
        ("strict: false", "strict: true"),
        ("labels: snapped", "labels: raw"),
        ("name: geometric", "name: a/b"),
        ("own_share: 0.5", "own_share: 0.0"),
        ("faces_away: 0.5", "faces_away: 0.1"),
        ("discount_start: 0.5", "discount_start: 0.4"),
    ],
)
def test_a_run_with_options_without_effect_is_read(now: str, then: str, tmp_path: Path) -> None:
    assert WHOLE.count(f"{now}\n") == 1
    read(tmp_path, WHOLE.replace(f"{now}\n", f"{then}\n"))


def test_a_folder_that_is_no_run_is_answered(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"config\.yaml cannot be read \(No such file or directory\); expected the"):
        load_config(tmp_path, TrainConfig)


def test_a_file_without_end_is_not_read_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").symlink_to("/dev/zero")
    with pytest.raises(InputError, match="larger than"):
        answered(lambda: load_config(tmp_path, TrainConfig), (), "zeros")


@times(30, 1_000)
def test_lines_of_a_configuration_in_any_order_are_one_or_an_error(count: int, tmp_path: Path) -> None:
    dice, read_so, lines = random.Random(count), 0, WHOLE.splitlines()
    others = [*lines, *LAUGHS.splitlines(), "x: ${x}", "? [", "- {", "!!set"]
    for _ in range(count):
        changed = list(lines)
        for _ in range(dice.choice((1, 1, 3, 40))):
            at = dice.randrange(len(changed))
            changed[at : at + dice.randrange(2)] = dice.choices(others, k=dice.randrange(3))
        text = "\n".join(changed)
        read_so += answered(lambda text=text: read(tmp_path, text), InputError, text) is not None
    assert 0 < read_so < count


NAMES = st.lists(st.sampled_from(["one", "one-2", "one-2-2", "on", "x-one", "one-x", "[one]", "ONE+"]), max_size=9)


@given(NAMES)
def test_each_run_has_a_folder_of_its_own_and_a_name_finds_all_that_were_made_of_it(names: list[str]) -> None:
    with tempfile.TemporaryDirectory() as runs:
        bedrooms = Path(runs) / "bedroom"
        folders = [make_folder(bedrooms / name) for name in names]
        assert len({*folders}) == len(names)
        assert all(folder.is_dir() for folder in folders)
        for name in {*names}:
            mine = {folder for folder, its in zip(folders, names, strict=True) if its == name}
            found = {*folders_of(bedrooms / name)}
            assert mine <= found
            assert all(folder.name.removeprefix(name).strip("-0123456789") == "" for folder in found)


LEAVES = st.sampled_from([None, 0, 1, "a", False])
TREES = st.recursive(LEAVES, lambda inner: st.dictionaries(st.sampled_from("abc"), inner, max_size=3), max_leaves=9)
CONFIGS = st.dictionaries(st.sampled_from(["a", "b", "room", "device", "seed"]), TREES, max_size=4)


def leaves(tree: Any, prefix: str = "") -> dict[str, Any]:
    """The values by their dotted names, what is no leaf as it is, too."""
    if not isinstance(tree, dict):
        return {}
    return {prefix + k: v for k, v in tree.items()} | {
        n: v for k, inner in tree.items() for n, v in leaves(inner, f"{prefix}{k}.").items()
    }


@given(CONFIGS, CONFIGS)
def test_differences_are_the_leaves_that_both_have_and_have_differently(one: dict, other: dict) -> None:
    first, second = leaves(one), leaves(other)
    both = {n for n in first.keys() & second.keys() if not (isinstance(first[n], dict) and isinstance(second[n], dict))}
    assert differences(one, other) == sorted(n for n in both if first[n] != second[n] and n not in NOT_COMPARED)
    assert differences(other, one) == differences(one, other)


def test_how_long_a_type_is_trained_and_where_makes_no_difference() -> None:
    """The updates of a run are method.updates, whatever its type of room says today."""
    one = {"device": "cpu", "room": {"updates": 1, "whole_updates": 1, "type": "study"}, "updates": 1}
    other = {"device": "cuda", "room": {"updates": 2, "whole_updates": 2, "type": "study"}, "updates": 2}
    assert differences(one, other) == ["updates"]
