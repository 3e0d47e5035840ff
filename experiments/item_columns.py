"""The columns of tables in which one item is placed: their rooms and starts, and how a cell of each is filled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from cell_config import CellConfig, learned_from
from cell_trainings import agent_seconds, clock_of, trained_agent, trained_planit

from layoutrl import InputError
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import GeometryObservation, observation_of
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.oracle import perfect_places
from layoutrl.evaluation.policy import greedy
from layoutrl.rivals.budgets import seconds_budget
from layoutrl.rivals.planit.canvas import box_of
from layoutrl.rivals.planit.scoring import score_all
from layoutrl.rivals.rules import best_wall_place, far_end_place, nearest_room_place, nearest_wall_place
from layoutrl.rivals.supervised import (
    Network,
    pointed_places,
    regressed_places,
    scored_places,
    train_pointer,
    train_regressor,
    train_scorer,
)
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import designed_rooms, two_parts
from layoutrl.runs.config import seeds
from layoutrl.runs.machine import keep_freed_memory

DRAWN = 1  # rooms whose layouts are kept, to be drawn
STARTS_SEED = 0  # of the one list of starts that every method is scored from


@dataclass(frozen=True)
class Setting:
    """Training rooms, rooms to be scored in, and B starts: one in each of these; with protocol=scene, many in one."""

    training: list[Room]
    simulator: Simulator  # of the rooms to be scored in
    room: np.ndarray  # (B,), indices of the simulator's rooms
    starts: np.ndarray  # (B, 2), metres
    device: torch.device


def setting_of(config: CellConfig, device: torch.device) -> Setting:
    """Return the rooms and starts of a cell: the same for every column and, unless protocol=scene, every seed.

    With protocol=scene the seed is the index of a scene. Raises InputError if there is no such scene, and if there are
    no rooms to train on or to be scored in.
    """
    if config.protocol == "scene":
        scenes = designed_rooms(config.room.type, config.room.item, config.data, "test")
        if config.seed >= len(scenes):
            raise InputError(f"seed: expected a scene, 0 to {len(scenes) - 1}; got {config.seed}")
        training = held_out = [scenes[config.seed]]
        room = np.zeros(config.budget.random_starts, dtype=int)
    else:
        training, held_out = two_parts(config.room.type, config.room.item, config.data, config.fold)
        training = learned_from(
            config, training, lambda d: designed_rooms(config.room.type, config.room.item, d, "train")
        )
        room = np.arange(len(held_out))
    simulator = Simulator(held_out, config.method.moves, config.reward)
    return Setting(training, simulator, room, simulator.starts(room, np.random.default_rng(STARTS_SEED)), device)


def agent(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """Train the agent, unless it is trained, and test it.

    Rows: from one start a room; the best of its first three stopping places; without the paper's rule that an illegal
    move ends a test, if the method has it; and, in held-out designed rooms, from many random starts.
    """
    simulator = setting.simulator
    (network, method, categories), about = trained_agent(config, setting.training, simulator.rooms, setting.device)
    policy = greedy(network, method)
    observe = observation_of(method.observation, simulator.rooms, setting.device, categories)
    batch_simulator = BatchSimulator(simulator, setting.device)
    run = policy.rollout(batch_simulator, observe, setting.room, setting.starts)
    places = {
        "agent": (setting.room, run.final),
        "best of 3": (setting.room, best_of(run.choices(3), simulator, setting.room)),
    }
    if method.on_illegal == "stop":
        masking = greedy(network, replace(method, on_illegal="mask"))
        masked = masking.rollout(batch_simulator, observe, setting.room, setting.starts)
        places["illegal moves masked"] = setting.room, masked.final
    if config.protocol == "unseen" and config.data.source == "designer":
        room = np.resize(setting.room, config.budget.random_starts)
        starts = simulator.starts(room, np.random.default_rng([STARTS_SEED, 1]))
        places["random starts"] = room, policy.rollout(batch_simulator, observe, room, starts).final
    # Only for analysis: does it value the designer's place higher than its own? With every_move Q is what is left to
    # gain: the lower it is, the better the place.
    designed = simulator.designer_position[setting.room]
    there, here = (
        policy.q.best_moves(batch_simulator, observe, setting.room, place)[1] for place in (designed, run.final)
    )
    better = there < here if config.method.every_move else there > here
    return {
        "places": places,
        "moves": float(run.moves.mean()),
        "ms_a_start": 1000 * run.seconds / len(setting.room),
        "knew_better": better,
        **about,
    }


def best_of(choices: np.ndarray, simulator: Simulator, room: np.ndarray) -> np.ndarray:
    """Return those of choices (B, n, 2) with the highest IoU, by knowledge of the answer: (B, 2)."""
    count = choices.shape[1]
    iou = simulator.reward(np.repeat(room, count), choices.reshape(-1, 2)).iou.reshape(-1, count)
    return choices[np.arange(len(room)), iou.argmax(1)]


def regressor(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """Train the agent's network to predict the designer's place, for as long as the agent was trained."""
    network, observe, about = supervised(config, setting, train_regressor)
    place = regressed_places(network, observe, setting.room, setting.starts, config.method.views(setting.device))
    return {"places": {"agent": (setting.room, place)}, **about}


def pointer(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """Train a network to point at the designer's place, for as long as the agent was trained. It needs no start."""
    network, observe, about = supervised(config, setting, train_pointer)
    place = pointed_places(network, observe, config.method.views(setting.device))
    return {"places": {"agent": (setting.room, place[setting.room])}, **about}


def scorer(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """Train the agent's network to predict the IoU of a place; it takes the best of many places. It needs no start."""
    network, observe, about = supervised(config, setting, train_scorer)
    place = scored_places(network, setting.simulator, observe, config.method.views(setting.device))
    return {"places": {"agent": (setting.room, place[setting.room])}, **about}


def supervised(
    config: CellConfig, setting: Setting, train: Callable[..., Network]
) -> tuple[Network, GeometryObservation, dict[str, Any]]:
    """Train a network by supervision, for as long as the agent: (network, its observation in test, facts about it)."""
    seconds = agent_seconds(config, setting.device)
    spent = seconds_budget(seconds, clock_of(setting.device))
    keep_freed_memory()
    categories = categories_of(setting.training)
    training = Simulator(setting.training, config.method.moves, config.reward)
    observe = GeometryObservation(setting.training, categories, setting.device)
    seed = np.random.SeedSequence(config.seed)
    network = train(training, observe, spent, seed, device=setting.device)
    observe = GeometryObservation(setting.simulator.rooms, categories, setting.device)
    return network, observe, {"training_seconds": seconds}


def planit(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """Train PlanIT, and let it place the moving item among all others, and furnish whole rooms from nothing."""
    seconds = agent_seconds(config, setting.device) if config.planit_time == "agent" else None
    placer, about = trained_planit(config, setting.training, setting.simulator.rooms, setting.device, seconds)
    seed = seeds(config)[3]
    one, every = score_all(placer, config.budget.evaluation_rooms, seed)
    return {
        "items": one,
        "all items": {name: found.as_dict() for name, found in every.items()},
        "layouts": {
            name: [[[i.category, *np.round(box_of(i), 3).tolist()] for i in items] for items in found.layouts[:DRAWN]]
            for name, found in every.items()
        },
        **about,
    }


def rules(_: CellConfig, setting: Setting) -> dict[str, Any]:
    """Place the item by rules that need no learning."""
    simulator, room, starts = setting.simulator, setting.room, setting.starts
    places = {
        "random start": starts,
        "nearest wall": nearest_wall_place(simulator, room, starts),
        "nearest room": nearest_room_place(simulator, room, setting.training),
        "best wall or corner": best_wall_place(simulator, room),  # with knowledge of the answer
    }
    if simulator.rooms[0].moving.category == "bathtub":
        places["hand rule"] = far_end_place(simulator, room)
    return {"places": {name: (room, place) for name, place in places.items()}}


def oracle(config: CellConfig, setting: Setting) -> dict[str, Any]:
    """Place the item by the optimal Q, with the same moves."""
    place = perfect_places(setting.simulator, setting.room, setting.starts, config.method.discount)
    return {"places": {"oracle": (setting.room, place)}}


FILLS: dict[str, Callable[[CellConfig, Setting], dict[str, Any]]] = {
    "agent": agent,
    "regressor": regressor,
    "pointer": pointer,
    "scorer": scorer,
    "planit": planit,
    "rules": rules,
    "oracle": oracle,
}
