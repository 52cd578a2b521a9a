"""Where a recording turns on the spot, and by how much: by its odometer, or by a circle that closes (ours)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from topoloc.camera.level import View
from topoloc.camera.matching import Matcher, Matches
from topoloc.errors import InputError
from topoloc.geometry import Floats
from topoloc.going_through import Track
from topoloc.keypoints import LEAST_SUPPORT
from topoloc.recording import Recording
from topoloc.types import Ints

SPOT_M_PER_RAD = 0.1
"""A robot turns on the spot where it comes no farther than this for each radian that it turns [m]."""
STEPS_DEG = (4.0, 8.0, 16.0, 32.0)
"""Frames are paired that are about so far apart [degrees]."""
WIDEST_DEG = 50.0
"""But no farther than this."""
MOST_PAIRS = 150
MOST_FRAMES = 400
"""Of a turn without odometry."""
LINK = 0.35
"""There a frame is tied to the last one that the picture has moved so far from [half-widths]."""
MOST_LOST = 2
"""A turn is lost after so many frames in a row that show nothing of the last one; one may be covered or unreadable."""
LEAST_LINKS = 3
"""A circle has so many at least before it closes."""
ALIKE = 0.2
"""Things move the same way that move alike to this, across and down [half-widths]."""
CIRCLE_WITHIN = np.deg2rad(40.0)
"""Frames are looked for again that an odometer says to be a full circle apart, within this [rad]."""
TOO_FAR = 1.0
"""Frames in which things moved farther have less than half of the picture in common [half-widths]."""
NEAR_ENOUGH = 0.5
"""They have three quarters in common where things moved so far [half-widths]."""
CIRCLES = 5
"""So many pairs of them are looked at."""
HOW_TO = "turn the robot on the spot in a full circle, slowly, with something to see all around"
"""What to do about a recording without a turn."""


def spot_pairs(robot: Floats, heading: Floats) -> list[tuple[int, int]]:
    """Pairs of frames between which the robot turned on the spot, by ``STEPS_DEG``.

    Args:
        robot: (N, 3) odometer at the frames.
        heading: (N,) of the camera, pan included, unwrapped [rad].
    """
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(robot[:, :2], axis=0), axis=1))])
    steps = np.deg2rad(STEPS_DEG)
    pairs: list[tuple[int, int]] = []
    key = 0
    while key < len(way) - 1:
        turn = np.abs(heading[key:] - heading[key])
        here = (way[key:] - way[key] <= SPOT_M_PER_RAD * turn) & (turn <= np.deg2rad(WIDEST_DEG))
        ahead = [int(np.argmax(turn >= step)) for step in steps if (turn >= step).any()]
        pairs += [(key, key + after) for after in dict.fromkeys(ahead) if here[after]]
        key += ahead[0] if ahead and here[ahead[0]] else 1
    return pairs


def some_of(pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """At most ``MOST_PAIRS`` of some pairs, evenly picked."""
    return list(pairs[:: max(1, -(-len(pairs) // MOST_PAIRS))])


def turned_in(pairs: Sequence[tuple[int, int]], heading: Floats) -> float:
    """How far a camera turned in the frames that pairs cover [rad]; heading (N,) is unwrapped."""
    covered = np.zeros(len(heading) - 1, dtype=bool)
    for first, second in pairs:
        covered[first:second] = True
    return float(np.abs(np.diff(heading))[covered].sum())


def spot_runs(pairs: Sequence[tuple[int, int]]) -> list[Ints]:
    """Frames (F,) of each turn on the spot, one after the other; ``pairs`` must be all of ``spot_pairs``, not some."""
    frames = np.unique(np.array(pairs))
    return np.split(frames, np.flatnonzero(~_joined(frames, pairs)) + 1)


def odometer_scale(matcher: Matcher, heading: Floats, runs: Sequence[Ints], view: View) -> float | None:
    """True turn over the odometer's, by pictures seen again after a full circle; None where none was.

    Args:
        matcher: of the recording.
        heading: (N,) of the camera by the odometer, unwrapped [rad].
        runs: of frames, each a turn on the spot.
        view: of the camera, about.
    """
    scales = []
    for run in runs:
        for first in run[:: -(-len(run) // CIRCLES)]:
            over = np.abs(np.abs(heading[run] - heading[first]) - 2.0 * np.pi)
            second = int(run[over.argmin()])
            near = over.min() < CIRCLE_WITHIN and second > first
            found = _coherent(matcher.match(int(first), second)) if near else None
            if found is not None:
                told = float(heading[second] - heading[first])
                scales.append((np.copysign(2.0 * np.pi, told) + turn_of(found, view)) / told)
    return float(np.median(scales)) if scales else None


def _joined(frames: np.ndarray, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """(F - 1,) whether a pair reaches over from each frame (F,) to the next."""
    reaches = np.zeros(int(frames[-1]) + 1, dtype=bool)
    for first, second in pairs:
        reaches[first:second] = True
    return np.asarray([reaches[a:b].all() for a, b in pairwise(frames)], dtype=bool)


def too_far_apart(matches: Sequence[Matches], heading: Floats) -> tuple[float, float] | None:
    """How far frames of turns are apart, and how far they should be at most [degrees]; None: they are near enough.

    Args:
        matches: of pairs of frames in turns.
        heading: (N,) of the camera by the odometer, unwrapped [rad].
    """
    next_to = [one for one in matches if one.second == one.first + 1 and _coherent(one) is not None]
    if not next_to:
        return None
    step = float(np.rad2deg(np.median([abs(heading[one.second] - heading[one.first]) for one in next_to])))
    shift = float(np.median([abs(np.median(_shifts(one)[:, 0])) for one in next_to]))
    return (step, step * NEAR_ENOUGH / shift) if shift > TOO_FAR else None


def turn_of(found: Matches, view: View) -> float:
    """How far a camera turned between two frames, by what they both show [rad, counter-clockwise]."""
    before, after = view.rays(found.before), view.rays(found.after)
    turns = np.arctan2(after[:, 0], after[:, 2]) - np.arctan2(before[:, 0], before[:, 2])
    return float(np.median(turns))


def closed_circle(recording: Recording, matcher: Matcher, track: Track) -> list[Matches]:
    """Frames of a turn tied to each other, one after the other, the last to the first: no odometer is needed.

    Raises:
        InputError: the chain breaks, or never comes back to its beginning.
    """
    count = len(recording.pictures["rgb"])
    frames = np.unique(np.linspace(0, count - 1, min(count, MOST_FRAMES)).round().astype(int)).tolist()
    links, closed = _followed(matcher, frames, None, track)
    if closed:
        return closed
    problem = f"no odometry, and no circle closes in {count} pictures"
    if not links or links[-1].second < frames[-1]:
        seen = recording.pictures["rgb"][links[-1].second if links else 0].path.name
        problem = f"no odometry, and after {seen} too little is seen again to follow the turn"
    raise InputError(recording.folder / "rgb.txt", problem, f"{HOW_TO}, or add odometry.txt")


def full_circles(matcher: Matcher, heading: Floats, runs: Sequence[Ints], track: Track) -> list[list[Matches]]:
    """The turns that come round to where they began, each as ``closed_circle`` ties it.

    The odometer says where to look for the beginning again, and no more. A turn that is lost on the way is left out.

    Args:
        matcher: of the recording.
        heading: (N,) of the camera by the odometer, unwrapped [rad].
        runs: of frames, each a turn on the spot.
        track: goes through the frames of each.
    """
    whole = [run for run in runs if np.ptp(heading[run]) > 2.0 * np.pi - CIRCLE_WITHIN]
    found = [_followed(matcher, _thinned(run, heading), heading, track)[1] for run in whole]
    return [closed for closed in found if closed]


def _thinned(run: Ints, heading: Floats) -> list[int]:
    """Some of the frames of a turn, the smallest of ``STEPS_DEG`` or more apart."""
    kept = [int(run[0])]
    for number in run[1:].tolist():
        if abs(heading[number] - heading[kept[-1]]) >= np.deg2rad(STEPS_DEG[0]):
            kept.append(number)
    return kept


def _followed(
    matcher: Matcher, frames: Sequence[int], heading: Floats | None, track: Track
) -> tuple[list[Matches], list[Matches]]:
    """The links along a turn as far as it was followed, and those of its circle, back to its beginning; none if open.

    Args:
        matcher: of the recording.
        frames: of the turn.
        heading: (N,) of the camera by the odometer, unwrapped [rad]: the circle closes only where it says so, about.
        track: goes through the frames.
    """
    links: list[Matches] = []
    closed: list[Matches] = []
    out_of_sight = False
    for link in _chain(matcher, frames, track):
        if links and np.median(_shifts(link)[:, 0]) * np.median(_shifts(links[0])[:, 0]) < 0.0:
            break  # it turns back, or something was taken for another thing
        links.append(link)
        near = heading is None or _round(heading[link.second] - heading[frames[0]])
        back = _coherent(matcher.match(link.second, frames[0])) if near else None
        out_of_sight |= back is None
        if back is not None and out_of_sight and len(links) >= LEAST_LINKS:
            if closed and _support(back) <= _support(closed[-1]):
                break
            closed = [*links, back]
        elif closed:
            break
    return links, closed


def _round(turn: float) -> bool:
    """Whether an odometer says that a turn [rad] is about a full circle."""
    return bool(abs(abs(turn) - 2.0 * np.pi) < CIRCLE_WITHIN)


def _chain(matcher: Matcher, frames: Sequence[int], track: Track) -> Iterator[Matches]:
    """Frames tied to each other, each ``LINK`` from the one before, or as near to that as they come.

    It ends where ``MOST_LOST`` frames in a row show nothing of the last one: what is seen again after that may be
    another thing that looks alike.
    """
    key: int = frames[0]
    waiting: Matches | None = None
    lost = 0
    for number in track(frames[1:], "following the turn"):
        found = _coherent(matcher.match(key, number))
        if found is None and waiting is not None:
            yield waiting
            key, waiting = waiting.second, None
            found = _coherent(matcher.match(key, number))
        lost = lost + 1 if found is None else 0
        if lost == MOST_LOST:
            return
        waiting = found or waiting
        if waiting is not None and abs(np.median(_shifts(waiting)[:, 0])) >= LINK:
            yield waiting
            key, waiting = waiting.second, None
    if waiting is not None:
        yield waiting


def _coherent(found: Matches | None) -> Matches | None:
    """What two frames both show, unless too little of it moved the same way: alike things are not the same."""
    return found if found is not None and _support(found) >= LEAST_SUPPORT else None


def _support(found: Matches) -> int:
    """How many things moved about the same way."""
    shifts = _shifts(found)
    return int((np.abs(shifts - np.median(shifts, axis=0)) < ALIKE).all(axis=1).sum())


def _shifts(found: Matches) -> Floats:
    """How far (M, 2) things moved in the picture [half-widths]."""
    return np.asarray(found.after - found.before)


def circle_headings(links: Sequence[Matches], view: View) -> Floats:
    """Headings (L + 1,) of the frames of a closed circle, the first one's in the end again [rad]: they add up to 2 pi.

    What ``view`` takes for the field of view hardly matters: it stretches all turns about alike.
    """
    turns = np.array([turn_of(link, view) for link in links])
    return np.concatenate([[0.0], np.cumsum(turns * 2.0 * np.pi / abs(turns.sum()))])
