"""Procedural textures of an office: each a function of a random generator that returns uint8 (rows, cols, 3) RGB."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from topoloc.types import Image

Colour = tuple[float, float, float]
Canvas = NDArray[np.float32]

WHITE: Colour = (232.0, 230.0, 222.0)
BEECH: Colour = (196.0, 164.0, 122.0)
DARK: Colour = (38.0, 38.0, 42.0)
BEIGE: Colour = (205.0, 200.0, 184.0)


def _canvas(rows: int, columns: int, colour: Colour) -> Canvas:
    """A sheet of one colour."""
    return np.full((rows, columns, 3), colour, dtype=np.float32)


def _finished(canvas: Canvas) -> Image:
    """A canvas as an image."""
    return np.asarray(canvas.clip(0.0, 255.0).astype(np.uint8))


def _clouds(rng: np.random.Generator, rows: int, columns: int, cells: tuple[int, int], octaves: int = 4) -> Canvas:
    """Smooth noise (rows, columns) of standard deviation about 1; ``cells`` are the coarsest spots down and across."""
    total = np.zeros((rows, columns), dtype=np.float32)
    for octave in range(octaves):
        grid = (min(rows, cells[0] << octave), min(columns, cells[1] << octave))
        spots = rng.standard_normal(grid, dtype=np.float32)
        total += cv2.resize(spots, (columns, rows), interpolation=cv2.INTER_LINEAR) * np.float32(0.6**octave)
    return total


def _box(canvas: Canvas, left: float, top: float, right: float, bottom: float, colour: Colour) -> None:
    """Fill a rectangle given in shares of the canvas."""
    rows, columns = canvas.shape[:2]
    canvas[round(top * rows) : round(bottom * rows), round(left * columns) : round(right * columns)] = colour


def _frame(canvas: Canvas, left: float, top: float, right: float, bottom: float, colour: Colour, px: int = 3) -> None:
    """Draw the outline of a rectangle given in shares of the canvas."""
    rows, columns = canvas.shape[:2]
    corners = ((round(left * columns), round(top * rows)), (round(right * columns) - 1, round(bottom * rows) - 1))
    cv2.rectangle(canvas, *corners, colour, px)


def _text(canvas: Canvas, rng: np.random.Generator, left: float, top: float, right: float, bottom: float) -> None:
    """Lines of grey words inside a rectangle given in shares of the canvas."""
    rows, columns = canvas.shape[:2]
    step = max(4, rows // 40)
    for row in range(round(top * rows), round(bottom * rows) - step, step):
        end = left + (right - left) * rng.uniform(0.55, 1.0)
        start, stop = round(left * columns), round(end * columns)
        ink = start + np.flatnonzero(rng.random(stop - start) < 0.85)
        canvas[row : row + max(1, step // 2), ink] = rng.uniform(50.0, 110.0)


def plaster(rng: np.random.Generator) -> Image:
    """A painted wall with faint stains."""
    return _finished(_canvas(256, 256, WHITE) + 3.5 * _clouds(rng, 256, 256, (2, 2), 6)[..., None])


def brick(rng: np.random.Generator) -> Image:
    """A wall of red bricks."""
    canvas = _canvas(256, 256, (170.0, 165.0, 158.0))
    for course in range(16):
        shift = (course % 2) * 20
        for left in range(-shift, 256, 40):
            tone = rng.normal(0.0, 14.0)
            canvas[course * 16 + 2 : course * 16 + 16, max(left + 2, 0) : max(left + 40, 0)] = (
                150.0 + tone,
                82.0 + tone * 0.7,
                62.0 + tone * 0.6,
            )
    return _finished(canvas + 6.0 * _clouds(rng, 256, 256, (16, 16), 4)[..., None])


def panel(rng: np.random.Generator) -> Image:
    """A grey partition of cloth-covered elements."""
    canvas = _canvas(256, 256, (138.0, 142.0, 150.0)) + 3.0 * _clouds(rng, 256, 256, (64, 64), 2)[..., None]
    _box(canvas, 0.0, 0.0, 1.0, 0.03, (190.0, 190.0, 190.0))
    _box(canvas, 0.0, 0.0, 0.03, 1.0, (92.0, 94.0, 98.0))
    return _finished(canvas)


def carpet(rng: np.random.Generator) -> Image:
    """Speckled blue-grey carpet."""
    speckle = 9.0 * rng.standard_normal((256, 256), dtype=np.float32) + 4.0 * _clouds(rng, 256, 256, (4, 4), 3)
    return _finished(_canvas(256, 256, (92.0, 98.0, 112.0)) + speckle[..., None])


def ceiling(rng: np.random.Generator) -> Image:
    """Ceiling tiles with a lamp in every fourth."""
    canvas = _canvas(256, 256, (214.0, 214.0, 210.0)) + 2.0 * _clouds(rng, 256, 256, (32, 32), 2)[..., None]
    canvas[::64] = canvas[:, ::64] = 150.0
    _box(canvas, 0.27, 0.27, 0.73, 0.48, (255.0, 255.0, 250.0))
    return _finished(canvas)


def wood(rng: np.random.Generator) -> Image:
    """Beech with a lengthwise grain."""
    grain = 8.0 * _clouds(rng, 256, 256, (48, 2), 3)
    return _finished(_canvas(256, 256, BEECH) + grain[..., None])


def bookshelf(rng: np.random.Generator) -> Image:
    """Five shelves of books and folders, with gaps."""
    rows, columns = 480, 256
    canvas = _canvas(rows, columns, (60.0, 48.0, 38.0))
    for shelf in range(5):
        floor = (shelf + 1) * rows // 5 - 6
        canvas[floor : floor + 6] = BEECH
        left = 8
        while left < columns - 12:
            thick, tall = int(rng.integers(4, 17)), int(rng.integers(50, 84))
            if rng.random() < 0.08:
                left += int(rng.integers(10, 34))
                continue
            right = min(left + thick, columns - 8)
            book = canvas[floor - tall : floor, left:right]
            book[:] = rng.choice([rng.uniform(25, 90), rng.uniform(90, 235)]) * rng.uniform(0.65, 1.1, 3)
            book[:, :1] *= 0.6
            if thick > 7:
                book[tall // 5 : tall // 5 + 12, 2:-2] = rng.uniform(190.0, 245.0)
            left = right
    canvas[:, :8] = canvas[:, -8:] = BEECH
    canvas[:8] = BEECH
    return _finished(canvas)


def cupboard(rng: np.random.Generator) -> Image:
    """Two tall doors with handles and a notice on one."""
    canvas = _canvas(384, 256, (176.0, 158.0, 132.0)) + 5.0 * _clouds(rng, 384, 256, (3, 40), 3)[..., None]
    for left, right in ((0.01, 0.5), (0.5, 0.99)):
        _frame(canvas, left, 0.01, right, 0.95, (88.0, 76.0, 62.0), 3)
    for handle in (0.43, 0.54):
        _box(canvas, handle, 0.45, handle + 0.025, 0.58, (55.0, 55.0, 58.0))
    _box(canvas, 0.0, 0.955, 1.0, 1.0, (62.0, 56.0, 50.0))
    side, top = rng.choice([0.12, 0.62]), rng.uniform(0.2, 0.35)
    _box(canvas, side, top, side + 0.2, top + 0.18, (240.0, 240.0, 236.0))
    _text(canvas, rng, side + 0.02, top + 0.02, side + 0.18, top + 0.16)
    return _finished(canvas)


def door(rng: np.random.Generator) -> Image:
    """A blue-grey door with a frame, a small window and a handle."""
    canvas = _canvas(420, 192, (104.0, 128.0, 148.0)) + 2.0 * _clouds(rng, 420, 192, (3, 3), 3)[..., None]
    _frame(canvas, 0.0, 0.0, 1.0, 1.05, (70.0, 74.0, 80.0), 12)
    _box(canvas, 0.58, 0.16, 0.76, 0.46, (52.0, 60.0, 66.0))
    _box(canvas, 0.60, 0.17, 0.74, 0.45, (178.0, 190.0, 190.0))
    _box(canvas, 0.14, 0.5, 0.28, 0.52, (210.0, 210.0, 212.0))
    _box(canvas, 0.22, 0.3, 0.46, 0.37, (236.0, 232.0, 214.0))
    return _finished(canvas)


def outside(rng: np.random.Generator) -> Image:
    """What windows look at: bright sky over trees and house fronts."""
    rows, columns = 512, 1024
    sky = np.linspace(228.0, 255.0, rows, dtype=np.float32)[::-1, None]
    canvas = _canvas(rows, columns, (0.0, 0.0, 0.0)) + (sky + 6.0 * _clouds(rng, rows, columns, (3, 6)))[..., None]
    for _ in range(7):
        left, wide, top = rng.uniform(0.0, 0.92), rng.uniform(0.06, 0.16), rng.uniform(0.24, 0.48)
        tone = rng.uniform(120.0, 205.0)
        _box(canvas, left, top, min(left + wide, 1.0), 1.0, (tone, tone * 0.94, tone * 0.86))
        for x in np.arange(left + 0.01, min(left + wide, 1.0) - 0.012, 0.018):
            for y in np.arange(top + 0.03, 0.97, 0.07):
                _box(canvas, x, y, x + 0.008, y + 0.035, (tone * 0.5, tone * 0.52, tone * 0.56))
    leaves = _clouds(rng, rows, columns, (5, 20), 6)
    height = 0.5 + 0.07 * cv2.resize(rng.standard_normal((1, 24), dtype=np.float32), (columns, 1))
    tree = (np.linspace(0.0, 1.0, rows)[:, None] > height + 0.03 * leaves) & (leaves > -0.9)
    canvas[tree] = (98.0, 118.0, 76.0)
    canvas += np.where(tree, 22.0 * leaves, 0.0)[..., None].astype(np.float32)
    return _finished(canvas)


def aluminium(rng: np.random.Generator) -> Image:
    """The frames of windows, dark against the light."""
    return _finished(_canvas(32, 32, (112.0, 112.0, 116.0)) + 3.0 * _clouds(rng, 32, 32, (2, 8), 2)[..., None])


def blinds(rng: np.random.Generator) -> Image:
    """Closed slats, bright from behind."""
    canvas = _canvas(256, 128, (226.0, 222.0, 206.0))
    for row in range(0, 256, 8):
        canvas[row : row + 2] = 150.0 + rng.normal(0.0, 8.0)
    canvas[:, 20:22] = canvas[:, 106:108] = 120.0
    return _finished(canvas)


def curtain(rng: np.random.Generator) -> Image:
    """Cloth in folds."""
    folds = cv2.GaussianBlur(rng.standard_normal((1, 256), dtype=np.float32), (0, 0), 5.0)
    deep = np.float32(26.0 / max(float(folds.std()), 1e-6))
    tint = rng.uniform(0.85, 1.0, 3).astype(np.float32)
    return _finished((_canvas(64, 256, (196.0, 190.0, 176.0)) + deep * np.asarray(folds)[..., None]) * tint)


def radiator(rng: np.random.Generator) -> Image:
    """A ribbed radiator under a window sill."""
    canvas = _canvas(128, 256, WHITE) + 2.0 * _clouds(rng, 128, 256, (2, 4))[..., None]
    _box(canvas, 0.1, 0.25, 0.9, 0.9, (214.0, 212.0, 204.0))
    for x in np.arange(0.11, 0.89, 0.025):
        _box(canvas, x, 0.28, x + 0.008, 0.88, (140.0, 138.0, 132.0))
    _box(canvas, 0.0, 0.0, 1.0, 0.07, (244.0, 244.0, 240.0))
    return _finished(canvas)


def screen(rng: np.random.Generator) -> Image:
    """The front of a monitor: dark frame, windows of a desktop."""
    canvas = _canvas(192, 256, (46.0, 46.0, 50.0))
    _box(canvas, 0.05, 0.06, 0.95, 0.88, (58.0, 92.0, 128.0))
    _box(canvas, 0.1, 0.14, 0.62, 0.74, (232.0, 234.0, 236.0))
    _box(canvas, 0.1, 0.14, 0.62, 0.2, (70.0, 96.0, 150.0))
    _text(canvas, rng, 0.13, 0.24, 0.58, 0.72)
    _box(canvas, 0.66, 0.3, 0.9, 0.66, (22.0, 24.0, 26.0))
    _box(canvas, 0.05, 0.83, 0.95, 0.88, (188.0, 188.0, 180.0))
    return _finished(canvas)


def casing(rng: np.random.Generator) -> Image:
    """The beige back and sides of a monitor or printer, with slots for the air."""
    canvas = _canvas(128, 128, BEIGE) + 3.0 * _clouds(rng, 128, 128, (3, 3))[..., None]
    for y in np.arange(0.2, 0.6, 0.08):
        _box(canvas, 0.2, y, 0.8, y + 0.03, (110.0, 106.0, 98.0))
    return _finished(canvas)


def computer(rng: np.random.Generator) -> Image:
    """The front of a tower: drives, a button, slots."""
    canvas = _canvas(192, 96, (186.0, 184.0, 176.0)) + 2.0 * _clouds(rng, 192, 96, (3, 3))[..., None]
    for y in (0.08, 0.2):
        _frame(canvas, 0.1, y, 0.9, y + 0.09, (120.0, 118.0, 112.0), 2)
    _box(canvas, 0.4, 0.45, 0.6, 0.5, (80.0, 84.0, 90.0))
    for y in np.arange(0.62, 0.94, 0.04):
        _box(canvas, 0.15, y, 0.85, y + 0.015, (104.0, 102.0, 98.0))
    return _finished(canvas)


def drawers(rng: np.random.Generator) -> Image:
    """Three drawers with handles."""
    canvas = _canvas(192, 128, (178.0, 176.0, 170.0)) + 3.0 * _clouds(rng, 192, 128, (3, 3))[..., None]
    for y in (0.02, 0.34, 0.67):
        _frame(canvas, 0.03, y, 0.97, y + 0.31, (108.0, 106.0, 102.0), 2)
        _box(canvas, 0.35, y + 0.08, 0.65, y + 0.12, (60.0, 60.0, 62.0))
    return _finished(canvas)


def desk_front(rng: np.random.Generator) -> Image:
    """The modesty panel of a desk under the edge of its top."""
    canvas = _canvas(128, 256, (168.0, 140.0, 104.0)) + 6.0 * _clouds(rng, 128, 256, (24, 2), 3)[..., None]
    _box(canvas, 0.0, 0.0, 1.0, 0.06, (218.0, 192.0, 150.0))
    _box(canvas, 0.0, 0.06, 1.0, 0.12, (70.0, 58.0, 44.0))
    _box(canvas, 0.0, 0.06, 0.03, 1.0, DARK)
    _box(canvas, 0.97, 0.06, 1.0, 1.0, DARK)
    return _finished(canvas)


def cloth(rng: np.random.Generator) -> Image:
    """The blue cloth of an office chair."""
    canvas = _canvas(96, 96, (52.0, 62.0, 96.0)) + 5.0 * _clouds(rng, 96, 96, (24, 24), 2)[..., None]
    _frame(canvas, 0.0, 0.0, 1.0, 1.0, (26.0, 28.0, 38.0), 5)
    return _finished(canvas)


def plastic(rng: np.random.Generator) -> Image:
    """Black plastic: feet, posts, telephones."""
    return _finished(_canvas(32, 32, DARK) + 4.0 * _clouds(rng, 32, 32, (4, 4), 2)[..., None])


def cardboard(rng: np.random.Generator) -> Image:
    """A box with a label and tape."""
    canvas = _canvas(128, 128, (176.0, 140.0, 96.0)) + 6.0 * _clouds(rng, 128, 128, (3, 3))[..., None]
    _box(canvas, 0.0, 0.44, 1.0, 0.52, (204.0, 180.0, 140.0))
    _box(canvas, 0.55, 0.58, 0.9, 0.88, (238.0, 238.0, 232.0))
    _text(canvas, rng, 0.58, 0.62, 0.87, 0.86)
    return _finished(canvas)


def paper(rng: np.random.Generator) -> Image:
    """The edge of stacked papers and folders."""
    canvas = _canvas(64, 128, (236.0, 236.0, 232.0))
    for row in range(0, 64, 3):
        canvas[row : row + 2] *= np.float32(rng.uniform(0.55, 1.0))
    return _finished(canvas)


def plant(rng: np.random.Generator) -> Image:
    """Leaves in front of each other."""
    canvas = _canvas(128, 128, (40.0, 62.0, 34.0))
    for _ in range(70):
        centre = (int(rng.integers(0, 128)), int(rng.integers(0, 128)))
        size = (int(rng.integers(8, 18)), int(rng.integers(3, 7)))
        tone = rng.uniform(0.7, 1.5)
        colour = (58.0 * tone, 104.0 * tone, 46.0 * tone)
        cv2.ellipse(canvas, centre, size, float(rng.uniform(0.0, 180.0)), 0.0, 360.0, colour, -1)
    return _finished(canvas)


def poster(rng: np.random.Generator) -> Image:
    """A research poster: a title, boxes of text, pictures and a graph."""
    paper_colour, title = rng.uniform(215.0, 250.0, 3), rng.uniform(30.0, 170.0, 3)
    canvas = _canvas(288, 208, (float(paper_colour[0]), float(paper_colour[1]), float(paper_colour[2])))
    _box(canvas, 0.0, 0.0, 1.0, rng.uniform(0.1, 0.18), (float(title[0]), float(title[1]), float(title[2])))
    for left, right in ((0.06, 0.47), (0.53, 0.94)):
        split = rng.uniform(0.35, 0.75)
        picture = rng.uniform(40.0, 210.0, 3)
        block = (0.22, split - 0.03) if rng.random() < 0.5 else (split + 0.03, 0.94)
        words = (split + 0.03, 0.94) if block[0] < 0.3 else (0.22, split - 0.03)
        _box(canvas, left, block[0], right, block[1], (float(picture[0]), float(picture[1]), float(picture[2])))
        _text(canvas, rng, left, words[0], right, words[1])
    blob = (rng.uniform(0.0, 255.0, 3)).tolist()
    cv2.circle(canvas, (int(rng.integers(40, 168)), int(rng.integers(90, 250))), int(rng.integers(14, 40)), blob, -1)
    _frame(canvas, 0.0, 0.0, 1.0, 1.0, (120.0, 120.0, 120.0), 2)
    return _finished(canvas)


def whiteboard(rng: np.random.Generator) -> Image:
    """A white board with a frame, scribbles and a box diagram."""
    canvas = _canvas(256, 384, (240.0, 242.0, 243.0)) + 2.0 * _clouds(rng, 256, 384, (3, 4))[..., None]
    for _ in range(9):
        ink = [(190.0, 40.0, 36.0), (40.0, 60.0, 150.0), (30.0, 30.0, 34.0)][int(rng.integers(0, 3))]
        start = rng.integers((20, 20), (330, 220))
        steps = np.cumsum(rng.integers(-14, 18, (14, 2)), axis=0) + start
        cv2.polylines(canvas, [np.clip(steps, 8, (376, 246)).astype(np.int32)], False, ink, 2)
    for left in (0.1, 0.4, 0.7):
        top = rng.uniform(0.1, 0.5)
        _frame(canvas, left, top, left + 0.18, top + 0.2, (40.0, 60.0, 150.0), 2)
    _frame(canvas, 0.0, 0.0, 1.0, 1.0, (130.0, 132.0, 136.0), 7)
    return _finished(canvas)


def shirt(rng: np.random.Generator) -> Image:
    """A person's upper part, arms at the sides."""
    colour = rng.uniform(60.0, 190.0, 3)
    folds = 13.0 * _clouds(rng, 192, 192, (3, 6), 4)
    canvas = _canvas(192, 192, (float(colour[0]), float(colour[1]), float(colour[2]))) + folds[..., None]
    for seam in (0.12, 0.46, 0.62, 0.96):
        _box(canvas, seam, 0.15, seam + 0.015, 1.0, (30.0, 30.0, 32.0))
    return _finished(canvas)


def trousers(rng: np.random.Generator) -> Image:
    """A person's legs."""
    canvas = _canvas(192, 128, (58.0, 60.0, 78.0)) + 8.0 * _clouds(rng, 192, 128, (3, 8), 4)[..., None]
    for seam in (0.24, 0.74):
        _box(canvas, seam, 0.1, seam + 0.03, 1.0, (18.0, 18.0, 22.0))
    return _finished(canvas)


def head(rng: np.random.Generator) -> Image:
    """Hair over a face."""
    canvas = _canvas(96, 128, (202.0, 160.0, 132.0)) + 4.0 * _clouds(rng, 96, 128, (4, 4))[..., None]
    _box(canvas, 0.0, 0.0, 1.0, 0.32, (62.0, 46.0, 34.0))
    _box(canvas, 0.45, 0.0, 1.0, 0.62, (62.0, 46.0, 34.0))
    for eye in (0.12, 0.26):
        _box(canvas, eye, 0.42, eye + 0.05, 0.47, (40.0, 32.0, 30.0))
    _box(canvas, 0.15, 0.74, 0.3, 0.78, (140.0, 78.0, 70.0))
    return _finished(canvas)


KINDS: dict[str, tuple[Callable[[np.random.Generator], Image], int]] = {
    "plaster": (plaster, 8),
    "brick": (brick, 4),
    "panel": (panel, 3),
    "carpet": (carpet, 1),
    "ceiling": (ceiling, 1),
    "wood": (wood, 1),
    "bookshelf": (bookshelf, 4),
    "cupboard": (cupboard, 2),
    "door": (door, 1),
    "outside": (outside, 2),
    "aluminium": (aluminium, 1),
    "blinds": (blinds, 1),
    "curtain": (curtain, 3),
    "radiator": (radiator, 1),
    "screen": (screen, 1),
    "casing": (casing, 1),
    "computer": (computer, 1),
    "drawers": (drawers, 1),
    "desk_front": (desk_front, 1),
    "cloth": (cloth, 1),
    "plastic": (plastic, 1),
    "cardboard": (cardboard, 2),
    "paper": (paper, 3),
    "plant": (plant, 2),
    "poster": (poster, 6),
    "whiteboard": (whiteboard, 1),
    "shirt": (shirt, 3),
    "trousers": (trousers, 1),
    "head": (head, 2),
}
"""Every kind of texture: how it is drawn, and how many different ones a world has."""


def texture_set(rng: np.random.Generator) -> dict[str, list[Image]]:
    """Draw all textures of a world, by kind."""
    return {name: [draw(rng) for _ in range(count)] for name, (draw, count) in KINDS.items()}
