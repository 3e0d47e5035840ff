"""python -m layoutrl.watch run=<folder> [rooms=6] [data=... data.root=...] [part=held_out|training|all] [out=<file>]"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from layoutrl import InputError
from layoutrl.env.measures import measured
from layoutrl.env.render import MOVING, color_of
from layoutrl.figures import DESIGNER, NO_MATH, STYLE, draw_item, draw_room, rgb
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.files import check_new
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.commands import command
from layoutrl.runs.config import COLUMNS, TrainConfig, WatchConfig
from layoutrl.runs.files import check_writable, writing
from layoutrl.runs.folder import load_config

if TYPE_CHECKING:
    from layoutrl.evaluation.furnishing import Furnisher

INCHES = 2.2  # height of a row
FRAMES_A_MOVE = 4
MOST_FRAMES = 600  # of a film, but for its last: all are in memory at once
START_MS, FRAME_MS, HELD_MS = 800, 60, 2500  # how long the first frame, the others and the last are shown
COLORS = 64  # of a GIF


def run(config: WatchConfig) -> list[Path]:
    """Write an animation of greedy episodes in rooms of a run, as GIF and WebP; returns the files.

    Raises InputError, before it reads rooms, where they cannot be written.
    """
    load_config(Path(config.run), TrainConfig)  # report a bad run first
    asked = files_of(Path(config.out)) if config.out else []
    for file in asked:
        check_new(file, file.suffix)
    check_writable(Path(config.out).parent if config.out else Path(config.run), "out")
    # Imported here: they load torch, which takes seconds, and a wrong option is reported before that.
    from layoutrl.env.batch import BatchSimulator
    from layoutrl.env.observation import observation_of
    from layoutrl.env.simulator import Simulator
    from layoutrl.evaluation.furnishing import Furnisher
    from layoutrl.evaluation.policy import greedy
    from layoutrl.runs.trained import trained_run

    shown = trained_run(config)
    rng = np.random.default_rng(config.seed)
    rooms = [shown.rooms[k] for k in rng.permutation(len(shown.rooms))[: config.rooms]]
    network, method, categories = shown.agent
    if method.scope == "room":
        episodes = rooms_filling_up(Furnisher(shown.agent), rooms)
    else:
        policy, simulator = greedy(network, method), Simulator(rooms, method.moves, shown.reward)
        observe = observation_of(method.observation, rooms, policy.q.device, categories)
        every = np.arange(len(rooms))
        starts = simulator.starts(every, rng)
        rollout = policy.rollout(BatchSimulator(simulator, policy.q.device), observe, every, starts)
        iou = simulator.reward(every, rollout.final).iou
        episodes = [one_item(room, rollout.way(k), float(iou[k])) for k, room in enumerate(simulator.rooms)]
    with style.context([STYLE, NO_MATH]):
        pictures = list(frames(episodes, config.width))
    own = Path(config.run) / f"watch-{shown.name}-{len(rooms)}-seed{config.seed}"
    for file in asked:
        check_new(file, file.suffix)  # once more: drawing takes a while
    write(pictures, files := asked or files_of(own))
    moves = np.mean([episode.moves for episode in episodes])
    mean = np.mean([episode.iou for episode in episodes])
    print(f"mean IoU {mean:.3f} in {len(rooms)} rooms, {moves:.1f} moves each")
    for file in files:
        print(f"wrote {file} ({file.stat().st_size / 1000:.0f} kB)")
    return files


@dataclass(frozen=True)
class Episode:
    """The moves of items in one room, and where the designer has these items."""

    room: Room  # without the items that move
    way: list[tuple[int, Item]]  # in order: index of the item that moves, the item at its new pose; empty: nothing fits
    designed: list[Item]
    iou: float
    taken: frozenset[int] = frozenset()  # indices of `way` at which an item, perhaps the same, is taken up

    @property
    def moves(self) -> int:
        """The number of moves; taking up an item is none."""
        return sum(map(self.moves_to, range(len(self.way))))

    def moves_to(self, step: int) -> bool:
        """Whether this step of the way is a move of the item from the step before, not the taking up of one."""
        return 0 < step < len(self.way) and step not in self.taken and self.way[step][0] == self.way[step - 1][0]

    @property
    def last(self) -> int:
        """The index of the end of the way; 0 where there is none."""
        return max(len(self.way) - 1, 0)


def one_item(room: Room, path: np.ndarray, iou: float) -> Episode:
    """Return the episode in which the target of a room moves along a path (n, 2), in metres."""
    way = [(0, replace(room.moving, center=(float(x), float(y)))) for x, y in path]
    return Episode(replace(room, furniture=tuple(room.others), target=None), way, [room.moving], iou)


def rooms_filling_up(furnisher: Furnisher, designs: Sequence[Room]) -> list[Episode]:
    """Return an episode for each design: the agent furnishes its empty room."""
    found = [best for best, *_ in furnisher.furnish([brief_of(room) for room in designs], 1)]
    ious = measured([best.layout for best in found], designs).iou
    episodes = []
    for best, design, iou in zip(found, designs, ious, strict=True):
        items = best.layout.furniture
        way = [(k, replace(items[k], center=center, rotation=degrees)) for k, center, degrees in best.path]
        shell = replace(design, furniture=(), target=None)
        episodes.append(Episode(shell, way, list(design.furniture), float(iou), best.taken))
    return episodes


def frames(episodes: Sequence[Episode], width: int) -> Iterator[Image.Image]:
    """Yield pictures, `width` pixels wide, of all episodes side by side.

    The last one also has the designer's places and the IoUs. An episode that ends early stands still until the others
    end. A film that would have more than MOST_FRAMES goes faster.
    """
    columns = min(COLUMNS, len(episodes))
    rows = -(-len(episodes) // columns)
    figure = Figure(figsize=(INCHES * columns, INCHES * rows), dpi=width / (INCHES * columns))
    canvas = FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid:
        axes.axis("off")
    for axes, episode in zip(grid, episodes, strict=False):
        draw_room(axes, episode.room, names=None)
        axes.set_title(" ")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laying out the axes again takes longer than drawing
    drawn: list[Artist] = []
    last = max(episode.last for episode in episodes)
    for along in np.linspace(0, last, min(FRAMES_A_MOVE * last + 1, MOST_FRAMES)):
        for artist in drawn:
            artist.remove()
        drawn = []
        for axes, episode in zip(grid, episodes, strict=False):
            if episode.way:
                drawn += _drawn(axes, episode, min(along, episode.last))
        yield _picture(canvas)
    for axes, episode in zip(grid, episodes, strict=False):
        for item in episode.designed:
            assert item.center is not None
            draw_item(axes, item, item.center, **DESIGNER)
        axes.set_title(f"IoU {episode.iou:.2f}")
    yield _picture(canvas)


def _drawn(axes: Axes, episode: Episode, along: float) -> list[Artist]:
    """Draw the items as they stand at step `along` of the way, or between two, and the trail of the moving one."""
    here = int(along)
    which, item = episode.way[here]
    stands = {k: there for k, there in episode.way[:here] if k != which}
    artists: list[Artist] = []
    for there in stands.values():
        assert there.center is not None
        artists += draw_item(axes, there, there.center, facecolor=rgb(color_of(there.category)))
    first = here
    while episode.moves_to(first) and episode.way[first - 1][1].rotation == item.rotation:
        first -= 1
    way = np.array([there.center for _, there in episode.way[first : here + 1]])
    if episode.moves_to(here + 1):
        _, onward = episode.way[here + 1]
        if onward.rotation == item.rotation:
            way = np.vstack([way, way[-1] + along % 1 * (np.array(onward.center) - way[-1])])
    artists += axes.plot(*way.T, color="black", linewidth=0.8, alpha=0.6)
    return artists + draw_item(axes, item, way[-1], facecolor=rgb(MOVING), alpha=0.85)


def _picture(canvas: FigureCanvasAgg) -> Image.Image:
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def files_of(base: Path) -> list[Path]:
    """Return <base>.gif and <base>.webp; base may have such a suffix itself. Raises InputError if it is no name."""
    if base.name in ("", ".."):
        raise InputError(f"out: {base} is no name of a file; expected one, as out=film")
    stem = base.stem if base.suffix.lower() in (".gif", ".webp") else base.name
    return [base.with_name(f"{stem}.{suffix}") for suffix in ("gif", "webp")]


def write(pictures: Sequence[Image.Image], files: Sequence[Path]) -> None:
    """Write the pictures as GIF and as WebP, both or neither. Raises InputError where they cannot be written."""
    palette = pictures[-1].quantize(COLORS, Image.Quantize.MAXCOVERAGE)  # white stays white
    few_colors = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    durations = [START_MS, *[FRAME_MS] * (len(pictures) - 2), HELD_MS]
    films = [io.BytesIO() for _ in files]
    for film, kind, (first, *others) in zip(films, ("GIF", "WEBP"), (few_colors, pictures), strict=True):
        first.save(film, kind, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)
    partial = [file.with_name(f"{file.name}.partial") for file in files]
    try:
        for file, begun, film in zip(files, partial, films, strict=True):
            with writing(file):
                begun.write_bytes(film.getvalue())
        for file, begun in zip(files, partial, strict=True):
            begun.replace(file)
    finally:
        for begun in partial:
            begun.unlink(missing_ok=True)


main = command("watch", WatchConfig, run)

if __name__ == "__main__":
    main()
