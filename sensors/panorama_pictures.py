"""Pictures of a reconstruction, from which a user sees why it failed and which setting to change (thesis 4.1.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sensors.images import resize
from sensors.panorama import Insertion, Panorama
from topoloc.geometry import Floats
from topoloc.plan import as_png
from topoloc.types import Image, Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN_COLUMNS = 1000
"""A panorama is drawn with so many columns at most."""
ELSEWHERE_DEG = 4.0
"""The runner-up is the best candidate at least so far from the chosen one, degrees."""
CHOSEN, RUNNER_UP, PRIOR, SCORE = "#009E73", "#D55E00", "#999999", "#0072B2"
"""Colours that colour-blind readers tell apart (Okabe and Ito)."""
OVERVIEW = "overview.png"

Paste = Callable[[Sequence[Image], Ints, int], Image]


def insertion_pictures(
    pictures: Sequence[Image], made: Panorama, names: Sequence[str], paste: Paste
) -> Iterator[tuple[str, bytes]]:
    """One PNG an insertion: the panorama so far, the frame at its place, and what the place was chosen by.

    Args:
        pictures: the snapshots as they were pasted.
        made: what came of them.
        names: of the snapshots.
        paste: how the method pastes: pictures, left columns, columns of the circle.

    Yields:
        Name of the file, after the snapshot, and its bytes.
    """
    from matplotlib.figure import Figure

    scale = min(1.0, SHOWN_COLUMNS / made.image.shape[1])
    rows, width = (max(1, round(size * scale)) for size in pictures[0].shape[:2])
    columns = round(made.image.shape[1] * scale)
    small = [resize(picture, width, rows) for picture in pictures]
    lefts = np.rint(made.columns * scale).astype(np.int64) % columns
    for number, (file, insertion) in enumerate(zip(_files(names), made.insertions, strict=True)):
        figure = Figure((8.0, 3.6), layout="constrained")
        parts = figure.subplot_mosaic("PP;FC", width_ratios=[1, 1.8], height_ratios=[1, 2.4])
        so_far = paste(small[: number + 1], lefts[: number + 1], columns)
        _show(parts["P"], so_far, f"{number + 1} of {len(names)}: the panorama so far, {names[number]} outlined")
        _outline(parts["P"], int(lefts[number]), width, rows, columns)
        _show(parts["F"], small[number], names[number])
        if insertion.slots is not None:
            _slots(parts["F"], insertion.slots, width, rows)
        _curve(parts["C"], insertion, names)
        yield file, as_png(figure)


def circle_picture(made: Panorama, names: Sequence[str], hfov_deg: float) -> tuple[str, bytes]:
    """One PNG of the whole circle: each frame on the panorama, and each step beside what pictures and prior say."""
    from matplotlib.figure import Figure

    figure = Figure((8.0, 3.8), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=[1, 2.4])
    scale = min(1.0, SHOWN_COLUMNS / made.image.shape[1])
    size = (round(made.image.shape[1] * scale), max(1, round(made.image.shape[0] * scale)))
    _show(above, resize(made.image, *size), f"{made.filled:.0%} of the circle seen; a number stands on each axis")
    middles = (made.columns * scale + size[0] * hfov_deg / 720.0) % size[0]
    for number, middle in enumerate(middles, start=1):
        above.annotate(str(number), (middle, size[1] / 2.0), color="white", backgroundcolor="black", fontsize=7)
    pairs = range(len(names))
    into = [made.insertions[(pair + 1) % len(names)] for pair in pairs]
    below.plot(pairs, [one.chosen_deg for one in into], "o", color=CHOSEN, label="chosen step")
    below.plot(pairs, [_best(one.score, one) for one in into], "x", color=SCORE, label="what the pictures alone say")
    below.plot(pairs, [_best(one.prior, one) for one in into], "_", color=PRIOR, label="nominal step")
    below.axhline(hfov_deg, color=RUNNER_UP, linewidth=0.8, label="above: no overlap")
    below.set(ylabel="step [degrees]", ylim=(0.0, None))
    below.set_xticks(pairs, [f"{_stem(names[p])}\n{_stem(names[(p + 1) % len(names)])}" for p in pairs], fontsize=6)
    below.legend(fontsize=7)
    return OVERVIEW, as_png(figure)


def _files(names: Sequence[str]) -> list[str]:
    """File names after the snapshots' own, with their endings where two differ in nothing else."""
    stems = [_stem(name) for name in names]
    taken = [*stems, Path(OVERVIEW).stem]
    return [f"{stem if taken.count(stem) == 1 else name}.png" for stem, name in zip(stems, names, strict=True)]


def _stem(name: str) -> str:
    return Path(name).stem


def _show(axes: Axes, picture: Image, title: str) -> None:
    axes.imshow(picture, cmap="gray", vmin=0, vmax=255)
    axes.set(xticks=[], yticks=[])
    axes.set_title(title, fontsize=8, loc="left")


def _outline(axes: Axes, left: int, width: int, rows: int, columns: int) -> None:
    """The frame's edges on the circle, on both of its ends where it crosses the first column."""
    from matplotlib.patches import Rectangle

    for start in (left, left - columns):
        axes.add_patch(Rectangle((start, 0), width, rows - 1, fill=False, edgecolor=CHOSEN, linewidth=1.5))
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))


def _slots(axes: Axes, matches: Floats, width: int, rows: int) -> None:
    """The slots of IMA on the frame, with the match in hundredths of those that were found in their place."""
    each = width / len(matches)
    for n, match in enumerate(matches):
        found = match > 0.0  # not so for NaN, which lies over black
        colour = CHOSEN if found else PRIOR if np.isnan(match) else RUNNER_UP
        axes.axvspan(n * each - 0.5, (n + 1) * each - 0.5, color=colour, alpha=0.35, linewidth=0.5)
        if found:
            axes.annotate(f"{100 * match:.0f}", ((n + 0.5) * each, 0.9 * rows), ha="center", fontsize=5, color="white")
    axes.set_xlabel("slots: green found here, orange another fits better,\ngrey over black", fontsize=6)


def _curve(axes: Axes, insertion: Insertion, names: Sequence[str]) -> None:
    """Score over candidates, with the prior, the one chosen and the best one elsewhere."""
    total = insertion.score if insertion.prior is None else insertion.score + insertion.prior
    axes.plot(insertion.angles_deg, insertion.score, color=SCORE, linewidth=1.0, label="pictures")
    if insertion.prior is not None:
        axes.plot(insertion.angles_deg, insertion.prior, color=PRIOR, linewidth=1.0, label="nominal step")
    axes.axvline(insertion.chosen_deg, color=CHOSEN, linewidth=1.0, label=f"chosen, {insertion.chosen_deg:.1f}")
    elsewhere = np.where(np.abs(insertion.angles_deg - insertion.chosen_deg) > ELSEWHERE_DEG, total, -np.inf)
    runner_up = float(insertion.angles_deg[elsewhere.argmax()])
    axes.axvline(runner_up, color=RUNNER_UP, linewidth=1.0, linestyle=":", label=f"runner-up, {runner_up:.1f}")
    where = "first column" if insertion.before is None else names[insertion.before]
    axes.set_xlabel(f"degrees clockwise from {where}", fontsize=8)
    axes.set_ylabel("SUM of Code 2.3" if insertion.prior is None else "log-likelihood", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=7)


def _best(values: Floats | None, insertion: Insertion) -> float:
    return np.nan if values is None or not values.max() else float(insertion.angles_deg[values.argmax()])
