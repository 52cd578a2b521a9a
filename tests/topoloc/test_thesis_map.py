"""The thesis's text map (4.1.3, Figure 4.1): what it says, what it becomes, and the one line that each mistake gets."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.spoil import Spoil, remove, rewrite, write

from topoloc.errors import InputError, OutputExists, UserError
from topoloc.files import read_image, write_image
from topoloc.geometry import rotate, wrap
from topoloc.thesis_map import (
    ThesisMapSettings,
    load_thesis_map,
    read_thesis_map,
    save_thesis_map,
)
from topoloc.topo_map import Camera, Node, TopoMap, View

FIGURE_4_1 = """\
/home/belush/images/panoramic
CHARGER 0 0
DESK_1 1000 0
DESK_2 1000 1000
DESK_3 0 1000
SHELVES 0 -1000
CENTRE 1000 -1000
CUPBOARD 2000 -1000
DOOR 2000 0
"""
FIGURE_5_22 = {1: (0, 0), 2: (1, 0), 3: (1, 1), 4: (1, 2), 5: (0, 2), 6: (0, 1), 7: (-1, 1), 8: (-1, 0)}
"""Nodes of the path on its 1 m grid [m]: EQUATIONS.md, 1."""
NAMES = ("CHARGER", "SHELVES", "CENTRE", "CUPBOARD", "DOOR", "DESK_1", "DESK_2", "DESK_3")
"""Those of Figure 4.1, by node of Figure 5.22."""

WHOLE_MM = st.integers(-(10**8), 10**8)


def circle(seed: int, rows: int = 36, columns: int = 432) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 3)).astype(np.uint8)


def same(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    assert one is not None and other is not None
    return np.array_equal(one, other)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A folder with ``lab.txt``, the text of Figure 4.1 but for its first line, and a panorama for each place."""
    (tmp_path / "lab.txt").write_text(FIGURE_4_1.replace("/home/belush/images/panoramic", "panoramic"))
    for seed, name in enumerate(NAMES):
        write_image(tmp_path / "panoramic" / f"{name}.png", circle(seed))
    return tmp_path


class TestFigure41:
    def test_as_it_is_printed(self, tmp_path: Path) -> None:
        (tmp_path / "lab.txt").write_text(FIGURE_4_1)
        said = read_thesis_map(tmp_path / "lab.txt")
        assert said.folder == Path("/home/belush/images/panoramic")
        assert [place.name for place in said.places] == [
            "CHARGER", "DESK_1", "DESK_2", "DESK_3", "SHELVES", "CENTRE", "CUPBOARD", "DOOR",
        ]  # fmt: skip
        assert said.places[6][1:] == (2000.0, -1000.0, 8)

    def test_is_the_map_of_figure_5_22_turned_by_a_right_angle(self, lab: Path) -> None:
        the_map = TopoMap.load(lab / "lab.txt")
        place = {node.id: (node.x, node.y) for node in the_map.nodes}
        for number, name in enumerate(NAMES, start=1):
            assert place[name] == pytest.approx(rotate(np.array(FIGURE_5_22[number], dtype=float), -np.pi / 2))
        of_figure = TopoMap("", Camera(), tuple(Node(str(k), "", x, y) for k, (x, y) in FIGURE_5_22.items()))
        number_of = {name: str(k) for k, name in enumerate(NAMES, start=1)}
        joined = {frozenset(number_of[the_map.nodes[i].id] for i in pair) for pair in np.asarray(the_map.edges)}
        assert joined == {frozenset(of_figure.nodes[i].id for i in pair) for pair in np.asarray(of_figure.edges)}

    def test_panoramas_camera_and_headings(self, lab: Path) -> None:
        the_map = TopoMap.load(str(lab / "lab.txt"))
        assert the_map.name == "lab" and the_map.camera == Camera(40.0, 48, 36) and not the_map.filtered
        for node in the_map.nodes:
            assert same(node.panorama, circle(NAMES.index(node.id)))
            assert node.name == node.id
            assert node.heading == pytest.approx(np.deg2rad(20.0))

    @given(st.floats(-400.0, 400.0), st.floats(20.0, 100.0))
    def test_the_first_column_begins_half_a_view_left_of_the_reference(self, reference: float, hfov: float) -> None:
        heading = ThesisMapSettings(hfov, reference).first_column
        assert -np.pi <= heading < np.pi
        assert float(wrap(heading - np.deg2rad(reference) - np.deg2rad(hfov) / 2)) == pytest.approx(0.0, abs=1e-9)


class TestRoundTrip:
    def test_text_map_text(self, lab: Path) -> None:
        the_map = load_thesis_map(lab / "lab.txt", ThesisMapSettings(40.0, 90.0, True))
        known = save_thesis_map(the_map, lab / "again" / "copy.txt")
        assert known == ThesisMapSettings(40.0, 90.0, True)
        written = (lab / "again" / "copy.txt").read_text().splitlines()
        assert written == ["copy_panoramas", *FIGURE_4_1.splitlines()[1:]]
        again = load_thesis_map(lab / "again" / "copy.txt", known)
        assert [replace(n, panorama=None) for n in again.nodes] == [replace(n, panorama=None) for n in the_map.nodes]
        assert all(same(a.panorama, b.panorama) for a, b in zip(again.nodes, the_map.nodes, strict=True))
        assert (again.camera, again.filtered) == (the_map.camera, True)

    @settings(max_examples=20, deadline=None)
    @given(places=st.lists(st.tuples(WHOLE_MM, WHOLE_MM), min_size=1, max_size=4))
    def test_whole_millimetres_stay(
        self, places: list[tuple[int, int]], tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        folder = tmp_path_factory.mktemp("mm")
        lines = [f"P{i} {x} {y}" for i, (x, y) in enumerate(places)]
        (folder / "m.txt").write_text("\n".join([".", *lines]))
        for i in range(len(places)):
            write_image(folder / f"P{i}.png", circle(i, 4, 54))
        save_thesis_map(load_thesis_map(folder / "m.txt"), folder / "n.txt")
        assert (folder / "n.txt").read_text().splitlines()[1:] == lines

    def test_what_lies_between_is_rounded(self, tmp_path: Path) -> None:
        one = TopoMap("m", Camera(40.0, 48, 36), (Node("A", "", 0.12346, -1.9996, 0.1, circle(0)),))
        known = save_thesis_map(one, tmp_path / "m.txt")
        assert (tmp_path / "m.txt").read_text() == "m_panoramas\nA 123 -2000\n"
        assert load_thesis_map(tmp_path / "m.txt", known).nodes[0].heading == pytest.approx(0.1, abs=1e-9)

    def test_blanks_empty_lines_and_other_kinds_of_picture(self, lab: Path) -> None:
        write_image(lab / "panoramic" / "DOOR.jpg", read_image(lab / "panoramic" / "DOOR.png"))
        (lab / "panoramic" / "DOOR.jpg").rename(lab / "panoramic" / "DOOR.JPG")
        (lab / "panoramic" / "DOOR.png").unlink()
        (lab / "panoramic" / "DESK_1.txt").write_text("no picture")
        text = (lab / "lab.txt").read_text().replace("DOOR 2000 0", "\n  DOOR\t2e3   0.0 \r\n")
        (lab / "lab.txt").write_bytes(b"\xef\xbb\xbf" + text.encode())
        node = TopoMap.load(lab / "lab.txt").nodes[-1]
        assert (node.id, node.x, node.y) == ("DOOR", 2.0, 0.0)


BAD: dict[str, tuple[Spoil, str]] = {
    "empty": (write("lab.txt", "\n  \n"), r"lab\.txt: holds nothing.*; write the folder"),
    "no places": (write("lab.txt", "panoramic\n"), r"lab\.txt: names no places.*; write"),
    "not text": (write("lab.txt", b"\xff\xfe\x00"), r"lab\.txt: is not a text file in UTF-8; write"),
    "no folder": (rewrite("lab.txt", "panoramic", "elsewhere"), r"line 1: the folder .*elsewhere cannot be read.*; "),
    "no first line": (rewrite("lab.txt", "panoramic\n", ""), r"line 1: the folder .*CHARGER 0 0 cannot be read.*; "),
    "a NUL": (rewrite("lab.txt", "panoramic", "pano\0ramic"), r"line 1: the folder .* cannot be read.*; "),
    "no picture": (remove("panoramic/DESK_2.png"), r"line 4: .*panoramic holds no picture of 'DESK_2'; put"),
    "two pictures": (
        lambda folder: write_image(folder / "panoramic/DESK_2.jpg", circle(0)),
        r"line 4: 'DESK_2' has two pictures, DESK_2\.jpg and DESK_2\.png; keep",
    ),
    "broken picture": (write("panoramic/DESK_2.png", "no"), r"line 4: the picture DESK_2\.png does not decode.*; save"),
    "another shape": (
        lambda folder: write_image(folder / "panoramic/DESK_2.png", circle(0, 36, 300)),
        r"line 4: DESK_2\.png is 300x36: not 432x36 in shape, as the first; make",
    ),
    "a word for x": (rewrite("lab.txt", "1000 1000", "one 1000"), r"line 4: x is 'one', not a finite number; write"),
    "an infinite y": (rewrite("lab.txt", "1000 1000", "1000 inf"), r"line 4: y is 'inf', not a finite number; write"),
    "a blank in the name": (rewrite("lab.txt", "DESK_2", "DESK 2"), r"line 4: 'DESK 2 1000 1000' has 4 words; write"),
    "no y": (rewrite("lab.txt", "1000 1000", "1000"), r"line 4: 'DESK_2 1000' has 2 words; write"),
    "far away": (rewrite("lab.txt", "1000 1000", "1e13 0"), r"line 4: the place lies 1e\+10 m from.*; write mill"),
    "a name twice": (rewrite("lab.txt", "DESK_2", "DESK_1"), r"line 4: the name 'DESK_1' stands .* on line 3; give"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_with_its_place(case: str, lab: Path) -> None:
    spoil, expected = BAD[case]
    spoil(lab)
    with pytest.raises(InputError) as caught:
        TopoMap.load(lab / "lab.txt")
    message = str(caught.value)
    assert re.search(expected, message) and "\n" not in message


def test_a_part_of_a_map_folder_is_no_text_map(lab: Path) -> None:
    TopoMap.load(lab / "lab.txt").save(lab / "map")
    for name in ("map.toml", "nodes.csv", "edges.csv"):
        with pytest.raises(InputError, match=rf"{name}: is a part of a map folder; name the folder itself, .*map$"):
            TopoMap.load(lab / "map" / name)


def test_settings_say_what_must_hold() -> None:
    for hfov in (0.0, 180.0, np.nan):
        with pytest.raises(ValueError, match=r"hfov_deg is .* between 0 and 180"):
            ThesisMapSettings(hfov)
    with pytest.raises(ValueError, match="reference_deg is inf; it must be finite"):
        ThesisMapSettings(reference_deg=np.inf)


def pair(**second: object) -> TopoMap:
    """Two nodes that a text map can hold, the second one as told."""
    node = {"id": "B", "name": "", "x": 1.0, "y": 0.0, "heading": 0.5, "panorama": circle(1)} | second
    return TopoMap("m", Camera(40.0, 48, 36), (Node("A", "DOOR", 0.0, 0.0, 0.5, circle(0)), Node(**node)))  # type: ignore[arg-type]


LOST: dict[str, tuple[TopoMap, str]] = {
    "a blank": (pair(name="the desk"), r"'the desk' has blanks.*; rename"),
    "a tab": (pair(name="the\tdesk"), "has blanks or is no file name"),
    "a path": (pair(name="../desk"), r"'\.\./desk' .* no file name"),
    "one name": (pair(name="DOOR"), r"nodes A and B are both called 'DOOR'.*; rename"),
    "one name on some systems": (pair(name="Door"), r"nodes A and B are both called 'Door'"),
    "headings": (pair(heading=0.6), r"panoramas of DOOR and B begin at different headings.*; roll"),
    "no panorama": (pair(panorama=None), r"node B has no panorama.*; take"),
    "views": (replace(pair(), views=(View(np.zeros(3), circle(0, 36, 48)),)), r"training views.*; save it as a folder"),
    "free area": (replace(pair(), free=(np.eye(3)[:, :2],)), r"free polygons.*; save it as a folder"),
    "edges": (replace(pair(), edges=np.zeros((0, 2), dtype=np.int64)), r"edges.*; save it as a folder"),
}


@pytest.mark.parametrize("case", LOST)
def test_what_a_text_map_cannot_hold_is_refused(case: str, tmp_path: Path) -> None:
    the_map, expected = LOST[case]
    with pytest.raises(UserError, match=expected) as caught:
        save_thesis_map(the_map, tmp_path / "m.txt")
    assert "\n" not in str(caught.value) and list(tmp_path.iterdir()) == []


class TestOverwriting:
    def test_nothing_is_replaced_unasked(self, tmp_path: Path) -> None:
        (tmp_path / "m.txt").write_text("mine")
        with pytest.raises(OutputExists):
            save_thesis_map(pair(), tmp_path / "m.txt")
        assert (tmp_path / "m.txt").read_text() == "mine" and not (tmp_path / "m_panoramas").exists()
        (tmp_path / "n_panoramas").mkdir()
        (tmp_path / "n_panoramas" / "x").write_text("")
        with pytest.raises(OutputExists):
            save_thesis_map(pair(), tmp_path / "n.txt")
        assert not (tmp_path / "n.txt").exists()

    def test_no_second_picture_of_a_place_is_left(self, tmp_path: Path) -> None:
        write_image(tmp_path / "m_panoramas" / "DOOR.jpg", circle(5))
        write_image(tmp_path / "m_panoramas" / "OTHER.jpg", circle(5))
        known = save_thesis_map(pair(), tmp_path / "m.txt", overwrite=True)
        assert len(load_thesis_map(tmp_path / "m.txt", known).nodes) == 2
        assert {p.name for p in (tmp_path / "m_panoramas").iterdir()} == {"DOOR.png", "B.png", "OTHER.jpg"}
