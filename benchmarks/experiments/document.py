"""Writes what a run of ``topoloc reproduce all`` gave into docs/experiments.md: ``make reproduce``."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.experiments.experiment import (
    AS_PUBLISHED,
    IMPROVED,
    SEEDS,
    Experiment,
    Measured,
    markdown,
    measure_seeds,
)
from benchmarks.experiments.picture import write_figure
from topoloc import plugins
from topoloc.files import write_text

DOCUMENT = Path(__file__).parents[2] / "docs" / "experiments.md"
PICTURES = DOCUMENT.parent / "pictures" / "experiments"
BEGIN, END = "<!-- written by make reproduce -->\n", "<!-- end -->\n"
"""What the tables stand between."""
ORDER = (
    "person",
    "door",
    "panorama-slots",
    "panorama-step",
    "turning",
    "slots",
    "heading",
    "heading-off-node",
    "zoom",
    "dead-reckoning",
    "kidnapping",
    "old-panoramas",
    "people",
    "aliasing",
    "virtual-destination",
    "heading-correction",
    "corridor",
    "no-zoom",
    "random-routes",
    "incremental-zoom",
    "odometry-reset",
    "robust-matching",
    "map-upkeep",
)
"""As the thesis has them, ours last."""
PICTURED = frozenset(
    ["person", "turning", "heading", "zoom", "kidnapping", "incremental-zoom", "odometry-reset", "robust-matching"]
)
"""Shown on the page; ``topoloc reproduce`` draws all."""


def section(experiment: Experiment, measured: Sequence[Measured]) -> str:
    """An experiment in Markdown."""
    parts = [
        f"## {experiment.title}\n",
        f"`topoloc reproduce {experiment.name}`; thesis {experiment.source}; seeds {SEEDS[0]} to {SEEDS[-1]}.\n",
        f"{experiment.about}\n",
    ]
    if experiment.name in PICTURED:
        parts.append(f"![{experiment.title} (simulated)](pictures/experiments/{experiment.name}.png)\n")
    return "\n".join([*parts, markdown(experiment, measured)])


ERRORS = {
    "fresh": ("old-panoramas", "fresh error rate", "0", "at most 5 %"),
    "two days old": ("old-panoramas", "error rate", "4.7 %", "4 to 12 %"),
    "with people": ("people", "error rate", "1.2 %", "2 to 12 %"),
    "laboratory and corridor": ("corridor", "error rate", "2.0 %", "-"),
}
"""Of each condition: experiment, key, what was published, and what was asked of a simulation with its settings."""
MOST_OF_ERRORS = 0.30
"""The improved method should make at most this share of the published method's errors."""


def errors(measured: Mapping[str, Sequence[Measured]]) -> str:
    """What the improved method leaves of the published one's errors, in Markdown; means over seeds."""
    lines = [
        "| errors, share of updates | published | asked for | as published | improved | left of them | medians |",
        "|---" * 7 + "|",
    ]
    for condition, (name, key, published, asked) in ERRORS.items():
        ours, theirs = ([one[column][key] for one in measured[name]] for column in (IMPROVED, AS_PUBLISHED))
        left = float(np.mean(ours) / np.mean(theirs))
        cells = [condition, published, asked, f"{100 * np.mean(theirs):.1f} %", f"{100 * np.mean(ours):.1f} %"]
        cells += [f"{100 * left:.0f} %{'' if left <= MOST_OF_ERRORS else ', **missed**'}"]
        lines.append(f"| {' | '.join(cells)} | {100 * np.median(theirs):.1f} and {100 * np.median(ours):.1f} % |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page from the folder of a run; seeds that it lacks are measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder that topoloc reproduce made")
    parser.add_argument("--jobs", type=int, default=-1)
    words = parser.parse_args()
    text = DOCUMENT.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise SystemExit(f"{DOCUMENT}: the lines around the tables are gone; put them back")
    sections, of_all = [], {}
    for name in ORDER:
        experiment: Experiment = plugins.load(plugins.EXPERIMENTS, name)
        measured = list(measure_seeds(experiment, SEEDS, words.run / name / "seeds", words.jobs))
        of_all[name] = measured
        sections.append(section(experiment, measured))
        if name in PICTURED:
            write_figure(PICTURES / f"{name}.png", experiment, measured)
    before, after = text.partition(BEGIN)[0], text.partition(END)[2]
    write_text(DOCUMENT, before + BEGIN + "\n".join([errors(of_all), *sections]) + END + after)


if __name__ == "__main__":
    main()
