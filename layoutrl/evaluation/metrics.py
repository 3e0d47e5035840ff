"""What a set of final positions is worth, and the best that the agent's moves allow."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from layoutrl.env.simulator import TOUCHING, Simulator
from layoutrl.evaluation.statistics import standard_error
from layoutrl.rooms.faults import blocking

NEAREST, NEAREST_TILTED = 3, 15  # coordinates tried on each axis for the ceiling, of items that stand upright or not


@dataclass(frozen=True)
class Score:
    """Scores over rooms (and starts), of one final position each. IoU is with the designer's footprint."""

    mean_iou: float
    std_iou: float  # standard deviation over positions
    standard_error: float | None  # of the mean IoU, where rooms of a group are not independent; None for one group
    median_iou: float
    share_090: float  # share of positions with an IoU of at least 0.9
    overlap: float  # mean share of the item that other items cover
    outside: float  # mean share of the item outside the indoor area
    blocked: float  # share of positions that block a door or window: `blocks_openings`

    def as_dict(self) -> dict[str, float | None]:
        """Plain numbers by name, ready for JSON."""
        return asdict(self)


def score(simulator: Simulator, room: np.ndarray, position: np.ndarray) -> Score:
    """Score final positions (B, 2) in rooms (B,)."""
    return score_of(
        simulator.reward(room, position).iou,
        *simulator.overlap_and_outside(room, position),
        blocks_openings(simulator, room, position),
        np.array([simulator.rooms[r].group for r in room]),
    )


def score_of(
    iou: np.ndarray, overlap: np.ndarray, outside: np.ndarray, blocked: np.ndarray, group: np.ndarray
) -> Score:
    """Return the score of B positions from the measures of each (B,) and the group of its room (B,)."""
    return Score(
        float(iou.mean()),
        float(iou.std()),
        standard_error(iou, group),
        float(np.median(iou)),
        float((iou >= 0.9).mean()),
        float(overlap.mean()),
        float(outside.mean()),
        float(blocked.mean()),
    )


def blocks_openings(simulator: Simulator, room: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Whether the items stand in a door, a window, or the 30 cm before and behind a door: `blocking`. (B,)"""
    items = [simulator.rooms[k].moving for k in room]
    footprints = np.array([item.footprint_at(tuple(p)) for item, p in zip(items, position, strict=True)])
    return blocking(simulator.rooms, room, [item.category for item in items], footprints)


def lattice_ceiling(simulator: Simulator, room: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """The best IoU that can be reached from each start (B, 2) by moves alone, without the snap into line. (B,)

    Each axis offers the multiples of the shortest step from the start and, with slides, from every
    contact with the outline or an item. Whether they can be reached through the room is not asked. Exact for upright
    rectangles and circles; for items at an angle, the best of the NEAREST_TILTED nearest values an axis.
    """
    designer, step = simulator.designer_position[room], simulator.steps.min(1)[room, None, None]
    anchors = starts[:, None]
    if simulator.moves.slide:
        x0, y0, x1, y1 = np.moveaxis(simulator.contacts[room], -1, 0)
        contacts = np.stack([x0, y0], -1)
        level = np.stack([np.abs(x1 - x0), np.abs(y1 - y0)], -1) < TOUCHING
        # Along a slanting border every coordinate can be a contact, the designer's too.
        slanting = ~level.any(-1, keepdims=True) & ~np.isnan(contacts)
        contacts = np.where(level, contacts, np.where(slanting, designer[:, None], np.nan))
        anchors = np.concatenate([anchors, contacts], 1)
    off = (anchors - designer[:, None]) % step  # displacements from the designer's place: (B, anchors, 2)
    off = np.concatenate([off, off - step], 1)
    order = np.argsort(np.abs(off), axis=1)[:, :NEAREST_TILTED]  # NaN last
    off = np.take_along_axis(off, order, 1)
    moving = [one.moving for one in simulator.rooms]
    upright = np.array([item.form == "circle" or item.degrees % 90 == 0 for item in moving])[room]
    designed = np.array([item.footprint for item in moving])[room, None]
    best = np.zeros(len(room))
    for i, j in np.ndindex(off.shape[1], off.shape[1]):
        displaced = designer + np.stack([off[:, i, 0], off[:, j, 1]], -1)
        tried = ~np.isnan(displaced).any(1) & (~upright | (max(i, j) < NEAREST))
        if tried.any():
            iou = simulator.ious(room[tried], displaced[tried], designed[tried])[:, 0]
            best[tried] = np.maximum(best[tried], iou)
    return best
