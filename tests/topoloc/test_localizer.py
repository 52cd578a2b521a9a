"""The one step, with a sensor and an estimator that write down what they are asked."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from topoloc.errors import InputError, UnreadableImage, UserError
from topoloc.estimate import SURPRISE, EstimateRule
from topoloc.geometry import compose, inverse
from topoloc.localizer import Localizer
from topoloc.odometry import MotionGate, OdometryNoise
from topoloc.recording import LazyImages
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Estimate, Evidence, Frame, Image, Motion, Status, WeightedPoses

THE_MAP = TopoMap("toy", Camera(), tuple(Node(str(i), "", float(i), 0.0) for i in range(3)))
PICTURE: Image = np.full((4, 4), 7, dtype=np.uint8)


class FakeSensor:
    """Says that the camera is at ``pose``; blind for a black picture."""

    needs = frozenset({"rgb"})

    def __init__(self, calls: list[str], pose: tuple[float, float, float] = (1.0, 0.0, 0.5)) -> None:
        self.calls, self.pose, self.fitted = calls, pose, 0

    def fit(self, topo_map: TopoMap) -> None:
        self.calls.append("fit")

    def observe(self, frame: Frame) -> Evidence:
        if not frame.images["rgb"].any():
            return Evidence.blind()
        self.calls.append("observe")
        one = np.ones(1)
        return Evidence(np.array([self.pose]), np.array([1]), 0.8 * one, 0.2 * one, 0.0 * one, 0.3 * one, 20.0 * one)


class FakeEstimator:
    """Believes the last evidence, carried by every motion since."""

    def __init__(self, calls: list[str], log_evidence: float | None = None) -> None:
        self.calls, self.log_evidence = calls, log_evidence
        self.motions: list[Motion] = []
        self.evidences: list[Evidence] = []

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        self.calls.append("reset")
        self.draw, self.prior = rng.random(), prior
        self._pose = np.zeros(3)

    def predict(self, motion: Motion) -> None:
        self.calls.append("predict")
        self.motions.append(motion)
        self._pose = compose(self._pose, motion.delta)

    def update(self, evidence: Evidence) -> float | None:
        self.calls.append("update")
        self.evidences.append(evidence)
        if not evidence.is_blind:
            self._pose = evidence.poses[0]
        return self.log_evidence

    @property
    def belief(self) -> WeightedPoses:
        return WeightedPoses.uniform(self._pose[None], (0.1, 0.1, 0.1))


def frame(
    time: float,
    odometry: tuple[float, float, float] | None = (0.0, 0.0, 0.0),
    images: Mapping[str, Image] | None = None,
    camera: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Frame:
    pose = None if odometry is None else np.array(odometry)
    return Frame(time, pose, np.array(camera), {"rgb": PICTURE} if images is None else images)


@pytest.fixture
def calls() -> list[str]:
    return []


def localizer_of(calls: list[str], **options: object) -> tuple[Localizer, FakeSensor, FakeEstimator]:
    sensor, estimator = FakeSensor(calls), FakeEstimator(calls)
    return Localizer(THE_MAP, sensor, estimator, **options), sensor, estimator  # type: ignore[arg-type]


def test_the_order_of_a_step(calls: list[str]) -> None:
    localizer, _, estimator = localizer_of(calls)
    assert sorted(calls) == ["fit", "reset"]
    calls.clear()
    localizer.step(frame(0.0))
    assert calls == ["observe", "update"]
    calls.clear()
    estimate = localizer.step(frame(1.0, (0.5, 0.0, 0.0)))
    assert [call for call in calls if call != "observe"] == ["predict", "update"]
    assert estimator.motions[0].delta == pytest.approx([0.5, 0.0, 0.0])
    assert localizer.last is not None
    assert (localizer.last.kind, localizer.last.timestamp, localizer.last.problem) == ("update", 1.0, "")
    assert localizer.last.estimate is estimate
    assert estimate.node == 1
    assert localizer.last.match == pytest.approx(0.8)


class TestGate:
    def test_frames_within_the_gate_ride_on_the_odometry(self, calls: list[str]) -> None:
        localizer, _, _ = localizer_of(calls)
        first = localizer.step(frame(0.0, (4.0, 4.0, np.pi / 2)))
        calls.clear()
        riding = localizer.step(frame(1.0, (4.0, 4.2, np.pi / 2 + 0.1)))
        assert calls == []
        assert localizer.last is not None
        assert (localizer.last.kind, localizer.last.evidence, localizer.last.match) == ("gated", None, None)
        assert riding.pose == pytest.approx(compose(first.pose, (0.2, 0.0, 0.1)))
        assert (riding.node, riding.status) == (first.node, first.status)

    def test_motions_within_the_gate_are_not_lost_and_not_counted_twice(self, calls: list[str]) -> None:
        localizer, _, estimator = localizer_of(calls)
        poses = [0.0, 0.1, 0.2, 0.29, 0.31, 0.4, 0.62]
        for time, x in enumerate(poses):
            localizer.step(frame(float(time), (x, 0.0, 0.0)))
        assert [motion.delta[0] for motion in estimator.motions] == pytest.approx([0.31, 0.31])

    def test_a_gated_frames_picture_is_not_even_read(self, calls: list[str]) -> None:
        localizer, _, _ = localizer_of(calls)
        localizer.step(frame(0.0))

        def refuse() -> Image:
            raise AssertionError("read")

        localizer.step(frame(1.0, (0.1, 0.0, 0.0), LazyImages({"rgb": refuse})))
        assert localizer.last is not None and localizer.last.kind == "gated"

    def test_pictures_are_not_kept(self, calls: list[str]) -> None:
        localizer, _, _ = localizer_of(calls)
        images = LazyImages({"rgb": lambda: PICTURE})
        still_there = weakref.ref(images)
        localizer.step(frame(0.0, images=images))
        del images
        gc.collect()
        assert still_there() is None

    def test_a_pan_turn_opens_it(self, calls: list[str]) -> None:
        localizer, _, estimator = localizer_of(calls)
        localizer.step(frame(0.0))
        localizer.step(frame(1.0, camera=(0.0, 0.0, np.deg2rad(10.0))))
        assert localizer.last is not None and localizer.last.kind == "update"
        assert estimator.motions[0].delta == pytest.approx(np.zeros(3))

    def test_its_limits_can_be_set(self, calls: list[str]) -> None:
        localizer, _, _ = localizer_of(calls, gate=MotionGate(90.0, 5.0))
        for time in range(3):
            localizer.step(frame(float(time), (2.0 * time, 0.0, 0.0)))
        assert calls.count("update") == 1


class TestWithoutOdometry:
    def test_every_frame_is_looked_at_after_a_motion_of_zero(self, calls: list[str]) -> None:
        noise = OdometryNoise(unknown_distance=0.6, unknown_heading=0.7)
        localizer, _, estimator = localizer_of(calls, noise=noise)
        for time in range(3):
            localizer.step(frame(float(time), None))
        assert calls.count("update") == 3
        for motion in estimator.motions:
            assert np.array_equal(motion.delta, np.zeros(3))
            assert np.diag(motion.covariance) == pytest.approx([0.36, 0.36, 0.49])

    @pytest.mark.parametrize("readings", [((0.0, 0.0, 0.0), None), (None, (0.0, 0.0, 0.0))])
    def test_an_odometer_that_comes_or_goes(
        self, readings: tuple[tuple[float, float, float] | None, ...], calls: list[str]
    ) -> None:
        localizer, _, estimator = localizer_of(calls)
        for time, reading in enumerate(readings):
            localizer.step(frame(float(time), reading))
        assert calls.count("update") == 2
        assert estimator.motions[0].covariance[0, 0] == pytest.approx(OdometryNoise().unknown_distance ** 2)


class TestBlindFrames:
    @staticmethod
    def unreadable() -> LazyImages:
        def read() -> Image:
            raise UnreadableImage(Path("x.png"), "does not decode", "save it again")

        return LazyImages({"rgb": read})

    def test_an_unreadable_image_is_a_blind_frame_and_the_run_goes_on(self, calls: list[str]) -> None:
        localizer, _, estimator = localizer_of(calls)
        localizer.step(frame(0.0))
        localizer.step(frame(1.0, (0.5, 0.0, 0.0), self.unreadable()))
        assert localizer.last is not None and localizer.last.evidence is not None
        assert (localizer.last.kind, localizer.last.evidence.is_blind) == ("unreadable", True)
        assert localizer.last.problem == "x.png: does not decode; save it again"
        assert estimator.evidences[1].is_blind and len(estimator.motions) == 1
        localizer.step(frame(2.0, (1.0, 0.0, 0.0)))
        assert localizer.last.kind == "update"
        assert [motion.delta[0] for motion in estimator.motions] == pytest.approx([0.5, 0.5])

    def test_a_missing_kind_of_image_is_named(self, calls: list[str]) -> None:
        localizer, _, estimator = localizer_of(calls)
        localizer.step(frame(0.0, images={"omni": PICTURE}))
        assert localizer.last is not None
        assert (localizer.last.kind, localizer.last.problem) == ("unreadable", "no rgb image")
        assert estimator.evidences[0].is_blind

    def test_a_flat_picture_is_blind_without_a_problem(self, calls: list[str]) -> None:
        localizer, _, _ = localizer_of(calls)
        localizer.step(frame(0.0, images={"rgb": np.zeros((4, 4), np.uint8)}))
        assert localizer.last is not None
        assert (localizer.last.kind, localizer.last.problem, localizer.last.match) == ("blind", "", None)

    def test_another_mistake_of_the_user_stops_the_run(self, calls: list[str]) -> None:
        def read() -> Image:
            raise InputError(Path("rgb.txt"), "another aspect ratio", "crop", line=3)

        localizer, _, _ = localizer_of(calls)
        with pytest.raises(UserError, match="line 3"):
            localizer.step(frame(0.0, images=LazyImages({"rgb": read})))


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (0.2, 0.1, np.pi / 2), (-0.3, 0.0, -3.0)])
def test_the_mount_is_taken_out_of_the_evidence_once(mount: tuple[float, float, float], calls: list[str]) -> None:
    localizer, sensor, estimator = localizer_of(calls)
    localizer.step(frame(0.0, camera=mount))
    expected = compose(sensor.pose, inverse(mount))
    assert estimator.evidences[0].poses[0] == pytest.approx(expected)
    assert compose(estimator.evidences[0].poses[0], mount) == pytest.approx(np.array(sensor.pose))
    assert localizer.last is not None and localizer.last.evidence is estimator.evidences[0]
    assert localizer.last.estimate.pose == pytest.approx(expected)


def test_seed_and_prior_reach_the_estimator(calls: list[str]) -> None:
    prior = WeightedPoses.uniform(np.ones((1, 3)))
    _, _, first = localizer_of(calls, rng=5, prior=prior)
    _, _, second = localizer_of(calls, rng=np.random.default_rng(5))
    _, _, third = localizer_of(calls, rng=6)
    assert first.draw == second.draw != third.draw
    assert first.prior is prior and second.prior is None


class TestLogEvidence:
    def probability_after(self, log_evidences: Sequence[float | None], rule: EstimateRule | None = None) -> float:
        class Ruled(FakeEstimator):
            estimate_rule = rule or EstimateRule()

            @property
            def belief(self) -> WeightedPoses:
                return WeightedPoses(np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.log([0.2, 0.8]))

        estimator = Ruled([])
        localizer = Localizer(THE_MAP, FakeSensor([]), estimator)
        for time, value in enumerate(log_evidences):
            estimator.log_evidence = value
            estimate = localizer.step(frame(float(time), (float(time), 0.0, 0.0)))
        return estimate.probability

    def test_no_evidence_ratio_leaves_the_belief_at_its_word(self) -> None:
        assert self.probability_after([None, None]) == pytest.approx(0.8)

    def test_the_running_mean_forgets(self) -> None:
        rule = EstimateRule(evidence_gain=1.0, evidence_memory=0.5)
        running = 0.5 * (0.5 * 0.0 + 0.5 * -2.0) + 0.5 * -1.0
        expected = 1.0 / (1.0 + np.exp(-(np.log(4.0) + running)))
        assert self.probability_after([-2.0, -1.0], rule) == pytest.approx(expected)

    def test_an_impossible_look_is_not_remembered_for_ever(self) -> None:
        rule = EstimateRule(evidence_gain=0.3)
        assert self.probability_after([-np.inf], rule) == pytest.approx(self.probability_after([SURPRISE], rule))
        assert self.probability_after([-np.inf], rule) < 0.5
        assert self.probability_after([-np.inf] + [0.0] * 30, rule) > 0.75

    def test_a_class_may_carry_its_own_rule(self) -> None:
        strict = EstimateRule(bias=-10.0)
        assert self.probability_after([None], strict) < 0.01


def test_the_status_is_read_off_the_estimate(calls: list[str]) -> None:
    localizer, _, _ = localizer_of(calls)
    assert localizer.step(frame(0.0)).status is Status.LOCALIZED


class FakeUpkeep:
    """Writes down what it is shown."""

    topo_map = THE_MAP
    before: Mapping[int, Image] = {}

    def __init__(self) -> None:
        self.shown: list[tuple[Frame, Estimate, Evidence]] = []

    def after(self, frame: Frame, estimate: Estimate, evidence: Evidence) -> None:
        self.shown.append((frame, estimate, evidence))


def test_the_upkeep_is_shown_each_update_and_nothing_else(calls: list[str]) -> None:
    upkeep = FakeUpkeep()
    localizer, _, _ = localizer_of(calls, upkeep=upkeep)
    frames = {
        "update": frame(0.0),
        "gated": frame(1.0, (0.1, 0.0, 0.0)),
        "blind": frame(2.0, (0.5, 0.0, 0.0), {"rgb": np.zeros((4, 4), np.uint8)}),
        "unreadable": frame(3.0, (1.0, 0.0, 0.0), {"omni": PICTURE}),
    }
    for kind, one in frames.items():
        estimate = localizer.step(one)
        assert localizer.last is not None and localizer.last.kind == kind
        if kind == "update":
            first = (estimate, localizer.last.evidence)
    ((seen, *told),) = upkeep.shown
    assert seen is frames["update"] and seen.images["rgb"] is PICTURE
    assert told[0] is first[0] and told[1] is first[1]
