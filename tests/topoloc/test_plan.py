"""The plan of a run: where each path begins, and whether there was a truth."""

from __future__ import annotations

import numpy as np
import pytest

from topoloc.geometry import Floats
from topoloc.plan import draw_plan
from topoloc.topo_map import Camera, Node, TopoMap

MAP = TopoMap("two", Camera(45.0, 32, 24), (Node("A", "", 0.0, 0.0), Node("B", "", 1.0, 0.0)), np.array([[0, 1]]))
PATH = np.array([[0.1, 0.2, 0.0], [0.9, 0.2, 0.0]])


@pytest.mark.parametrize(
    ("truth", "title", "starts"),
    [(PATH + 0.5, "ima", [[0.6, 0.7], [0.1, 0.2]]), (None, "ima, no ground truth", [[0.1, 0.2]])],
)
def test_each_path_has_a_start_and_no_truth_is_told(
    truth: Floats | None, title: str, starts: list[list[float]]
) -> None:
    [axes] = draw_plan(MAP, PATH, truth, title="ima").axes
    assert axes.get_title() == title
    [start] = [line for line in axes.lines if line.get_label() == "start"]
    assert np.asarray(start.get_xydata()) == pytest.approx(np.array(starts))
    legend = axes.get_legend()
    assert legend is not None and "start" in [text.get_text() for text in legend.get_texts()]
