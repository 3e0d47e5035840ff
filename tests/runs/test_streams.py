"""Rooms go through in blocks, and what is done of a file is known when it is gone on with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.runs import streams
from layoutrl.runs.streams import Growing, Tally, growing

FULL = Path("/dev/full")  # what is written there finds no room


def test_blocks_begin_with_a_room_and_double_while_they_are_answered_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(streams, "time", SimpleNamespace(monotonic=lambda: now[0]))
    sizes = []
    for block in streams.blocks(range(1000)):
        sizes.append(len(block))
        now[0] += 0.1 * len(block)
    assert sizes == [1, 2, 4, 8, 16] + [32] * 30 + [9]
    assert max(map(len, streams.blocks(range(2000)))) == streams.MOST
    assert [*streams.blocks([None, 1, 2, None, 3, None, None, 4, 5])] == [[1], [2], [3], [4, 5]]


@given(st.lists(st.none() | st.integers(), max_size=600))
def test_blocks_are_all_rooms_in_order_and_none_waits_for_who_writes_on(entries: list[int | None]) -> None:
    taken = 0

    def told() -> Iterator[int | None]:
        nonlocal taken
        for entry in entries:
            taken += entry is not None
            yield entry
            assert entry is not None or taken == len(seen)  # all are answered as the next is waited for

    seen = list[int]()
    for block in streams.blocks(told()):
        assert 1 <= len(block) <= streams.MOST
        seen += block
    assert seen == [entry for entry in entries if entry is not None]


@pytest.mark.parametrize(
    "state", ["", "[]", '{"about": []}', '{"about": {"seed": 0}, "bytes": 0, "tally": {"more": 1}}']
)
def test_a_state_that_is_none_is_answered(state: str, tmp_path: Path) -> None:
    part = tmp_path / "out.jsonl.part"
    part.mkdir()
    (part / "state.json").write_text(state)
    (part / "rooms.jsonl").touch()
    with (
        pytest.raises(InputError, match=r"^out: what a run .* is damaged; expected another out="),
        growing(tmp_path / "out.jsonl", {"seed": 0}),
    ):
        pass
    assert (part / "state.json").read_text() == state


@pytest.mark.parametrize("again", [False, True])
def test_who_is_stopped_is_told_to_go_on_only_where_that_can_be(
    again: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped() -> None:
        with growing(tmp_path / "out.jsonl", {"seed": 0}, again=again) as grown:
            grown.add([{"id": "done"}])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    lines = tmp_path / "out.jsonl.part" / "rooms.jsonl"
    said = "the same command goes on where it was" if again else f"the rooms are in {lines}"
    assert capsys.readouterr().err == f"{said}\n"
    assert lines.read_text() == '{"id": "done"}\n'


@pytest.mark.skipif(not FULL.exists(), reason="it has no /dev/full")
@pytest.mark.parametrize("again", [False, True])
def test_a_full_disk_is_answered(again: bool) -> None:
    then = ": the same command goes on then" * again
    said = rf"^out: cannot write {FULL} \(No space left on device\); expected a disk with room{then}$"
    with FULL.open("wb", buffering=0) as disk, pytest.raises(InputError, match=said):
        Growing(disk, Tally(), again=again).add([{"id": "done"}])
