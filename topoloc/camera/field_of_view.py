"""The horizontal field of view of a camera, from a turn on the spot (ours)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from topoloc.camera.level import View
from topoloc.camera.matching import Matcher, Matches
from topoloc.camera.poses import poses_at_frames, refuse_panoramas
from topoloc.camera.turn_fit import TurnedPoints, fitted, searched, spread
from topoloc.camera.turns import (
    HOW_TO,
    circle_headings,
    closed_circle,
    full_circles,
    odometer_scale,
    some_of,
    spot_pairs,
    spot_runs,
    too_far_apart,
    turned_in,
)
from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats, between, compose
from topoloc.going_through import Track, in_silence
from topoloc.recording import Recording
from topoloc.settings import read_toml
from topoloc.types import Ints

LEAST_PAIRS = 4
LEAST_TURNED = np.deg2rad(30.0)
"""Less of a turn tells nothing [rad]."""
LEAST_AGREEING = 0.4
"""Share of the points that must agree with a turn on the spot."""
SCALE_WITHIN = 0.15
"""An odometer that errs by more of a circle than this was not seen to close one."""
UNTOLD_M = 0.2
"""A camera whose place nobody tells may sit so far from the axis of rotation [m]."""
ROUNDS = 3
"""Headings around a circle and the field of view are worked out from each other so many times."""


@dataclass(frozen=True)
class FieldOfView:
    """What a turn on the spot tells of a camera.

    Attributes:
        hfov_deg: horizontal field of view, degrees.
        sd_deg: its standard deviation, degrees, with what ``UNTOLD_M`` costs where the camera's place is not told; the
            error of an odometer that no circle checked is not in it.
        pairs: of frames that it comes from.
        turned_deg: how far the camera turned in them, degrees.
        pitch_deg: how far the camera looks down, degrees.
        roll_deg: how far the picture's right side hangs down, degrees.
        agreeing: share of the points seen twice that agree.
        closed: whether a turn came back to where it began, so that the circle is the measure, not the odometer.
        odometer_scale: true turn over that of the odometer; None where no circle was closed, or there is no odometer.
        size: width and height of the pictures, pixels.
        points: what it was fitted to.
        residuals: (M, 2) how far each of them is off [half-widths of the picture].
        circles: full ones that were followed from picture to picture; 0: the odometer told how far pairs turned.
        place_told: whether the camera's place on the robot was told; else it was taken to sit on the axis.
    """

    hfov_deg: float
    sd_deg: float
    pairs: int
    turned_deg: float
    pitch_deg: float
    roll_deg: float
    agreeing: float
    closed: bool
    odometer_scale: float | None
    size: tuple[int, int]
    points: TurnedPoints = field(repr=False)
    residuals: Floats = field(repr=False)
    circles: int = 0
    place_told: bool = True


def estimate_field_of_view(recording: Recording, scene_m: float = 3.0, track: Track = in_silence) -> FieldOfView:
    """Measure the field of view where a recording turns on the spot.

    Full circles that can be followed from picture to picture are the measure, pooled where there are several; else
    the odometer's turns are. A recording without odometry must be one such circle. A pan head's turns are as good as
    the robot's.

    Args:
        recording: with ``rgb`` pictures, read as ``camera.toml`` has it: without the bends of a lens that is told.
        scene_m: usual distance of things from the camera [m]; it matters where the mount is off the axis of rotation.
        track: goes through pairs of frames.

    Raises:
        UserError: it does not turn on the spot, or what is seen does not go with its turns.
    """
    refuse_panoramas(recording)
    if not scene_m > 0.0:
        raise UserError(f"scene_m is {scene_m:g}; things are more than 0 m away")
    matcher = Matcher(recording)
    if recording.odometry is None:
        return _by_circle(recording, matcher, scene_m, track)
    return _by_odometer(recording, matcher, scene_m, track)


def _by_odometer(recording: Recording, matcher: Matcher, scene_m: float, track: Track) -> FieldOfView:
    robot, mounts = poses_at_frames(recording)
    camera = compose(robot, mounts)
    heading = np.unwrap(camera[:, 2])
    pairs = spot_pairs(robot, heading)
    turn = turned_in(pairs, heading) if pairs else 0.0
    if turn < LEAST_TURNED:
        problem = f"turns on the spot by {np.rad2deg(turn):.0f} degrees only"
        raise InputError(recording.folder / "odometry.txt", problem, HOW_TO)
    some = some_of(pairs)
    found = [matcher.match(*some[number]) for number in track(range(len(some)), "comparing pictures of the turn")]
    matches = [one for one in found if one is not None]
    if len(matches) < LEAST_PAIRS:
        _refuse_far_apart(recording, matches, heading)
        apart = np.rad2deg(np.median([abs(heading[second] - heading[first]) for first, second in some]))
        seen = f"{len(matches)} of {len(some)} pairs of frames in the turn"
        problem = f"{seen} show the same things; they are {apart:.0f} degrees apart"
        enough = "a lens of 40 degrees needs pictures every 10 degrees or less"
        raise InputError(recording.folder / "rgb.txt", problem, f"{HOW_TO}; {enough}")
    points = turned_points(matches, camera, scene_m)
    view = fitted(points, searched(points))
    _refuse_wrong_sense(recording, points, view)
    if points.agreeing(view) < LEAST_AGREEING:
        _refuse_far_apart(recording, matches, heading)
    whole = _by_full_circles(recording, matcher, camera, spot_runs(pairs), view, scene_m, track)
    if whole is not None:
        return whole
    scale = odometer_scale(matcher, heading, spot_runs(pairs), view)
    if scale is not None and abs(scale - 1.0) < SCALE_WITHIN:
        points = points.scaled(scale)
        return _told(recording, points, fitted(points, view), turn * scale, scale)
    return _told(recording, points, view, turn, None)


def _by_full_circles(
    recording: Recording,
    matcher: Matcher,
    camera: Floats,
    runs: Sequence[Ints],
    view: View,
    scene_m: float,
    track: Track,
) -> FieldOfView | None:
    """What the circles tell that can be followed from picture to picture; None where there is none, or little agrees.

    Args:
        recording: that turns.
        matcher: of it.
        camera: (N, 3) poses of the camera by the odometer.
        runs: of frames, each a turn on the spot.
        view: of the camera, about.
        scene_m: usual distance of things [m].
        track: goes through the frames.
    """
    heading = np.unwrap(camera[:, 2])
    circles = full_circles(matcher, heading, runs, track)
    if not circles:
        return None
    linked = turned_points([link for links in circles for link in links], camera, scene_m)
    points, view = _around(circles, linked, view)
    if points.agreeing(view) < LEAST_AGREEING:
        return None
    turn = 2.0 * np.pi * len(circles)
    return _told(recording, points, view, turn, _scale_of(circles, heading, view), len(circles))


def _around(circles: Sequence[Sequence[Matches]], points: TurnedPoints, view: View) -> tuple[TurnedPoints, View]:
    """Points of circles with the turns that add up to full ones, and the view that fits them."""
    for _ in range(ROUNDS):
        turns = np.concatenate([np.diff(circle_headings(links, view)) for links in circles])
        points = replace(points, turn=turns[points.pair])
        view = fitted(points, view)
    return points, view


def _scale_of(circles: Sequence[Sequence[Matches]], heading: Floats, view: View) -> float:
    """True turn over the odometer's (heading (N,), unwrapped [rad]), by circles."""
    told = [heading[links[-1].first] - heading[links[0].first] for links in circles]
    return float(np.median([circle_headings(links, view)[-2] for links in circles] / np.array(told)))


def _by_circle(recording: Recording, matcher: Matcher, scene_m: float, track: Track) -> FieldOfView:
    links = closed_circle(recording, matcher, track)
    mount = np.array([recording.mount.x, recording.mount.y, np.deg2rad(recording.mount.yaw_deg)])
    frames = [link.first for link in links]
    view = View.of(60.0)
    for _ in range(ROUNDS):
        poses = np.zeros((max(frames) + 1, 3))
        poses[frames, 2] = circle_headings(links, view)[:-1]
        points = turned_points(links, compose(poses, mount), scene_m)
        view = fitted(points, searched(points))
    return _told(recording, points, view, 2.0 * np.pi, None, circles=1)


def turned_points(matches: Sequence[Matches], camera: Floats, scene_m: float) -> TurnedPoints:
    """Points that frames have in common, and how a camera with poses (N, 3) turned and moved between them."""
    counts = [len(one.before) for one in matches]
    steps = np.array([between(camera[one.first], camera[one.second]) for one in matches])
    moved = np.column_stack([-steps[:, 1], np.zeros(len(steps)), steps[:, 0]])
    return TurnedPoints(
        np.concatenate([one.before for one in matches]),
        np.concatenate([one.after for one in matches]),
        np.repeat(steps[:, 2], counts),
        np.repeat(moved, counts, axis=0),
        np.repeat(np.arange(len(matches)), counts),
        scene_m,
    )


def _refuse_wrong_sense(recording: Recording, points: TurnedPoints, view: View) -> None:
    """Raise ``InputError`` where the pictures would fit far better if the robot turned the other way."""
    other = points.scaled(-1.0)
    if points.agreeing(view) < LEAST_AGREEING < other.agreeing(fitted(other, searched(other))):
        remedy = "headings grow counter-clockwise; look whether the pictures are mirror-flipped or upside down"
        raise InputError(recording.folder / "odometry.txt", "turns the other way than the pictures do", remedy)


def _refuse_far_apart(recording: Recording, matches: Sequence[Matches], heading: Floats) -> None:
    """Raise ``InputError`` where frames are so far apart in the turns that they share too little."""
    found = too_far_apart(matches, heading)
    if found is not None:
        step, needed = found
        problem = f"frames in the turns are {step:.0f} degrees apart, and share less than half of what they show"
        remedy = f"pictures every {max(1.0, needed):.0f} degrees or less are needed with this lens: turn more slowly"
        raise InputError(recording.folder / "rgb.txt", problem, remedy)


def _told(
    recording: Recording, points: TurnedPoints, view: View, turn: float, scale: float | None, circles: int = 0
) -> FieldOfView:
    """The answer, unless too few points agree with it."""
    agreeing = points.agreeing(view)
    if agreeing < LEAST_AGREEING:
        problem = f"only {100.0 * agreeing:.0f} % of what is seen twice moves as in a turn on the spot"
        raise InputError(recording.folder, problem, f"{HOW_TO}; look whether times of pictures and odometry agree")
    image = next(iter(recording)).images["rgb"]
    told = _place_told(recording)
    return FieldOfView(
        view.hfov_deg,
        float(np.hypot(spread(points, view), 0.0 if told else _doubt_of_place(view, points.scene_m))),
        points.pairs,
        float(np.rad2deg(turn)),
        float(np.rad2deg(view.pitch)),
        float(np.rad2deg(view.roll)),
        agreeing,
        circles > 0 or scale is not None,
        scale,
        (image.shape[1], image.shape[0]),
        points,
        points.residuals(view),
        circles,
        told,
    )


def _place_told(recording: Recording) -> bool:
    """Whether ``camera.toml`` says where the camera sits; ``x = 0`` in it says on the axis, no ``[mount]`` nothing."""
    path = recording.folder / "camera.toml"
    table = read_toml(path, "restore it").get("mount", {}) if path.exists() else {}
    return "x" in table or "y" in table


def _doubt_of_place(view: View, scene_m: float) -> float:
    """How wrong a field of view is where the camera is ``UNTOLD_M`` ahead of the axis and nobody knows [degrees]."""
    return float(np.sin(np.deg2rad(view.hfov_deg)) * np.rad2deg(UNTOLD_M / scene_m))
