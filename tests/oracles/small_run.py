"""The folder of a small benchmark run, written by hand, so that each figure of its report can be told beforehand."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np
import tomli_w

from benchmarks import replay
from benchmarks.results import ResultsFile, Row
from benchmarks.run_files import answers_path, drive_path, looks_path, steps_path
from topoloc.files import write_csv, write_text
from topoloc.steps import STEP_COLUMNS, TRUTH_COLUMNS

SCENARIOS, SENSORS, ESTIMATORS = ("toy", "carried"), ("ima", "mix(a,b)"), ("activity", "grid")
FRAMES, KIDNAPPED_AT = 6, 3
KINDS = ("update", "update", "gated", "update", "update", "blind")
NODES = ("1", "1", "1", "2", "", "2")
PROBABILITIES = (0.95, 0.95, 0.5, 0.55, 0.2, 0.95)
RIGHT = ("1", "0", "", "1", "0", "1")
"""Four updates name a node: at 0.95 two of three are right, at 0.55 the one is."""
UNFED = "needs right images; the scenario has rgb images"


def accuracy(scenario: str, sensor: str, estimator: str, seed: int) -> float:
    """``ima/grid`` is 0.4 below the others, which only scatter."""
    base = 0.9 if scenario == "toy" else 0.7
    noise = 0.01 * (seed % 3) * (1 if sensor == "ima" else -1)
    return round(base + noise - 0.4 * (sensor == "ima" and estimator == "grid"), 4)


def offset_m(estimator: str, seed: int) -> float:
    """How far each estimate is from the truth."""
    return (0.2 if estimator == "activity" else 0.5) + 0.1 * seed


def row(scenario: str, sensor: str, estimator: str, seed: int) -> Row:
    """A row of the run; the second sensor's grid cannot be fed on the second scenario."""
    if (scenario, sensor, estimator) == ("carried", "mix(a,b)", "grid"):
        return Row(scenario, sensor, estimator, seed, "unavailable", UNFED)
    off = offset_m(estimator, seed)
    values = {
        "steps": 5.0,
        "node_accuracy": accuracy(scenario, sensor, estimator, seed),
        "wrong_rate": 0.05,
        "position_median_m": off,
        "heading_median_deg": 10.0 + seed,
        "steps_to_localize": 1.0 + seed,
        "recall_at_p99": 0.1 * seed,
        "lost_rate": 0.05 * seed,
        "calibration_error": 0.02 * seed,
        "nees": 3.0 + seed,
        "recovery_steps": 2.0 if scenario == "carried" and estimator == "activity" else None,
        "sensor_ms": 1234.5,
        "estimator_ms": 10.0 + 2.0 * seed,
    }
    return Row(scenario, sensor, estimator, seed, values=values)


def rows(seeds: int) -> list[Row]:
    """All rows of the run."""
    return [row(c, s, e, seed) for c in SCENARIOS for s in SENSORS for e in ESTIMATORS for seed in range(seeds)]


def write_run(
    folder: Path, seeds: int = 2, written: Iterable[Row] | None = None, recorded: Collection[str] = ("carried",)
) -> Path:
    """Write the folder.

    Args:
        folder: a new one.
        seeds: of the run.
        written: the rows; all of them by default.
        recorded: scenarios of one drive.
    """
    kept = rows(seeds) if written is None else list(written)
    _write_config(folder, seeds, recorded)
    with ResultsFile(folder / "results.csv", kept):
        pass
    for one in kept:
        if one.status == "ok":
            _write_steps(folder, one)
    for scenario in SCENARIOS:
        _write_replay(folder, scenario)
    return folder


def _write_config(folder: Path, seeds: int, recorded: Collection[str]) -> None:
    run = {
        "command": "topoloc bench",
        "started": "2030-01-01 12:00:00",
        "rows": len(rows(seeds)),
        "scenarios": list(SCENARIOS),
        "sensors": list(SENSORS),
        "estimators": list(ESTIMATORS),
        "seeds": seeds,
        "updates": FRAMES,
        "first_seed": 0,
        "settings": ["sensors.ima.slots=4", "estimators.grid.headings=12"],
    }
    words = {"toy": "A toy.", "carried": "Carried away."}
    about = {name: {"description": text, "recorded": name in recorded} for name, text in words.items()}
    write_text(folder / "config.toml", tomli_w.dumps({"run": run, "scenarios": about}))


def _write_steps(folder: Path, one: Row) -> None:
    off = offset_m(one.estimator, one.seed)
    lines = [
        (k, 0.5 * k + off, 0, 0, NODES[k], PROBABILITIES[k], "LOCALIZED", "", KINDS[k], 0.5 * k, 0, 0, RIGHT[k])
        for k in range(FRAMES)
    ]
    write_csv(folder / steps_path(*one.key), STEP_COLUMNS + TRUTH_COLUMNS, lines)


def _write_replay(folder: Path, scenario: str) -> None:
    grey = np.arange(40 * 120, dtype=np.uint8).reshape(40, 120)
    panorama, frame = replay.panorama_url(grey), replay.panorama_url(grey[:, :50])
    drive = replay.Drive(
        scenario,
        0,
        [replay.NodeSeen(str(i + 1), f"PLACE {i + 1}", float(i), 0.0, 90.0, panorama) for i in range(3)],
        [(0, 1), (1, 2)],
        [float(k) for k in range(FRAMES)],
        [(0.5 * k, 0.0, 0.0) for k in range(FRAMES)],
        [(0.5 * k, 0.1 * k) for k in range(FRAMES)],
        [frame] * (FRAMES - 1) + [""],
        [KIDNAPPED_AT] if scenario == "carried" else [],
    )
    write_text(folder / drive_path(scenario), replay.as_json(drive))
    for sensor in SENSORS:
        looks = [_look(k, sensor) for k in range(FRAMES) if KINDS[k] != "gated"]
        write_text(folder / looks_path(scenario, sensor), replay.as_json(looks))
        for estimator in ESTIMATORS:
            answers = [_answer(k, estimator) for k in range(FRAMES)]
            write_text(folder / answers_path(scenario, sensor, estimator), replay.as_json(answers))


def _look(frame: int, sensor: str) -> replay.Look:
    hypotheses = [
        replay.Hypothesis(1, 0.8, 1.5, 1.0, 0.0, 5.0),
        replay.Hypothesis(0, 0.4, -1.25, 0.0, 0.0, None),
    ]
    slots = [replay.Slots(1, 0.8, [0.2, 0.98], 0.05, [0.9, 0.1], [True, False])] if sensor == "ima" else []
    return replay.Look(frame, hypotheses, slots, "")


def _answer(frame: int, estimator: str) -> replay.Answer:
    off = offset_m(estimator, 0)
    node = int(NODES[frame]) - 1 if NODES[frame] else None
    origins = [replay.Line(0, None, None, 1.0, False)]
    destinations = [replay.Line(1, 5.0, 0.8, 0.75, False), replay.Line(0, 5.0, 0.5, 0.25, True)]
    account = replay.Account("normal", origins, destinations, 0, [[0.5], [0.25]], [[4.0], [None]])
    cells = [(0.5 * frame + off, 0.0, 0.75), (0.0, 1.0, 0.25)] if estimator == "grid" else [(0.5 * frame, 0.0, 1.0)]
    return replay.Answer(
        KINDS[frame],
        0.5 * frame + off,
        0.0,
        10.0,
        node,
        PROBABILITIES[frame],
        "LOCALIZED",
        RIGHT[frame] == "1",
        [] if KINDS[frame] == "gated" else cells,
        account if estimator == "activity" else None,
    )
