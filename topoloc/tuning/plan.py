"""What ``topoloc tune`` does: plan what is tried, try it, and say what is worth taking."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from topoloc import plugins
from topoloc.checks.same_drive import ITS_OWN, from_this_recording
from topoloc.errors import InputError
from topoloc.geometry import Floats
from topoloc.metrics import Metric
from topoloc.odometry import OdometryNoise
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap
from topoloc.tuning.candidates import tunables_of
from topoloc.tuning.choice import NOISES, Choice, Tunable
from topoloc.tuning.evaluator import Evaluator
from topoloc.tuning.folds import Fold, folds_of
from topoloc.tuning.looks import refuse_blindness
from topoloc.tuning.odometry_noise import NoiseFit, fit_noise, log_likelihood, motions_of, scaled
from topoloc.tuning.search import Training, alone, searched, trainings_of, trials_of
from topoloc.tuning.trial import Outcome
from topoloc.tuning.verdict import Verdict, verdict_of


@dataclass(frozen=True)
class Tuned:
    """What came of it.

    Attributes:
        score: by which settings were chosen.
        folds: F of them.
        tunables: the settings that were tried.
        outcomes: all that was tried, in order.
        alone: by key and value: the defaults with that one setting changed; the odometer's noise from all folds.
        proposal: what is best on all folds.
        held_out: (F,) what was best on all folds but each one.
        verdict: of ``held_out``, each on its fold, beside the defaults.
        noise: the odometer's, fitted on all folds.
        noise_gains: (F,) by how much a motion of a fold is likelier under the noise fitted on the others than under
            the defaults [nats]; none without an odometer.
    """

    score: Metric
    folds: Sequence[Fold]
    tunables: Sequence[Tunable]
    outcomes: Mapping[Choice, Outcome]
    alone: Mapping[tuple[str, str], Choice]
    proposal: Choice
    held_out: Sequence[Choice]
    verdict: Verdict
    noise: NoiseFit
    noise_gains: Floats

    def scores(self, choice: Choice) -> Floats:
        """(F,) of a choice on each fold; NaN where the settings were refused."""
        return self.outcomes[choice].metrics.get(self.score.name, np.full(len(self.folds), np.nan))

    @property
    def held_out_scores(self) -> Floats:
        """(F,) on each fold, of what was chosen without it."""
        return np.array([self.scores(choice)[number] for number, choice in enumerate(self.held_out)])


@dataclass(frozen=True)
class Plan:
    """What will be tried; made at once, so that mistakes show before the work.

    Attributes:
        topo_map: the map.
        sensor, estimator: names.
        folds: F of them.
        tunables: settings and their values.
        score: a metric that is better higher or lower.
        seed: of the estimator's random numbers.
    """

    topo_map: TopoMap
    sensor: str
    estimator: str
    folds: Sequence[Fold]
    tunables: Sequence[Tunable]
    score: Metric
    seed: int = 0

    @property
    def trials(self) -> int:
        """About how often ``carry_out`` tells of progress: of every choice, and of every sensor on its own."""
        eyes = 1 + sum(len(one.others) for one in self.tunables if one.key.startswith("sensor."))
        singles = sum(1 + len(one.others) for one in self.tunables)
        return eyes + singles + trials_of(self.tunables, len(self.folds) + 1)

    def carry_out(self, jobs: int, advance: Callable[[], None] = lambda: None) -> Tuned:
        """Try everything.

        Args:
            jobs: processes.
            advance: is called about ``trials`` times.

        Raises:
            UserError: the map or the recordings lack what the sensor needs, or no value of a setting can be had.
        """
        fits = [fit_noise([fold for fold, used in zip(self.folds, mask, strict=True) if used]) for mask in self._masks]
        trainings = [Training(mask, _noises(fit)) for mask, fit in zip(self._masks, fits, strict=True)]
        evaluator = Evaluator(self.topo_map, self.folds, self.sensor, self.estimator, self.seed, jobs, advance)
        singles = alone(self.tunables, trainings[-1])
        evaluator.try_all(list(singles.values()))
        for one in self.tunables:
            evaluator.refuse_nonsense([singles[one.key, word] for word in one.others])
        *held_out, proposal = searched(evaluator, self.tunables, trainings, self.score)
        default = evaluator.outcomes[Choice()].metrics[self.score.name]
        chosen = [evaluator.outcomes[choice].metrics[self.score.name][number] for number, choice in enumerate(held_out)]
        verdict = verdict_of(np.array(chosen), default, self.score.better == "higher")
        gains = _noise_gains(self.folds, fits[:-1]) if fits[-1].told else np.zeros(0)
        outcomes = evaluator.outcomes
        return Tuned(
            self.score, self.folds, self.tunables, outcomes, singles, proposal, held_out, verdict, fits[-1], gains
        )

    @property
    def _masks(self) -> list[np.ndarray]:
        return trainings_of(len(self.folds))


def plan_of(
    topo_map: TopoMap,
    recordings: Sequence[Recording],
    score: Metric,
    *,
    sensor: str = "ima",
    estimator: str = "activity",
    tries: Sequence[str] = (),
    folds: int | None = None,
    seed: int = 0,
) -> Plan:
    """Plan a tuning.

    Args:
        topo_map: the map.
        recordings: with ground truth.
        score: what is made better.
        sensor: its name, as ``topoloc.plugins`` takes it.
        estimator: alike.
        tries: ``sensor.slots=6,8,12`` words; without any, ``topoloc.tuning.candidates`` has some.
        folds: stretches that each recording is cut into; None: its laps.
        seed: of the estimator's random numbers.

    Raises:
        UserError: recordings without truth, too short, without the images that the sensor needs, or the one that the
            map was built of; unknown names.
    """
    eye = plugins.make_sensor(sensor)
    parts = folds_of([recording.on(topo_map.camera) for recording in recordings], folds)
    refuse_blindness(eye, sensor, parts)
    _refuse_own(topo_map, recordings)
    tunables = tunables_of(sensor, estimator, tries, with_odometry=fit_noise(parts).told)
    return Plan(topo_map, sensor, estimator, parts, tunables, score, seed)


def _refuse_own(topo_map: TopoMap, recordings: Sequence[Recording]) -> None:
    """On the frames that a map is made of, the defaults can hardly be wrong, and any setting looks as good."""
    for recording in recordings:
        share = from_this_recording(topo_map, recording)
        if share > ITS_OWN:
            raise InputError(
                recording.folder,
                f"the map was built of it ({share:.0%} of the map's pictures looked at are its frames), so that it "
                "tells nothing of settings",
                "record another drive through the same places, and tune on that",
            )


def _noises(fit: NoiseFit) -> dict[str, OdometryNoise]:
    """What the words for the odometer's noise stand for."""
    fitted = {word: scaled(fit.noise, factor) for word, factor in NOISES.items() if factor > 0.0}
    return {"default": OdometryNoise(), **fitted}


def _noise_gains(folds: Sequence[Fold], fits: Sequence[NoiseFit]) -> Floats:
    """(F,) mean log density of a motion of each fold under the noise fitted without it, less that of the defaults."""
    gains = []
    for fold, fit in zip(folds, fits, strict=True):
        motions = motions_of([fold])
        gains.append(log_likelihood(fit.noise, motions) - log_likelihood(OdometryNoise(), motions))
    return np.array(gains)
