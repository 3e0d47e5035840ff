"""The agent that a run has trained, and the rooms to evaluate or show it in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import torch

from layoutrl import InputError
from layoutrl.agents.learner import Agent, q_network
from layoutrl.env.reward import Reward
from layoutrl.rooms.collection import digest
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import Data, parts_of
from layoutrl.runs.checkpoints import load_checkpoint, misfit_explained
from layoutrl.runs.config import AS_IN_THE_RUN, RunConfig, TrainConfig
from layoutrl.runs.folder import check_there, load_config, located, moved, stated
from layoutrl.runs.machine import device_of
from layoutrl.runs.ranges import check_on_illegal


class Kept(NamedTuple):
    """An agent, as a checkpoint has it."""

    agent: Agent
    rooms: str  # the digest of the rooms that it was trained on
    updates: int


def kept_agent(
    folder: Path, config: TrainConfig, device: torch.device, which: Literal["last", "best"] = "last"
) -> Kept:
    """Load the agent of a run. Raises InputError if its checkpoint does not fit the configuration."""
    state = load_checkpoint(folder, device, which, stated(config))
    with misfit_explained(folder):
        network = q_network(config.method, state["categories"], np.random.SeedSequence(0), device)
        network.load_state_dict(state["training"]["agent"]["network"])
        updates = state["training"]["agent"]["updates"]
    return Kept(Agent(network, config.method, state["categories"]), state["rooms"], updates)


@dataclass(frozen=True)
class TrainedRun:
    """The agent of a run, and the rooms to evaluate or show it in."""

    agent: Agent
    reward: Reward
    rooms: list[Room]
    training: list[Room]  # what it was trained on
    data: Data
    part: str  # of the rooms of `data`: held_out, training or all
    checkpoint: str  # last or best
    updates: int  # made up to that checkpoint

    @property
    def name(self) -> str:
        """The rooms, with a hash of them, and the policy, for names of files."""
        which = {
            "designer": f"-rooms{self.data.seed}",
            "floorplans": f"-{self.data.labels}",
            "json": f"-{Path(self.data.root or '').stem}",
        }
        rooms = f"{self.data.source}{which.get(self.data.source or '', '')}-{self.part}"
        best = "-best" if self.checkpoint == "best" else ""
        return f"{rooms}-{digest(self.rooms)[:6]}-{self.agent.method.on_illegal}{best}"


def asked_data(own: Data, given: Data) -> tuple[Data, bool]:
    """Return the data meant by those `given` for a run with its `own`, and whether both are of the same source.

    Without a source, what is not given is as in the run. For the designer, the same source means the same seed; prints
    what is given of its training rooms, other than by default, and cannot count.
    """
    data = given
    if data.source is None:
        unset = asdict(AS_IN_THE_RUN)
        data = replace(own, **{name: value for name, value in asdict(data).items() if value != unset[name]})
    designed = data.source == own.source == "designer"  # wherever their cache lies
    same = data.seed == own.seed if designed else (data.source, data.root) == (own.source, own.root)
    if designed and same:
        # The training part is no larger than what it was trained on, and disturbed alike.
        few = [count for count in (data.train_rooms, own.train_rooms) if count is not None]
        data = replace(data, train_rooms=min(few), disturbed=own.disturbed)
        usual = AS_IN_THE_RUN if given.source is None else Data("designer")
        for name in ("train_rooms", "disturbed"):
            asked, taken = getattr(given, name), getattr(data, name)
            if asked not in (taken, getattr(usual, name)):
                print(f"data.{name}: {asked} is not taken; the rooms of the training are as in the run ({taken})")
    return data, same


def trained_run(config: RunConfig) -> TrainedRun:
    """Load the agent of a run and the rooms that were asked for; prints how many these are.

    Rooms of another source are left out if the agent was trained on them. The run's own may be elsewhere now, if that
    is given. Raises InputError if they do not exist, if other rooms are there, and if no room is left.
    """
    folder = Path(config.run)
    trained = load_config(folder, TrainConfig)
    given = located(config.data)
    own, moved_to = trained.data, moved(trained.data, given)
    check_there(folder, moved_to)
    trained = replace(trained, data=moved_to)
    method = replace(trained.method, on_illegal=config.on_illegal or trained.method.on_illegal)
    check_on_illegal("on_illegal", method)
    device = device_of(config.device)
    kept = kept_agent(folder, trained, device, config.checkpoint)
    learns = trained.method.scope, trained.room.type, trained.room.item
    data, same = asked_data(trained.data, given)
    # Other rooms are read first: that they are not there is told before the agent's own are made, which takes a while.
    others = None if data == trained.data else parts_of(*learns, data, trained.fold)
    training, held_out = parts_of(*learns, trained.data, trained.fold)
    if digest(training) != kept.rooms:
        if moved_to != own:
            raise InputError(
                f"data: {moved_to.root} has other rooms than {folder} was trained on, which are not at {own.root} any "
                "more; expected its own: without them nobody knows which rooms it never saw"
            )
        print(f"{folder} was trained on other rooms than there are now; how it does may say less than it seems")

    parts = others or (training, held_out)
    part = config.part or ("held_out" if same or data.source == "designer" else "all")
    chosen = {"training": parts[0], "held_out": parts[1], "all": parts[0] + parts[1]}[part]
    if not same:
        chosen = _unseen(chosen, training)
    if not chosen and part == "all":
        raise InputError(f"data: {data.source} has no rooms to score; expected some that the agent did not learn from")
    if not chosen:
        raise InputError(f"part: {data.source} has no {part} rooms to score; expected another part, or more rooms")
    print(f"{len(chosen)} rooms of {data.source} ({part})")
    unknown = [{item.category for item in room.furniture}.difference(kept.agent.categories) for room in chosen]
    if names := sorted(set().union(*unknown)):
        print(f"{sum(map(bool, unknown))} of them have furniture that the agent does not know: {', '.join(names)}")
    return TrainedRun(
        kept.agent._replace(method=method),
        trained.reward,
        chosen,
        training,
        data,
        part,
        config.checkpoint,
        kept.updates,
    )


def _unseen(rooms: Sequence[Room], training: Sequence[Room]) -> list[Room]:
    """Return the rooms of groups that no room of the training is of; print how many others there are."""
    trained_on = {room.group for room in training}
    unseen = [room for room in rooms if room.group not in trained_on]
    if len(unseen) < len(rooms):
        print(f"left out {len(rooms) - len(unseen)} rooms that the agent was trained on")
    return unseen
