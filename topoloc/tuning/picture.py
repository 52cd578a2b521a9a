"""The picture of a tuning: what each setting does alone, and how the choice does where it was not made."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from topoloc.plan import ESTIMATE, WRONG
from topoloc.tuning.choice import Choice
from topoloc.tuning.plan import Tuned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from topoloc.tuning.choice import Tunable

COLUMNS = 3
"""Panels side by side."""


def draw_tuning(tuned: Tuned) -> Figure:
    """A panel for each setting with its score at each value, a dot a fold, and one for the held-out folds."""
    from matplotlib.figure import Figure

    count = len(tuned.tunables) + 1
    rows = -(-count // COLUMNS)
    figure = Figure(figsize=(3.3 * COLUMNS, 2.7 * rows + 0.3), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False).ravel()
    for axes, tunable in zip(panels, tuned.tunables, strict=False):
        _draw_setting(axes, tuned, tunable)
    _draw_held_out(panels[count - 1], tuned)
    for axes in panels[count:]:
        axes.set_visible(False)
    unit = f" [{tuned.score.unit}]" if tuned.score.unit else ""
    for axes in panels[::COLUMNS]:
        axes.set_ylabel(f"{tuned.score.label}{unit}")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, fontsize=8, frameon=False)
    return figure


def _draw_setting(axes: Axes, tuned: Tuned, tunable: Tunable) -> None:
    """Dots for folds and a line through their means, over the values in order."""
    words = sorted((tunable.default, *tunable.others), key=_order)
    scores = np.array([tuned.scores(tuned.alone[tunable.key, word]) for word in words])
    place, chosen = np.arange(len(words)), tuned.proposal.word(tunable)
    folds = np.repeat(place, scores.shape[1])
    axes.plot(folds, scores.ravel(), color="0.7", linestyle="", marker="o", markersize=3, label="a fold")
    axes.plot(place, scores.mean(axis=1), color=ESTIMATE, linewidth=1.2, label="mean of folds")
    for word, style in (
        (tunable.default, {"marker": "s", "color": ESTIMATE, "label": "default"}),
        (chosen, {"marker": "o", "markerfacecolor": "none", "color": WRONG, "markersize": 11, "label": "proposal"}),
    ):
        at = words.index(word)
        axes.plot([at], [scores[at].mean()], linestyle="", **style)
    axes.set_xticks(place, [word.replace("estimated x", "x") for word in words], fontsize=8)
    axes.margins(x=0.15)
    axes.set_title(f"{tunable.key} alone", fontsize=9)


def _draw_held_out(axes: Axes, tuned: Tuned) -> None:
    """A line for each fold from the defaults to what was chosen without it, and one for the means."""
    pairs = np.array([tuned.scores(Choice()), tuned.held_out_scores])
    axes.plot([0, 1], pairs, color="0.7", marker="o", markersize=3, linewidth=0.8)
    axes.plot([0, 1], pairs.mean(axis=1), color=ESTIMATE, marker="s", linewidth=1.6)
    axes.set_xticks([0, 1], ["defaults", "chosen without\nthe fold"], fontsize=8)
    axes.set_xlim(-0.3, 1.3)
    axes.set_title(f"held out: {tuned.verdict.gain:+.3f} (better is above 0)", fontsize=9)


def _order(word: str) -> tuple[float, str]:
    """Numbers by size, then words by the alphabet."""
    try:
        return float(word), ""
    except ValueError:
        return float("inf"), word
