"""A map as a folder: what is saved comes back, and each mistake in a file is named with its line and a remedy."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.spoil import remove, rewrite, write

from topoloc.errors import InputError, OutputExists, UserError
from topoloc.files import write_image
from topoloc.geometry import wrap
from topoloc.topo_map import Camera, Node, TopoMap, View

CAMERA = Camera(40.0, 48, 36)
RNG = np.random.default_rng(0)


def picture(rows: int = 36, columns: int = 432, colour: bool = True) -> np.ndarray:
    return RNG.integers(0, 256, (rows, columns, 3) if colour else (rows, columns)).astype(np.uint8)


def full_map() -> TopoMap:
    nodes = (
        Node("1", "charger", 0.0, 0.0, 0.5, picture()),
        Node("b", 'a "quoted", comma', 1.5, -2.25, -3.0, picture()),
        Node("c-3", "Tür", 1.0 / 3.0, 512345.678, 3.0),
    )
    views = (
        View(np.array([0.1, 0.2, -1.0]), picture(36, 48)),
        View(np.array([1.0 / 7.0, 0.0, 3.0]), picture(36, 48), right=picture(36, 48)),
    )
    free = (np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0 / 3.0]]), np.array([[5.0, 5], [6, 5], [6, 6], [5, 6]]))
    return TopoMap("the “lab”", CAMERA, nodes, np.array([[0, 2], [1, 0]]), free, views, True, 0.12)


def assert_same_map(a: TopoMap, b: TopoMap) -> None:
    assert (a.name, a.camera, a.filtered, a.baseline_m) == (b.name, b.camera, b.filtered, b.baseline_m)
    assert [(n.id, n.name, n.x, n.y) for n in a.nodes] == [(n.id, n.name, n.x, n.y) for n in b.nodes]
    for one, other in zip(a.nodes, b.nodes, strict=True):
        assert float(wrap(one.heading - other.heading)) == pytest.approx(0.0, abs=1e-12)
        assert (one.panorama is None) == (other.panorama is None)
        if one.panorama is not None and other.panorama is not None:
            assert np.array_equal(one.panorama, other.panorama)
    assert np.array_equal(np.asarray(a.edges), np.asarray(b.edges))
    assert len(a.free) == len(b.free) and all(np.array_equal(p, q) for p, q in zip(a.free, b.free, strict=True))
    assert len(a.views) == len(b.views)
    for view, same in zip(a.views, b.views, strict=True):
        assert np.allclose(view.pose, same.pose, atol=1e-12) and np.array_equal(view.image, same.image)
        assert (view.right is None) == (same.right is None)
        if view.right is not None and same.right is not None:
            assert np.array_equal(view.right, same.right)


class TestRoundTrip:
    def test_everything_comes_back(self, tmp_path: Path) -> None:
        the_map = full_map()
        the_map.save(tmp_path / "m")
        assert_same_map(TopoMap.load(tmp_path / "m"), the_map)
        assert_same_map(TopoMap.load(str(tmp_path / "m")), the_map)

    def test_without_stereo_there_is_no_word_of_it(self, tmp_path: Path) -> None:
        views = tuple(replace(view, right=None) for view in full_map().views)
        the_map = replace(full_map(), views=views, baseline_m=None)
        the_map.save(tmp_path / "m")
        assert (tmp_path / "m" / "views.csv").read_text().startswith("x,y,heading,image\n")
        assert "baseline" not in (tmp_path / "m" / "map.toml").read_text()
        assert len(TopoMap.load(tmp_path / "m").views) == 2

    def test_a_bare_map(self, tmp_path: Path) -> None:
        bare = TopoMap("bare", Camera(), (Node("x", "", 0.0, 0.0),))
        bare.save(tmp_path / "m")
        assert_same_map(TopoMap.load(tmp_path / "m"), bare)

    def test_no_edges_stay_no_edges(self, tmp_path: Path) -> None:
        the_map = replace(full_map(), edges=np.zeros((0, 2), dtype=np.int64))
        the_map.save(tmp_path / "m")
        assert len(np.asarray(TopoMap.load(tmp_path / "m").edges)) == 0

    def test_a_grey_panorama_keeps_its_grey_levels(self, tmp_path: Path) -> None:
        grey = picture(colour=False)
        TopoMap("grey", CAMERA, (Node("1", "", 0, 0, 0, grey),), filtered=True).save(tmp_path / "m")
        read = TopoMap.load(tmp_path / "m").nodes[0].panorama
        assert read is not None and np.array_equal(read.reshape(36, 432, -1)[..., 0], grey)

    @pytest.mark.parametrize("identity", ["a/b", "../../escaped", "/abs", "..", "a\\b", "*?"])
    def test_an_id_is_no_path(self, identity: str, tmp_path: Path) -> None:
        """Any id may name a node; its panorama stays inside the folder."""
        the_map = TopoMap("odd", CAMERA, (Node(identity, "", 0, 0, 0, picture()),))
        the_map.save(tmp_path / "inner" / "m")
        assert {p.name for p in tmp_path.iterdir()} == {"inner"}
        assert {p.name for p in (tmp_path / "inner").iterdir()} == {"m"}
        assert_same_map(TopoMap.load(tmp_path / "inner" / "m"), the_map)

    def test_ids_that_look_alike_as_file_names_keep_their_own_panoramas(self, tmp_path: Path) -> None:
        nodes = tuple(
            Node(name, "", float(i), 0, 0, picture()) for i, name in enumerate(("a/b", "a_b", "a%2Fb", "a b"))
        )
        the_map = TopoMap("alike", CAMERA, nodes)
        the_map.save(tmp_path / "m")
        assert_same_map(TopoMap.load(tmp_path / "m"), the_map)

    def test_nothing_is_written_over_unless_told(self, tmp_path: Path) -> None:
        (tmp_path / "m").mkdir()
        (tmp_path / "m" / "precious").write_text("mine")
        with pytest.raises(OutputExists, match="--overwrite"):
            full_map().save(tmp_path / "m")
        assert [p.name for p in (tmp_path / "m").iterdir()] == ["precious"]
        the_map = full_map()
        the_map.save(tmp_path / "m", overwrite=True)
        assert_same_map(TopoMap.load(tmp_path / "m"), the_map)
        assert (tmp_path / "m" / "precious").read_text() == "mine"


NODES = "id,name,x,y,heading,panorama\n1,one,0,0,0,one.png\n\n2,two,1,0,90,\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A map written by hand: two nodes, the first with a panorama."""
    where = tmp_path / "map"
    where.mkdir()
    (where / "map.toml").write_text('name = "hand"\n\n[camera]\nhfov_deg = 40\nwidth = 48\nheight = 36\n')
    (where / "nodes.csv").write_text(NODES)
    write_image(where / "one.png", picture())
    write_image(where / "v.png", picture(36, 48))
    return where


def complaint(folder: Path) -> str:
    with pytest.raises(UserError) as caught:
        TopoMap.load(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert ";" in message, "a remedy follows the problem"
    return message


class TestByHand:
    def test_a_map_written_by_hand(self, folder: Path) -> None:
        the_map = TopoMap.load(folder)
        assert (the_map.name, the_map.camera, the_map.filtered) == ("hand", CAMERA, False)
        assert [node.id for node in the_map.nodes] == ["1", "2"]
        assert the_map.nodes[1].heading == pytest.approx(np.pi / 2)
        assert np.asarray(the_map.edges).tolist() == [[0, 1]]

    @pytest.mark.parametrize(
        "text",
        [
            "\ufeff" + NODES,
            NODES.replace("\n", "\r\n"),
            NODES.replace(",", " , "),
            "panorama,heading,y,x,name,id,note\none.png,0,0,0,one,1,hello\n,90,0,1,two,2,\n",
        ],
        ids=["byte order mark", "Windows line ends", "spaces", "other order and a column more"],
    )
    def test_csv_as_spreadsheets_write_it(self, text: str, folder: Path) -> None:
        plain = TopoMap.load(folder)
        (folder / "nodes.csv").write_text(text, newline="")
        assert_same_map(TopoMap.load(folder), plain)

    def test_the_name_defaults_to_the_folders(self, folder: Path) -> None:
        (folder / "map.toml").write_text("[camera]\nwidth = 48\nheight = 36\n")
        assert TopoMap.load(folder).name == "map"

    def test_a_panorama_may_be_scaled(self, folder: Path) -> None:
        write_image(folder / "one.png", picture(18, 216))
        assert TopoMap.load(folder).nodes[0].panorama is not None


TOML = "[camera]\nwidth = 48\nheight = 36\n"

BAD = {
    "map.toml missing": (remove("map.toml"), r"map\.toml: no such file"),
    "nodes.csv missing": (remove("nodes.csv"), r"nodes\.csv: no such file"),
    "TOML syntax": (rewrite("map.toml", "hfov_deg = 40", "hfov_deg = = 40"), r"map\.toml.*line 4"),
    "unknown key": (write("map.toml", 'nmae = "x"\n' + TOML), r"map\.toml.*'nmae'.*camera.*name"),
    "unknown camera key": (write("map.toml", TOML + "fov = 3\n"), r"map\.toml \[camera\].*'fov'.*hfov_deg"),
    "camera is a number": (write("map.toml", "camera = 5\n"), r"map\.toml.*camera"),
    "camera is a text": (write("map.toml", 'camera = "wide"\n'), r"map\.toml.*camera.*table"),
    "camera is a list": (write("map.toml", "[[camera]]\nwidth = 48\n"), r"map\.toml.*camera"),
    "hfov 0": (rewrite("map.toml", "= 40", "= 0"), r"map\.toml.*hfov_deg.*between 0 and 180"),
    "hfov negative": (rewrite("map.toml", "= 40", "= -40"), r"map\.toml.*hfov_deg.*between 0 and 180"),
    "hfov text": (rewrite("map.toml", "= 40", '= "wide"'), r"map\.toml.*hfov_deg.*'wide'"),
    "hfov nan": (rewrite("map.toml", "= 40", "= nan"), r"map\.toml.*hfov_deg"),
    "hfov inf": (rewrite("map.toml", "= 40", "= inf"), r"map\.toml.*hfov_deg"),
    "width a fraction": (rewrite("map.toml", "= 48", "= 48.5"), r"map\.toml.*width.*whole number"),
    "width 0": (rewrite("map.toml", "= 48", "= 0"), r"map\.toml.*0x36"),
    "width beyond floats": (rewrite("map.toml", "= 48", "= 1" + "0" * 400), r"map\.toml.*width"),
    "filtered is a text": (write("map.toml", 'panoramas_filtered = "no"\n' + TOML), r"map\.toml.*panoramas_filtered"),
    "free is no list": (write("map.toml", "free = 5\n" + TOML), r"map\.toml.*free.*polygons"),
    "free with two corners": (write("map.toml", "free = [[[0, 0], [1, 1]]]\n" + TOML), r"map\.toml.*free.*polygons"),
    "free with NaN": (write("map.toml", "free = [[[0, 0], [1, 1], [nan, 0]]]\n" + TOML), r"map\.toml.*free.*polygons"),
    "nodes.csv empty": (write("nodes.csv", ""), r"nodes\.csv, line 1: the header lacks id"),
    "header only": (write("nodes.csv", NODES.partition("\n")[0] + "\n"), r"nodes\.csv: the map has no nodes"),
    "column lacking": (rewrite("nodes.csv", ",heading", ""), r"nodes\.csv, line 1: .*heading"),
    "repeated id": (rewrite("nodes.csv", "2,two", "1,two"), r"nodes\.csv, line 4: .*'1'.*line 2"),
    "empty id": (rewrite("nodes.csv", "2,two", ",two"), r"nodes\.csv, line 4: .*id"),
    "NaN in x": (rewrite("nodes.csv", "two,1", "two,nan"), r"nodes\.csv, line 4: x is 'nan'"),
    "inf in y": (rewrite("nodes.csv", "1,0,90", "1,-inf,90"), r"nodes\.csv, line 4: y is '-inf'"),
    "letters in heading": (rewrite("nodes.csv", "90", "north"), r"nodes\.csv, line 4: heading is 'north'"),
    "nothing in x": (rewrite("nodes.csv", "two,1", "two,"), r"nodes\.csv, line 4: x is ''"),
    "a value too many": (rewrite("nodes.csv", "90,", "90,,"), r"nodes\.csv, line 4: 7 values under 6"),
    "a value too few": (rewrite("nodes.csv", "0,90,", "90,"), r"nodes\.csv, line 4: 5 values under 6"),
    "decimal commas": (rewrite("nodes.csv", "two,1,", "two,1,5,"), r"nodes\.csv, line 4: 7 values under 6"),
    "binary": (write("nodes.csv", bytes(range(256)) * 4), r"nodes\.csv: .*text"),
    "NUL in a path": (rewrite("nodes.csv", "one.png", "o\0ne.png"), r"nodes\.csv, line 2"),
    "an open quote before much text": (write("nodes.csv", NODES + '3,"' + "x" * 200_000), r"nodes\.csv"),
    "panorama missing": (remove("one.png"), r"nodes\.csv, line 2: .*one\.png"),
    "panorama is a text": (write("one.png", "hello"), r"nodes\.csv, line 2: .*one\.png.*decode"),
    "panorama without bytes": (write("one.png", ""), r"nodes\.csv, line 2: .*one\.png.*decode"),
    "panorama is a folder": (rewrite("nodes.csv", "one.png", "."), r"nodes\.csv, line 2: "),
    "panorama too wide": (lambda folder: write_image(folder / "one.png", picture(36, 460)), r"line 2: .*460.*432"),
    "panorama of one frame": (lambda folder: write_image(folder / "one.png", picture(36, 48)), r"line 2: .*48.*432"),
    "edge to nowhere": (write("edges.csv", "a,b\n1,2\n1,9\n"), r"edges\.csv, line 3: .*'9'"),
    "edges without header": (write("edges.csv", "1,2\n"), r"edges\.csv, line 1: .*a, b"),
    "view missing": (write("views.csv", "x,y,heading,image\n0,0,0,u.png\n"), r"views\.csv, line 2: .*u\.png"),
    "view without image": (write("views.csv", "x,y,heading,image\n0,0,0,\n"), r"views\.csv, line 2: "),
    "view of a panorama": (write("views.csv", "x,y,heading,image\n0,0,0,one.png\n"), r"views\.csv, line 2: .*432x36"),
    "right missing": (write("views.csv", "x,y,heading,image,right\n0,0,0,v.png,\n0,0,0,v.png,w.png\n"), r"3: .*w\.png"),
    "right of a panorama": (
        write("views.csv", "x,y,heading,image,right\n0,0,0,v.png,one.png\n"),
        r"views\.csv, line 2: one\.png is 432x36.*48x36",
    ),
    "baseline negative": (
        write("map.toml", "baseline_m = -0.1\n" + TOML),
        r"map\.toml: baseline_m is -0\.1; .*above 0",
    ),
    "baseline a text": (write("map.toml", 'baseline_m = "wide"\n' + TOML), r"map\.toml: baseline_m is 'wide'"),
    "view with letters": (write("views.csv", "x,y,heading,image\nq,0,0,one.png\n"), r"views\.csv, line 2: x is 'q'"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_with_its_place(case: str, folder: Path) -> None:
    spoil, expected = BAD[case]
    spoil(folder)
    assert re.search(expected, complaint(folder))


def test_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere: no such folder; name"):
        TopoMap.load(tmp_path / "nowhere")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="no such folder"):
        TopoMap.load(tmp_path / "file")


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99])
def test_a_truncated_panorama(share: float, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = (folder / "one.png").read_bytes()
    (folder / "one.png").write_bytes(data[: int(len(data) * share)])
    assert "one.png" in complaint(folder)
    assert capfd.readouterr().err == "", "a library's own complaint must not reach the user's screen"


def test_a_picture_that_claims_to_be_enormous(folder: Path) -> None:
    """The header alone says 100,000 x 100,000 pixels."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"0")) + chunk(b"IEND", b"")
    (folder / "one.png").write_bytes(data)
    assert "one.png" in complaint(folder)
