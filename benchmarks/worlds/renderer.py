"""A simulated camera: image columns cast through textured vertical faces and horizontal planes, in vectorised numpy.

A view is an array of rays on the floor plan, one a column, and one row scale: pin-hole frames and cylinders share the
code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from topoloc.geometry import Floats
from topoloc.topo_map import Camera
from topoloc.types import Image, Ints

EYE_M = 1.1
"""Height of the camera above the floor [m]."""
NEAREST_M = 0.05
"""Nothing nearer than this is drawn [m]."""
SECTOR_DEG = 40.0
"""A cylinder is cast in sectors this wide, so that a sector sees few faces; degrees."""


@dataclass(frozen=True)
class Atlas:
    """All textures of a world with their reduced copies (mip levels), packed for one look-up a pixel.

    Attributes:
        texels: (N,) uint32, RGBA bytes; texel 0 is black, the colour of nothing. A texture is stored column by column,
            each column with its last texel twice, so that a row index rounded up stays inside.
        start: (textures, levels) index of the first texel.
        width, height: (textures, levels) size of each level in texels.
    """

    texels: NDArray[np.uint32]
    start: Ints
    width: Ints
    height: Ints

    @classmethod
    def of(cls, textures: Sequence[Image], levels: int = 6) -> Atlas:
        """Pack textures, each uint8 (rows, cols, 3)."""
        packed = [np.zeros(1, dtype=np.uint32)]
        start, width, height, total = [], [], [], 1
        for texture in textures:
            level = texture
            for _ in range(levels):
                rows, columns = level.shape[:2]
                start.append(total)
                width.append(columns)
                height.append(rows)
                texels = np.full((columns, rows + 1, 4), 255, dtype=np.uint8)
                texels[:, :rows, :3] = level.transpose(1, 0, 2)
                texels[:, rows] = texels[:, rows - 1]
                packed.append(texels.view(np.uint32).reshape(-1))
                total += packed[-1].size
                smaller = (max(1, columns // 2), max(1, rows // 2))
                level = np.asarray(cv2.resize(level, smaller, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        shape = (len(textures), levels)
        sizes = (np.array(values, dtype=np.int64).reshape(shape) for values in (start, width, height))
        return cls(np.concatenate(packed), *sizes)


@dataclass(frozen=True)
class Faces:
    """F vertical rectangles, seen from the right of the line from their first to their second end only.

    Attributes:
        ends: (F, 4) x0, y0, x1, y1 [m]; the texture runs from end 0 to end 1, left to right for who sees it.
        heights: (F, 2) low and high edge [m].
        texture: (F,) index into the atlas; the texture's height covers the face once.
        repeat: (F,) texture widths along the face.
        offset: (F,) where the texture begins at end 0, in texture widths.
        shade: (F, 4) brightness factor at end 0 high, end 1 high, end 0 low, end 1 low.
    """

    ends: Floats
    heights: Floats
    texture: Ints
    repeat: Floats
    offset: Floats
    shade: Floats


@dataclass(frozen=True)
class Planes:
    """P horizontal rectangles: floor, ceiling, tops of desks; seen from above and from below.

    Attributes:
        centre: (P, 2) [m].
        half: (P, 2) half the sides [m].
        yaw: (P,) of the first side [rad].
        height: (P,) [m].
        texture: (P,) index into the atlas; repeats over the floor plan.
        tile: (P,) side that the texture covers once [m].
        shade: (P,) brightness factor.
    """

    centre: Floats
    half: Floats
    yaw: Floats
    height: Floats
    texture: Ints
    tile: Floats
    shade: Floats


@dataclass(frozen=True)
class Scene:
    """What the camera can see. Where nothing is hit the picture is black.

    Surfaces may touch but not pierce each other: what is nearer is decided once for every piece of a column between
    the edges of surfaces.
    """

    atlas: Atlas
    faces: Faces
    planes: Planes

    def with_faces(self, more: Faces) -> Scene:
        """The scene with more faces in it, of textures that the atlas already has."""
        names = ("ends", "heights", "texture", "repeat", "offset", "shade")
        joined = Faces(*(np.concatenate([getattr(self.faces, name), getattr(more, name)]) for name in names))
        return replace(self, faces=joined)


@dataclass(frozen=True)
class Shake:
    """How a camera in motion points away from where its pose says, in pixels of the frame.

    Attributes:
        down: rows that the horizon moves down.
        aside: columns that the picture moves to the right.
        roll: rows that the horizon falls from the left edge to the right one.
    """

    down: float = 0.0
    aside: float = 0.0
    roll: float = 0.0


@dataclass(frozen=True)
class Rays:
    """The columns of a view.

    Attributes:
        eye: (3,) x, y, height [m].
        directions: (C, 2) on the floor plan, not normalised; columns run clockwise over less than half a circle.
        horizon: (C,) row of the horizon.
        scale: rows per unit of slope, where a direction's length is the unit of distance.
        pitch: width of a column: the cross product of neighbouring directions.
        rows: of the picture.
    """

    eye: Floats
    directions: Floats
    horizon: Floats
    scale: float
    pitch: float
    rows: int


def focal_length(camera: Camera) -> float:
    """Focal length of the pin-hole [pixels]."""
    return float(camera.width / 2.0 / np.tan(np.deg2rad(camera.hfov_deg) / 2.0))


def frame_rays(pose: Floats, camera: Camera, eye_m: float = EYE_M, shake: Shake | None = None) -> Rays:
    """Columns of a pin-hole frame taken at ``pose`` (3,): the camera's, heading = optical axis [m, m, rad]."""
    shake = shake or Shake()
    focal = focal_length(camera)
    across = (np.arange(camera.width) + 0.5 - camera.width / 2.0 - shake.aside) / focal
    forward = np.array([np.cos(pose[2]), np.sin(pose[2])])
    right = np.array([forward[1], -forward[0]])
    slope = np.linspace(-0.5, 0.5, camera.width) * shake.roll
    horizon = camera.height / 2.0 + shake.down + slope
    return Rays(
        np.array([pose[0], pose[1], eye_m]),
        forward + across[:, None] * right,
        horizon,
        focal,
        1.0 / focal,
        camera.height,
    )


def render_frame(
    scene: Scene,
    pose: Floats,
    camera: Camera,
    eye_m: float = EYE_M,
    shake: Shake | None = None,
) -> Image:
    """A pin-hole frame, uint8 (height, width, 3) RGB, from the camera's pose (3,) [m, m, rad, map frame]."""
    return render(scene, frame_rays(pose, camera, eye_m, shake))


def render_cylinder(scene: Scene, position: Floats, heading: float, camera: Camera, eye_m: float = EYE_M) -> Image:
    """A full circle seen from one point, linear in angle.

    Args:
        scene: what there is to see.
        position: (2,) of the eye [m].
        heading: of the left edge of column 0 [rad, ccw]; columns run clockwise.
        camera: gives the number of columns, ``panorama_columns()``, and the rows and their scale.
        eye_m: height of the eye [m].

    Returns:
        uint8 (height, panorama columns, 3) RGB.
    """
    columns = camera.panorama_columns()
    step = 2.0 * np.pi / columns
    angles = heading - (np.arange(columns) + 0.5) * step
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    eye = np.array([position[0], position[1], eye_m])
    sectors = np.array_split(directions, int(np.ceil(360.0 / SECTOR_DEG)))
    middle = camera.height / 2.0
    views = [Rays(eye, part, np.full(len(part), middle), focal_length(camera), step, camera.height) for part in sectors]
    return np.concatenate([render(scene, view) for view in views], axis=1)


@dataclass(frozen=True)
class _Hits:
    """Where rays meet surfaces: N pairs of a column and a surface.

    ``low`` and ``high`` are the first row and the row after the last; 1 / distance is ``near + rise * row``, exact for
    faces and planes alike, so that comparing it tells what hides what. ``along`` is the share of a face's length.
    """

    column: Ints
    surface: Ints
    is_plane: NDArray[np.bool_]
    low: Ints
    high: Ints
    near: Floats
    rise: Floats
    along: Floats
    grain: Floats

    @classmethod
    def joined(cls, first: _Hits, second: _Hits) -> _Hits:
        """Both, ordered by column."""
        both = {name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in cls.__annotations__}
        order = np.flatnonzero(both["high"] > both["low"])
        order = order[np.argsort(both["column"][order], kind="stable")]
        return cls(**{name: values[order] for name, values in both.items()})


def render(scene: Scene, rays: Rays) -> Image:
    """The picture of any view, uint8 (rows, columns, 3) RGB, without the errors of a sensor."""
    hits = _Hits.joined(_face_hits(scene.faces, rays), _plane_hits(scene.planes, rays))
    hit, length = _visible_spans(hits, len(rays.directions), rays.rows)
    texel, shade = _look_up(scene, rays, hits, hit, length)
    columns = len(rays.directions)
    picture = scene.atlas.texels.take(texel).reshape(columns, rays.rows)
    upright = cv2.cvtColor(cv2.transpose(picture.view(np.uint8).reshape(columns, rays.rows, 4)), cv2.COLOR_RGBA2RGB)
    light = cv2.cvtColor(cv2.transpose(shade.reshape(columns, rays.rows)), cv2.COLOR_GRAY2RGB)
    return np.asarray(cv2.multiply(upright, light, dtype=cv2.CV_8U), dtype=np.uint8)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _may_be_seen(start: Floats, end: Floats, directions: Floats, margin: float | Floats = 0.0) -> NDArray[np.bool_]:
    """Which segments, ends (F, 2) relative to the eye, are not wholly to the left, right or rear of the view."""
    left, right = (side / np.hypot(*side) for side in (directions[0], directions[-1]))
    ahead = left + right
    kept = np.ones(len(start), dtype=bool)
    for inward in (np.array([left[1], -left[0]]), np.array([-right[1], right[0]]), ahead / np.hypot(*ahead)):
        kept &= np.maximum(start @ inward, end @ inward) > -np.asarray(margin)
    return kept


def _edge_rows(rays: Rays, column: Ints, height: Floats, inverse_distance: Floats) -> Floats:
    """Row at which a height [m] appears: fractional, clipped to the picture."""
    row = rays.horizon[column] - rays.scale * (height - rays.eye[2]) * inverse_distance
    return np.asarray(np.clip(row, 0.0, rays.rows))


def _face_hits(faces: Faces, rays: Rays) -> _Hits:
    """Where the columns' rays meet the faces that are turned to the eye."""
    start, end = faces.ends[:, :2] - rays.eye[:2], faces.ends[:, 2:] - rays.eye[:2]
    index = np.flatnonzero((_cross(start, end - start) < 0.0) & _may_be_seen(start, end, rays.directions))
    start, along = start[index], (end - start)[index]
    x, y = rays.directions[:, 0], rays.directions[:, 1]
    slant = along[:, 1:] * x - along[:, :1] * y  # (F, C), cross(direction, along)
    offset = start[:, :1] * y - start[:, 1:] * x  # cross(start, direction)
    which, column = np.nonzero((slant < 0.0) & (offset <= 0.0) & (offset > slant))
    inverse = slant[which, column] / _cross(start, along)[which]
    ahead = inverse < 1.0 / NEAREST_M
    which, column, inverse = which[ahead], column[ahead], inverse[ahead]
    slant_hit, surface = slant[which, column], index[which]
    low, high = (_edge_rows(rays, column, faces.heights[surface, side], inverse) for side in (1, 0))
    return _Hits(
        column,
        surface,
        np.zeros(len(column), dtype=bool),
        np.ceil(low - 0.5).astype(np.int64),
        np.ceil(high - 0.5).astype(np.int64),
        inverse,
        np.zeros(len(column)),
        offset[which, column] / slant_hit,
        -rays.pitch / (inverse * slant_hit),
    )


def _plane_hits(planes: Planes, rays: Rays) -> _Hits:
    """Where the columns' rays enter and leave the horizontal planes."""
    middle, reach = planes.centre - rays.eye[:2], np.hypot(planes.half[:, 0], planes.half[:, 1])
    seen = _may_be_seen(middle, middle, rays.directions, reach) & (np.abs(planes.height - rays.eye[2]) > 1e-6)
    index = np.flatnonzero(seen)
    cos, sin = np.cos(planes.yaw[index])[:, None], np.sin(planes.yaw[index])[:, None]
    x, y = rays.directions[:, 0], rays.directions[:, 1]
    enter, leave = np.zeros((len(index), len(x))), np.full((len(index), len(x)), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):  # a ray along a side never crosses it: infinity is meant
        for side, (along, across) in enumerate(((cos, sin), (-sin, cos))):
            direction = along * x + across * y
            centre = along * middle[index, :1] + across * middle[index, 1:]
            half = planes.half[index, side, None]
            one, other = (centre - half) / direction, (centre + half) / direction
            enter = np.fmax(enter, np.fmin(one, other))
            leave = np.fmin(leave, np.fmax(one, other))
    which, column = np.nonzero(leave > np.maximum(enter, NEAREST_M))
    surface = index[which]
    height = planes.height[surface]
    fall = rays.scale * (rays.eye[2] - height)  # rows below the horizon at unit distance
    near = _edge_rows(rays, column, height, 1.0 / np.maximum(enter[which, column], NEAREST_M))
    far = _edge_rows(rays, column, height, 1.0 / leave[which, column])
    return _Hits(
        column,
        surface,
        np.ones(len(column), dtype=bool),
        np.ceil(np.minimum(near, far) - 0.5).astype(np.int64),
        np.ceil(np.maximum(near, far) - 0.5).astype(np.int64),
        -rays.horizon[column] / fall,
        1.0 / fall,
        np.zeros(len(column)),
        np.zeros(len(column)),
    )


def _visible_spans(hits: _Hits, columns: int, rows: int) -> tuple[Ints, Ints]:
    """Cut every column where a surface begins or ends, and find the nearest surface of each piece.

    Returns:
        Index of the hit that is seen, -1 for none, and number of rows of each span, column by column from the top.
    """
    count = np.bincount(hits.column, minlength=columns)
    most = max(int(count.max(initial=0)), 1)
    place = np.arange(len(hits.column)) - np.repeat(np.cumsum(count) - count, count)
    low, high = np.full((columns, most), rows), np.full((columns, most), 0)
    index = np.full((columns, most), -1)
    near, rise = np.zeros((columns, most)), np.zeros((columns, most))
    filled = (low, high, index, near, rise)
    for table, values in zip(filled, (hits.low, hits.high, np.arange(len(place)), hits.near, hits.rise), strict=True):
        table[hits.column, place] = values
    cuts = np.concatenate([np.zeros((columns, 1), dtype=np.int64), low, high, np.full((columns, 1), rows)], axis=1)
    cuts.sort(axis=1)
    column, piece = np.nonzero(cuts[:, 1:] > cuts[:, :-1])
    top, bottom = cuts[column, piece], cuts[column, piece + 1]
    covers = (low[column] <= top[:, None]) & (high[column] >= bottom[:, None])
    nearness = np.where(covers, near[column] + rise[column] * ((top + bottom) / 2.0)[:, None], 0.0)
    winner = nearness.argmax(axis=1)
    span = np.arange(len(column))
    return np.where(nearness[span, winner] > 0.0, index[column, winner], -1), bottom - top


def _look_up(
    scene: Scene,
    rays: Rays,
    hits: _Hits,
    hit: Ints,
    length: Ints,
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Index of the texel and brightness factor of every pixel (columns * rows), column by column."""
    row = np.tile(np.arange(rays.rows, dtype=np.float32) + np.float32(0.5), len(rays.directions))
    seen = np.flatnonzero(hit >= 0)
    on_plane = np.zeros(len(hit), dtype=bool)
    on_plane[seen] = hits.is_plane[hit[seen]]
    base, line = _face_spans(scene, rays, hits, hit, seen[~on_plane[seen]])
    pixels = np.repeat(line, length, axis=0)
    texel = np.repeat(base, length)
    texel += (pixels[:, 0] + pixels[:, 1] * row).astype(np.int32)
    shade = pixels[:, 2] + pixels[:, 3] * row
    pixel = np.flatnonzero(np.repeat(on_plane, length))
    if len(pixel):
        plane_hit = np.repeat(hit[on_plane], length[on_plane])
        texel[pixel] = _plane_texels(scene, rays, hits, plane_hit, row[pixel])
        shade[pixel] = scene.planes.shade[hits.surface[plane_hit]]
    return texel, shade


def _level(texels_per_pixel: Floats, levels: int) -> Ints:
    """Mip level at which a texel is about a pixel."""
    exponent = np.log2(np.maximum(texels_per_pixel, 1.0)) + 0.5
    return np.minimum(exponent, levels - 1).astype(np.int64)


def _face_spans(
    scene: Scene, rays: Rays, hits: _Hits, hit: Ints, span: Ints
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Of every span: its texture column's first texel (S,), and (S, 4) texture row and shade as lines in row.

    Only the spans that show faces, numbered ``span``, are filled in.
    """
    faces, atlas = scene.faces, scene.atlas
    base = np.zeros(len(hit), dtype=np.int32)
    line = np.zeros((len(hit), 4), dtype=np.float32)
    seen = hit[span]
    surface, along, inverse = hits.surface[seen], hits.along[seen], hits.near[seen]
    texture, repeat = faces.texture[surface], faces.repeat[surface]
    low, high = faces.heights[surface].T
    climb = 1.0 / (rays.scale * inverse * (high - low))  # share of the face's height in a row
    offset = (high - rays.eye[2]) / (high - low) - rays.horizon[hits.column[seen]] * climb
    down = climb * atlas.height[texture, 0]
    across = hits.grain[seen] * repeat * atlas.width[texture, 0]
    level = _level(np.maximum(down, np.minimum(across, 4.0 * down)), atlas.start.shape[1])
    width, height = atlas.width[texture, level], atlas.height[texture, level]
    column = np.minimum(((faces.offset[surface] + along * repeat) % 1.0 * width).astype(np.int64), width - 1)
    base[span] = atlas.start[texture, level] + column * (height + 1)
    shade = faces.shade[surface]
    top = shade[:, 0] + (shade[:, 1] - shade[:, 0]) * along
    bottom = shade[:, 2] + (shade[:, 3] - shade[:, 2]) * along
    line[span] = np.stack(
        [offset * height, climb * height, top + (bottom - top) * offset, (bottom - top) * climb], axis=1
    )
    return base, line


def _plane_texels(scene: Scene, rays: Rays, hits: _Hits, seen: Ints, row: NDArray[np.float32]) -> Ints:
    """Index of the texel of pixels (N,) that show planes: the hit each belongs to, and its row."""
    planes, atlas = scene.planes, scene.atlas
    surface, column = hits.surface[seen], hits.column[seen]
    distance = 1.0 / (hits.near[seen] + hits.rise[seen] * row)
    texture, tile = planes.texture[surface], planes.tile[surface]
    density = distance**2 * np.abs(hits.rise[seen]) * atlas.height[texture, 0] / tile
    level = _level(np.sqrt(density * distance * rays.pitch * atlas.width[texture, 0] / tile), atlas.start.shape[1])
    width, height = atlas.width[texture, level], atlas.height[texture, level]
    x = (rays.eye[0] + distance * rays.directions[column, 0]) / tile
    y = (rays.eye[1] + distance * rays.directions[column, 1]) / tile
    across, down = ((x % 1.0) * width).astype(np.int64), ((y % 1.0) * height).astype(np.int64)
    return np.asarray(atlas.start[texture, level] + np.minimum(across, width - 1) * (height + 1) + down)
