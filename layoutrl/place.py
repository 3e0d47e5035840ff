"""python -m layoutrl.place run=<folder> rooms=<file> [item=<category>] [out=<file>]

One item a room, by a trained agent; or, with by=search or by=annealer instead of run=, all items that have no center.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from layoutrl import InputError
from layoutrl.env.answerable import answerable
from layoutrl.env.faults import faults
from layoutrl.env.geometry import fitting_positions
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.metrics import blocks_openings
from layoutrl.rivals.budgets import seconds_budget
from layoutrl.rivals.rooms.annealer import anneal
from layoutrl.rivals.rooms.relations import Relations, mine
from layoutrl.rivals.rooms.search import search
from layoutrl.rooms.brief import missing, ways
from layoutrl.rooms.collection import Collection, choose_missing
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.files import read_rooms, write_rooms
from layoutrl.rooms.room import Item, Room, envelopes
from layoutrl.rooms.sources import main_item, read_files
from layoutrl.runs.commands import command
from layoutrl.runs.config import PlaceConfig, TrainConfig

DESIGNED = 200  # rooms of each type, whose relations a rival keeps


def run(config: PlaceConfig) -> Path:
    """Put what has no center where it belongs, in rooms of a file; returns the file written.

    Raises InputError where no room lacks such an item, or the file to write is there already.
    """
    source = Path(config.rooms).expanduser()
    out = Path(config.out or source.absolute().parent / f"{source.absolute().stem}-placed.jsonl").expanduser()
    if out.exists() or out.suffix != ".jsonl":
        what = "is there already" if out.exists() else "is no .jsonl file"
        raise InputError(f"out: {out} {what}; expected the name of a new .jsonl file, as out=<file>")
    if (config.run is None) == (config.by is None):
        raise InputError(
            "run: expected either run=<folder> of a training, or by=search or by=annealer, which need none"
        )
    if config.by and config.item:
        raise InputError(f"item: by={config.by} places all items that have no center; expected no item=")
    done = by_rival(config, source) if config.run is None else by_agent(config, Path(config.run), source)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_rooms(out, done)
    print(f"wrote {out}")
    return out


def by_agent(config: PlaceConfig, folder: Path, source: Path) -> list[Room]:
    """The rooms with the one item that has no center where a trained agent moves it."""
    # Here, as they load torch, which takes seconds: a wrong option is answered before.
    from layoutrl.env.batch import BatchSimulator
    from layoutrl.env.observation import observation_of
    from layoutrl.evaluation.protocols import greedy
    from layoutrl.runs.folder import load_config
    from layoutrl.runs.machine import device_of
    from layoutrl.runs.trained import trained_agent

    trained, device = load_config(folder, TrainConfig), device_of(config.device)
    agent, categories, _ = trained_agent(folder, trained, device, config.checkpoint)
    collection = read_files("json", trained.room.type, source)
    asked = known(choose_missing(collection, item_of(trained, config.item, categories)), categories)
    chosen = fitting(facing_all_ways(asked))
    print(chosen)
    if not chosen.rooms:
        why = "; ".join(line.strip() for line in str(chosen).splitlines()[1:])
        raise InputError(
            f"rooms: {source} has no {trained.room.type} to work on: {why or 'it is empty'}; "
            "expected one item without a center"
        )

    # The simulator is for rooms whose answer is known. Here it is none: any place will do, and nothing looks at it.
    rooms = [placed(room, *room.envelope.centroid.coords) for room in chosen.rooms]
    simulator = Simulator(rooms, trained.method.moves, trained.reward.weights)
    index = np.arange(len(rooms))
    episodes = greedy(agent, trained.method).rollout(
        BatchSimulator(simulator, device),
        observation_of(trained.method.observation, rooms, device, categories),
        index,
        simulator.starts(index, np.random.default_rng(config.seed)),
    )
    index = best_facings(rooms, episodes.value[episodes.moves, index])
    place = episodes.final[index]
    overlap, outside = simulator.overlap_and_outside(index, place)
    blocks = blocks_openings(simulator, index, place)
    for n, k in enumerate(index):
        (x, y), item = place[n], rooms[k].moving
        print(
            f"{rooms[k].id}: {item.category} at {x:.3f}, {y:.3f}, rotation {item.degrees:g}, after {episodes.moves[k]} "
            f"moves; {overlap[n]:.1%} over other items, {outside[n]:.1%} outside"
            f"{', blocks an opening' if blocks[n] else ''}"
        )
    target = {room.id: room.target for room in collection.rooms}  # as it was read
    centers = [(round(x, 4), round(y, 4)) for x, y in place.tolist()]
    return [
        replace(placed(rooms[k], center), target=target[rooms[k].id]) for k, center in zip(index, centers, strict=True)
    ]


def by_rival(config: PlaceConfig, source: Path) -> list[Room]:
    """The rooms with all items that have no center where a rival puts them, which knows designed rooms of each type."""
    collection = read_rooms(source)
    print(collection)
    if not (briefs := [room for room in collection.rooms if missing(room)]):
        raise InputError(f"rooms: {source} has no room with an item without a center; expected one or more")
    relations: dict[str, Relations] = {}
    done = []
    for k, room in enumerate(tqdm(briefs, "furnishing", unit="room", delay=1, disable=None)):
        if room.room_type not in relations:
            relations[room.room_type] = mine(design_rooms(room.room_type, "train", 0, DESIGNED).rooms)
        known = relations[room.room_type]
        asked = answerable(room, known.alone)
        spent, rng = seconds_budget(config.seconds, time.process_time), np.random.default_rng([config.seed, k])
        if config.by == "search":
            layout = search(asked.brief, known, config.search, spent, rng)
        else:
            layout = anneal(asked.brief, known, config.annealer, spent, rng)
        done.append(asked.answer(layout))
        wrong = [
            f"the {done[-1].furniture[n].category}: {fault}" for n, fault in faults(done[-1]) if n not in asked.refused
        ]
        tqdm.write(f"{room.id}: {'; '.join([*asked.lines, *wrong]) or 'all is placed, and nothing is wrong'}")
    return done


def item_of(trained: TrainConfig, asked: str | None, categories: Sequence[str]) -> str:
    """The category to place: what the agent was trained to move. Raises InputError for another, where that is known."""
    source, item = str(trained.data.source), trained.room.item
    moved = main_item(source, trained.room.type) if item == "main" else item
    known = moved != "all" and (item != "main" or source != "json")  # rooms of one's own may name other targets
    if asked and known and asked != moved:
        raise InputError(f"item: the agent was trained to move a {moved}; expected it, got {asked}")
    if asked and asked not in categories:
        raise InputError(f"item: expected what the agent knows, one of {', '.join(categories)}; got {asked}")
    return asked or moved


def known(chosen: Collection, categories: Sequence[str]) -> Collection:
    """The rooms whose target the agent knows; the others left out. Other furniture that it does not know is no matter:
    it is observed as of no category."""
    reasons = {
        room.id: f"the agent knows no {room.moving.category}, but {', '.join(categories)}"
        for room in chosen.rooms
        if room.moving.category not in categories
    }
    return _without(chosen, reasons)


def facing_all_ways(chosen: Collection) -> Collection:
    """Each room whose target has no rotation four times, once for each way that it can face."""
    rooms = []
    for room in chosen.rooms:
        rooms += [with_target(room, replace(room.moving, rotation=degrees)) for degrees in ways(room, room.moving)]
    return replace(chosen, rooms=rooms)


def fitting(chosen: Collection) -> Collection:
    """The rooms that their target fits into as it faces; those into which it fits in no way left out."""
    rooms = chosen.rooms
    regions = fitting_positions(envelopes(rooms), np.array([room.moving.template for room in rooms]))
    fits = [room for room, region in zip(rooms, regions, strict=True) if not region.is_empty]
    misfits = {room.id: f"the {room.moving.category} does not fit into it" for room in rooms}
    for room in fits:
        misfits.pop(room.id, None)
    return _without(replace(chosen, rooms=fits), misfits)


def best_facings(rooms: Sequence[Room], value: np.ndarray) -> np.ndarray:
    """Of the entries (B,) of each room the one that ended at the highest value (B,), by the order of the rooms."""
    best: dict[str, int] = {}
    for k, room in enumerate(rooms):
        if room.id not in best or value[k] > value[best[room.id]]:
            best[room.id] = k
    return np.array(list(best.values()))


def _without(chosen: Collection, reasons: dict[str, str]) -> Collection:
    rooms = [room for room in chosen.rooms if room.id not in reasons]
    return replace(chosen, rooms=rooms, left_out=[*chosen.left_out, *reasons.items()])


def placed(room: Room, center: tuple[float, float]) -> Room:
    """The room with its target there."""
    return with_target(room, replace(room.moving, center=center))


def with_target(room: Room, item: Item) -> Room:
    """The room with another target."""
    furniture = list(room.furniture)
    assert room.target is not None
    furniture[room.target] = item
    return replace(room, furniture=tuple(furniture))


main = command("place", PlaceConfig, run)

if __name__ == "__main__":
    main()
