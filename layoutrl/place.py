"""python -m layoutrl.place run=<folder> rooms=<file> [item=<category>] [out=<file>]"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from layoutrl import InputError
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import fitting_positions
from layoutrl.env.observation import observation_of
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.metrics import blocks_openings
from layoutrl.evaluation.protocols import greedy
from layoutrl.rooms.collection import Collection, choose_missing
from layoutrl.rooms.files import write_rooms
from layoutrl.rooms.room import Room, envelopes
from layoutrl.rooms.sources import main_item, read_files
from layoutrl.runs.commands import command
from layoutrl.runs.config import PlaceConfig, TrainConfig
from layoutrl.runs.folder import load_config
from layoutrl.runs.machine import device_of
from layoutrl.runs.trained import trained_agent


def run(config: PlaceConfig) -> Path:
    """Put an item that has no center where a trained agent moves it, in rooms of a file; returns the file written.

    Raises InputError where no room lacks such an item, or the file to write is there already.
    """
    folder, source = Path(config.run), Path(config.rooms).expanduser()
    out = Path(config.out or source.absolute().parent / f"{source.absolute().stem}-placed.jsonl").expanduser()
    if out.exists() or out.suffix != ".jsonl":
        what = "is there already" if out.exists() else "is no .jsonl file"
        raise InputError(f"out: {out} {what}; expected the name of a new .jsonl file, as out=<file>")
    trained, device = load_config(folder, TrainConfig), device_of(config.device)
    agent, categories, _ = trained_agent(folder, trained, device, config.checkpoint)
    collection = read_files("json", trained.room.type, source)
    chosen = fitting(known(choose_missing(collection, item_of(trained, config.item, categories)), categories))
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
    place = episodes.final
    overlap, outside = simulator.overlap_and_outside(index, place)
    blocks = blocks_openings(simulator, index, place)
    for k, room in enumerate(rooms):
        x, y = place[k]
        print(
            f"{room.id}: {room.moving.category} at {x:.3f}, {y:.3f} after {episodes.moves[k]} moves; "
            f"{overlap[k]:.1%} over other items, {outside[k]:.1%} outside{', blocks an opening' if blocks[k] else ''}"
        )
    target = {room.id: room.target for room in collection.rooms}  # as it was read
    out.parent.mkdir(parents=True, exist_ok=True)
    centers = [(round(x, 4), round(y, 4)) for x, y in place.tolist()]
    done = [replace(placed(room, c), target=target[room.id]) for room, c in zip(rooms, centers, strict=True)]
    write_rooms(out, done)
    print(f"wrote {out}")
    return out


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


def fitting(chosen: Collection) -> Collection:
    """The rooms that their target fits into; the others left out, with the reason."""
    rooms = chosen.rooms
    regions = fitting_positions(envelopes(rooms), np.array([room.moving.template for room in rooms]))
    misfits = {
        room.id: f"the {room.moving.category} does not fit into it"
        for room, region in zip(rooms, regions, strict=True)
        if region.is_empty
    }
    return _without(chosen, misfits)


def _without(chosen: Collection, reasons: dict[str, str]) -> Collection:
    rooms = [room for room in chosen.rooms if room.id not in reasons]
    return replace(chosen, rooms=rooms, left_out=[*chosen.left_out, *reasons.items()])


def placed(room: Room, center: tuple[float, float]) -> Room:
    """The room with its target there."""
    furniture = list(room.furniture)
    assert room.target is not None
    furniture[room.target] = replace(room.moving, center=center)
    return replace(room, furniture=tuple(furniture))


main = command("place", PlaceConfig, run)

if __name__ == "__main__":
    main()
