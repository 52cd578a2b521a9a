"""Writes what a run of ``topoloc reproduce all`` gave into docs/experiments.md: ``make reproduce``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.experiments.experiment import SEEDS, Experiment, Measured, markdown, measure_seeds
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


def main() -> None:
    """Write the page from the folder of a run; seeds that it lacks are measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder that topoloc reproduce made")
    parser.add_argument("--jobs", type=int, default=-1)
    words = parser.parse_args()
    text = DOCUMENT.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise SystemExit(f"{DOCUMENT}: the lines around the tables are gone; put them back")
    sections = []
    for name in ORDER:
        experiment: Experiment = plugins.load(plugins.EXPERIMENTS, name)
        measured = list(measure_seeds(experiment, SEEDS, words.run / name / "seeds", words.jobs))
        sections.append(section(experiment, measured))
        if name in PICTURED:
            write_figure(PICTURES / f"{name}.png", experiment, measured)
    before, after = text.partition(BEGIN)[0], text.partition(END)[2]
    write_text(DOCUMENT, before + BEGIN + "\n".join(sections) + END + after)


if __name__ == "__main__":
    main()
