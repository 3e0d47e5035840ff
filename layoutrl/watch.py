"""python -m layoutrl.watch run=<folder> [rooms=6] [data=... data.root=...] [part=held_out|training|all] [out=<file>]"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from layoutrl import InputError
from layoutrl.env.render import MOVING
from layoutrl.figures import DESIGNER, STYLE, draw_item, draw_room, rgb
from layoutrl.rooms.room import Room
from layoutrl.runs.commands import command
from layoutrl.runs.config import WatchConfig

COLUMNS = 3  # of rooms side by side
INCHES = 2.2  # height of a row
FRAMES_A_MOVE = 4
START_MS, FRAME_MS, HELD_MS = 800, 60, 2500  # the first frame, each, the last
COLORS = 64  # of a GIF


def run(config: WatchConfig) -> list[Path]:
    """Write an animation of greedy episodes in rooms of a run, as GIF and WebP; returns the files."""
    # Here, as they load torch, which takes seconds: a wrong option is answered before.
    from layoutrl.env.batch import BatchSimulator
    from layoutrl.runs.trained import trained_run

    shown = trained_run(config)
    rng = np.random.default_rng(config.seed)
    simulator = shown.simulator
    chosen = rng.permutation(len(simulator.rooms))[: config.rooms]
    starts = simulator.starts(chosen, rng)
    episodes = shown.policy.rollout(BatchSimulator(simulator, shown.policy.device), shown.observe, chosen, starts)
    iou = simulator.reward(chosen, episodes.final).iou
    paths = [episodes.path[: moves + 1, k] for k, moves in enumerate(episodes.moves)]
    with style.context(STYLE):
        pictures = list(frames([simulator.rooms[k] for k in chosen], paths, iou, config.width))
    base = Path(config.out or Path(config.run) / f"watch-{shown.name}-{config.rooms}-seed{config.seed}")
    files = write(pictures, base)
    print(f"mean IoU {iou.mean():.3f} in {len(chosen)} rooms, {episodes.moves.mean():.1f} moves each")
    for file in files:
        print(f"wrote {file} ({file.stat().st_size / 1000:.0f} kB)")
    return files


def frames(
    rooms: Sequence[Room], paths: Sequence[np.ndarray], ious: Sequence[float] | np.ndarray, width: int
) -> Iterator[Image.Image]:
    """Pictures, `width` pixels wide, of episodes side by side; the last one has the designer's places and the IoUs.

    An episode is a path (n, 2) in metres; what ends earlier waits for the others.
    """
    columns = min(COLUMNS, len(rooms))
    rows = -(-len(rooms) // columns)
    figure = Figure(figsize=(INCHES * columns, INCHES * rows), dpi=width / (INCHES * columns))
    canvas = FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid:
        axes.axis("off")
    for axes, room in zip(grid, rooms, strict=False):
        draw_room(axes, room, moving=False, names=None)
        axes.set_title(" ")
    moving: list[Artist] = []
    for step in range(FRAMES_A_MOVE * (max(map(len, paths)) - 1) + 1):
        for artist in moving:
            artist.remove()
        moving = []
        for axes, room, path in zip(grid, rooms, paths, strict=False):
            move = min(step / FRAMES_A_MOVE, len(path) - 1)
            before, after = path[int(move)], path[min(int(move) + 1, len(path) - 1)]
            way = np.vstack([path[: int(move) + 1], before + move % 1 * (after - before)])
            moving += axes.plot(*way.T, color="black", linewidth=0.8, alpha=0.6)
            moving += draw_item(axes, room.moving, way[-1], facecolor=rgb(MOVING), alpha=0.85)
        yield _picture(canvas)
    for axes, room, iou in zip(grid, rooms, ious, strict=False):
        assert room.moving.center is not None
        draw_item(axes, room.moving, room.moving.center, **DESIGNER)
        axes.set_title(f"IoU {iou:.2f}")
    yield _picture(canvas)


def _picture(canvas: FigureCanvasAgg) -> Image.Image:
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def write(pictures: Sequence[Image.Image], base: Path) -> list[Path]:
    """Write <base>.gif and <base>.webp. Raises InputError where they cannot be written."""
    palette = pictures[-1].quantize(COLORS, Image.Quantize.MAXCOVERAGE)  # white stays white
    files = [base.with_name(f"{base.name}.{suffix}") for suffix in ("gif", "webp")]
    durations = [START_MS, *[FRAME_MS] * (len(pictures) - 2), HELD_MS]
    few_colors = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    try:
        base.parent.mkdir(parents=True, exist_ok=True)
        for file, (first, *others) in zip(files, (few_colors, pictures), strict=True):
            first.save(file, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)
    except OSError as error:
        raise InputError(
            f"out: cannot write {base} ({error.strerror}); expected a file in a folder to write to"
        ) from None
    return files


main = command("watch", WatchConfig, run)

if __name__ == "__main__":
    main()
