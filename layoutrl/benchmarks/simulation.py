"""How fast rooms are stepped, by both simulators; how that grows with episodes and items."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import torch
from matplotlib.figure import Figure
from torch import Tensor
from torch.utils.benchmark import Timer

from layoutrl import InputError
from layoutrl.agents.exploration import explore
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.device import generator_of
from layoutrl.env.episodes import Episodes, Step
from layoutrl.env.measures import measured
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_simulator import RoomsSimulator
from layoutrl.env.scenes import ItemSimulator
from layoutrl.env.simulator import Simulator
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.config import BenchConfig

ITEMS = 5  # at least so many in the rooms of `moves`
FURNISHED = 6  # items in the rooms of `furnishing`


def moves(config: BenchConfig, rooms: Sequence[Room], device: torch.device) -> dict[str, float]:
    """Measure random legal moves a second in the same rooms, by both simulators and by a single environment."""
    furnished = well_furnished(config, rooms)
    simulator = Simulator(furnished, config.method.moves, config.reward)
    fast = moves_a_second(config, BatchSimulator(simulator, device), config.batch)
    slow = 0.0
    for batch in config.shapely_batches:
        play = random_moves_by_shapely(simulator, batch, np.random.default_rng(config.seed))
        slow = max(slow, batch / seconds_of(partial(next, play), config.seconds))
    alone = config.method.max_moves / seconds_of(partial(episode, *environment(config, furnished)), config.seconds)
    play = random_moves_by_shapely(simulator, 1, np.random.default_rng(config.seed))
    return {
        "moves_a_second": fast,
        "shapely_moves_a_second": slow,
        "times_shapely": fast / slow,
        "environment_steps_a_second": alone,
        "shapely_steps_a_second": 1 / seconds_of(partial(next, play), config.seconds),
    }


def well_furnished(config: BenchConfig, rooms: Sequence[Room]) -> list[Room]:
    """The rooms with ITEMS items or more. Raises InputError where there is none."""
    furnished = [room for room in rooms if len(room.furniture) >= ITEMS]
    if not furnished:
        raise InputError(f"parts: speed expects rooms with {ITEMS} items or more; no {config.room.type} has them")
    return furnished


def growth(
    config: BenchConfig, rooms: Sequence[Room], _held_out: Sequence[Room], device: torch.device
) -> dict[str, dict[int, float]]:
    """Moves a second by the number of parallel episodes, and of items in a room."""
    simulator = BatchSimulator(Simulator(rooms, config.method.moves, config.reward), device)
    by_episodes = {batch: moves_a_second(config, simulator, batch) for batch in config.batches}
    by_items = {}
    for count in config.items:
        rng = np.random.default_rng(config.seed)
        crowded = [with_items(room, count, rng) for room in rooms[: config.items_rooms]]
        simulator = BatchSimulator(Simulator(crowded, config.method.moves, config.reward), device)
        by_items[count] = moves_a_second(config, simulator, config.batch)
    return {"moves_a_second_by_episodes": by_episodes, "moves_a_second_by_items": by_items}


def furnishing(
    config: BenchConfig, rooms: Sequence[Room], held_out: Sequence[Room], device: torch.device
) -> dict[str, float]:
    """Measure random legal actions a second in whole rooms of FURNISHED items, by both simulators; and the seconds of
    set-up and of all measures of the held-out rooms."""
    rng = np.random.default_rng(config.seed)
    designs = [with_items(room, FURNISHED, rng) for room in rooms[: config.items_rooms]]
    began = time.perf_counter()
    simulator = RoomsSimulator([brief_of(room) for room in designs], designs, config.method.moves, config.reward)
    batched = BatchRoomsSimulator(simulator, device)
    setup = time.perf_counter() - began
    generator = torch.Generator(device).manual_seed(config.seed)
    fast = config.batch / seconds_of(partial(next, random_actions(batched, config.batch, generator)), config.seconds)
    few = config.shapely_batches[0]
    play = random_actions_by_shapely(simulator, few, np.random.default_rng(config.seed))
    slow = few / seconds_of(partial(next, play), config.seconds)
    layouts = [replace(room, furniture=tuple(map(replace, room.furniture))) for room in held_out]
    began = time.perf_counter()  # timed once: rooms cache what is derived from them
    measured(layouts, held_out)
    measuring = time.perf_counter() - began
    return {
        "actions_a_second": fast,
        "shapely_actions_a_second": slow,
        "times_shapely": fast / slow,
        "setup_seconds": setup,
        "measures_seconds": measuring,
    }


def random_actions(simulator: BatchRoomsSimulator, episodes: int, generator: torch.Generator) -> Iterator[Tensor]:
    """Rewards (B,) of legal actions drawn at random; episodes never end."""
    room = torch.randint(len(simulator.rooms), (episodes,), generator=generator, device=simulator.device)
    state = simulator.begin(room, generator)
    none = torch.zeros_like(room)
    while True:
        length, legal = simulator.reach(state)
        action = explore(none, legal, 1.0, generator)
        state = simulator.moved(state, action, length.gather(1, action[:, None])[:, 0])
        yield simulator.reward(state).total


def random_actions_by_shapely(
    simulator: RoomsSimulator, episodes: int, rng: np.random.Generator
) -> Iterator[np.ndarray]:
    """The same by the reference simulator."""
    state = simulator.begin(rng.integers(len(simulator.rooms), size=episodes), rng)
    every = np.arange(episodes)
    while True:
        item, center, quarter, legal = simulator.destinations(state)
        action = (rng.random(legal.shape) * legal).argmax(1)
        state = simulator.put(state, item[every, action], center[every, action], quarter[every, action])
        yield simulator.reward(state).total


def with_items(room: Room, count: int, rng: np.random.Generator) -> Room:
    """The room with `count` items, the moving one first: some taken away, or small boxes put anywhere indoors."""
    furniture = [room.moving, *room.others][:count]
    x0, y0, x1, y1 = room.indoor.bounds
    while len(furniture) < count:
        width, depth = rng.uniform(0.1, 0.3, 2)  # metres
        x, y = rng.uniform((x0, y0), (x1, y1))
        box = Item("box", (float(width), float(depth)), (float(x), float(y)))
        if room.indoor.covers(box.footprint):
            furniture.append(box)
    return replace(room, furniture=tuple(furniture), target=0)


def plot(measured: dict[str, Any]) -> Figure:
    """What `growth` measured."""
    figure = Figure(figsize=(9, 3.5), layout="constrained")
    for axes, name, label in zip(
        figure.subplots(1, 2), measured, ("parallel episodes", "items in a room"), strict=True
    ):
        axes.plot(list(measured[name]), list(measured[name].values()), marker="o")
        axes.set(xlabel=label, ylabel="moves a second")
        axes.grid(alpha=0.3)
    figure.axes[0].set(xscale="log", yscale="log")
    figure.axes[1].set_ylim(bottom=0)
    return figure


def moves_a_second(config: BenchConfig, simulator: BatchSimulator, episodes: int) -> float:
    """How many moves so many parallel episodes make in a second."""
    play = random_moves(simulator, episodes, config.method.max_moves, np.random.SeedSequence(config.seed))
    return episodes / seconds_of(partial(next, play), config.seconds)


def random_moves(
    simulator: ItemSimulator, episodes: int, max_moves: int, seed: np.random.SeedSequence
) -> Iterator[Step]:
    """Steps of many episodes, of legal moves drawn at random."""
    generator = generator_of(seed, simulator.device)
    running = Episodes(simulator, np.arange(episodes) * max_moves // episodes, max_moves, generator)
    none = torch.zeros(episodes, dtype=torch.int64, device=simulator.device)
    while True:
        yield running.step(explore(none, running.legal, 1.0, generator))


def random_moves_by_shapely(simulator: Simulator, episodes: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Rewards (B,) of the same by the reference simulator; its episodes never end, which spares it the new ones."""
    room = rng.integers(len(simulator.rooms), size=episodes)
    position = simulator.starts(room, rng)
    reached, legal = simulator.destinations(room, position)
    while True:
        action = (rng.random(legal.shape) * legal).argmax(1)
        can_move = legal.any(1)
        position[can_move] = reached[can_move, action[can_move]]
        reward = simulator.reward(room, position).total
        reached, legal = simulator.destinations(room, position)
        yield reward


def environment(config: BenchConfig, rooms: Sequence[Room]) -> tuple[gymnasium.Env[Any, Any], np.random.Generator]:
    """Return `layoutrl/Layout-v0` with the geometry observation, made by Gymnasium, and a generator to draw moves."""
    method = config.method
    env = gymnasium.make(
        "layoutrl/Layout-v0", rooms=rooms, moves=method.moves, reward=config.reward, max_moves=method.max_moves
    )
    env.reset(seed=config.seed)
    return env, np.random.default_rng(config.seed)


def episode(env: gymnasium.Env[Any, Any], rng: np.random.Generator) -> None:
    """An episode of legal moves drawn at random, from its reset to its end."""
    _, info = env.reset()
    ended = False
    while not ended:
        action = (rng.random(len(info["legal"])) * info["legal"]).argmax()
        *_, ended, info = env.step(action)


def seconds_of(work: Callable[[], object], at_least: float) -> float:
    """Median time of a call, after a warm-up, repeated for `at_least` seconds; waits for the GPU."""
    timer = Timer("work()", globals={"work": work}, num_threads=torch.get_num_threads())
    return timer.blocked_autorange(min_run_time=at_least).median
