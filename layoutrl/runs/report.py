"""The evaluation of an agent that trainings and the command line share: numbers, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from layoutrl.agents.learner import Agent
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import Observe, observation_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.metrics import lattice_ceiling, score
from layoutrl.evaluation.policy import Policy, greedy
from layoutrl.rivals.rooms.baselines import Library
from layoutrl.rivals.rules import nearest_room_place, random_wall_place
from layoutrl.rooms.room import Room
from layoutrl.runs.rooms_report import evaluate_rooms, rooms_table

AGENT, START, WALL, NEAREST = "agent", "random start", "random wall or corner place", "nearest training room"


def scored(
    agent: Agent,
    reward: Reward,
    rooms: Sequence[Room],
    training: Sequence[Room],
    seed: np.random.SeedSequence,
    starts_a_room: int = 1,
) -> tuple[dict[str, Any], str]:
    """Evaluate an agent of one item or of whole rooms; return the numbers and the text to print.

    `training` are the rooms that it learned from.
    """
    network, method, categories = agent
    if method.scope == "room":
        # The nearest room is looked for in the views that the agent learned from.
        library = Library(training, mirrors_alike=method.symmetries)
        result = evaluate_rooms(Furnisher(agent), rooms, library, seed)
        return result, rooms_table(result)
    policy, simulator = greedy(network, method), Simulator(rooms, method.moves, reward)
    observe = observation_of(method.observation, rooms, policy.q.device, categories)
    result = evaluate(policy, simulator, observe, training, starts_a_room=starts_a_room, seed=seed)
    return result, table(result)


def evaluate(
    policy: Policy,
    simulator: Simulator,
    observe: Observe,
    training: Sequence[Room],
    *,
    starts_a_room: int,
    seed: np.random.SeedSequence,
) -> dict[str, Any]:
    """Score the agent and three baselines from the same random starts in every room of the simulator.

    The result is plain numbers, ready for JSON: a row each, the lattice ceiling, and the IoU from every start. Moves
    and time (`ms_a_start`) are means over starts.
    """
    start_rng, wall_rng = (np.random.default_rng(s) for s in seed.spawn(2))
    room = np.repeat(np.arange(len(simulator.rooms)), starts_a_room)
    starts = simulator.starts(room, start_rng)
    run = policy.rollout(BatchSimulator(simulator, policy.q.device), observe, room, starts)
    ceiling = lattice_ceiling(simulator, room, starts)
    places = {
        AGENT: run.final,
        START: starts,
        WALL: random_wall_place(simulator, room, starts, wall_rng),
        NEAREST: nearest_room_place(simulator, room, training),
    }
    iou = simulator.reward(room, run.final).iou
    category = np.array([r.moving.category for r in simulator.rooms])[room]
    return {
        "rooms": len(simulator.rooms),
        "groups": len({room.group for room in simulator.rooms}),
        "starts_a_room": starts_a_room,
        "rows": {name: score(simulator, room, position).as_dict() for name, position in places.items()},
        "items": {str(c): float(iou[category == c].mean()) for c in sorted(set(category))},  # the agent's mean IoU
        "lattice_ceiling": float(ceiling.mean()),
        "moves": float(run.moves.mean()),
        "ms_a_start": 1000 * run.seconds / len(room),
        "positions": [
            {
                "room": simulator.rooms[k].id,
                "item": str(category[b]),
                "iou": float(iou[b]),
                "center": run.final[b].tolist(),
                "moves": int(run.moves[b]),
            }
            for b, k in enumerate(room)
        ],
    }


def table(evaluation: dict[str, Any]) -> str:
    """The evaluation as text: IoU is mean ± standard deviation, and the standard error of the mean over groups."""
    columns = f"{'s.e.':>6} {'median':>7} {'>= 0.9':>7} {'overlap':>8} {'outside':>8} {'blocks':>7}"
    lines = [f"{'':28} {'IoU ± sd':>15} {columns}"]
    for name, row in evaluation["rows"].items():
        error = "     -" if row["standard_error"] is None else f"{row['standard_error']:6.3f}"
        lines.append(
            f"{name:28} {row['mean_iou']:7.3f} ± {row['std_iou']:5.3f} {error} "
            f"{row['median_iou']:7.3f} {row['share_090']:7.1%} {row['overlap']:8.4f} {row['outside']:8.4f} "
            f"{row['blocked']:7.1%}"
        )
    lines.append(f"{'lattice ceiling':28} {evaluation['lattice_ceiling']:7.3f}")
    if len(evaluation["items"]) > 1:
        lines.append("agent, by item: " + ", ".join(f"{name} {iou:.3f}" for name, iou in evaluation["items"].items()))
    lines.append(
        f"{evaluation['rooms']} rooms in {evaluation['groups']} groups, {evaluation['starts_a_room']} start(s) each; "
        f"{evaluation['moves']:.1f} moves and {evaluation['ms_a_start']:.1f} ms a start"
    )
    return "\n".join(lines)
