"""The horizontal field of view of a camera, from a turn on the spot (ours)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from topoloc.camera.level import View
from topoloc.camera.matching import Matcher, Matches
from topoloc.camera.poses import poses_at_frames, refuse_panoramas
from topoloc.camera.turn_fit import TurnedPoints, fitted, searched, spread
from topoloc.camera.turns import HOW_TO, circle_headings, closed_circle, odometer_scale, spot_pairs, turned_in
from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats, between, compose
from topoloc.going_through import Track, in_silence
from topoloc.recording import Recording

LEAST_PAIRS = 4
LEAST_TURNED = np.deg2rad(30.0)
"""Less of a turn tells nothing [rad]."""
LEAST_AGREEING = 0.4
"""Share of the points that must agree with a turn on the spot."""
SCALE_WITHIN = 0.15
"""An odometer that errs by more of a circle than this was not seen to close one."""
ROUNDS = 3
"""Headings around a circle and the field of view are worked out from each other so many times."""


@dataclass(frozen=True)
class FieldOfView:
    """What a turn on the spot tells of a camera.

    Attributes:
        hfov_deg: horizontal field of view, degrees.
        sd_deg: its standard deviation, degrees; the error of an odometer that no circle checked is not in it.
        pairs: of frames that it comes from.
        turned_deg: how far the camera turned in them, degrees.
        pitch_deg: how far the camera looks down, degrees.
        roll_deg: how far the picture's right side hangs down, degrees.
        agreeing: share of the points seen twice that agree.
        closed: whether the turn came back to where it began, so that the circle is the measure, not the odometer.
        odometer_scale: true turn over that of the odometer; None where no circle was closed, or there is no odometer.
        size: width and height of the pictures, pixels.
        points: what it was fitted to.
        residuals: (M, 2) how far each of them is off [half-widths of the picture].
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


def estimate_field_of_view(recording: Recording, scene_m: float = 3.0, track: Track = in_silence) -> FieldOfView:
    """Measure the field of view where a recording turns on the spot.

    With odometry, its turns are the measure, unless a full circle shows how long they really are; without, the
    recording must be one such circle. A pan head's turns are as good as the robot's.

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
    found = [matcher.match(*pairs[number]) for number in track(range(len(pairs)), "comparing pictures of the turn")]
    matches = [one for one in found if one is not None]
    if len(matches) < LEAST_PAIRS:
        problem = f"{len(matches)} of {len(pairs)} pairs of frames in the turn show the same things"
        raise InputError(recording.folder / "rgb.txt", problem, HOW_TO)
    points = turned_points(matches, camera, scene_m)
    view = fitted(points, searched(points))
    _refuse_wrong_sense(recording, points, view)
    scale = odometer_scale(matcher, heading, pairs, view)
    if scale is not None and abs(scale - 1.0) < SCALE_WITHIN:
        points = points.scaled(scale)
        return _told(recording, points, fitted(points, view), turn * scale, scale)
    return _told(recording, points, view, turn, None)


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
    return _told(recording, points, view, 2.0 * np.pi, None, closed=True)


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


def _told(
    recording: Recording, points: TurnedPoints, view: View, turn: float, scale: float | None, closed: bool = False
) -> FieldOfView:
    """The answer, unless too few points agree with it."""
    agreeing = points.agreeing(view)
    if agreeing < LEAST_AGREEING:
        problem = f"only {100.0 * agreeing:.0f} % of what is seen twice moves as in a turn on the spot"
        raise InputError(recording.folder, problem, f"{HOW_TO}; look whether times of pictures and odometry agree")
    image = next(iter(recording)).images["rgb"]
    return FieldOfView(
        view.hfov_deg,
        spread(points, view),
        points.pairs,
        float(np.rad2deg(turn)),
        float(np.rad2deg(view.pitch)),
        float(np.rad2deg(view.roll)),
        agreeing,
        closed or scale is not None,
        scale,
        (image.shape[1], image.shape[0]),
        points,
        points.residuals(view),
    )
