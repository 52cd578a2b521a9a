"""Active localization (second seed, section 4): look next where a look tells most, until the robot is localized.

The map's own views stand for what a robot may come to see: a sensor looks at each of them once, as at a frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from topoloc.errors import UserError
from topoloc.geometry import Floats, compose, wrap
from topoloc.interfaces import Sensor
from topoloc.localizer import Localizer
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Evidence, Frame, Image, Ints, Status, WeightedPoses

ORIENTATIONS = 22
"""Different orientations of the camera (second seed, 6.1)."""
VIEW_STEP_DEG = 15.0
"""Where a map has panoramas only, a view is cut from each of them every so many degrees."""


@dataclass(frozen=True)
class Action:
    """What a robot can do before it looks again: drive, turn, point its camera.

    Attributes:
        motion: (3,) relative pose of the robot, in its own frame before the action [m, m, rad].
        camera: (3,) pose of the camera on the robot after the action, pan included [m, m, rad].
    """

    motion: Floats
    camera: Floats

    def __post_init__(self) -> None:
        for name in ("motion", "camera"):
            pose = np.array(getattr(self, name), dtype=np.float64)
            if pose.shape != (3,) or not np.isfinite(pose).all():
                raise ValueError(f"{name} is {pose}; it must be three finite numbers")
            pose.setflags(write=False)
            object.__setattr__(self, name, pose)


def orientations(count: int = ORIENTATIONS) -> Floats:
    """Angles (count,) at equal distances around the circle, the first straight ahead [rad]."""
    return wrap(np.arange(count) * 2.0 * np.pi / count)


def pans(angles: ArrayLike | None = None, camera: ArrayLike = (0.0, 0.0, 0.0)) -> list[Action]:
    """What a standing robot with a pan head can do.

    Args:
        angles: (A,) of the head [rad, ccw]: those that it reaches; None: ``orientations()``.
        camera: (3,) pose of the camera on the robot at pan 0; the head turns on the spot.
    """
    mount, angle = np.asarray(camera, dtype=np.float64), orientations() if angles is None else np.asarray(angles)
    return [Action(np.zeros(3), np.array([mount[0], mount[1], float(wrap(mount[2] + pan))])) for pan in angle]


def turns(angles: ArrayLike | None = None, camera: ArrayLike = (0.0, 0.0, 0.0)) -> list[Action]:
    """What a robot without a pan head can do: turn in place.

    Args:
        angles: (A,) to turn by [rad, ccw]; None: ``orientations()``.
        camera: (3,) pose of the camera on the robot.
    """
    angle = orientations() if angles is None else np.asarray(angles)
    return [Action(np.array([0.0, 0.0, turn]), np.asarray(camera)) for turn in angle]


class ActionSelection(Protocol):
    """Chooses what to do next, such as ``estimators.action.LeastEntropy``."""

    def choose(self, belief: WeightedPoses, actions: Sequence[Action]) -> int:
        """Index of the best of one or more actions, for a robot of which ``belief`` is known."""


class Robot(Protocol):
    """A robot that can be told where to look, real or simulated."""

    def look(self, action: Action) -> Frame:
        """Carry out the action, and take a frame there."""


@dataclass(frozen=True)
class ViewEvidence:
    """What a sensor says of each of V views of a map: M hypotheses in all, each of them one view's.

    Attributes:
        view: (M,) index of the view that a hypothesis belongs to.
        poses: (M, 3) hypotheses of the camera's pose.
        log_likelihoods, sigma, kappa: (M,) as in ``Evidence``.
        log_floors: (V,) as in ``Evidence``; 0 for a view that is blind, whose likelihood is 1 everywhere.
        weights: (V,) how much each view counts.
    """

    view: Ints
    poses: Floats
    log_likelihoods: Floats
    sigma: Floats
    kappa: Floats
    log_floors: Floats
    weights: Floats

    @classmethod
    def of(cls, evidences: Sequence[Evidence], poses: ArrayLike) -> ViewEvidence:
        """Put together what a sensor said of views.

        A view counts the less, the more views stand around it, so that a corner photographed twice changes nothing.

        Args:
            evidences: V of them, one or more, about the camera.
            poses: (V, 3) where the views were taken.

        Raises:
            ValueError: there is no view.
        """
        if not evidences:
            raise ValueError("there must be evidence of one view at least")
        parts = {
            name: np.concatenate([getattr(evidence, name) for evidence in evidences])
            for name in ("poses", "log_likelihoods", "sigma", "kappa")
        }
        view = np.repeat(np.arange(len(evidences)), [len(evidence.poses) for evidence in evidences])
        log_floors = np.array([0.0 if evidence.is_blind else evidence.log_floor for evidence in evidences])
        own = np.asarray(poses, dtype=np.float64)
        return cls(view, **parts, log_floors=log_floors, weights=_thinness(own, parts["sigma"], parts["kappa"]))


def view_evidence(topo_map: TopoMap, sensor: Sensor, camera: ArrayLike = (0.0, 0.0, 0.0)) -> ViewEvidence:
    """Let a sensor look at the map's views, or at windows cut from its panoramas, as at frames of a robot.

    Args:
        topo_map: with training views or panoramas.
        sensor: fitted to the map.
        camera: (3,) pose of the camera on the robot, at pan 0 if it has a head. Of a sensor that matches panoramas,
            the evidence is exact for a robot that turns or whose camera stands on its axis; a head that turns a camera
            elsewhere displaces it by at most twice the camera's distance from the axis.

    Raises:
        UserError: the map has neither, or the sensor needs images that a map does not hold.
    """
    seen = list(_views_as_frames(topo_map, np.asarray(camera, dtype=np.float64)))
    if not seen:
        raise UserError(f"map {topo_map.name!r} has neither training views nor panoramas to look at; add either")
    missing = sensor.needs - frozenset(seen[0][1].images)
    if missing:
        raise UserError(
            f"map {topo_map.name!r} has no {', '.join(sorted(missing))} images to foretell looks from; take a sensor "
            "that needs rgb images only"
        )
    return ViewEvidence.of([sensor.observe(frame) for _, frame in seen], [pose for pose, _ in seen])


class ActiveLocalizer:
    """A localizer that says where to look next.

    No direction is looked at twice from one place: the same picture again is no news, though an estimator would take
    it for some.

    Args:
        localizer: takes in the frames; its motion gate tells which looks are the same.
        selection: chooses among the actions.
        actions: what the robot can do at any time; of equally good ones the first is taken, as a rule.
    """

    def __init__(self, localizer: Localizer, selection: ActionSelection, actions: Sequence[Action]) -> None:
        self.localizer, self.selection, self.actions = localizer, selection, tuple(actions)
        self._looks: list[tuple[Floats, Floats]] = []  # odometer and camera poses of the looks from here, oldest first
        self._status: Status | None = None

    def step(self, frame: Frame) -> Estimate:
        """Take in one frame, however it came about: where the robot is now."""
        estimate = self.localizer.step(frame)
        odometry = np.zeros(3) if frame.odometry is None else frame.odometry  # without an odometer: it stands
        near = self.localizer.gate.min_translation_m
        self._looks = [look for look in self._looks if np.linalg.norm(look[0][:2] - odometry[:2]) < near]
        self._looks.append((odometry, frame.camera))
        self._status = estimate.status
        return estimate

    def next_action(self) -> Action | None:
        """What to do before the next look; None where the robot is localized or every look was taken already."""
        fresh = [action for action in self.actions if self._is_fresh(action)]
        if self._status is Status.LOCALIZED or not fresh:
            return None
        return fresh[self.selection.choose(self.localizer.estimator.belief, fresh)]

    def run(self, robot: Robot, frame: Frame, most_looks: int = ORIENTATIONS) -> Estimate:
        """Look until LOCALIZED.

        Args:
            robot: does what it is told.
            frame: what it sees now.
            most_looks: give up after so many, the first included.

        Returns:
            The last estimate; its status tells how it ended.
        """
        estimate = self.step(frame)
        for _ in range(most_looks - 1):
            action = self.next_action()
            if action is None:
                break
            estimate = self.step(robot.look(action))
        return estimate

    def _is_fresh(self, action: Action) -> bool:
        """Whether an action opens the motion gate towards every look from here."""
        if not self._looks:
            return True
        reached = compose(self._looks[-1][0], action.motion)
        return all(
            self.localizer.gate.opens(odometry, camera, reached, action.camera) for odometry, camera in self._looks
        )


def _views_as_frames(topo_map: TopoMap, camera: Floats) -> Iterator[tuple[Floats, Frame]]:
    """Pose (3,) and frame of each training view; where there is none, of windows of the panoramas."""
    empty = Frame(0.0, None, camera, {})
    for view in topo_map.views:
        right = {} if view.right is None else {"right": view.right}
        yield view.pose, replace(empty, images={"rgb": view.image, **right})
    if topo_map.views:
        return
    for node in topo_map.nodes:
        panorama = node.panorama  # once: it may have to be decoded
        if panorama is not None:
            for window, axis in _windows(panorama, topo_map.camera.hfov_deg):
                pose = np.array([node.x, node.y, float(wrap(node.heading - axis))])
                yield pose, replace(empty, images={"rgb": window})


def _windows(panorama: Image, hfov_deg: float) -> Iterator[tuple[Image, float]]:
    """Windows of a panorama, one frame wide, and how far clockwise of its first column their middles are [rad]."""
    columns = panorama.shape[1]
    width = round(columns * hfov_deg / 360.0)
    for start in np.arange(0.0, 360.0, VIEW_STEP_DEG):
        left = round(start / 360.0 * columns)
        window = np.take(panorama, np.arange(left, left + width), axis=1, mode="wrap")
        yield window, (left + width / 2.0) * 2.0 * np.pi / columns


def _thinness(poses: Floats, sigma: Floats, kappa: Floats) -> Floats:
    """Weights (V,) of views at poses (V, 3): one by how many stand around, itself included (ours).

    Args:
        poses: of the camera.
        sigma: (M,) of the hypotheses that the views make [m]; its median says how far around reaches.
        kappa: (M,) alike.
    """
    if not len(sigma):
        return np.ones(len(poses))
    squared = (poses[:, :1] - poses[:, 0]) ** 2 + (poses[:, 1:2] - poses[:, 1]) ** 2
    turned = np.cos(poses[:, 2:] - poses[:, 2]) - 1.0
    around = np.exp(-squared / (2.0 * np.median(sigma) ** 2) + np.median(kappa) * turned).sum(axis=1)
    return np.asarray(1.0 / around)
