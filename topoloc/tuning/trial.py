"""One choice of settings on every fold: how good, and how dear."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from topoloc import plugins
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.localizer import Localizer
from topoloc.metrics import METRICS, Costs, Run
from topoloc.topo_map import TopoMap
from topoloc.tuning.choice import Choice
from topoloc.tuning.folds import Fold
from topoloc.tuning.looks import Looks, Remembered

TELLING = tuple(metric for metric in METRICS if not metric.of_machine)
"""The metrics that another run of the same settings has, too."""
DRAWS = 4
"""An estimator that draws random numbers is run with so many seeds, and the mean is taken."""


@dataclass(frozen=True)
class Outcome:
    """What came of a choice.

    Attributes:
        metrics: by name of ``TELLING``: (F,) a value a fold; NaN where it has none.
        look_ms: one look of the sensor, in the median [ms].
        update_ms: one update without the look, in the median of the drives' means [ms].
        refused: why the settings cannot go together; then nothing else is told.
    """

    metrics: Mapping[str, Floats]
    look_ms: float = float("nan")
    update_ms: float = float("nan")
    refused: str = ""


def refusal(make: Callable[[str, Mapping[str, Any]], object], name: str, settings: Mapping[str, Any]) -> str:
    """Why a sensor or an estimator does not take its settings; empty where it does.

    Args:
        make: ``topoloc.plugins.make_sensor`` or ``make_estimator``.
        name: of what is made.
        settings: of it.
    """
    try:
        make(name, settings)
    except UserError as error:
        return str(error)
    return ""


def tried(topo_map: TopoMap, estimator: str, choice: Choice, folds: Sequence[Fold], looks: Looks, seed: int) -> Outcome:
    """Drive every fold with a choice of settings, from an unknown start each.

    Args:
        topo_map: the map.
        estimator: its name.
        choice: of settings; those of the sensor are in the looks already.
        folds: F of them.
        looks: what the sensor says of their frames.
        seed: of the estimator's random numbers.
    """
    values, updates_ms = [], []
    mind = plugins.make_estimator(estimator, choice.table("estimator"))
    for number, (fold, said) in enumerate(zip(folds, looks.of_folds, strict=True)):
        draws = []
        for draw in range(DRAWS):
            rng = np.random.default_rng((seed, number, draw))
            untouched = rng.bit_generator.state
            eye = Remembered({picture.time: look for picture, look in zip(fold.pictures, said, strict=True)})
            run = _driven(Localizer(topo_map, eye, mind, rng=rng, noise=choice.noise), fold)
            draws.append([_number(metric.value(run)) for metric in TELLING])
            updates_ms.append(_number(run.costs.estimator_ms))
            if rng.bit_generator.state == untouched:
                break
        values.append(np.mean(draws, axis=0))
    metrics = dict(zip((metric.name for metric in TELLING), np.array(values).T, strict=True))
    return Outcome(metrics, looks.look_ms, float(np.median(updates_ms)))


def _driven(localizer: Localizer, fold: Fold) -> Run:
    """A localizer on all frames of a fold, whose images it needs no more."""
    steps = []
    begun = perf_counter()
    for frame in fold.frames:
        localizer.step(frame)
        assert localizer.last is not None  # a step was just made
        steps.append(localizer.last)
    costs = Costs(estimator_ms=1000.0 * (perf_counter() - begun) / len(steps))
    return Run.of(localizer.topo_map, steps, fold.truth, costs=costs)


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
