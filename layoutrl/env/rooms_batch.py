"""The simulator of whole rooms as tensors: thousands of them step at once, exactly, on CPU or GPU.

The reference `RoomsSimulator` defines states, moves and rewards.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.packed import Footprints
from layoutrl.env.reward import RewardTerms
from layoutrl.env.rooms_simulator import QUARTERS, TURNS, RoomsSimulator, State, faces_alike
from layoutrl.rooms.room import Item

FAR = 1e4  # metres: where items that do not stand are put, so far from any room that nothing touches them
NOTHING = Item("", (0.0, 0.0), (FAR, FAR))  # pads tables


class BatchRoomsSimulator:
    """Moves and rewards in B states at once, in the rooms of a `RoomsSimulator`. Areas are computed in `dtype`."""

    def __init__(
        self, simulator: RoomsSimulator, device: torch.device | str = "cpu", dtype: torch.dtype = torch.float32
    ):
        self.rooms = simulator.rooms
        self.moves = simulator.moves
        self.actions = simulator.actions
        self.device = torch.device(device)
        self.one_item = BatchSimulator(simulator.one_item, device, dtype)  # in a room for each item and facing
        self.count, self.ways, self.room_index = (
            torch.tensor(table, device=device) for table in (simulator.count, simulator.ways, simulator.room_index)
        )
        # Halves up: rounded to even, the quarters of an item at 45 degrees would not be a quarter apart.
        quarters = np.floor(simulator.degrees / 90 + 0.5).astype(int) % 4
        self.turns = torch.tensor(quarters, device=device)  # (rooms, N, 4): quarters, rounded, from facing right
        self._turns = torch.tensor(TURNS, device=device)
        # Footprints of the items (rooms, N), at their first rotation and a quarter further.
        like = torch.empty(0, device=device, dtype=dtype)
        rows, most = simulator.room_index.shape[:2]
        self._items = _Table([_padded(items, most) for items in simulator.items], simulator.degrees, like)

        # If the reward counts it, the floor that is to be free before each item; if any of it fits, a simulator of it.
        floors = simulator.floor_simulator
        self._floors = BatchSimulator(floors, device, dtype) if floors else None
        self._weighs_floor = simulator.reward_function.theta4 != 0
        if self._weighs_floor:
            floor = [_padded([each or NOTHING for each in row], most) for row in simulator.floor]
            self._floor_table = _Table(floor, simulator.degrees, like)
            self._floor_index, self._ahead, self._welcome = (
                torch.tensor(table, device=device)
                for table in (simulator.floor_index, simulator.ahead, simulator.welcome)
            )

        # The designer's places that each item may take, (rooms * N, T), and what their IoU counts in each quarter.
        places = [there for targets in simulator.targets for there in targets]
        longest = max(map(len, places), default=0)
        table = [_padded(there, longest) for there in places]
        shape = rows * most, longest
        counts = np.zeros((*shape, QUARTERS))
        for (k, t, q), degrees in np.ndenumerate(np.repeat(simulator.degrees.reshape(-1, 1, QUARTERS), longest, 1)):
            if t < len(places[k]):
                counts[k, t, q] = 1.0 if faces_alike(places[k][t], degrees) else simulator.reward_function.faces_away
        own = np.array([[item.degrees for item in row] for row in table]).reshape(*shape, 1)
        self._targets = _Table(table, own, like)
        self._target_center = torch.tensor(
            np.array([[item.center for item in row] for row in table]).reshape(*shape, 2), device=device
        )
        self._target_counts = torch.tensor(counts).to(like)

    def begin(self, room: Tensor, generator: torch.Generator) -> State[Tensor]:
        """Return rooms (B,) with none of the items to place, and draw the pose that each will have when it is taken."""
        room_index = self.room_index.index_select(0, room)
        chance = torch.rand(room_index.shape, generator=generator, device=self.device)
        quarter = chance.masked_fill(room_index < 0, -1.0).argmax(2)
        room_index = room_index.gather(2, quarter[..., None])[..., 0]
        center = self.one_item.starts(room_index.clamp(min=0).flatten(), generator).view(*room_index.shape, 2)
        return State(room, center, quarter, torch.zeros_like(room_index, dtype=torch.bool), torch.zeros_like(room))

    def put(self, state: State[Tensor], item: Tensor, center: Tensor, quarter: Tensor) -> State[Tensor]:
        """The states in which an item (B,) stands at centers (B, 2), turned by quarters (B,), and is what moves."""
        index = item[:, None]
        return State(
            state.room,
            state.center.scatter(1, index[..., None].expand(-1, 1, 2), center[:, None]),
            state.quarter.scatter(1, index, quarter[:, None]),
            state.stands.scatter(1, index, True),
            item,
        )

    def reach(self, state: State[Tensor]) -> tuple[Tensor, Tensor]:
        """How far every action leads, in metres, and whether it is legal: (B, A) each. Turns and takes lead nowhere."""
        length, legal = self.steps(state)
        _, center, quarter = self._moving(state)
        ways = self.ways[state.room, state.moving]
        turns = []
        for turn in self._turns:
            as_turned = self.room_index[state.room, state.moving, (quarter + turn) % ways]
            fits = self.one_item.is_legal(as_turned.clamp(min=0), center)
            turns.append(fits & (ways > 1) & (as_turned >= 0))
        stands = state.stands.gather(1, state.moving[:, None])
        can_take = torch.arange(state.stands.shape[1], device=self.device) < self.count[state.room][:, None]
        can_take = can_take & ~(torch.zeros_like(can_take).scatter(1, state.moving[:, None], stands))
        legal = torch.cat([torch.cat([legal, torch.stack(turns, 1)], 1) & stands, can_take], 1)
        return torch.nn.functional.pad(length, (0, self.actions - length.shape[1])), legal

    def steps(self, state: State[Tensor]) -> tuple[Tensor, Tensor]:
        """As `reach`, but of the moves and slides alone: (B, moves) each."""
        room_index, center, _ = self._moving(state)
        return self.one_item.reach(room_index, center, self._others(state))

    def moved(self, state: State[Tensor], action: Tensor, length: Tensor) -> State[Tensor]:
        """Return the states after an action (B,), which leads `length` (B,) metres far."""
        turn = action - self.moves.count
        item = torch.where(turn >= len(self._turns), turn - len(self._turns), state.moving)
        _, center, quarter = self._moving(state._replace(moving=item))
        by = self._turns[turn.clamp(0, len(self._turns) - 1)].where((turn >= 0) & (turn < len(self._turns)), 0)
        quarter = (quarter + by) % self.ways[state.room, item]
        return self.put(state, item, self.one_item.moved(state.room, center, action, length), quarter)

    def reward(self, state: State[Tensor]) -> RewardTerms[Tensor]:
        """The reward of the moving item where it stands, among what stands now: terms (B,), 0 until one is taken."""
        room_index, center, quarter = self._moving(state)
        which = state.room * self.room_index.shape[1] + state.moving
        if self._target_counts.shape[1]:
            there = self._target_center.index_select(0, which)
            targets = self._targets.footprints(which, there, torch.zeros_like(there[..., 0], dtype=torch.int64))
            ious = self.one_item.ious(room_index, center, targets)
            iou = (ious * self._target_counts[which, :, quarter]).amax(1)
        else:
            iou = torch.zeros(len(room_index), device=self.device, dtype=self._target_counts.dtype)
        taken = self._floor_taken(state) if self._weighs_floor else None
        terms = self.one_item.reward(room_index, center, self._others(state), iou, taken)
        stands = state.stands.gather(1, state.moving[:, None])[:, 0]
        return RewardTerms(*(term * stands for term in terms))

    def _floor_taken(self, state: State[Tensor]) -> Tensor:
        """As `RoomsSimulator.floor_taken`: (B,)."""
        room_index, center, quarter = self._moving(state)
        floor = self._floor_index[state.room, state.moving, quarter]
        middle = center + self._ahead[state.room, state.moving, quarter]
        item, stand = torch.arange(state.stands.shape[1], device=self.device), _others_stand(state)
        taken = self._target_counts.new_zeros(len(room_index))
        if self._floors is not None:
            others = self._items.some(state, state.center, stand & ~self._welcome[state.room, state.moving])
            terms = self._floors.reward(floor.clamp(min=0), middle, others, taken)
            taken = (terms.r2 + terms.r3).where(floor >= 0, 0.0)
        in_the_way = stand & ~self._welcome[state.room[:, None], item, state.moving[:, None]]
        middles = state.center + self._ahead[state.room[:, None], item, state.quarter]
        theirs = self._floor_table.some(state, middles, in_the_way)
        return taken + self.one_item.ious(room_index, center, theirs).sum(1)

    def _moving(self, state: State[Tensor]) -> tuple[Tensor, Tensor, Tensor]:
        """Return the room of `one_item` (B,), the center (B, 2) and the quarter (B,) of the moving items."""
        index = state.moving[:, None]
        quarter = state.quarter.gather(1, index)[:, 0]
        center = state.center.gather(1, index[..., None].expand(-1, 1, 2))[:, 0]
        return self.room_index[state.room, state.moving, quarter], center, quarter

    def _others(self, state: State[Tensor]) -> Footprints:
        """What stands and does not move."""
        return self._items.some(state, state.center, _others_stand(state))


def either(chosen: Tensor, new: State[Tensor], old: State[Tensor]) -> State[Tensor]:
    """Return the states of `new` where `chosen` (B,), and those of `old` elsewhere."""
    both = zip(new, old, strict=True)
    return State(*(torch.where(chosen.view(-1, *[1] * (one.ndim - 1)), one, other) for one, other in both))


def _others_stand(state: State[Tensor]) -> Tensor:
    """Which items stand and do not move: bool (B, N)."""
    return state.stands.scatter(1, state.moving[:, None], False)


def _padded(items: Sequence[Item], length: int) -> list[Item]:
    return [*items, *[NOTHING] * (length - len(items))]


class _Table:
    """Footprints of items (rows, K), each at two rotations, a quarter apart."""

    def __init__(self, items: Sequence[Sequence[Item]], degrees: np.ndarray, like: Tensor):
        """Take items (rows, K) and their rotations in degrees (rows, K, ...), of which the first counts."""
        shape = degrees.shape[:2]
        size = np.array([[item.size for item in row] for row in items]).reshape(*shape, 2)
        disc = np.array([[item.form == "circle" for item in row] for row in items], dtype=bool).reshape(shape)
        first = degrees[..., 0]
        slanted = ~disc & (first % 90 != 0) & (size > 0).all(-1)
        swapped = (first % 180 == 90)[..., None]
        half = np.where(swapped, size[..., ::-1], size) / 2
        half = np.stack([half, half[..., ::-1]], 2)  # (rows, K, parity, 2)
        turn = np.deg2rad(np.where(slanted, first, 0))
        cosine, sine = np.abs(np.cos(turn))[..., None, None], np.abs(np.sin(turn))[..., None, None]
        bounds = np.where(disc[..., None, None], half, cosine * half + sine * half[..., ::-1])
        self._half, self._bounds = (torch.tensor(values).to(like) for values in (half, bounds))
        self._disc = torch.tensor(disc, device=like.device) if disc.any() else None
        self._turn = torch.tensor(turn).to(like) if slanted.any() else None

    def some(self, state: State[Tensor], center: Tensor, these: Tensor) -> Footprints:
        """Return the footprints of `these` (B, K) of a state's items, at centers (B, K, 2); the others are FAR away."""
        return self.footprints(state.room, center.where(these[..., None], FAR), state.quarter)

    def footprints(self, row: Tensor, center: Tensor, quarter: Tensor) -> Footprints:
        """Return the footprints of rows (B,) at centers (B, K, 2), by quarters (B, K) from their first rotation."""
        odd = (quarter % 2).bool()[..., None]

        def at(table: Tensor) -> Tensor:
            even, turned = table.index_select(0, row).unbind(2)
            return torch.where(odd, turned, even)

        half = at(self._half)
        return Footprints(
            center,
            half,
            half if self._turn is None else at(self._bounds),
            None if self._disc is None else self._disc.index_select(0, row),
            None if self._turn is None else self._turn.index_select(0, row),
        )
