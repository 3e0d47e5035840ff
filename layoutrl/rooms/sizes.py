"""Sizes of furniture, as the designer has it, and questions about sizes that none of it has. Metres."""

from __future__ import annotations

from layoutrl.rooms.clearances import FRONT_DEPTH
from layoutrl.rooms.room import Item

# The least and the most of depth and of width, in 300 designed rooms of every type.
SIZES = {
    "armchair": ((0.7, 0.9), (0.7, 0.9)),
    "bathtub": ((0.7, 0.8), (1.5, 1.77)),
    "bed": ((2.0, 2.1), (1.2, 1.8)),
    "bench": ((0.45, 0.45), (1.2, 1.7)),
    "bookcase": ((0.3, 0.35), (0.8, 2.0)),
    "chair": ((0.45, 0.5), (0.45, 0.5)),
    "coffee_table": ((0.5, 0.9), (0.7, 1.2)),
    "cooktop": ((0.6, 0.6), (0.6, 0.9)),
    "counter": ((0.6, 0.6), (0.3, 3.09)),
    "desk": ((0.6, 0.8), (1.0, 1.6)),
    "dresser": ((0.45, 0.45), (0.8, 1.15)),
    "fridge": ((0.6, 0.65), (0.6, 0.9)),
    "laundry_cabinet": ((0.6, 0.65), (1.1, 1.6)),
    "lounge_chair": ((0.6, 0.7), (0.6, 0.7)),
    "loveseat": ((0.8, 0.9), (1.3, 1.6)),
    "nightstand": ((0.45, 0.5), (0.5, 0.5)),
    "plant_rack": ((0.3, 0.3), (0.7, 1.0)),
    "platform": ((1.6, 2.1), (1.8, 3.1)),
    "shower": ((0.8, 1.0), (0.8, 1.0)),
    "side_table": ((0.4, 0.5), (0.4, 0.5)),
    "sideboard": ((0.4, 0.45), (0.8, 1.8)),
    "sink": ((0.5, 0.65), (0.45, 0.9)),
    "sofa": ((0.85, 1.0), (1.8, 2.4)),
    "sofa_bed": ((0.9, 0.9), (1.8, 2.0)),
    "stool": ((0.45, 0.45), (0.45, 0.45)),
    "table": ((0.8, 1.25), (0.8, 1.8)),
    "toilet": ((0.65, 0.75), (0.38, 0.42)),
    "tv_unit": ((0.35, 0.45), (1.2, 2.2)),
    "vanity": ((0.45, 0.55), (0.6, 1.2)),
    "wardrobe": ((0.55, 0.6), (0.6, 2.4)),
    "washer": ((0.6, 0.6), (0.6, 0.6)),
    "washing_machine": ((0.55, 0.6), (0.6, 0.6)),
}
ROOMY = 1.25  # times as large or as small as the designer has it: no question yet
ALIKE = 0.2  # metres: if the sides differ by less, it does not matter which is the depth
OUTSIZE = 2.0  # times as large or as small as any of the designer's, in depth and in width: too large, or too small


def doubt(item: Item, word: str | None = None) -> str | None:
    """Return a question about the size of an item, on its unit or on which side is its depth; None if there is none.

    It calls the item by the `word`, or else by its category.
    """
    if item.category not in SIZES:
        return None
    depth, width = SIZES[item.category]
    size = f"the {word or item.category} of {item.size[0]:g} by {item.size[1]:g} m"
    if min(item.size[0] / depth[1], item.size[1] / width[1]) > OUTSIZE:
        return f"{size} is more than twice as large as others are: is the unit right?"
    if max(item.size[0] / depth[0], item.size[1] / width[0]) < 1 / OUTSIZE:
        return f"{size} is less than half as large as others are: is the unit right?"
    swapped = f"{size}: is its depth given as its width? a size is depth, then width"
    deeper = depth[0] > width[1]  # all of the designer's are deeper than wide, as beds are
    if deeper and item.size[0] < item.size[1] - ALIKE / 2 and _within(item.size[1], depth):
        return swapped
    if item.category not in FRONT_DEPTH or abs(item.size[0] - item.size[1]) < ALIKE:
        return None
    if not _within(item.size[0], depth) and _within(item.size[1], depth) and _within(item.size[0], width):
        return swapped
    return None


def _within(side: float, usual: tuple[float, float]) -> bool:
    return usual[0] / ROOMY <= side <= usual[1] * ROOMY
