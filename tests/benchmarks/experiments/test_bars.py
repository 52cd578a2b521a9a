"""Bars over seeds."""

from __future__ import annotations

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from benchmarks.experiments.bars import draw_bars


def heights(axes: Axes) -> list[float]:
    return [bar.get_height() for bar in axes.patches if isinstance(bar, Rectangle)]


def test_bars_are_means_over_the_seeds_that_have_a_value() -> None:
    measured = [{"ours": {"a": 0.2, "b": float("nan")}}, {"ours": {"a": 0.4, "b": 0.5}}]
    axes = Figure().add_subplot()
    draw_bars(axes, measured, {"A": "a", "B": "b"}, {"ours": "black"}, published=(0.1, 0.9))
    assert heights(axes) == pytest.approx([0.1, 0.9, 0.3, 0.5])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["A", "B"]


def test_a_key_that_no_seed_has_is_an_empty_bar() -> None:
    axes = Figure().add_subplot()
    draw_bars(axes, [{"ours": {"a": float("nan")}}], {"A": "a"}, {"ours": "black"})
    assert heights(axes) == [0.0]
