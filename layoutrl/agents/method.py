"""What an agent is configured by. It loads no torch, so that a wrong option is answered at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from layoutrl.env.simulator import Moves

if TYPE_CHECKING:
    import torch

    from layoutrl.env.symmetry import Symmetry

MOST_ACTIONS = 31  # one bit each of a positive int32, as the replay keeps them


@dataclass(kw_only=True)
class Method:
    """What an agent sees, how it moves and how it learns; `conf/method/` has the values.

    A field of type Any is a Literal, which OmegaConf cannot express.
    """

    name: str
    observation: Any  # geometry or image
    steps: list[float]
    unit: Any  # of the steps: metre or pixel
    slide: bool
    max_moves: int  # moves of a training episode
    evaluation_moves: int  # at most, in a greedy episode
    climbs: int = 0  # moves after it, at most, to where values are higher, seen from all around
    snap: float = 0.0  # metres: from no further it is put in line with what stands beside it
    on_illegal: Any  # in test: stop or mask
    goal_iou: float | None = None  # an episode of one item ends where it has it; None: never
    double: bool
    dueling: bool = False
    discount: float
    learning_rate: float
    symmetries: bool  # an equal share of what is learned from is seen in each mirrored and turned view
    batch: int  # transitions an update
    episodes: int  # stepped at once
    warmup_moves: int
    replay_capacity: int
    target_period: int  # updates
    epsilon_start: float
    epsilon_end: float
    epsilon_share: float  # of the updates, over which epsilon falls
    updates: dict[str, int]  # by budget
    scope: Any = "item"  # what is furnished: one item of a room, or the whole room (room)
    every_move: bool = False  # learn what every legal move of a pose gains, not only the one that was made
    discount_start: float = 0.5  # with every_move: from which the discount rises, over the first half of the updates
    near_share: float = 0.0  # of the episodes that are to begin near the designer's place, if legal
    # Of whole rooms:
    own_share: float = 0.5  # of rooms in which the agent's own mistakes stay, as far as it does not explore

    @property
    def moves(self) -> Moves:
        """The actions."""
        return Moves(tuple(self.steps), self.unit, self.slide)

    def views(self, device: torch.device) -> list[Symmetry]:
        """The symmetries that are learned from, and averaged over in test.

        A whole room is seen as the item that moves is turned, so that only mirroring is left, and that is learned from
        where the type of the room allows it (`room.mirrors_alike`).
        """
        from layoutrl.env.symmetry import mirrored, symmetries

        views = mirrored if self.scope == "room" else symmetries
        return views(self.moves, device)[: None if self.symmetries else 1]
