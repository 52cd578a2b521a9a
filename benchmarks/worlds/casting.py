"""Rays meet surfaces: what every column of a view hits, and which pieces of it are seen, in vectorised numpy.

Large worlds stay fast because the walls around the eye are cast first, and what they hide is left out: whole surfaces
by what they can reach at most, then single hits. Nothing is left out that could be seen, so the picture is the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from topoloc.geometry import Floats, rotate
from topoloc.types import Ints

NEAREST_M = 0.05
"""Nothing nearer than this is drawn [m]."""
WALL_M = 1.9
"""Faces of at least this height that cross the eye's are cast first, to hide others [m]; it changes the speed only."""
BEHIND = 1e-9
"""A corner is behind the eye when it is not this far ahead of it [m]."""
SLACK = 1e-6
"""What bounds are widened by, so that rounding never hides what can be seen [columns, rows, shares]."""

Bools = NDArray[np.bool_]


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

    @cached_property
    def lines(self) -> Floats:
        """(4, F) x and y of end 0 and of the way to end 1 [m], each in one piece of memory."""
        return np.concatenate([self.ends[:, :2], self.ends[:, 2:] - self.ends[:, :2]], axis=1).T.copy()


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

    @cached_property
    def corners(self) -> Floats:
        """(2, 4, P) x and y of the corners [m]."""
        signs = np.array([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])
        corners = self.centre + rotate(signs[:, None] * self.half, self.yaw)  # (4, P, 2)
        return corners.transpose(2, 0, 1).copy()

    @cached_property
    def middle(self) -> Floats:
        """(2, P) x and y of the centres [m]."""
        return self.centre.T.copy()

    @cached_property
    def reach(self) -> Floats:
        """(P,) from the centre to a corner [m]."""
        return np.hypot(self.half[:, 0], self.half[:, 1])

    @cached_property
    def turns(self) -> Floats:
        """(2, P) cosine and sine of the yaw."""
        return np.stack([np.cos(self.yaw), np.sin(self.yaw)])


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

    @cached_property
    def axis(self) -> Floats:
        """(2,) unit vector to the middle of the view."""
        left, right = (side / np.hypot(*side) for side in self.directions[[0, -1]])
        return np.asarray((left + right) / np.hypot(*(left + right)))

    @cached_property
    def tangents(self) -> Floats:
        """(C,) of the columns' angles from the axis, growing clockwise."""
        ahead, aside = _ahead_and_aside(self.directions.T, self.axis)
        return np.asarray(aside / ahead)

    @cached_property
    def longest(self) -> float:
        """The longest step along the axis that a column takes for one unit of distance [m]."""
        return float((self.directions @ self.axis).max())


@dataclass(frozen=True)
class Hits:
    """Where rays meet surfaces: N pairs of a column and a surface, faces before planes.

    Attributes:
        column: (N,) of the view.
        surface: (N,) index of the face or of the plane.
        is_plane: (N,) which of the two it is.
        low, high: (N,) the first row and the row after the last.
        near, rise: (N,) 1 / distance is ``near + rise * row``, exact for faces and planes alike, so that comparing it
            tells what hides what.
        along: (N,) share of the face's length; 0 for planes.
        grain: (N,) share of the face's length that a column is wide; 0 for planes.
    """

    column: Ints
    surface: Ints
    is_plane: Bools
    low: Ints
    high: Ints
    near: Floats
    rise: Floats
    along: Floats
    grain: Floats

    def taken(self, which: Ints | Bools) -> Hits:
        """Some of the hits, by index or mask."""
        return Hits(**{name: getattr(self, name)[which] for name in Hits.__annotations__})


@dataclass(frozen=True)
class Seen:
    """The picture as pieces of columns, column by column from the top.

    Attributes:
        hits: what the rays meet.
        hit: (S,) index into ``hits`` of what a piece shows; -1 for nothing.
        length: (S,) rows of a piece; they add up to columns * rows.
    """

    hits: Hits
    hit: Ints
    length: Ints


def cast(faces: Faces, planes: Planes, rays: Rays) -> Seen:
    """What a view sees."""
    face_extents, plane_extents = _extents_of_faces(faces, rays), _extents_of_planes(planes, rays)
    tall = face_extents.taken(_are_walls(faces.heights[face_extents.surface], rays.eye[2]))
    screen = _Screen.of(_face_hits(faces, rays, tall), rays)
    of_faces = _face_hits(faces, rays, face_extents.taken(screen.leaves(face_extents)))
    of_planes = _plane_hits(planes, rays, plane_extents.taken(screen.leaves(plane_extents)))
    names = Hits.__annotations__
    hits = Hits(**{name: np.concatenate([getattr(of_faces, name), getattr(of_planes, name)]) for name in names})
    hits = hits.taken(np.flatnonzero((hits.high > hits.low) & screen.leaves_hits(hits)))
    return _visible_pieces(hits, len(rays.directions), rays.rows)


@dataclass(frozen=True)
class _Extents:
    """The most that N surfaces can cover of a view.

    Attributes:
        surface: (N,) index of the face or plane, ascending.
        first, last: (N,) the first column and the column after the last.
        nearness: (N,) 1 / distance of its nearest point at most; infinite where a corner is behind the eye.
        up, down: (N,) how far it reaches above and below the eye [m], not negative.
    """

    surface: Ints
    first: Ints
    last: Ints
    nearness: Floats
    up: Floats
    down: Floats

    @classmethod
    def of(cls, surface: Ints, heights: Floats, left: Floats, right: Floats, ahead: Floats, rays: Rays) -> _Extents:
        """Those of N surfaces that lie in view.

        Args:
            surface: (N,) index of the face or plane, ascending.
            heights: (F, 2) low and high edge of all faces or planes [m].
            left: (N,) tangent of the angle, clockwise from the axis, at which a surface begins.
            right: (N,) tangent of the angle at which it ends.
            ahead: (N,) of its nearest corner, along the axis; 0 where it is behind the eye [m].
            rays: the view.
        """
        left, right = left - SLACK, right + SLACK
        seen = np.flatnonzero((left <= rays.tangents[-1]) & (right >= rays.tangents[0]))
        low, high = heights[surface[seen]].T - rays.eye[2]
        with np.errstate(divide="ignore"):  # beside or behind the eye: infinitely near, for all we know
            nearness = rays.longest * (1.0 + SLACK) / ahead[seen]
        first = np.searchsorted(rays.tangents, left[seen])
        last = np.searchsorted(rays.tangents, right[seen], side="right")
        extents = cls(surface[seen], first, last, nearness, np.maximum(high, 0.0), np.maximum(-low, 0.0))
        return extents.taken(last > first)  # the others lie between two columns

    def taken(self, which: Ints | Bools) -> _Extents:
        """Some of the surfaces, by index or mask."""
        return _Extents(**{name: getattr(self, name)[which] for name in _Extents.__annotations__})


def _ahead_and_aside(points: Floats, axis: Floats) -> tuple[Floats, Floats]:
    """Points (2, ...) relative to the eye along the axis, and to its right [m]."""
    x, y = points
    return x * axis[0] + y * axis[1], x * axis[1] - y * axis[0]


def _tangent(ahead: Floats, aside: Floats, behind: float | Floats) -> Floats:
    """Of the angle clockwise from the axis; ``behind`` where a point is not ahead of the eye."""
    return np.where(ahead > BEHIND, aside / np.maximum(ahead, BEHIND), behind)


def _extents_of_faces(faces: Faces, rays: Rays) -> _Extents:
    """What the faces that are turned to the eye can cover; seen from there they run clockwise."""
    x, y, along_x, along_y = faces.lines
    x, y = x - rays.eye[0], y - rays.eye[1]
    turned = np.flatnonzero(x * along_y - y * along_x < 0.0)
    start, along = np.stack([x[turned], y[turned]]), faces.lines[2:, turned]
    ahead, aside = _ahead_and_aside(start, rays.axis)
    more_ahead, more_aside = _ahead_and_aside(along, rays.axis)
    end_ahead, end_aside = ahead + more_ahead, aside + more_aside
    left, right = _tangent(ahead, aside, -np.inf), _tangent(end_ahead, end_aside, np.inf)
    nearest, farthest = np.minimum(ahead, end_ahead), np.maximum(ahead, end_ahead)
    left[farthest <= BEHIND] = np.inf  # wholly behind the eye: in no column
    return _Extents.of(turned, faces.heights, left, right, np.where(nearest > BEHIND, nearest, 0.0), rays)


def _extents_of_planes(planes: Planes, rays: Rays) -> _Extents:
    """What the planes that are not seen edge-on can cover."""
    index = np.flatnonzero((np.abs(planes.height - rays.eye[2]) > SLACK) & _circles_in_view(planes, rays))
    ahead, aside = _ahead_and_aside(planes.corners[:, :, index] - rays.eye[:2, None, None], rays.axis)
    # beside the eye a plane reaches as far round as it goes: to the left, to the right, or, below the eye, both
    leftmost = np.where(aside.min(axis=0) <= BEHIND, -np.inf, np.inf)
    rightmost = np.where(aside.max(axis=0) >= -BEHIND, np.inf, -np.inf)
    left, right = _tangent(ahead, aside, leftmost).min(axis=0), _tangent(ahead, aside, rightmost).max(axis=0)
    nearest = ahead.min(axis=0)
    left[ahead.max(axis=0) <= BEHIND] = np.inf  # wholly behind the eye: in no column
    heights = np.stack([planes.height, planes.height], axis=1)
    return _Extents.of(index, heights, left, right, np.where(nearest > BEHIND, nearest, 0.0), rays)


def _circles_in_view(planes: Planes, rays: Rays) -> Bools:
    """Which planes (P,) may be seen, by the circles around them: quicker than by their corners."""
    ahead, aside = _ahead_and_aside(planes.middle - rays.eye[:2, None], rays.axis)
    left, right = rays.tangents[[0, -1]]
    reach = planes.reach + SLACK
    inside = (left * ahead - aside < np.hypot(1.0, left) * reach) & (
        aside - right * ahead < np.hypot(1.0, right) * reach
    )
    return np.asarray(inside & (ahead > -reach))


def _are_walls(heights: Floats, eye_m: float) -> Bools:
    """Which faces, low and high edge (N, 2) [m], are worth casting first."""
    low, high = heights.T
    return np.asarray((low <= eye_m) & (high >= eye_m) & (high - low >= WALL_M))


@dataclass(frozen=True)
class _Screen:
    """The nearest wall of each of C columns, and what it hides.

    Attributes:
        near: (C,) 1 / distance of the wall; 0 where there is none.
        low, high: (C,) the first row that it covers and the row after the last.
        bounds: (3, C) what is farther than all of these is hidden: nearness, slope up and slope down from the eye.
    """

    near: Floats
    low: Ints
    high: Ints
    bounds: Floats

    @classmethod
    def of(cls, walls: Hits, rays: Rays) -> _Screen:
        """The nearest of the walls' hits."""
        near = np.zeros(len(rays.directions))
        np.maximum.at(near, walls.column, walls.near)
        nearest = np.flatnonzero(walls.near == near[walls.column])
        low, high = np.full(len(near), rays.rows), np.zeros(len(near), dtype=np.int64)
        low[walls.column[nearest]], high[walls.column[nearest]] = walls.low[nearest], walls.high[nearest]
        # a row's number is rounded: an edge up to half a row farther out is still hidden
        up = np.where(low > 0, (rays.horizon - low + 0.5 - SLACK) / rays.scale, np.inf)
        down = np.where(high < rays.rows, (high + 0.5 - SLACK - rays.horizon) / rays.scale, np.inf)
        return cls(near, low, high, np.stack([near, up, down]))

    def leaves(self, extents: _Extents) -> Bools:
        """Which surfaces (N,) are not wholly behind the walls of the columns that they may cover."""
        near, up, down = _least(self.bounds, extents.first, extents.last)
        nearness = extents.nearness
        with np.errstate(invalid="ignore"):  # infinitely near but neither above nor below: seen
            hidden = (nearness < near) & (extents.up * nearness <= up) & (extents.down * nearness <= down)
        return np.asarray(~hidden)

    def leaves_hits(self, hits: Hits) -> Bools:
        """Which hits (N,) are not wholly behind the wall of their column."""
        nearest = hits.near + np.maximum(hits.rise * hits.low, hits.rise * hits.high)
        covered = (hits.low >= self.low[hits.column]) & (hits.high <= self.high[hits.column])
        return np.asarray(~(covered & (nearest < self.near[hits.column])))


def _least(values: Floats, first: Ints, last: Ints) -> Floats:
    """Minima (R, N) of the rows of ``values`` (R, C) over N ranges of columns, none empty."""
    levels = [values]  # level k: minima over 2^k columns from each on
    while 2 ** len(levels) <= values.shape[1]:
        reach = 2 ** (len(levels) - 1)
        shifted = np.concatenate([levels[-1][:, reach:], levels[-1][:, -reach:]], axis=1)
        levels.append(np.minimum(levels[-1], shifted))
    level = np.log2(last - first).astype(np.int64)
    table = np.stack(levels, axis=1)
    return np.minimum(table[:, level, first], table[:, level, last - 2**level])


def _edge_rows(rays: Rays, column: Ints, height: Floats, inverse_distance: Floats) -> Ints:
    """First row whose middle is below a height [m], within the picture."""
    row = rays.horizon[column] - rays.scale * (height - rays.eye[2]) * inverse_distance
    return np.asarray(np.ceil(np.clip(row, 0.0, rays.rows) - 0.5).astype(np.int64))


def _face_hits(faces: Faces, rays: Rays, extents: _Extents) -> Hits:
    """Where the columns' rays meet faces that are turned to the eye."""
    which, column = _ranges(extents.first, extents.last)
    lines = faces.lines[:, extents.surface] - np.array([*rays.eye[:2], 0.0, 0.0])[:, None]
    start_x, start_y, along_x, along_y = lines[:, which]
    x, y = rays.directions[column].T
    slant = along_y * x - along_x * y  # cross(direction, along)
    offset = start_x * y - start_y * x  # cross(start, direction)
    inverse = slant / (lines[0] * lines[3] - lines[1] * lines[2])[which]
    met = np.flatnonzero((slant < 0.0) & (offset <= 0.0) & (offset > slant) & (inverse < 1.0 / NEAREST_M))
    column, surface, inverse, slant = column[met], extents.surface[which[met]], inverse[met], slant[met]
    low, high = (_edge_rows(rays, column, faces.heights[surface, side], inverse) for side in (1, 0))
    nothing = np.zeros(len(met))
    along, grain = offset[met] / slant, -rays.pitch / (inverse * slant)
    return Hits(column, surface, nothing.astype(bool), low, high, inverse, nothing, along, grain)


def _plane_hits(planes: Planes, rays: Rays, extents: _Extents) -> Hits:
    """Where the columns' rays enter and leave horizontal planes."""
    which, column = _ranges(extents.first, extents.last)
    enter, leave = _crossing(planes, rays, extents.surface, which, column)
    crossed = np.flatnonzero(leave > np.maximum(enter, NEAREST_M))
    enter, leave, surface, column = enter[crossed], leave[crossed], extents.surface[which[crossed]], column[crossed]
    height = planes.height[surface]
    fall = rays.scale * (rays.eye[2] - height)  # rows below the horizon at unit distance
    near = _edge_rows(rays, column, height, 1.0 / np.maximum(enter, NEAREST_M))
    far = _edge_rows(rays, column, height, 1.0 / leave)
    low, high, nothing = np.minimum(near, far), np.maximum(near, far), np.zeros(len(crossed))
    is_plane = np.ones(len(crossed), dtype=bool)
    return Hits(column, surface, is_plane, low, high, -rays.horizon[column] / fall, 1.0 / fall, nothing, nothing)


def _crossing(planes: Planes, rays: Rays, surface: Ints, which: Ints, column: Ints) -> tuple[Floats, Floats]:
    """Distances (N,) at which rays in ``column`` enter and leave the rectangles ``surface[which]``.

    None enters before the eye.
    """
    x, y = rays.directions[column].T
    cos, sin = planes.turns[:, surface]
    middle_x, middle_y = planes.middle[:, surface] - rays.eye[:2, None]
    enter, leave = np.zeros(len(column)), np.full(len(column), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):  # a ray along a side never crosses it: infinity is meant
        for side, (along, across) in enumerate(((cos, sin), (-sin, cos))):
            centre, half = along * middle_x + across * middle_y, planes.half[surface, side]
            direction = along[which] * x + across[which] * y
            one, other = (centre - half)[which] / direction, (centre + half)[which] / direction
            enter = np.fmax(enter, np.fmin(one, other))
            leave = np.fmin(leave, np.fmax(one, other))
    return enter, leave


def _visible_pieces(hits: Hits, columns: int, rows: int) -> Seen:
    """Cut every column where a surface begins or ends, and where two pierce each other: what is nearest in each piece.

    1 / distance is linear in the row: what is nearest in the first and in the last row of a piece is so in between.
    """
    stride = rows + 1  # columns and rows in one number: a row of a column is column * stride + row
    start, column = np.arange(columns) * stride, hits.column * stride
    low, high = column + hits.low, column + hits.high
    cut, number = np.zeros(columns * stride, dtype=bool), np.zeros(columns * stride, dtype=np.int64)
    for cuts in (low, high, start, start + rows):
        cut[cuts] = True
    cuts = np.flatnonzero(cut)
    number[cuts] = np.arange(len(cuts))
    piece = np.flatnonzero(cuts % stride < rows)
    begin, end, done = cuts[piece], cuts[piece + 1], []
    ranges = number[low] - hits.column, number[high] - hits.column  # every column before has a cut that begins nothing
    while len(begin):
        top = begin % stride
        first, last = _nearest(hits, *ranges, np.stack([top + 0.5, top + (end - begin) - 0.5]))
        whole, torn = first == last, np.flatnonzero(first != last)
        done.append(np.stack([begin[whole], first[whole]]))
        one, other, begin, end, top = first[torn], last[torn], begin[torn], end[torn], top[torn]
        row = (hits.near[other] - hits.near[one]) / (hits.rise[one] - hits.rise[other]) - top
        middle = begin + np.ceil(np.clip(row - 0.5, 1.0, end - begin - 1.0)).astype(np.int64)
        begin, end = np.sort(np.concatenate([begin, middle])), np.sort(np.concatenate([middle, end]))
        ranges = np.searchsorted(begin, low), np.searchsorted(begin, high)
    begin, hit = np.concatenate(done, axis=1)
    order = np.argsort(begin)
    begin, hit = begin[order], hit[order]
    new = np.flatnonzero((np.diff(hit, prepend=-2) != 0) | (begin % stride == 0))  # the others go on with the last one
    begin = begin[new]
    return Seen(hits, hit[new], np.diff(begin - begin // stride, append=columns * rows))


def _nearest(hits: Hits, first: Ints, last: Ints, rows: Floats) -> Ints:
    """The hits (R, S) that are nearest in R rows of each of S pieces; -1 where there is none.

    Args:
        hits: what the rays meet, faces before planes.
        first: (N,) the first piece that a hit covers.
        last: (N,) the piece after the last.
        rows: (R, S) within the pieces.
    """
    useful, found = np.flatnonzero(last > first)[::-1], np.full(rows.shape, -1)
    faces, planes = useful[~hits.is_plane[useful]], useful[hits.is_plane[useful]]
    faces = faces[np.argsort(hits.near[faces], kind="stable")]  # painted from far to near; of equals the first is last
    which, piece = _ranges(first[faces], last[faces])
    found[:, piece] = faces[which]
    which, piece = _ranges(first[planes], last[planes])
    plane, painted = planes[which], np.append(hits.near, 0.0)
    for nearest, row in zip(found, rows, strict=True):
        nearness = hits.near[plane] + hits.rise[plane] * row[piece]
        seen = np.flatnonzero(nearness > painted[nearest[piece]])
        seen = seen[np.argsort(nearness[seen], kind="stable")]
        nearest[piece[seen]] = plane[seen]
    return found


def _ranges(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """The numbers of N ranges, one after the other: which range each is of, and the number."""
    count = last - first
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count - first, count)
