"""Designed rooms: each follows from its type, part, seed and index alone.

It is the same in any order, by any number of processes, on any machine. NumPy may change its streams of random
numbers from one version to another; a test would tell.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from numbers import Integral
from typing import Literal

from tqdm import tqdm

from layoutrl import InputError
from layoutrl.rooms.clearances import passage
from layoutrl.rooms.designer.balcony import BALCONY
from layoutrl.rooms.designer.bathroom import BATHROOM
from layoutrl.rooms.designer.bedroom import BEDROOM
from layoutrl.rooms.designer.dining_room import DINING_ROOM
from layoutrl.rooms.designer.kitchen import KITCHEN
from layoutrl.rooms.designer.living_room import LIVING_ROOM
from layoutrl.rooms.designer.search import Choice, NoDesign, Place, design
from layoutrl.rooms.designer.shell import Dice, Gap, Shell
from layoutrl.rooms.designer.study import STUDY
from layoutrl.rooms.designer.tatami import TATAMI
from layoutrl.rooms.room import MAIN_ITEM, Item, Opening, Room, wall_band

ROOM_TYPES = {
    room_type.name: room_type
    for room_type in (BALCONY, BATHROOM, BEDROOM, DINING_ROOM, KITCHEN, LIVING_ROOM, STUDY, TATAMI)
}
Part = Literal["train", "test"]
PARTS: tuple[Part, ...] = ("train", "test")  # their seeds differ
NAMED = 3  # reasons named for each template in a summary
FEW = 100  # rooms: for so few, starting processes takes longer than it saves
TASK = 10  # rooms that a process designs at a time: Ctrl-C waits for them
MOST_PROCESSES = 61  # the most that Windows can wait for


@dataclass
class Design:
    """A room, its template, the decisions behind it, and (template, reason) of every try before it."""

    room: Room
    template: str
    shell: Shell
    choices: Sequence[Choice]
    rejected: list[tuple[str, str]] = field(default_factory=list)


def design_room(room_type: str, part: Part, seed: int, index: int) -> Design:
    """Design one room.

    Where the template cannot be built in the shell, keep the reason, and draw a new shell and template.
    """
    kind = ROOM_TYPES[room_type]
    dice = Dice(seed, PARTS.index(part), list(MAIN_ITEM).index(room_type), index)
    rejected: list[tuple[str, str]] = []
    while True:
        shell = kind.shell(dice)
        suiting = {name: template.share for name, template in kind.templates.items() if template.suits(shell)}
        if not suiting:
            continue
        name = dice.pick(suiting)
        try:
            choices = design(shell, kind.templates[name].steps(dice, shell), round(100 * passage(room_type)))
        except NoDesign as reason:
            rejected.append((name, str(reason)))
            continue
        room = _room(f"{room_type}-{name}-{part}{seed}-{index}", room_type, shell, [c.place for c in choices])
        return Design(room, name, shell, choices, rejected)


@dataclass
class Designs:
    """Designed rooms in order; how many each template made, and how often and why it failed."""

    rooms: list[Room] = field(default_factory=list)
    made: Counter[str] = field(default_factory=Counter)
    rejected: Counter[tuple[str, str]] = field(default_factory=Counter)

    def reject_rate(self, template: str) -> float:
        """The share of a template's tries that came to nothing."""
        failed = sum(count for (name, _), count in self.rejected.items() if name == template)
        return failed / (failed + self.made[template])

    def __str__(self) -> str:
        """A line a template: rooms, reject rate, and the most frequent reasons."""
        lines = []
        for name in dict.fromkeys([*self.made, *(template for template, _ in self.rejected)]):
            line = f"  {name}: {self.made[name]} rooms, {self.reject_rate(name):.0%} of its tries rejected"
            reasons = [f"{reason} ({n})" for (template, reason), n in self.rejected.most_common() if template == name]
            more = ["..."] if len(reasons) > NAMED else []
            lines.append(": ".join([line, "; ".join(reasons[:NAMED] + more)] if reasons else [line]))
        return "\n".join(lines)


def design_rooms(room_type: str, part: Part, seed: int, count: int) -> Designs:
    """Rooms 0 to count - 1 of a part, on all cores.

    Raises InputError for an unknown type or part, a negative seed, and a count below 1.
    """
    for name, value, known in (("room_type", room_type, [*ROOM_TYPES]), ("part", part, [*PARTS])):
        if value not in known:
            raise InputError(f"{name}: expected one of {', '.join(known)}; got {value!r:.60}")
    for name, number, least in (("seed", seed, 0), ("count", count, 1)):
        if not isinstance(number, Integral) or number < least:
            raise InputError(f"{name}: expected a whole number, {least} or more; got {number!r:.60}")
    return joined(design_each(room_type, part, seed, range(count)))


def joined(parts: Iterable[Designs]) -> Designs:
    """All designs in one, in the order of the parts."""
    whole = Designs()
    for some in parts:
        whole.rooms += some.rooms
        whole.made.update(some.made)
        whole.rejected.update(some.rejected)
    return whole


def design_each(room_type: str, part: Part, seed: int, indices: Sequence[int]) -> Generator[Designs, None, None]:
    """Design the rooms with these indices on all cores and yield them in order, one at a time.

    A caller that stops early must close the generator.
    """
    one = partial(_one, room_type, part, seed)
    shown = partial(_shown, f"designing {room_type} rooms, {part}", len(indices))
    if len(indices) <= FEW:
        yield from shown(map(one, indices))
        return
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    pool = ProcessPoolExecutor(min(cores, len(indices) // TASK, MOST_PROCESSES), initializer=_begin_worker)
    try:
        with _deaf_to_ctrl_c():
            designed = pool.map(one, indices, chunksize=TASK)  # starts all workers
        yield from shown(designed)
    finally:
        pool.shutdown(cancel_futures=True)


def _shown(what: str, total: int, designed: Iterable[Designs]) -> Iterator[Designs]:
    # No bar in the first second, or where the output is no terminal.
    with tqdm(desc=what, total=total, unit="room", delay=1, disable=None) as bar:
        for one in designed:
            bar.update()
            yield one


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """Let processes that are started inside ignore Ctrl-C from their first moment.

    Otherwise Ctrl-C during their imports ends in a traceback.
    """
    if threading.current_thread() is not threading.main_thread():  # elsewhere signals cannot be set
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _begin_worker() -> None:
    """Ignore Ctrl-C, which reaches every process of a terminal: the parent handles it. End with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait for the parent to end, and exit: a worker whose parent is killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    try:
        parent.join()
    except ValueError:  # forked by a worker of joblib, it has nothing to join
        while os.getppid() == parent.ident:
            time.sleep(1)
    os._exit(1)


def _one(room_type: str, part: Part, seed: int, index: int) -> Designs:
    design = design_room(room_type, part, seed, index)
    return Designs([design.room], Counter([design.template]), Counter(design.rejected))


def _room(room_id: str, room_type: str, shell: Shell, places: Sequence[Place]) -> Room:
    """Convert a shell and its places to a room in metres, the origin in the lower left corner of the shell's box."""
    outline = tuple((x / 100, y / 100) for x, y in shell.outline)
    openings = (
        *(Opening("door", _band(shell, door)) for door in shell.doors),
        *(Opening("window", _band(shell, window)) for window in shell.windows),
    )
    furniture = tuple(item_of(place) for place in places)
    walls = wall_band(outline, (), openings, shell.thickness / 100)
    (main,) = [k for k, item in enumerate(furniture) if item.category == MAIN_ITEM[room_type]]
    return Room(room_id, room_type, outline, walls, openings, furniture, main)


def _band(shell: Shell, gap: Gap) -> tuple[tuple[float, float], ...]:
    """The opening as a polygon through the wall."""
    x0, y0, x1, y1 = (c / 100 for c in gap.strip(-shell.thickness))
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def item_of(place: Place) -> Item:
    """Convert a place to an item, in metres and degrees."""
    piece = place.piece
    center = (place.twice_center[0] / 200, place.twice_center[1] / 200)
    form: Literal["rectangle", "circle"] = "circle" if piece.circle else "rectangle"
    return Item(piece.category, (piece.depth / 100, piece.width / 100), center, 90.0 * place.facing, form, piece.tucked)
