"""The README's figures: the decision process and two networks, as in Figures 3 and 5 of Di & Yu 2021, and the results.

    python experiments/diagrams.py [--out docs/figures]

Widths are read from the networks themselves, results from the cells of Table 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from kept import RESULTS, parser_of
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from printing import Table
from table1 import AGENT, CEILING, PAPER, POINTER, RIVAL, THEIRS, main_table, measured
from torch import nn

from layoutrl.agents.networks import GeometryNetwork, PaperNetwork
from layoutrl.env.observation import COLUMNS
from layoutrl.env.simulator import Moves
from layoutrl.figures import BLUE, GREEN, ORANGE, PURPLE, STYLE, save
from layoutrl.runs.commands import answers_errors

INPUT, LEARNED, FIXED, OUTPUT = BLUE, ORANGE, PURPLE, GREEN
CATEGORIES = 4  # of furniture; any number does


def box(axes: Axes, center: tuple[float, float], size: tuple[float, float], text: str, color: str) -> None:
    """A box with rounded corners around a text."""
    (x, y), (width, height) = center, size
    axes.add_patch(
        FancyBboxPatch(
            (x - width / 2, y - height / 2), width, height, boxstyle="round,pad=0,rounding_size=0.08",
            facecolor=f"{color}33", edgecolor=color, linewidth=1.2,
        )
    )  # fmt: skip
    axes.text(x, y, text, ha="center", va="center", linespacing=1.35)


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str = "", at: tuple[float, float] = (0, 0)
) -> None:
    """An arrow with a text at its middle, moved by `at`."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0})
    middle = ((start[0] + end[0]) / 2 + at[0], (start[1] + end[1]) / 2 + at[1])
    axes.text(*middle, text, ha="center", va="center", linespacing=1.3)


def canvas() -> tuple[Figure, Axes]:
    """Return a figure, and axes on which a unit is an inch."""
    width, height = 7.2, 3.3
    figure = Figure(figsize=(width, height))
    axes = figure.subplots()
    axes.set(xlim=(0, width), ylim=(0, height), aspect="equal")
    axes.axis("off")
    return figure, axes


def process() -> Figure:
    """Figure 3: state, move, reward, and what learns from them."""
    figure, axes = canvas()
    box(axes, (1.25, 2.5), (2.1, 1.1), "Room\nwalls, doors, windows,\nfurniture of known size", INPUT)
    box(axes, (4.0, 2.5), (2.0, 1.1), "Simulator\n$s_{t+1},\\ r_t = F(s_t, a_t)$\nexact areas of polygons", FIXED)
    box(axes, (4.0, 0.7), (2.0, 0.9), "Agent\n$a_t = $ arg max $Q(s_t, a)$\namong the legal moves", LEARNED)
    box(axes, (6.3, 2.5), (1.6, 1.1), "Reward\n$r = r_1 + r_2 + r_3$\nin $[-200, 100]$", OUTPUT)
    box(axes, (6.3, 0.7), (1.6, 0.9), "Replay\n$(S, A, R, S')$\nas poses", FIXED)
    box(
        axes,
        (1.25, 0.7),
        (2.1, 0.9),
        "Learner\n$Q(s, a) \\to r + \\gamma$ max $Q'(s', a')$\nover the legal moves $a'$",
        LEARNED,
    )
    arrow(axes, (2.3, 2.5), (3.0, 2.5))
    arrow(axes, (3.55, 1.95), (3.55, 1.15), "state $s_t$", (-0.38, 0))
    arrow(axes, (4.45, 1.15), (4.45, 1.95), "move $a_t$", (0.4, 0))
    arrow(axes, (5.0, 2.5), (5.5, 2.5))
    arrow(axes, (6.3, 1.95), (6.3, 1.15))
    axes.plot([5.5, 5.25, 5.25, 1.25], [0.5, 0.5, 0.08, 0.08], color="black", linewidth=1.2)
    arrow(axes, (1.25, 0.08), (1.25, 0.25))
    arrow(axes, (2.3, 0.7), (3.0, 0.7), "weights", (0, 0.13))
    return figure


def linear(module: nn.Module) -> list[nn.Linear]:
    return [layer for layer in module.modules() if isinstance(layer, nn.Linear)]


def row(axes: Axes, y: float, boxes: Sequence[tuple[str, str]], width: float, gap: float, height: float) -> None:
    """Boxes from left to right, an arrow between each two."""
    x = width / 2 + 0.05
    for k, (text, color) in enumerate(boxes):
        box(axes, (x, y), (width, height), text, color)
        if k:
            arrow(axes, (x - width / 2 - gap, y), (x - width / 2, y))
        x += width + gap


def networks() -> Figure:
    """Figure 5: the paper's network on pictures, and the project's on the set of a room's elements."""
    paper = PaperNetwork(4)
    convolutions = [layer for layer in paper.features if isinstance(layer, nn.Conv2d)]
    first, second = linear(paper.features)
    moves = Moves().count
    ours = GeometryNetwork(len(COLUMNS) + CATEGORIES, moves, dueling=True)
    figure, axes = canvas()
    axes.text(0.05, 3.15, "method=paper: a picture", fontweight="bold", va="center")
    boxes = [("picture\n128 x 128\nRGB", INPUT)]
    boxes += [(f"convolution\n3 x 3, stride 2\n{layer.out_channels} features", LEARNED) for layer in convolutions]
    boxes += [
        (f"fully connected\n{first.in_features}, {first.out_features},\n{second.out_features}", LEARNED),
        ("$Q$ of\n4 moves", OUTPUT),
    ]
    row(axes, 2.5, boxes, 1.0, 0.2, 0.85)

    wide, narrow = linear(ours.trunk)[-1].out_features, linear(ours.element)[-1].out_features
    axes.text(
        0.05,
        1.6,
        "method=geometric: the set of elements, as seen from the item that moves",
        fontweight="bold",
        va="center",
    )
    boxes = [
        ("walls,\nopenings,\nfurniture", INPUT),
        (f"each element\n{narrow}, {narrow}", LEARNED),
        ("maximum\nand sum\nover the set", FIXED),
        (f"each, having\nheard of all\n{narrow}", LEARNED),
        ("maximum\nand sum\nover the set", FIXED),
        (f"{wide}, {wide},\nvalue and\nadvantage", LEARNED),
        (f"$Q$ of\n{moves} moves", OUTPUT),
    ]
    row(axes, 0.95, boxes, 0.88, 0.15, 0.85)
    box(axes, (2.5, 0.2), (2.9, 0.26), "how far it can go in each direction, and slide", INPUT)
    axes.plot([3.95, 5.64], [0.2, 0.2], color="black", linewidth=1.2)
    arrow(axes, (5.64, 0.2), (5.64, 0.525))
    arrow(axes, (3.58, 0.33), (3.58, 0.525))
    return figure


# How the columns of the README's table are drawn: colour, marker, and words.
LOOKS = {
    THEIRS: ("black", "D", "Di & Yu, as printed (other rooms; interval not known)"),
    AGENT: (BLUE, "o", "agent"),
    POINTER: (ORANGE, "s", "supervised pointer, trained at least as long"),
    RIVAL: (GREEN, "^", "PlanIT, trained for less in four types"),
}
TICKS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999, 1)


def results(table: Table) -> Figure:
    """The README's table: mean IoU and its 95% interval, by room type."""
    figure = Figure(figsize=(7.6, 4.2))
    axes = figure.subplots()
    # The scale is the square root of 1 - IoU: markers stand apart near 0.5 as well as near 0.99.
    axes.set_xscale("function", functions=(lambda iou: 1 - np.sqrt(np.maximum(1 - iou, 0)), lambda x: 1 - (1 - x) ** 2))
    rooms = list(dict.fromkeys(record["room"] for record in table.records))
    with_iou = [record for record in table.records if "mean_iou" in record]
    for k in range(0, len(rooms), 2):
        axes.axhspan(k - 0.5, k + 0.5, color="black", alpha=0.05, linewidth=0)
    for n, (method, (color, marker, words)) in enumerate(LOOKS.items()):
        found = [record for record in with_iou if record["method"] == method]
        y = [rooms.index(record["room"]) + 0.2 * (n - 1.5) for record in found]
        low, high = ([record.get(end, np.nan) for record in found] for end in ("interval_low", "interval_high"))
        axes.hlines(y, low, high, color=color, clip_on=False)
        face = "white" if method == THEIRS else color
        means = [record["mean_iou"] for record in found]
        axes.plot(means, y, marker, color=color, markerfacecolor=face, markersize=5, label=words, clip_on=False)
    for record in with_iou:
        if record["method"] == CEILING:
            k, iou = rooms.index(record["room"]), record["mean_iou"]
            axes.plot([iou, iou], [k - 0.35, k + 0.35], color="black", clip_on=False)
    axes.plot([], [], "|", color="black", markersize=8, label=CEILING)
    axes.set(xlabel="mean IoU in held-out rooms, stretched towards 1, and its 95% interval over rooms")
    axes.set(xlim=(TICKS[0], 1), xticks=TICKS, xticklabels=[f"{tick:g}" for tick in TICKS])
    axes.set(ylim=(len(rooms) - 0.5, -0.5), yticks=range(len(rooms)))
    axes.set_yticklabels([room.replace("_", " ") for room in rooms])
    axes.grid(axis="x", linewidth=0.4, alpha=0.6)
    axes.tick_params(axis="y", length=0)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/figures"))
    out = parser.parse_args().out
    table = main_table({room: measured(RESULTS / "default" / "table1", room) for room in PAPER})
    with style.context(STYLE):
        for name, figure in (("process", process()), ("networks", networks()), ("results", results(table))):
            for file in save(figure, out / name):
                print(f"wrote {file}")


if __name__ == "__main__":
    main()
