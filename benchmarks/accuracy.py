"""How often each estimator is right in the laboratory, how fast it recovers, and whether its probability is true.

``make accuracy`` writes the tables of docs/estimators.md. The thesis's own conditions (5.2.3, 5.2.4): ten laps fresh,
two days old, and with people; a node is right up to 0.25 m. Kidnappings: four to a seed, fresh and old; recovered is
who names a right node within three updates with a match, as the thesis's robot did. Probabilities are compared over
the benchmark's scenarios and the old laboratory together. Everything is simulated.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from benchmarks.calibration import RULE_SENSORS, Drive, Recalled, watched
from benchmarks.drives import ESTIMATOR_STREAM
from benchmarks.experiments.conditions import CONDITIONS
from benchmarks.experiments.kidnappings import KIDNAPPINGS, LOOKS, kidnapped, looks_until_right
from benchmarks.worlds.settings import WorldSettings
from topoloc import plugins
from topoloc.cli.progress import bar
from topoloc.files import write_text
from topoloc.geometry import Floats
from topoloc.localizer import Localizer
from topoloc.metrics import Run, calibration_error
from topoloc.thesis import THESIS

DOCUMENT = Path(__file__).parents[1] / "docs" / "estimators.md"
BEGIN, END = "<!-- written by make accuracy -->\n", "<!-- end -->\n"
"""What the tables stand between."""
SEEDS = tuple(range(10, 20))
"""Nothing was fitted to them; the table of the README has 0 to 9."""
LAPS, UPDATES = 10.0, 60
SCENARIOS: tuple[WorldSettings, ...] = (
    WorldSettings(updates=UPDATES),
    WorldSettings(updates=UPDATES, people=0.35),
    WorldSettings(updates=UPDATES, age=1.0),
    WorldSettings(updates=UPDATES, kidnap_at=UPDATES // 2),
)
"""Over which the probabilities of all sensors are compared with what is so."""
BINS = 10


@dataclass(frozen=True)
class Answers:
    """What one estimator said on the drives of one seed.

    Attributes:
        errors: by condition, share of updates that name a wrong node, or none.
        recovered: by condition, (K,) whether each kidnapped robot was found in time.
        probability, right: (U,) stated probability, and whether the named node was right.
    """

    errors: Mapping[str, float]
    recovered: Mapping[str, tuple[bool, ...]]
    probability: Floats
    right: np.ndarray


def answers(seed: int, estimators: Sequence[str], laps: float = LAPS) -> dict[str, Answers]:
    """All answers of one seed, by estimator; each sensor looks at each frame once."""
    with threadpool_limits(1):
        long = {name: watched("ima", replace(world, laps=laps), seed) for name, world in CONDITIONS.items()}
        carried = {
            name: [watched("ima", kidnapped(CONDITIONS[name], *event), seed) for event in KIDNAPPINGS]
            for name in ("fresh", "old")
        }
        told = [watched(sensor, world, seed) for sensor in RULE_SENSORS for world in SCENARIOS]
        return {name: _answers_of(name, seed, long, carried, told) for name in estimators}


def _answers_of(
    name: str,
    seed: int,
    long: Mapping[str, Drive],
    carried: Mapping[str, Sequence[Drive]],
    told: Sequence[Drive],
) -> Answers:
    runs = [_run(drive, name, seed) for drive in told]
    named = np.concatenate([run.nodes >= 0 for run in runs])
    return Answers(
        {condition: 1.0 - float(_run(drive, name, seed).right.mean()) for condition, drive in long.items()},
        {
            condition: tuple(_is_found(drive, _run(drive, name, seed)) for drive in drives)
            for condition, drives in carried.items()
        },
        np.concatenate([run.probabilities for run in runs])[named],
        np.concatenate([run.right for run in runs])[named],
    )


def _run(drive: Drive, estimator: str, seed: int) -> Run:
    simulation = drive.simulation
    localizer = Localizer(
        simulation.topo_map,
        Recalled(drive),
        plugins.make_estimator(estimator),
        rng=np.random.default_rng([seed, ESTIMATOR_STREAM]),
    )
    steps = []
    for frame in simulation.frames:
        localizer.step(frame)
        assert localizer.last is not None  # a step was just made
        steps.append(localizer.last)
    return Run.of(simulation.topo_map, steps, simulation.truth)


def _is_found(drive: Drive, run: Run) -> bool:
    """Whether a right node was named within ``LOOKS`` updates with a match after the kidnapping."""
    frames = drive.simulation.frames
    after = run.updates >= drive.world.kidnap_at
    looks = [drive.evidence[frames[index].timestamp] for index in run.updates[after]]
    matched = np.array([len(look.match) > 0 and look.match.max() > THESIS.match_threshold for look in looks])
    return looks_until_right(matched, run.right[after]) <= LOOKS


def measure_all(
    seeds: Sequence[int], estimators: Sequence[str], laps: float = LAPS, jobs: int = -1
) -> dict[str, list[Answers]]:
    """The answers of each estimator, a seed each, in their order."""
    made = Parallel(n_jobs=jobs, return_as="generator")(delayed(answers)(seed, estimators, laps) for seed in seeds)
    with bar() as progress:
        by_seed = list(progress.track(made, total=len(seeds), description="driving seeds"))
    return {name: [one[name] for one in by_seed] for name in estimators}


def table(measured: Mapping[str, Sequence[Answers]]) -> str:
    """Errors, recovery and calibration of each estimator in Markdown, mean +- standard deviation over seeds."""
    heads = ["estimator", *(f"errors, {name}" for name in CONDITIONS), "recovered, fresh", "recovered, old"]
    lines = [f"| {' | '.join([*heads, 'calibration error'])} |", "|---" * (len(heads) + 1) + "|"]
    for name, seeds in measured.items():
        cells = [f"`{name}`"]
        for condition in CONDITIONS:
            errors = 100.0 * np.array([one.errors[condition] for one in seeds])
            cells.append(f"{errors.mean():.1f} ± {errors.std():.1f} %")
        for condition in ("fresh", "old"):
            found = np.concatenate([one.recovered[condition] for one in seeds])
            cells.append(f"{found.sum()} of {len(found)}")
        probability, right = _together(seeds)
        cells.append(f"{calibration_error(probability, right):.3f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def reliability(measured: Mapping[str, Sequence[Answers]]) -> str:
    """Share of right nodes among the updates of each stated probability, in Markdown; the number in brackets."""
    edges = np.linspace(0.0, 1.0, BINS + 1)
    lines = [
        f"| said | {' | '.join(f'{low:.1f} to {high:.1f}' for low, high in pairwise(edges))} |",
        "|---" * (BINS + 1) + "|",
    ]
    for name, seeds in measured.items():
        probability, right = _together(seeds)
        bins = np.minimum((probability * BINS).astype(int), BINS - 1)
        cells = [
            f"{right[bins == k].mean():.2f} ({(bins == k).sum()})" if (bins == k).any() else "" for k in range(BINS)
        ]
        lines.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _together(seeds: Sequence[Answers]) -> tuple[Floats, np.ndarray]:
    return np.concatenate([one.probability for one in seeds]), np.concatenate([one.right for one in seeds])


def main() -> None:
    """Measure, and print the tables; with --write, put them into the document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first-seed", type=int, default=SEEDS[0])
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--laps", type=float, default=LAPS)
    parser.add_argument("--estimators", nargs="+", default=plugins.names(plugins.ESTIMATORS))
    parser.add_argument("--write", action="store_true", help=f"put the tables into docs/{DOCUMENT.name}")
    words = parser.parse_args()
    for name in words.estimators:
        plugins.load(plugins.ESTIMATORS, name)  # a slip of the finger shows before the driving
    seeds = range(words.first_seed, words.first_seed + words.seeds)
    measured = measure_all(seeds, words.estimators, words.laps)
    tables = table(measured) + "\n" + reliability(measured)
    print(tables)
    if words.write:
        text = DOCUMENT.read_text(encoding="utf-8")
        if BEGIN not in text or END not in text:
            raise SystemExit(f"{DOCUMENT}: the lines around the tables are gone; put them back")
        before, after = text.partition(BEGIN)[0], text.partition(END)[2]
        write_text(DOCUMENT, before + BEGIN + tables + END + after)


if __name__ == "__main__":
    main()
