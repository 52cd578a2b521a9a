"""Localization as a behaviour: answers at any time, and the same ones as a plain localizer. Nothing sleeps."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimators import BestMatch, ParticleFilter
from topoloc.behaviours import Engine, Localize, Position
from topoloc.errors import InputError, UnknownName
from topoloc.geometry import compose
from topoloc.interfaces import Estimator
from topoloc.localizer import Localizer
from topoloc.plugins import make_estimator
from topoloc.testing import evidence_for, toy_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image, Status

PATIENCE_S = 10.0
MAP = toy_map()
TRUTH = [np.array([0.4 * i, 0.1, 0.05 * i]) for i in range(8)]
BLIND = -1.0
"""An x that the eye reads as a covered camera."""


class TrueEye:
    """Evidence for the pose that stands in the picture's place."""

    needs = frozenset({"rgb"})

    def fit(self, topo_map: TopoMap) -> None:
        self.topo_map = topo_map

    def observe(self, frame: Frame) -> Evidence:
        pose = np.asarray(frame.images["rgb"]).view(np.float64).reshape(-1)
        return Evidence.blind() if pose[0] == BLIND else evidence_for(self.topo_map, pose)


class SlowEye(TrueEye):
    """Waits in ``observe`` until it is let go."""

    def __init__(self) -> None:
        self.busy, self.go_on = threading.Event(), threading.Event()

    def observe(self, frame: Frame) -> Evidence:
        self.busy.set()
        assert self.go_on.wait(PATIENCE_S)
        return super().observe(frame)


class Film:
    """Shows the next frame when it is let; a robot at rest shows the last one again."""

    def __init__(self, frames: Iterable[Frame]) -> None:
        self._frames = list(frames)
        self._shown = 0
        self._next = threading.Condition()

    def advance(self) -> None:
        with self._next:
            self._shown += 1
            self._next.notify_all()

    def look(self) -> Frame:
        with self._next:
            assert self._next.wait_for(lambda: self._shown > 0, PATIENCE_S)
            return self._frames[self._shown - 1]


def picture_of(pose: np.ndarray) -> Image:
    return np.ascontiguousarray(pose, dtype=np.float64).view(np.uint8).reshape(1, -1)


def frames(truth: Iterable[np.ndarray] = TRUTH) -> Iterator[Frame]:
    for i, pose in enumerate(truth):
        yield Frame(float(i), compose((5.0, 5.0, 1.0), pose), np.zeros(3), {"rgb": picture_of(pose)})


def wait_for(behaviour: Localize, moment: float) -> Position:
    return behaviour.wait(PATIENCE_S, after=moment - 0.5)


@pytest.fixture
def engine() -> Engine:
    return Engine(pause_s=0.0, patience_s=PATIENCE_S)


@pytest.mark.parametrize("name", ["activity", "particle", "grid", "best-match"])
def test_estimates_are_those_of_a_plain_localizer(name: str, engine: Engine) -> None:
    plain = Localizer(MAP, TrueEye(), make_estimator(name), rng=3)
    robot = Film(frames())
    behaviour = Localize(robot, MAP, TrueEye(), name, rng=3)
    with engine:
        engine.start(behaviour)
        for frame in frames():
            expected = plain.step(frame)
            robot.advance()
            position = wait_for(behaviour, frame.timestamp)
            assert position.timestamp == frame.timestamp
            found = position.estimate
            assert np.array_equal(found.covariance, expected.covariance)
            assert (found.node, found.probability, found.status) == (
                expected.node,
                expected.probability,
                expected.status,
            )
            assert found.pose == pytest.approx(expected.pose, abs=1e-12)  # a second look at one place is gated
            assert position.node == (None if expected.node is None else MAP.nodes[expected.node])


def test_before_the_first_look_there_is_no_position(engine: Engine) -> None:
    robot = Film(frames())
    behaviour = Localize(robot, MAP, TrueEye(), "particle")
    assert behaviour.position() is None
    with engine:
        engine.start(behaviour)
        assert behaviour.position() is None
        with pytest.raises(TimeoutError, match=r"no position within 0\.0 s; is Localize started"):
            behaviour.wait(0.0)
        robot.advance()
        assert behaviour.wait(PATIENCE_S).timestamp == 0.0


def test_until_a_look_says_something_it_is_lost(engine: Engine) -> None:
    robot = Film(frames([np.array([BLIND, 0.0, 0.0]), TRUTH[1]]))
    behaviour = Localize(robot, MAP, TrueEye(), "particle")
    with engine:
        engine.start(behaviour)
        robot.advance()
        first = wait_for(behaviour, 0.0)
        assert (first.node, first.estimate.node, first.estimate.status) == (None, None, Status.LOST)
        robot.advance()
        assert wait_for(behaviour, 1.0).node is not None


def test_answers_at_once_while_a_slow_sensor_looks(engine: Engine) -> None:
    robot, eye = Film(frames()), SlowEye()
    behaviour = Localize(robot, MAP, eye, ParticleFilter())
    with engine:
        engine.start(behaviour)
        robot.advance()
        assert eye.busy.wait(PATIENCE_S)
        assert behaviour.position() is None
        eye.go_on.set()
        first = wait_for(behaviour, 0.0)
        eye.go_on.clear()
        eye.busy.clear()
        robot.advance()
        assert eye.busy.wait(PATIENCE_S)  # the second update is under way, and stays so
        for _ in range(100):
            position = behaviour.position()
            assert position is not None and position.timestamp == first.timestamp
        eye.go_on.set()
        assert wait_for(behaviour, 1.0).timestamp == 1.0


def test_after_a_stop_the_last_position_stays_and_a_new_start_goes_on(engine: Engine) -> None:
    robot = Film(frames())
    behaviour = Localize(robot, MAP, TrueEye(), "particle")
    engine.start(behaviour)
    robot.advance()
    wait_for(behaviour, 0.0)
    engine.stop()
    last = behaviour.position()
    assert last is not None and last.timestamp == 0.0
    robot.advance()
    assert behaviour.position() is last
    with engine:
        engine.start(behaviour)
        assert wait_for(behaviour, 1.0).estimate.status is not Status.LOST


def test_the_same_frame_again_is_no_news() -> None:
    """A robot at rest may give one frame again and again; without an odometer nothing else would hold it back."""

    class Counting(TrueEye):
        looks = 0

        def observe(self, frame: Frame) -> Evidence:
            self.looks += 1
            return super().observe(frame)

    class Resting:
        def look(self) -> Frame:
            return replace(next(frames()), odometry=None)

    eye = Counting()
    behaviour = Localize(Resting(), MAP, eye, BestMatch())
    behaviour.init()
    for _ in range(5):
        assert behaviour.action()
    assert eye.looks == 1


def test_what_ends_it_reaches_whoever_asks(engine: Engine) -> None:
    class BrokenEye(TrueEye):
        def observe(self, frame: Frame) -> Evidence:
            raise ZeroDivisionError("in the sensor")

    robot = Film(frames())
    behaviour = Localize(robot, MAP, BrokenEye(), "particle")
    engine.start(behaviour)
    robot.advance()
    with pytest.raises(ZeroDivisionError):
        behaviour.wait(PATIENCE_S)
    with pytest.raises(ZeroDivisionError):
        behaviour.position()
    with pytest.raises(ZeroDivisionError):
        engine.stop()


def test_init_loads_the_map_and_makes_what_is_named(tmp_path: Path, engine: Engine) -> None:
    MAP.save(tmp_path / "map")
    robot = Film(frames())
    behaviour = Localize(robot, tmp_path / "map", TrueEye(), "voting")
    with engine:
        engine.start(behaviour)
        robot.advance()
        node = behaviour.wait(PATIENCE_S).node
        assert node is not None and node.id == "0-0"


@pytest.mark.parametrize(
    ("topo_map", "sensor", "estimator", "error"),
    [
        ("nowhere", "ima", "grid", InputError),
        (MAP, "imma", "grid", UnknownName),
        (MAP, "ima", "gridd", UnknownName),
    ],
)
def test_a_users_mistake_in_init_stays_one(
    topo_map: TopoMap | str, sensor: str, estimator: Estimator | str, error: type[Exception], engine: Engine
) -> None:
    behaviour = Localize(Film(frames()), topo_map, sensor, estimator)
    with pytest.raises(error):
        engine.run(behaviour, PATIENCE_S)
    with pytest.raises(error):
        behaviour.wait(PATIENCE_S)
