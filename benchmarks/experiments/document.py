"""Writes what a run of ``topoloc reproduce all`` gave into the pages of the experiments: ``make reproduce``."""

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

DOCS = Path(__file__).parents[2] / "docs"
PICTURES = DOCS / "pictures" / "experiments"
BEGIN, END = "<!-- written by make reproduce -->\n", "<!-- end -->\n"
"""What the tables stand between."""
THESIS_PAGE, APPEARANCE_PAGE = "experiments.md", "appearance_experiments.md"
PAGES: dict[str, tuple[str, ...]] = {
    THESIS_PAGE: (
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
    ),
    APPEARANCE_PAGE: (
        "active-vision",
        "illumination-ratio",
        "disparity-localization",
        "signature-distance",
        "map-layout",
        "map-layout-steps",
        "particle-weights",
    ),
}
"""As the thesis has them, ours last; then those of the second and of the third seed."""
PICTURED = frozenset(
    [
        *(
            "person",
            "turning",
            "heading",
            "zoom",
            "kidnapping",
            "incremental-zoom",
            "odometry-reset",
            "robust-matching",
        ),
        *PAGES[APPEARANCE_PAGE],
    ]
)
"""Shown on the page; ``topoloc reproduce`` draws all."""


def section(experiment: Experiment, measured: Sequence[Measured]) -> str:
    """An experiment in Markdown."""
    seeds = f"seeds {SEEDS[0]} to {SEEDS[-1]}"
    parts = [
        f"## {experiment.title}\n",
        f"`topoloc reproduce {experiment.name}`; {experiment.document} {experiment.source}; {seeds}.\n",
        f"{experiment.about}\n",
    ]
    if experiment.name in PICTURED:
        parts.append(f"![{experiment.title} (simulated)](pictures/experiments/{experiment.name}.png)\n")
    parts.append(markdown(experiment, measured, details=False))
    hidden = sum(quantity.detail for quantity in experiment.quantities)
    if hidden:
        parts.append(f"{hidden} more rows: `topoloc reproduce {experiment.name}`.\n")
    return "\n".join(parts)


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


def write_page(name: str, run: Path, jobs: int) -> None:
    """Write the tables of a page from the folder of a run; seeds that it lacks are measured."""
    page = DOCS / name
    text = page.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise SystemExit(f"{page}: the lines around the tables are gone; put them back")
    sections, of_all = [], {}
    for one in PAGES[name]:
        experiment: Experiment = plugins.load(plugins.EXPERIMENTS, one)
        measured = list(measure_seeds(experiment, SEEDS, run / one / "seeds", jobs))
        of_all[one] = measured
        sections.append(section(experiment, measured))
        if one in PICTURED:
            write_figure(PICTURES / f"{one}.png", experiment, measured)
    head = [errors(of_all)] if name == THESIS_PAGE else []
    before, after = text.partition(BEGIN)[0], text.partition(END)[2]
    write_text(page, before + BEGIN + "\n".join([*head, *sections]) + END + after)


def main() -> None:
    """Write the pages that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder that topoloc reproduce made")
    parser.add_argument("pages", nargs="*", help=f"of {', '.join(PAGES)}; all by default")
    parser.add_argument("--jobs", type=int, default=-1)
    words = parser.parse_args()
    for name in words.pages or PAGES:
        write_page(name, words.run, words.jobs)


if __name__ == "__main__":
    main()
