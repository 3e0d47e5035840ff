"""What a perfect Q would score: where the greedy policy of the exact optimal action values puts an item.

Training solves a Markov decision process without terminal states: the reward is that of the place entered, divided by
REWARD_SCALE, illegal moves are masked, the future is discounted. Its optimal policy need not end at the designer's
place: what a move costs now can outweigh what lies beyond, and no move stays in place. The gap between this yardstick
and the lattice ceiling is due to the discount, the reward and the lack of a move that stays. The optimal policy ends in
a loop, where it is stopped; a trained agent spends the rest of its moves searching further, which helps one that errs.

Moves can reach up to millions of places in a room. Only those that can be on an optimal path are searched: branch and
bound, breadth first, many episodes at once. It minimises discounted costs = best reward - reward >= 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import shapely
import torch
from torch import Tensor

from layoutrl import InputError
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import GRID, snap
from layoutrl.env.reward import REWARD_SCALE
from layoutrl.env.simulator import DIRECTIONS, Simulator

TOLERANCE = 1e-6  # of discounted reward / REWARD_SCALE: branches that promise no more than this are cut
EPISODES = 32  # searched together: many enough for tensors to pay, few enough for memory
AT_ONCE = 8192  # poses in one call of the simulator: they stay in the processor's cache
BEAM = 100  # open paths an episode in the first, incomplete search
SLACK = 0.01  # of reward / REWARD_SCALE: how tight the bound on the best place of a room is
BITS = 29  # of a coordinate in a key: up to 268 m from the start on the grid; two, and 5 for one of EPISODES, make 63
Ask = Callable[[Tensor, Tensor], tuple[Tensor, ...]]  # about poses: rooms (n,), positions (n, 2)


def perfect_places(
    simulator: Simulator, room: np.ndarray, starts: np.ndarray, discount: float, dtype: torch.dtype = torch.float32
) -> np.ndarray:
    """Return where the greedy policy of the optimal Q stops, from starts (B, 2) in rooms (B,): (B, 2), all in metres.

    The policy ends in a loop, and stops at that place of the loop which the move of highest Q enters. From every place
    on its path its return is the best possible up to TOLERANCE, with moves and rewards as the BatchSimulator of this
    `dtype` has them. Raises InputError for a discount or a reward that the search does not take (`check_solvable`).
    """
    check_solvable(simulator, discount)
    batch_simulator = BatchSimulator(simulator, dtype=dtype)
    best = best_rewards(simulator, batch_simulator)[room]
    return np.concatenate(
        [each.stops() for each in _searches(simulator, batch_simulator, best, room, starts, discount)]
    )


def perfect_values(
    simulator: Simulator, room: np.ndarray, position: np.ndarray, discount: float, dtype: torch.dtype = torch.float32
) -> np.ndarray:
    """The optimal Q of every move from positions (B, 2) in metres in rooms (B,): (B, A), of rewards / REWARD_SCALE.

    It is -inf of illegal moves, and up to discount * TOLERANCE too low of others, with moves and rewards as above.
    Raises as `perfect_places` does.
    """
    check_solvable(simulator, discount)
    batch_simulator = BatchSimulator(simulator, dtype=dtype)
    length, legal = _asked(batch_simulator.reach, room, position)
    which, action = np.nonzero(legal)
    reached, of = _led_to(position[which], action, length[which, action]), room[which]
    best = best_rewards(simulator, batch_simulator)[of]
    searches = _searches(simulator, batch_simulator, best, of, reached, discount)
    cost = np.concatenate([search.least_cost for search in searches])
    q = np.full(legal.shape, -np.inf)
    q[which, action] = _rewards(batch_simulator, of, reached) + discount * (best / (1 - discount) - cost)
    return q


def check_solvable(simulator: Simulator, discount: float) -> None:
    """Raise InputError unless 0 < discount < 1, without which the search has no end, and no reward exceeds theta1 times
    the IoU, by which it bounds what is to come."""
    if not 0 < discount < 1:
        raise InputError(f"discount: expected more than 0 and less than 1; got {discount}")
    reward = simulator.reward_function
    if not (reward.theta1 > 0 >= max(reward.theta2, reward.theta3)):
        raise InputError(f"reward: expected theta1 above 0, theta2 and theta3 at most 0; got {reward}")


def _searches(
    simulator: Simulator,
    batch_simulator: BatchSimulator,
    best_reward: np.ndarray,
    room: np.ndarray,
    starts: np.ndarray,
    discount: float,
) -> Iterator[Search]:
    """Searches from starts (B, 2), EPISODES of them together."""
    for k in np.split(np.arange(len(room)), range(EPISODES, len(room), EPISODES)):
        yield Search(simulator, batch_simulator, best_reward[k], room[k], starts[k], discount)


def best_rewards(simulator: Simulator, batch_simulator: BatchSimulator) -> np.ndarray:
    """Return an upper bound on reward / REWARD_SCALE in each room (rooms,), at most SLACK above the true maximum.

    It can be far below 1: chairs stand under the table that moves. Rectangles of places are quartered until none can
    hold a better place, since an IoU changes by at most 2 / the larger area for each square metre swept.
    """
    weights, rooms = simulator.reward_function, len(simulator.rooms)
    size, own = _sizes(simulator), simulator.item_area
    of_shape = simulator.room_of_shape
    an_area = 2 / np.maximum(shapely.area(simulator.shapes), own[of_shape])
    steepest = max(abs(weights.theta1), abs(weights.theta2)) * np.bincount(of_shape, an_area, rooms)
    steepest = (steepest + abs(weights.theta3) * 2 / own) / REWARD_SCALE  # of reward, for each square metre swept
    slope = steepest[:, None] * size[:, ::-1]  # for each metre along x and y

    of, center = np.arange(rooms), simulator.designer_position
    best = np.maximum(_rewards(batch_simulator, of, center), 0)
    least_iou = np.minimum(best * REWARD_SCALE / weights.theta1, 1)[:, None]  # that a better place must have
    half = size * (1 - least_iou) / (1 + least_iou)
    while len(of):
        reward = _rewards(batch_simulator, of, center)
        np.maximum.at(best, of, reward)
        promising = reward + (slope[of] * half).sum(1) > best[of] + SLACK
        of, center, half = of[promising].repeat(4), center[promising].repeat(4, 0), half[promising].repeat(4, 0) / 2
        center += half * np.tile([(-1, -1), (-1, 1), (1, -1), (1, 1)], (len(of) // 4, 1))
    return best + SLACK


class Search:
    """The places that B episodes can reach, as far as they matter; place b < B is the start of episode b.

    `least_cost` (B,) is the discounted cost of the optimal policy from each start.
    """

    def __init__(
        self,
        simulator: Simulator,
        batch_simulator: BatchSimulator,
        best_reward: np.ndarray,
        room: np.ndarray,
        starts: np.ndarray,
        gamma: float,
    ):
        self._simulator, self._batch, self._room, self._starts = simulator, batch_simulator, room, starts
        self._gamma = gamma
        self._size = _sizes(simulator)[room]  # (B, 2)
        self._best_reward = best_reward  # (B,)
        episode = np.arange(len(room))
        self._keys, self._places = self._key(episode, starts), episode  # sorted keys, and which place each is
        self._episode, self._position = np.empty(0, dtype=int), np.empty((0, 2))
        self._cost, self._to_come = np.empty((2, 0))  # of entering a place; a lower bound on what follows
        self._leads_to: np.ndarray = np.empty((0, simulator.moves.count), dtype=np.int32)  # by action; -1 for illegal
        self._value = np.empty(0)  # upper bound on the discounted cost from here on; infinite where not expanded
        self._add(episode, starts)
        self.least_cost = np.full(len(room), np.inf)  # known so far, from each start
        self._explore(BEAM)  # finds nearly the least cost, by which the complete search can cut more
        self._explore(None)

    def stops(self) -> np.ndarray:
        """Return the stopping place of each episode (B, 2): the place of its loop with the best move into it."""
        value, follows = self._value, np.arange(len(self._value))
        expanded = np.flatnonzero(np.isfinite(value))
        while True:  # value iteration; the values of alternating moves, where it starts, are nearly optimal
            entering = self._cost + self._gamma * value
            q = np.append(entering, np.inf)[self._leads_to[expanded]]
            best = np.minimum(q.min(1), value[expanded])
            if (value[expanded] - best).max() < TOLERANCE / 1000:
                break
            value[expanded] = best
        known = np.isfinite(q.min(1))
        follows[expanded[known]] = self._leads_to[expanded[known], q[known].argmin(1)]
        far = follows
        for _ in range(len(follows).bit_length()):  # 2, 4, 8, ... moves: longer than any way into a loop
            far = far[far]
        first = stop = far[: len(self._starts)]
        here = follows[first]
        while (here != first).any():
            stop = np.where(entering[here] < entering[stop], here, stop)
            here = np.where(here == first, first, follows[here])
        return self._position[stop]

    def _explore(self, beam: int | None) -> None:
        """Expand every place that an optimal path may visit; with a beam, follow only each episode's best `beam` paths.

        What a path may still cost, if it is to be no worse than the least known cost, must exceed both what the rest
        costs at least and what the best earlier path to the same place may still cost. Other paths are dropped.
        """
        place, paid, depth = np.arange(len(self._starts)), np.zeros(len(self._starts)), 0  # the ends of all open paths
        entered_at, entered_paid = np.empty((2, 0))  # depth and cost of that earlier path
        while len(place):
            self._expand(place[np.isinf(self._value[place])])
            possible = paid + self._gamma**depth * self._value[place]
            np.minimum.at(self.least_cost, self._episode[place], possible)
            path, action = np.nonzero(self._leads_to[place] >= 0)
            place = self._leads_to[place[path], action]
            paid = paid[path] + self._gamma**depth * self._cost[place]
            depth += 1

            new = len(self._cost) - len(entered_at)
            entered_at = np.append(entered_at, np.zeros(new))
            entered_paid = np.append(entered_paid, np.full(new, np.inf))
            least = self.least_cost[self._episode[place]]
            left = (least - paid) / self._gamma**depth
            left_before = (least - entered_paid[place]) / self._gamma ** entered_at[place]
            pays = left > np.maximum(self._to_come[place], left_before) + TOLERANCE
            place, paid = place[pays], paid[pays]
            cheapest = np.lexsort((paid, place))
            place, first = np.unique(place[cheapest], return_index=True)
            paid = paid[cheapest][first]
            if beam:
                promise = np.lexsort((paid + self._gamma**depth * self._to_come[place], self._episode[place]))
                of = self._episode[place[promise]]
                chosen = promise[np.arange(len(of)) - np.searchsorted(of, of) < beam]
                place, paid = place[chosen], paid[chosen]
            entered_at[place], entered_paid[place] = depth, paid

    def _expand(self, place: np.ndarray) -> None:
        """Find where every move from these places leads, and what alternating between each and a neighbour costs."""
        if not len(place):
            return
        episode, position = self._episode[place], self._position[place]
        length, legal = _asked(self._batch.reach, self._room[episode], position)
        stuck = ~legal.any(1)
        legal[stuck, 0], length[stuck, 0] = True, 0.0  # the item stays
        origin, action = np.nonzero(legal)
        reached = _led_to(position[origin], action, length[origin, action])
        keys, first, of_key = np.unique(self._key(episode[origin], reached), return_index=True, return_inverse=True)
        at = np.searchsorted(self._keys, keys)
        new = self._keys[np.minimum(at, len(self._keys) - 1)] != keys
        places = self._places[np.minimum(at, len(self._keys) - 1)]
        places[new] = len(self._cost) + np.arange(new.sum())
        self._keys = np.insert(self._keys, at[new], keys[new])
        self._places = np.insert(self._places, at[new], places[new])
        self._add(episode[origin[first[new]]], reached[first[new]])
        self._leads_to[place[origin], action] = places[of_key]
        # Steps can be taken back; slides perhaps not.
        steps = self._leads_to[place, : self._simulator.moves.first_slide]
        neighbour = np.append(self._cost, np.inf)[steps].min(1)
        self._value[place] = (neighbour + self._gamma * self._cost[place]) / (1 - self._gamma**2)

    def _add(self, episode: np.ndarray, position: np.ndarray) -> None:
        """Add places (n, 2) of episodes (n,)."""
        if not len(episode):
            return
        reward = _rewards(self._batch, self._room[episode], position)
        # A move changes one coordinate: after the next one, IoU is at most what the other coordinate allows.
        off = np.abs(position - self._simulator.designer_position[self._room[episode]])
        size = self._size[episode]
        next_iou = (np.maximum(size - off, 0) / (size + off)).max(1)
        self._episode = np.append(self._episode, episode)
        self._position = np.append(self._position, position, axis=0)
        best_next = self._simulator.reward_function.theta1 * next_iou / REWARD_SCALE
        self._cost = np.append(self._cost, self._best_reward[episode] - reward)
        self._to_come = np.append(self._to_come, np.maximum(self._best_reward[episode] - best_next, 0))
        self._value = np.append(self._value, np.full(len(episode), np.inf))
        unknown = np.full((len(episode), self._leads_to.shape[1]), -1, dtype=np.int32)
        self._leads_to = np.append(self._leads_to, unknown, axis=0)

    def _key(self, episode: np.ndarray, position: np.ndarray) -> np.ndarray:
        """One number for each episode and place on the grid."""
        x, y = np.rint((position - self._starts[episode]) / GRID).astype(np.int64).T + (1 << BITS - 1)
        return (episode << 2 * BITS) + (x << BITS) + y


def _led_to(position: np.ndarray, action: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Where moves lead from positions (n, 2)."""
    return snap(position + DIRECTIONS[action % 4] * length[:, None])


def _sizes(simulator: Simulator) -> np.ndarray:
    """Return the sides of the box around the item of each room: (rooms, 2), metres."""
    return simulator.item_bounds[:, 2:] - simulator.item_bounds[:, :2]


def _rewards(batch_simulator: BatchSimulator, room: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the rewards of entering positions (n, 2) in rooms (n,), divided by REWARD_SCALE: (n,)."""
    (total,) = _asked(lambda *poses: (batch_simulator.reward(*poses).total,), room, position)
    return total / REWARD_SCALE


def _asked(question: Ask, room: np.ndarray, position: np.ndarray) -> list[np.ndarray]:
    """Return what the simulator answers about poses, AT_ONCE at a time."""
    parts = range(AT_ONCE, len(room), AT_ONCE)
    poses = zip(np.split(room, parts), np.split(position, parts), strict=True)
    answers = [question(torch.as_tensor(k), torch.as_tensor(at)) for k, at in poses]
    return [torch.cat(answer).numpy() for answer in zip(*answers, strict=True)]
