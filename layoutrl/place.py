"""python -m layoutrl.place run=<folder> rooms=<file> [item=<category>] [out=<file>]"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import hydra
import numpy as np
from omegaconf import DictConfig, OmegaConf

from layoutrl import build
from layoutrl.config import PlaceConfig, TrainConfig, config_directory, register
from layoutrl.env.batch import BatchSimulator
from layoutrl.errors import InputError
from layoutrl.evaluation.metrics import blocks_openings
from layoutrl.rooms.collection import choose_missing
from layoutrl.rooms.files import write_rooms
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources import read_files
from layoutrl.runs import load_config


def run(config: PlaceConfig) -> Path:
    """Put an item that has no center where a trained agent moves it, in rooms of a file; returns the file written.

    Raises InputError where no room lacks such an item, or the file to write is there already.
    """
    folder, source = Path(config.run), Path(config.rooms).expanduser()
    out = Path(config.out or source.with_name(f"{source.stem}-placed.jsonl")).expanduser()
    if out.exists():
        raise InputError(f"out: {out} is there already; expected the name of a new file, as out=<file>")
    trained, device = load_config(folder, TrainConfig), build.device(config.device)
    agent, categories = build.trained_agent(folder, trained.method, device, config.checkpoint)
    item = config.item or trained.room.item
    chosen = choose_missing(read_files("json", trained.room.type, source), item)
    print(chosen)
    if not chosen.rooms:
        raise InputError(f"rooms: {source} has no {trained.room.type} to work on; expected one item without a center")

    # The simulator is for rooms whose answer is known. Here it is none: any place will do, and nothing looks at it.
    rooms = [placed(room, *room.envelope.centroid.coords) for room in chosen.rooms]
    simulator = build.simulator(rooms, trained.method, trained.reward)
    index = np.arange(len(rooms))
    episodes = build.greedy(agent, trained.method).rollout(
        BatchSimulator(simulator, device),
        build.observation(rooms, trained.method, categories, device),
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
    out.parent.mkdir(parents=True, exist_ok=True)
    write_rooms(
        out, [placed(room, (round(x, 4), round(y, 4))) for room, (x, y) in zip(rooms, place.tolist(), strict=True)]
    )
    print(f"wrote {out}")
    return out


def placed(room: Room, center: tuple[float, float]) -> Room:
    """The room with its target there."""
    furniture = list(room.furniture)
    assert room.target is not None
    furniture[room.target] = replace(room.moving, center=center)
    return replace(room, furniture=tuple(furniture))


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="place")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
