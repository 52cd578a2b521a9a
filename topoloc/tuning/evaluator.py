"""Choices of settings -> outcomes, each tried once, in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from topoloc import plugins
from topoloc.errors import UserError
from topoloc.topo_map import TopoMap
from topoloc.tuning.choice import Choice
from topoloc.tuning.folds import Fold
from topoloc.tuning.looks import Looks, taken
from topoloc.tuning.trial import Outcome, refusal, tried

Words = tuple[tuple[str, str], ...]


@dataclass
class Evaluator:
    """Tries choices on folds; what was tried, and what a sensor saw, is remembered.

    Attributes:
        topo_map: the map.
        folds: F of them.
        sensor, estimator: their names.
        seed: of the estimator's random numbers.
        jobs: processes; with 1 all is done in this one.
        advance: is told of each choice that came in, and each time a sensor looked at everything.
        outcomes: of all that was tried, in order.
    """

    topo_map: TopoMap
    folds: Sequence[Fold]
    sensor: str
    estimator: str
    seed: int = 0
    jobs: int = 1
    advance: Callable[[], None] = lambda: None
    outcomes: dict[Choice, Outcome] = field(default_factory=dict)
    _looks: dict[Words, Looks] = field(default_factory=dict)
    _reasons: dict[tuple[str, Words], str] = field(default_factory=dict)

    def try_all(self, choices: Sequence[Choice]) -> None:
        """See to it that ``outcomes`` has all of these."""
        new = list(dict.fromkeys(choice for choice in choices if choice not in self.outcomes))
        reasons = {choice: self._refusal(choice) for choice in new}
        able = [choice for choice in new if not reasons[choice]]
        self._look_for(able)
        work = [
            (tried, self.topo_map, self.estimator, choice, self.folds, self._looks[choice.part("sensor")], self.seed)
            for choice in able
        ]
        results = dict(zip(able, self._done(work), strict=True))
        self.outcomes |= {choice: results.get(choice, Outcome({}, refused=reasons[choice])) for choice in new}
        for _ in range(len(choices) - len(able)):
            self.advance()

    def _refusal(self, choice: Choice) -> str:
        """Why sensor or estimator do not take the settings; empty where both do."""
        for kind, name, make in (
            ("sensor", self.sensor, plugins.make_sensor),
            ("estimator", self.estimator, plugins.make_estimator),
        ):
            key = (kind, choice.part(kind))
            if key not in self._reasons:
                self._reasons[key] = refusal(make, name, choice.table(kind))
            if self._reasons[key]:
                return self._reasons[key]
        return ""

    def _look_for(self, choices: Sequence[Choice]) -> None:
        """Take the looks of sensor settings that have none yet."""
        new = {choice.part("sensor"): choice for choice in choices if choice.part("sensor") not in self._looks}
        work = [(taken, self.topo_map, self.sensor, choice.table("sensor"), self.folds) for choice in new.values()]
        self._looks |= dict(zip(new, self._done(work), strict=True))

    def _done(self, work: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
        """The results of functions, in order."""
        for result in self._results(work):
            self.advance()
            yield result

    def _results(self, work: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
        if self.jobs == 1 or len(work) < 2:
            yield from (function(*given) for function, *given in work)
            return
        from joblib import Parallel, delayed, parallel_config

        with parallel_config(backend="loky", inner_max_num_threads=1):
            tasks = (delayed(function)(*given) for function, *given in work)
            yield from Parallel(n_jobs=self.jobs, return_as="generator")(tasks)

    def refuse_nonsense(self, choices: Sequence[Choice]) -> None:
        """Raise ``UserError`` where not one of several choices can be tried at all."""
        refused = [self.outcomes[choice].refused for choice in choices]
        if refused and all(refused):
            raise UserError(refused[0])
