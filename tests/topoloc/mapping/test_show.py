"""``topoloc map show``: a plan to scale, panoramas with true headings above them, whatever the size of the map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.lines import Line2D

from topoloc.cli.main import run
from topoloc.files import read_image
from topoloc.geometry import wrap
from topoloc.mapping.show import draw_map, heading_ticks, shown_nodes
from topoloc.thesis_map import save_thesis_map
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Image

CAMERA = Camera(45.0, 32, 24)


def panorama(level: int) -> Image:
    return np.full((24, 256, 3), level, dtype=np.uint8)


def small_map(nodes: int = 4, **more: Any) -> TopoMap:
    made = [Node(f"P{i}", f"place_{i}", 1.5 * i, 0.5 * (i % 2), 0.4, panorama(40 + 10 * i)) for i in range(nodes)]
    return TopoMap("small", CAMERA, tuple(made), **more)


@given(st.floats(-np.pi, np.pi), st.integers(8, 4000))
def test_headings_stand_above_the_columns_that_look_there(heading: float, columns: int) -> None:
    at, degrees = heading_ticks(heading, columns)
    assert (np.diff(at) > 0.0).all() and len(degrees) == 8
    assert min(degrees) > -180 and max(degrees) == 180, "as headings are told everywhere else"
    looks = heading - (at + 0.5) / columns * 2.0 * np.pi
    assert wrap(looks - np.deg2rad(degrees)) == pytest.approx(np.zeros(8), abs=1e-9)
    assert at.min() >= -1.0 - 1e-6 and at.max() <= columns


class TestDrawing:
    def test_the_plan_is_to_scale_and_shows_everything(self) -> None:
        free = (np.array([[-1.0, -1.0], [6.0, -1.0], [6.0, 2.0], [-1.0, 2.0]]),)
        views = (View(np.array([8.0, 1.0, 0.0]), panorama(3)),)
        topo_map = small_map(free=free, views=views, edges=np.array([[0, 1], [1, 2]]))
        figure = draw_map(topo_map, shown_nodes(topo_map, (), 2))
        plan, *strips = figure.axes
        assert plan.get_aspect() == 1.0 and len(strips) == 2
        assert {text.get_text() for text in plan.texts} == {"P0", "P1", "P2", "P3"}
        assert plan.get_xlim()[0] < -1.0 and plan.get_xlim()[1] > 8.0
        legend = plan.get_legend()
        assert legend is not None
        labels = [text.get_text() for text in legend.get_texts()]
        assert labels == ["edge", "training view", "node with a panorama", "left edge of the panorama"]
        assert "4 nodes, 2 edges, 4 panoramas, 1 views" in plan.get_title()
        arrow = legend.legend_handles[1]
        assert isinstance(arrow, Line2D) and "arrow" in str(arrow.get_marker()), "as it is drawn in the plan"
        assert [axes.get_ylabel() for axes in strips] == ["P0\nplace_0", "P1\nplace_1"]

    def test_a_single_node(self) -> None:
        topo_map = small_map(1)
        figure = draw_map(topo_map, shown_nodes(topo_map, (), 8))
        assert len(figure.axes) == 2

    def test_thousands_of_nodes_have_no_names_but_those_shown(self) -> None:
        nodes = [Node(f"{x}-{y}", "", float(x), float(y)) for x in range(60) for y in range(60)]
        nodes[100] = Node("this", "", nodes[100].x, nodes[100].y, 0.0, panorama(9))
        topo_map = TopoMap("big", CAMERA, tuple(nodes))
        figure = draw_map(topo_map, shown_nodes(topo_map, (), 8))
        assert [text.get_text() for text in figure.axes[0].texts] == ["this"]
        assert len(figure.axes) == 2


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    small_map(9).save(tmp_path / "map")
    return tmp_path / "map"


class TestCommand:
    def test_into_the_map_and_what_is_left_out(self, saved: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["map", "show", str(saved)]) == 0
        told = capsys.readouterr().out
        assert f"{saved / 'show.png'}: 9 nodes, 8 of 9 panoramas" in told
        assert "the others: --panoramas 9, or by id, as --nodes P8" in told
        assert read_image(saved / "show.png").shape[1] > 500
        assert run(["map", "show", str(saved)]) == 2, "nothing is overwritten silently"

    def test_nodes_by_id(self, saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        out = tmp_path / "deep" / "some.jpg"
        assert run(["map", "show", str(saved), "-o", str(out), "--nodes", "P3", "P8"]) == 0
        assert "2 of 9 panoramas" in capsys.readouterr().out and out.exists()
        assert run(["map", "show", str(saved), "-o", str(tmp_path / "b.png"), "--nodes", "P77"]) == 2
        assert "no node of the map is called 'P77'; choose from: P0, P1" in capsys.readouterr().err

    def test_a_text_map(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        save_thesis_map(small_map(), tmp_path / "lab.txt")
        assert run(["map", "show", str(tmp_path / "lab.txt")]) == 0
        assert f"{tmp_path / 'lab.png'}: 4 nodes" in capsys.readouterr().out

    @pytest.mark.parametrize(
        ("output", "told"), [("a.xyz", "end the name in .png"), ("", "end the name in .png"), ("d.png", "is a folder")]
    )
    def test_a_place_that_is_no_picture(
        self, output: str, told: str, saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "d.png").mkdir()
        assert run(["map", "show", str(saved), "-o", str(tmp_path / output)]) == 2
        assert told in capsys.readouterr().err
