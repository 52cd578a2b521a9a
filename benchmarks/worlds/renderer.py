"""A simulated camera: pictures and depths of textured vertical faces and horizontal planes, in vectorised numpy.

A view is an array of rays on the floor plan, one a column, and one row scale: pin-hole frames and cylinders share the
code. What the rays meet is found in ``casting``; colours and depths are looked up here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.casting import Faces, Hits, Planes, Rays, Seen, cast
from topoloc.geometry import Floats, compose
from topoloc.topo_map import Camera
from topoloc.types import Image, Ints

__all__ = [
    "EYE_M",
    "Atlas",
    "Faces",
    "Planes",
    "Rays",
    "Scene",
    "Shake",
    "cylinder_rays",
    "distances",
    "focal_length",
    "frame_rays",
    "render",
    "render_cylinder",
    "render_cylinder_depth",
    "render_depth",
    "render_frame",
    "right_of",
]

EYE_M = 1.1
"""Height of the camera above the floor [m]."""
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
class Scene:
    """What the camera can see. Where nothing is hit the picture is black.

    Surfaces may touch and pierce each other; of two in the very same place the first is seen, a face before a plane.
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


def cylinder_rays(position: Floats, heading: float, camera: Camera, eye_m: float = EYE_M) -> list[Rays]:
    """Columns of a full circle seen from ``position`` (2,) [m], in sectors; see ``render_cylinder``."""
    columns = camera.panorama_columns()
    step = 2.0 * np.pi / columns
    angles = heading - (np.arange(columns) + 0.5) * step
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    eye = np.array([position[0], position[1], eye_m])
    sectors = np.array_split(directions, int(np.ceil(360.0 / SECTOR_DEG)))
    middle = camera.height / 2.0
    return [Rays(eye, part, np.full(len(part), middle), focal_length(camera), step, camera.height) for part in sectors]


def right_of(pose: Floats, baseline_m: float) -> Floats:
    """Pose (3,) of the right camera of a stereo pair whose left one is at ``pose`` (3,) [m, m, rad]."""
    return compose(pose, (0.0, -baseline_m, 0.0))


def render_frame(
    scene: Scene,
    pose: Floats,
    camera: Camera,
    eye_m: float = EYE_M,
    shake: Shake | None = None,
) -> Image:
    """A pin-hole frame, uint8 (height, width, 3) RGB, from the camera's pose (3,) [m, m, rad, map frame]."""
    return render(scene, frame_rays(pose, camera, eye_m, shake))


def render_depth(
    scene: Scene,
    pose: Floats,
    camera: Camera,
    eye_m: float = EYE_M,
    shake: Shake | None = None,
) -> NDArray[np.float32]:
    """Depth along the optical axis of what ``render_frame`` shows, (height, width) [m]; infinite where nothing is."""
    return distances(scene, frame_rays(pose, camera, eye_m, shake))


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
    return np.concatenate([render(scene, rays) for rays in cylinder_rays(position, heading, camera, eye_m)], axis=1)


def render_cylinder_depth(
    scene: Scene, position: Floats, heading: float, camera: Camera, eye_m: float = EYE_M
) -> NDArray[np.float32]:
    """Horizontal distance of what ``render_cylinder`` shows, (height, panorama columns) [m]; infinite for nothing."""
    return np.concatenate([distances(scene, rays) for rays in cylinder_rays(position, heading, camera, eye_m)], axis=1)


def render(scene: Scene, rays: Rays) -> Image:
    """The picture of any view, uint8 (rows, columns, 3) RGB, without the errors of a sensor."""
    seen = cast(scene.faces, scene.planes, rays)
    texel, shade = _look_up(scene, rays, seen)
    columns = len(rays.directions)
    picture = scene.atlas.texels.take(texel).reshape(columns, rays.rows)
    upright = cv2.cvtColor(cv2.transpose(picture.view(np.uint8).reshape(columns, rays.rows, 4)), cv2.COLOR_RGBA2RGB)
    light = cv2.cvtColor(cv2.transpose(shade.reshape(columns, rays.rows)), cv2.COLOR_GRAY2RGB)
    return np.asarray(cv2.multiply(upright, light, dtype=cv2.CV_8U), dtype=np.uint8)


def distances(scene: Scene, rays: Rays) -> NDArray[np.float32]:
    """How far what ``render`` shows is, (rows, columns), in lengths of the column's direction; infinite for nothing."""
    seen = cast(scene.faces, scene.planes, rays)
    near, rise = (np.append(values, 0.0)[seen.hit] for values in (seen.hits.near, seen.hits.rise))  # -1: nothing
    nearness = np.repeat(near, seen.length) + np.repeat(rise, seen.length) * _rows(len(rays.directions), rays.rows)
    with np.errstate(divide="ignore"):  # infinity is meant
        distance = (1.0 / nearness).astype(np.float32)
    return np.ascontiguousarray(distance.reshape(-1, rays.rows).T)


@lru_cache(maxsize=8)
def _rows(columns: int, rows: int) -> NDArray[np.float32]:
    """Row of the middle of every pixel (columns * rows), column by column."""
    return np.tile(np.arange(rows, dtype=np.float32) + np.float32(0.5), columns)


def _look_up(scene: Scene, rays: Rays, seen: Seen) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Index of the texel and brightness factor of every pixel (columns * rows), column by column."""
    hits, hit, length, row = seen.hits, seen.hit, seen.length, _rows(len(rays.directions), rays.rows)
    something = np.flatnonzero(hit >= 0)
    on_plane = np.zeros(len(hit), dtype=bool)
    on_plane[something] = hits.is_plane[hit[something]]
    base, line = _face_spans(scene, rays, hits, hit, something[~on_plane[something]])
    texel_row, texel_rise, light, light_rise = (np.repeat(values, length) for values in line)
    texel = np.repeat(base, length)
    texel += (texel_row + texel_rise * row).astype(np.int32)
    shade = light + light_rise * row
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
    scene: Scene, rays: Rays, hits: Hits, hit: Ints, span: Ints
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Of every span: its texture column's first texel (S,), and (4, S) texture row and shade as lines in row.

    Only the spans that show faces, numbered ``span``, are filled in.
    """
    faces, atlas = scene.faces, scene.atlas
    base = np.zeros(len(hit), dtype=np.int32)
    line = np.zeros((4, len(hit)), dtype=np.float32)
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
    line[:, span] = np.stack([offset * height, climb * height, top + (bottom - top) * offset, (bottom - top) * climb])
    return base, line


def _plane_texels(scene: Scene, rays: Rays, hits: Hits, seen: Ints, row: NDArray[np.float32]) -> Ints:
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
