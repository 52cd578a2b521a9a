"""Tests of the contract tests: they pass a sound class and say what is wrong with a broken one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from topoloc.geometry import compose
from topoloc.testing import check_estimator, check_sensor, evidence_for, toy_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Motion, WeightedPoses


class Sound:
    """A small grid of poses on the nodes: enough of a Bayes filter to keep every promise."""

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        self.rng, self.topo_map = rng, topo_map
        headings = np.linspace(-np.pi, np.pi, 8, endpoint=False)
        self.poses = np.array([(x, y, heading) for x, y in topo_map.positions for heading in headings])
        self.logs = np.zeros(len(self.poses))
        if prior is not None:
            self.poses, self.logs = np.array(prior.poses), np.array(prior.log_weights)

    def predict(self, motion: Motion) -> None:
        self.poses = compose(self.poses, motion.delta)
        away = self.topo_map.positions.mean(axis=0) - self.poses[:, :2]
        self.poses[:, :2] += np.where(np.linalg.norm(away, axis=1)[:, None] > 4.0, away, 0.0)

    def update(self, evidence: Evidence) -> float | None:
        if evidence.is_blind:
            return None
        ratio = np.array([evidence.log_likelihood(pose[None, :2], pose[None, 2:])[0, 0] for pose in self.poses])
        if np.isfinite(self.logs + ratio).any():
            self.logs = self.logs + ratio - (self.logs + ratio).max()
        return 0.0

    @property
    def belief(self) -> WeightedPoses:
        return WeightedPoses(self.poses, self.logs, np.full(3, 0.01))


def test_a_sound_estimator_passes() -> None:
    check_estimator(Sound)
    check_estimator(Sound, toy_map(4, 1), seed=3)


class NoPredict:
    reset, update, belief = Sound.reset, Sound.update, Sound.belief


class ArrayBelief(Sound):
    @property
    def belief(self) -> WeightedPoses:
        return self.poses  # type: ignore[return-value]


class HeadingsRunAway(Sound):
    def predict(self, motion: Motion) -> None:
        self.poses = self.poses + motion.delta


class HasAnOpinionWhenBlind(Sound):
    def update(self, evidence: Evidence) -> float | None:
        return 0.0 if evidence.is_blind else super().update(evidence)


class NaNEvidence(Sound):
    def update(self, evidence: Evidence) -> float | None:
        return None if evidence.is_blind else float("nan")


class OwnDice(Sound):
    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        super().reset(topo_map, rng, prior)
        self.poses[:, :2] += np.random.default_rng().normal(0.0, 0.1, (len(self.poses), 2))


class FirstHypothesisWins(Sound):
    def update(self, evidence: Evidence) -> float | None:
        if evidence.is_blind:
            return None
        self.poses, self.logs = np.array(evidence.poses[:1]), np.zeros(1)
        return 0.0


class Deaf(Sound):
    """Takes in nothing at all."""

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        super().reset(topo_map, rng)

    def predict(self, motion: Motion) -> None:
        pass

    def update(self, evidence: Evidence) -> float | None:
        return None


class Stubborn(Sound):
    def update(self, evidence: Evidence) -> float | None:
        return None


class Backwards(Sound):
    def predict(self, motion: Motion) -> None:
        super().predict(Motion(-motion.delta, motion.covariance))


class OverflowingWeights(Sound):
    def update(self, evidence: Evidence) -> float | None:
        if evidence.is_blind:
            return None
        ratio = evidence.log_likelihood(self.poses[:, :2], self.poses[:, 2:])
        with np.errstate(all="ignore"):
            self.logs = np.log(np.exp(self.logs) * np.exp(ratio[:, 0]))
        return 0.0


class ForgetsItsMap(Sound):
    """Keeps what it learnt in the class instead of the instance."""

    memory: np.ndarray | None = None

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        super().reset(topo_map, rng, prior)
        if ForgetsItsMap.memory is not None and prior is None:
            self.logs = ForgetsItsMap.memory

    def update(self, evidence: Evidence) -> float | None:
        result = super().update(evidence)
        if len(self.logs) > 1:
            ForgetsItsMap.memory = self.logs
        return result


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        (NoPredict, "lacks predict"),
        (ArrayBelief, "must be WeightedPoses after reset"),
        (HeadingsRunAway, r"headings must lie in \[-pi, pi\)"),
        (HasAnOpinionWhenBlind, "None for a blind frame"),
        (NaNEvidence, "NaN after"),
        (OwnDice, "same seed"),
        (FirstHypothesisWins, "order of hypotheses"),
        (ForgetsItsMap, "same seed"),
        (Deaf, "a prior of one pose"),
        (Stubborn, "make that node lead"),
        (Backwards, "move the belief along its heading"),
    ],
)
def test_a_broken_estimator_is_told_what_is_wrong(broken: Callable[[], object], says: str) -> None:
    with pytest.raises(AssertionError, match=says):
        check_estimator(broken)  # type: ignore[arg-type]


def test_weights_that_overflow_do_not_pass() -> None:
    """WeightedPoses itself refuses them."""
    with pytest.raises((AssertionError, ValueError), match=r"finite|overflow"):
        check_estimator(OverflowingWeights)


FRAMES = [
    Frame(float(i), None, np.zeros(3), {"rgb": np.random.default_rng(i).integers(0, 256, (6, 8, 3)).astype(np.uint8)})
    for i in range(3)
]


class SoundSensor:
    """Brightness tells the place: silly, but it keeps every promise."""

    needs = frozenset({"rgb"})

    def fit(self, topo_map: TopoMap) -> None:
        self.topo_map = topo_map

    def observe(self, frame: Frame) -> Evidence:
        image = frame.images["rgb"]
        if image.reshape(-1, *image.shape[2:]).std(axis=0).max() < 1.0:
            return Evidence.blind()
        return evidence_for(self.topo_map, (float(image.mean()) / 64.0, 0.0, 0.0))


def test_a_sound_sensor_passes() -> None:
    check_sensor(SoundSensor(), toy_map(), FRAMES)


class NoFit:
    needs, observe = SoundSensor.needs, SoundSensor.observe


class NeedsAList(SoundSensor):
    needs = ["rgb"]  # type: ignore[assignment]  # noqa: RUF012


class Changed(SoundSensor):
    """Evidence with one field spoilt."""

    field, value = "match", 1.5

    def observe(self, frame: Frame) -> Evidence:
        evidence = super().observe(frame)
        if evidence.is_blind:
            return evidence
        spoilt: dict[str, Any] = {self.field: np.full(len(evidence.poses), self.value)}
        return replace(evidence, **spoilt)


class MatchAboveOne(Changed):
    pass


class MatchBelowZero(Changed):
    value = -0.1


class NaNMatch(Changed):
    value = float("nan")


class NodeBeyondTheMap(Changed):
    field, value = "nodes", 99


class NegativeDistance(Changed):
    field, value = "distance", -1.0


class NaNDistance(Changed):
    field, value = "distance", float("nan")


class ZeroLikelihood(SoundSensor):
    def observe(self, frame: Frame) -> Evidence:
        evidence = super().observe(frame)
        if evidence.is_blind:
            return evidence
        return replace(evidence, log_likelihoods=np.full(len(evidence.poses), -np.inf), log_floor=-np.inf)


class Moody(SoundSensor):
    calls = 0

    def observe(self, frame: Frame) -> Evidence:
        self.calls += 1
        evidence = super().observe(frame)
        return evidence if evidence.is_blind else replace(evidence, match=evidence.match * 0.9**self.calls)


class MovesAbout(SoundSensor):
    """The matches stay, the poses do not."""

    calls = 0

    def observe(self, frame: Frame) -> Evidence:
        self.calls += 1
        evidence = super().observe(frame)
        return evidence if evidence.is_blind else replace(evidence, poses=evidence.poses + float(self.calls))


class AlwaysBlind(SoundSensor):
    def observe(self, frame: Frame) -> Evidence:
        return Evidence.blind()


class AlwaysTheSame(SoundSensor):
    def observe(self, frame: Frame) -> Evidence:
        evidence = super().observe(frame)
        return evidence if evidence.is_blind else evidence_for(self.topo_map, (1.0, 0.0, 0.0))


class SeesInTheDark(SoundSensor):
    def observe(self, frame: Frame) -> Evidence:
        return evidence_for(self.topo_map, (float(frame.images["rgb"].mean()) / 64.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        (AlwaysBlind, "must not be blind"),
        (AlwaysTheSame, "different frames"),
        (SeesInTheDark, "flat picture"),
        (NoFit, "lacks fit"),
        (NeedsAList, "frozenset"),
        (MatchAboveOne, r"match must lie in \[0, 1\]"),
        (MatchBelowZero, r"match must lie in \[0, 1\]"),
        (NaNMatch, r"match must lie in \[0, 1\]"),
        (NodeBeyondTheMap, "index topo_map.nodes"),
        (NegativeDistance, "distance"),
        (NaNDistance, "distance"),
        (ZeroLikelihood, "finite at every node"),
        (Moody, "same frame"),
        (MovesAbout, "same frame"),
    ],
)
def test_a_broken_sensor_is_told_what_is_wrong(broken: Callable[[], object], says: str) -> None:
    with pytest.raises(AssertionError, match=says):
        check_sensor(broken(), toy_map(), FRAMES)  # type: ignore[arg-type]


def test_a_sensor_that_cannot_read_grey_pictures_is_found() -> None:
    class ColourOnly(SoundSensor):
        def observe(self, frame: Frame) -> Evidence:
            assert frame.images["rgb"].ndim == 3, "I want colour"
            return super().observe(frame)

    with pytest.raises(AssertionError, match="I want colour"):
        check_sensor(ColourOnly(), toy_map(), FRAMES)


def test_evidence_for_is_best_at_the_pose() -> None:
    the_map = toy_map()
    evidence = evidence_for(the_map, (2.0, 1.0, 0.3))
    assert the_map.nodes[int(evidence.match.argmax())].id == "2-1"
    values = evidence.log_likelihood(np.array([[2.0, 1.0], [0.0, 0.0]]), np.array([[0.3]]))
    assert values[0, 0] > values[1, 0] + 2.0
    assert not evidence_for(the_map, (0.0, 0.0, 0.0), heading_known=False).kappa.any()
