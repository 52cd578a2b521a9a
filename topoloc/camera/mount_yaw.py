"""The yaw of the camera on the robot, from drives straight ahead (ours).

While a robot drives, everything moves away from the point of the picture that the camera is moved towards. Its rotation
is known from the odometer; with the azimuth b and the slope s of a thing seen before and after, and d the direction of
travel, the epipolar constraint of motion in the plane is s1 sin(b2 - d) = s2 sin(b1 - d). Whether the camera moves
towards d or away from it is told by azimuths: they move away from d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from topoloc.camera.jackknife import jackknife
from topoloc.camera.level import View, turned
from topoloc.camera.matching import Matcher, Matches
from topoloc.camera.poses import poses_at_frames, refuse_panoramas
from topoloc.errors import InputError
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.going_through import Track, in_silence
from topoloc.recording import Recording
from topoloc.types import Ints

STEPS_M = (0.2, 0.4, 0.8)
"""Frames are paired that are about so far apart [m]."""
FARTHEST_M = 1.2
"""But no farther than this."""
STRAIGHT_RAD_PER_M = 0.35
"""A drive is straight that turns by no more than this for each metre [rad]."""
MOST_PAIRS = 120
HOW_TO = "drive straight ahead for some metres, slowly, past things one to five metres away, and record odometry"
"""What to do about a recording without a straight drive."""
LEAST_PAIRS = 5
YAWS = np.deg2rad(np.arange(-180.0, 180.0, 3.0))
"""Yaws that the search begins with [rad]."""
MOST = np.deg2rad(25.0)
"""Yaw and pitch stay so near to where a fit began [rad]."""
NOISE = 0.004
"""How exactly a keypoint is found [half-widths]."""
LEAST_GRADIENT = 0.02
"""A thing near the horizon and the direction of travel tells little: its error is taken over no less than this."""
LEAST_AWAY = 0.7
"""Share of the things that must move away from the direction of travel, rather than towards it."""
MOVES = 3.0
"""A thing tells towards or away that moved by so many times the noise."""


@dataclass(frozen=True)
class MountYaw:
    """What straight drives tell of how the camera sits on the robot.

    Attributes:
        yaw_deg: of the camera on the robot, degrees counter-clockwise: 90 looks to the left.
        sd_deg: its standard deviation, degrees; an error of the field of view is not in it.
        pairs: of frames that it comes from.
        driven_m: how far the robot drove in them [m].
        away: share of the things that move away from the direction of travel, as all should that stand still.
    """

    yaw_deg: float
    sd_deg: float
    pairs: int
    driven_m: float
    away: float


@dataclass(frozen=True)
class MovedPoints:
    """Points seen before and after steps of a robot.

    Attributes:
        before: (M, 2) in half-widths of the picture from its middle.
        after: (M, 2).
        turn: (M,) of the camera between the two [rad, counter-clockwise].
        direction: (M,) of the camera's way, from the robot's heading in the first [rad, counter-clockwise].
        pan: (M,) of the camera's head in the first [rad, counter-clockwise].
        pair: (M,) which pair of frames each is of, from 0 up, without gaps.
    """

    before: Floats
    after: Floats
    turn: Floats
    direction: Floats
    pan: Floats
    pair: Ints

    @property
    def pairs(self) -> int:
        """How many pairs of frames there are."""
        return int(self.pair.max(initial=-1)) + 1

    def of_pairs(self, kept: NDArray[np.bool_]) -> MovedPoints:
        """The points of some of the pairs (pairs,)."""
        chosen = kept[self.pair]
        return MovedPoints(
            self.before[chosen],
            self.after[chosen],
            self.turn[chosen],
            self.direction[chosen],
            self.pan[chosen],
            np.unique(self.pair[chosen], return_inverse=True)[1],
        )

    def bearings(self, view: View, yaw: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Azimuths from the direction of travel, before and after, and slopes, each (M,) [rad, clockwise; down]."""
        before, after = view.rays(self.before), turned(view.rays(self.after), -self.turn)
        ahead = yaw + self.pan - self.direction  # of the direction of travel, clockwise from the optical axis
        first, second = (np.arctan2(rays[:, 0], rays[:, 2]) - ahead for rays in (before, after))
        return first, second, before[:, 1], after[:, 1]

    def errors(self, view: View, yaw: float) -> Floats:
        """(M,) how far points are off their epipolar line, over what is to be expected (Sampson's distance)."""
        first, second, slope, slope_after = self.bearings(view, yaw)
        off = slope * np.sin(second) - slope_after * np.sin(first)
        by = (np.sin(second), np.sin(first), slope * np.cos(second), slope_after * np.cos(first))
        expected = np.sqrt(np.sum(np.square(by), axis=0) + LEAST_GRADIENT**2) * NOISE / view.focal
        return np.asarray(off / expected)

    def away(self, view: View, yaw: float) -> float:
        """Share of the things, of those that moved enough to tell, that moved away from the direction of travel."""
        first, second, _, _ = self.bearings(view, yaw)
        moved = wrap(second - first)
        tells = np.abs(moved) > MOVES * NOISE / view.focal
        return float((np.sign(moved) == np.sign(np.sin(first)))[tells].mean()) if tells.any() else 0.5


def searched(points: MovedPoints, view: View) -> float:
    """The yaw, of ``YAWS``, that fits best and has things move away [rad]."""
    costs = np.array([np.log1p(points.errors(view, float(yaw)) ** 2).mean() for yaw in YAWS])
    best = float(YAWS[costs.argmin()])
    return best if points.away(view, best) >= 0.5 else float(wrap(best + np.pi))


def fitted(points: MovedPoints, start: View, yaw: float) -> tuple[View, float]:
    """Pitch of the view and yaw that fit best, from a start: least squares with a Cauchy loss.

    The roll is taken for none: a drive hardly tells it from pitch where the camera looks aside.
    """

    def moved(change: Floats) -> tuple[View, float]:
        return replace(start, pitch=start.pitch + float(change[1])), yaw + float(change[0])

    found = least_squares(
        lambda change: points.errors(*moved(change)), np.zeros(2), loss="cauchy", x_scale=0.1, bounds=(-MOST, MOST)
    )
    return moved(found.x)


def estimate_mount_yaw(recording: Recording, track: Track = in_silence) -> MountYaw:
    """Measure the yaw of the camera where a recording drives straight ahead, or straight back.

    Args:
        recording: with ``rgb`` pictures, odometry and a camera whose field of view is told. The mount's place is taken
            as ``camera.toml`` tells it; what it tells of the yaw is not used.
        track: goes through pairs of frames.

    Raises:
        UserError: it tells no field of view, does not drive straight, or what is seen does not go with its drive.
    """
    refuse_panoramas(recording)
    if recording.camera is None:
        remedy = "write hfov_deg, width and height there; 'topoloc camera turn' measures them"
        raise InputError(recording.folder / "camera.toml", "tells no field of view", remedy)
    robot, mounts = poses_at_frames(recording)
    pan = wrap(mounts[:, 2] - np.deg2rad(recording.mount.yaw_deg))
    pairs = straight_pairs(robot)
    matcher = Matcher(recording)
    found = [matcher.match(*pairs[number]) for number in track(range(len(pairs)), "comparing pictures of the drive")]
    matches = [one for one in found if one is not None]
    if len(matches) < LEAST_PAIRS:
        problem = f"{len(pairs)} pairs of frames of a straight drive, of which {len(matches)} show the same things"
        raise InputError(recording.folder, problem, HOW_TO)
    points = moved_points(matches, robot, pan, recording)
    level = View.of(recording.camera.hfov_deg)
    view, yaw = fitted(points, level, searched(points, level))
    away = points.away(view, yaw)
    if away < LEAST_AWAY:
        problem = f"only {100.0 * away:.0f} % of what is seen twice moves as on a straight drive"
        raise InputError(recording.folder, problem, f"{HOW_TO}; look at hfov_deg, and whether times agree")
    apart = jackknife(points.pairs, lambda kept: float(wrap(fitted(points.of_pairs(kept), view, yaw)[1] - yaw)))
    driven = _driven(robot, [(one.first, one.second) for one in matches])
    return MountYaw(float(np.rad2deg(wrap(yaw))), float(np.rad2deg(apart)), points.pairs, driven, away)


def straight_pairs(robot: Floats) -> list[tuple[int, int]]:
    """Pairs of frames between which the robot, with poses (N, 3), drove straight, by ``STEPS_M``."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(robot[:, :2], axis=0), axis=1))])
    heading = np.unwrap(robot[:, 2])
    bend = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(heading)))])
    pairs: list[tuple[int, int]] = []
    key = 0
    while key < len(way) - 1:
        ahead = np.searchsorted(way, [way[key] + step for step in STEPS_M])
        for other in dict.fromkeys(int(one) for one in ahead if one < len(way)):
            driven, turned_by = way[other] - way[key], bend[other] - bend[key]
            if driven <= FARTHEST_M and turned_by <= STRAIGHT_RAD_PER_M * driven:
                pairs.append((key, other))
        key = max(key + 1, int(np.searchsorted(way, way[key] + 0.5 * STEPS_M[0])))
    return pairs[:: -(-len(pairs) // MOST_PAIRS)] if pairs else []


def moved_points(matches: Sequence[Matches], robot: Floats, pan: Floats, recording: Recording) -> MovedPoints:
    """Points that frames have in common, and how the camera went between them.

    Args:
        matches: of pairs of frames.
        robot: (N, 3) poses of the robot.
        pan: (N,) of the camera's head [rad].
        recording: of whose mount the place is used.
    """
    place = compose(robot, [recording.mount.x, recording.mount.y, 0.0])
    first, second = np.array([(one.first, one.second) for one in matches]).T
    steps = between(place[first], place[second])
    pair = np.repeat(np.arange(len(matches)), [len(one.before) for one in matches])
    return MovedPoints(
        np.concatenate([one.before for one in matches]),
        np.concatenate([one.after for one in matches]),
        (steps[:, 2] + wrap(pan[second] - pan[first]))[pair],
        np.arctan2(steps[:, 1], steps[:, 0])[pair],
        pan[first][pair],
        pair,
    )


def _driven(robot: Floats, pairs: Sequence[tuple[int, int]]) -> float:
    """How far a robot with poses (N, 3) drove in the frames that pairs cover [m]."""
    covered = np.zeros(len(robot) - 1, dtype=bool)
    for first, second in pairs:
        covered[first:second] = True
    return float(np.linalg.norm(np.diff(robot[:, :2], axis=0), axis=1)[covered].sum())
