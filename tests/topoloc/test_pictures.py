"""Pictures of a map stay on the disk until they are asked for, and are then what they always were."""

from __future__ import annotations

import copy
import io
import os
import pickle
import re
import struct
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.spoil import rewrite
from PIL import Image as Pictures
from PIL.PngImagePlugin import PngInfo

import topoloc.pictures
from topoloc.checks import check_map
from topoloc.errors import InputError, UnreadableImage
from topoloc.files import read_image, write_image
from topoloc.picture_header import size_of
from topoloc.pictures import PictureFile, Recent, held_in
from topoloc.thesis_map import save_thesis_map
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Image

CAMERA = Camera(40.0, 48, 36)
ORIENTATION = 0x0112


def picture(seed: int, rows: int = 36, columns: int = 432) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 3), dtype=np.uint8)


def some_map() -> TopoMap:
    nodes = (*(Node(str(k), f"place {k}", float(k), 0.0, 0.0, picture(k)) for k in range(3)), Node("3", "", 3.0, 0.0))
    views = (View(np.zeros(3), picture(10, 36, 48)), View(np.ones(3), picture(11, 36, 48), picture(12, 36, 48)))
    return TopoMap("m", CAMERA, nodes, views=views, baseline_m=0.1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    some_map().save(tmp_path / "m")
    return tmp_path / "m"


def assert_same_pictures(read: TopoMap, expected: TopoMap) -> None:
    for node, other in zip(read.nodes, expected.nodes, strict=True):
        assert node.has_panorama == (node.panorama is not None) == (other.panorama is not None)
        assert other.panorama is None or np.array_equal(np.asarray(node.panorama), other.panorama)
    for view, seen in zip(read.views, expected.views, strict=True):
        assert np.array_equal(view.image, seen.image)
        assert view.has_right == (view.right is not None) == (seen.right is not None)
        assert seen.right is None or np.array_equal(np.asarray(view.right), seen.right)


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that were decoded, in order."""
    names: list[str] = []

    def counting(path: Path) -> Image:
        names.append(path.name)
        return read_image(path)

    monkeypatch.setattr(topoloc.pictures, "read_image", counting)
    return names


class TestLazily:
    def test_opening_decodes_nothing_and_asking_decodes_once(self, folder: Path, decoded: list[str]) -> None:
        the_map = TopoMap.load(folder)
        assert [node.has_panorama for node in the_map.nodes] == [True, True, True, False]
        assert [view.has_right for view in the_map.views] == [False, True]
        assert decoded == []
        first = the_map.nodes[1].panorama
        assert first is not None and not first.flags.writeable
        assert the_map.nodes[1].panorama is first
        assert decoded == ["1.png"]
        assert_same_pictures(the_map, some_map())
        assert len(decoded) == 6

    def test_pixels_cannot_be_written_to(self, folder: Path) -> None:
        """They would be lost when the picture is decoded again."""
        Pictures.fromarray(np.zeros((36, 432), np.uint16)).save(folder / "panoramas" / "0.png")
        for node in TopoMap.load(folder).nodes[:3]:
            assert not np.asarray(node.panorama).flags.writeable

    def test_beyond_the_budget_pictures_are_decoded_again(
        self, folder: Path, decoded: list[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(Recent.__init__, "__defaults__", (2 * 36 * 432 * 3,))
        the_map = TopoMap.load(folder)
        for _ in range(2):
            for node in the_map.nodes:
                assert node.panorama is None or np.array_equal(node.panorama, picture(int(node.id)))
        assert decoded == ["0.png", "1.png", "2.png"] * 2

    def test_a_relative_folder_stays_the_same(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(folder.parent)
        the_map = TopoMap.load("m")
        monkeypatch.chdir("/")
        assert_same_pictures(the_map, some_map())

    def test_a_pickled_map_takes_no_pixels_along(self, folder: Path, decoded: list[str]) -> None:
        the_map = TopoMap.load(folder)
        assert the_map.nodes[0].panorama is not None and decoded == ["0.png"]
        data = pickle.dumps(the_map)
        assert len(data) < picture(0).nbytes / 4
        there = pickle.loads(data)
        assert decoded == ["0.png"]
        assert_same_pictures(there, some_map())
        shelves = [held.shelf for node in there.nodes if isinstance(held := held_in(node, "panorama"), PictureFile)]
        assert all(shelf is shelves[0] for shelf in shelves) and len(shelves) == 3

    def test_nodes_are_still_values(self, folder: Path) -> None:
        node = TopoMap.load(folder).nodes[1]
        assert node == Node("1", "place 1", 1.0, 0.0) and hash(node) == hash(Node("1", "place 1", 1.0, 0.0))
        assert repr(node) == "Node(id='1', name='place 1', x=1.0, y=0.0, heading=0.0)"
        turned = replace(node, heading=1.0)
        assert np.array_equal(np.asarray(turned.panorama), picture(1)) and turned.heading == 1.0
        assert np.array_equal(np.asarray(copy.deepcopy(node).panorama), picture(1))
        assert replace(node, panorama=None).panorama is None
        assert Node("a", "a", 0.0, 0.0).panorama is None and not Node("a", "a", 0.0, 0.0).has_panorama
        with pytest.raises(AttributeError):
            node.panorama = None  # type: ignore[misc]
        with pytest.raises(TypeError):
            View(np.zeros(3))  # type: ignore[call-arg]


def spoiled(path: Path) -> None:
    """Other bytes in the middle of a PNG: its two ends are whole."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 40] = bytes(40)
    path.write_bytes(data)


class TestBroken:
    def test_a_picture_is_named_with_its_line_when_it_is_decoded(self, folder: Path) -> None:
        spoiled(folder / "panoramas" / "1.png")
        spoiled(folder / "views" / "00001_right.png")
        the_map = TopoMap.load(folder)
        with pytest.raises(
            InputError, match=r"nodes\.csv, line 3: the picture 1\.png does not decode as an image; save"
        ):
            _ = the_map.nodes[1].panorama
        with pytest.raises(InputError, match=r"views\.csv, line 3: the picture 00001_right\.png does not decode"):
            _ = the_map.views[1].right
        assert not isinstance(error_of(lambda: the_map.nodes[1].panorama), UnreadableImage), "a map is no blind frame"

    @pytest.mark.parametrize("name", ["panoramas/2.png", "views/00000.png", "views/00001_right.png"])
    def test_a_check_finds_it(self, name: str, folder: Path) -> None:
        spoiled(folder / name)
        with pytest.raises(InputError, match=re.escape(Path(name).name)):
            check_map(TopoMap.load(folder), folder)

    def test_a_picture_that_was_changed_meanwhile(self, folder: Path) -> None:
        the_map = TopoMap.load(folder)
        write_image(folder / "panoramas" / "0.png", picture(7))
        with pytest.raises(InputError, match=r"line 2: the picture 0\.png was changed after .*; open the map again"):
            _ = the_map.nodes[0].panorama
        (folder / "panoramas" / "1.png").unlink()
        with pytest.raises(InputError, match=r"line 3: the picture 1\.png cannot be read \(No such file.*; restore"):
            _ = the_map.nodes[1].panorama
        (folder / "panoramas" / "2.png").chmod(0o600)
        os.link(folder / "panoramas" / "2.png", folder / "panoramas" / "link.png")
        assert np.array_equal(np.asarray(the_map.nodes[2].panorama), picture(2)), "its content is the same"

    def test_a_picture_that_its_end_turns(self, folder: Path) -> None:
        """EXIF may follow the pixels, where opening a map does not look."""
        path = folder / "panoramas" / "0.png"
        whole = path.read_bytes()
        path.write_bytes(whole[:-12] + chunk(b"eXIf", turned(6)[6:]) + whole[-12:])
        with pytest.raises(InputError, match=r"line 2: the picture 0\.png is 36x432, and its head says 432x36; save"):
            _ = TopoMap.load(folder).nodes[0].panorama


def error_of(act: Callable[[], object]) -> BaseException:
    with pytest.raises(InputError) as caught:
        act()
    return caught.value


@pytest.mark.parametrize("budget", [0, 10**8])
class TestSavedOntoItself:
    @pytest.fixture(autouse=True)
    def kept(self, budget: int, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(Recent.__init__, "__defaults__", (budget,))

    def test_pictures_are_those_that_were_written(self, folder: Path) -> None:
        """Node 0 names the picture that node 1 will be written to, and the reverse."""
        rewrite("nodes.csv", "panoramas/0.png", "panoramas/x.png")(folder)
        rewrite("nodes.csv", "panoramas/1.png", "panoramas/0.png")(folder)
        rewrite("nodes.csv", "panoramas/x.png", "panoramas/1.png")(folder)
        the_map, other = TopoMap.load(folder), TopoMap.load(folder)
        the_map.save(folder, overwrite=True)
        nodes = some_map().nodes
        swapped = (replace(nodes[0], panorama=picture(1)), replace(nodes[1], panorama=picture(0)), *nodes[2:])
        expected = replace(some_map(), nodes=swapped)
        assert_same_pictures(the_map, expected)
        assert_same_pictures(TopoMap.load(folder), expected)
        assert "open the map again" in str(error_of(lambda: other.nodes[0].panorama)), "rather than the wrong picture"

    def test_a_picture_from_elsewhere_stays_there(self, folder: Path, tmp_path: Path) -> None:
        the_map = TopoMap.load(folder)
        the_map.save(tmp_path / "copy")
        held = held_in(the_map.nodes[0], "panorama")
        assert isinstance(held, PictureFile) and held.path == folder / "panoramas" / "0.png"
        (tmp_path / "copy" / "panoramas" / "0.png").unlink()
        assert_same_pictures(the_map, some_map())

    def test_a_text_map(self, tmp_path: Path) -> None:
        plain = TopoMap("m", CAMERA, tuple(replace(node, name=node.id) for node in some_map().nodes[:3]))
        save_thesis_map(plain, tmp_path / "m.txt")
        the_map = TopoMap.load(tmp_path / "m.txt")
        save_thesis_map(the_map, tmp_path / "m.txt", overwrite=True)
        assert_same_pictures(the_map, plain)


class TestRecent:
    def test_the_last_ones_are_kept(self) -> None:
        recent = Recent(2500)
        made: list[int] = []

        def get(key: int) -> Image:
            def make() -> Image:
                made.append(key)
                return np.full(1000, key, np.uint8)

            return recent.get(key, make)

        for key in (0, 1, 0, 2, 0, 1):
            assert (get(key) == key).all()
            assert recent.held <= 2500
        assert made == [0, 1, 2, 1]

    def test_one_that_is_too_large_drives_none_out(self) -> None:
        recent = Recent(2500)
        small = recent.get("small", lambda: np.zeros(1000, np.uint8))
        assert recent.get("large", lambda: np.zeros(3000, np.uint8)).size == 3000
        assert recent.get("small", lambda: np.ones(1, np.uint8)) is small

    def test_threads(self) -> None:
        recent = Recent(5000)

        def right(key: int) -> bool:
            return bool((recent.get(key % 9, lambda: np.full(1000, key % 9, np.uint8)) == key % 9).all())

        with ThreadPoolExecutor(8) as pool:
            assert all(pool.map(right, range(3000)))
        assert recent.held <= 5000


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def turned(orientation: int) -> bytes:
    """EXIF that says so."""
    exif = Pictures.Exif()
    exif[ORIENTATION] = orientation
    return b"Exif\0\0" + exif.tobytes().removeprefix(b"Exif\0\0")


def encoded(kind: str, mode: str = "RGB", **options: object) -> bytes:
    buffer = io.BytesIO()
    Pictures.fromarray(picture(0, 20, 31)).convert(mode).save(buffer, kind, **options)
    return buffer.getvalue()


def with_exif_before_pixels(data: bytes) -> bytes:
    return data[:33] + chunk(b"eXIf", turned(6)[6:]) + data[33:]


def commented() -> PngInfo:
    info = PngInfo()
    info.add_text("Software", "somebody's")
    return info


FILES: dict[str, bytes] = {
    "PNG": encoded("PNG"),
    "grey PNG": encoded("PNG", "L"),
    "PNG of 16 bits": encoded("PNG", "I;16"),
    "PNG with a palette": encoded("PNG", "P"),
    "PNG with alpha": encoded("PNG", "RGBA"),
    "PNG with a resolution": encoded("PNG", dpi=(72, 72)),
    "PNG with a comment": encoded("PNG", pnginfo=commented()),
    "PNG that is turned": with_exif_before_pixels(encoded("PNG")),
    "PNG and more": encoded("PNG") + b"more",
    "JPEG": encoded("JPEG"),
    "progressive JPEG": encoded("JPEG", progressive=True),
    "JPEG upside down": encoded("JPEG", exif=turned(3)),
    "JPEG that is turned": encoded("JPEG", exif=turned(6)),
    "JPEG that is turned and mirrored": encoded("JPEG", exif=turned(5)),
    "JPEG and more": encoded("JPEG") + b"more",
    "BMP": encoded("BMP"),
    "TIFF": encoded("TIFF"),
    "PPM": encoded("PPM"),
}


class TestSize:
    @pytest.mark.parametrize("case", FILES)
    def test_is_that_of_the_picture(self, case: str, tmp_path: Path) -> None:
        (tmp_path / "p").write_bytes(FILES[case])
        rows, columns = read_image(tmp_path / "p").shape[:2]
        assert size_of(tmp_path / "p") == (rows, columns)
        assert ("turned" in case) == ((rows, columns) == (31, 20))

    @pytest.mark.parametrize("case", ["PNG", "PNG with a palette", "JPEG", "JPEG that is turned", "BMP", "TIFF"])
    @pytest.mark.parametrize("share", [0.0, 0.01, 0.1, 0.5, 0.99])
    @pytest.mark.filterwarnings("ignore:Corrupt EXIF data:UserWarning")
    def test_a_file_that_is_cut_off_is_refused_where_it_does_not_decode(
        self, case: str, share: float, tmp_path: Path
    ) -> None:
        """A few bytes may lack at the end, and all pixels be there."""
        (tmp_path / "p").write_bytes(FILES[case][: int(len(FILES[case]) * share)])
        try:
            expected = read_image(tmp_path / "p").shape[:2]
        except UnreadableImage:
            with pytest.raises(UnreadableImage, match="does not decode"):
                size_of(tmp_path / "p")
        else:
            assert share > 0.9 and size_of(tmp_path / "p") == expected

    @pytest.mark.parametrize("case", ["PNG", "grey PNG", "PNG with a comment", "JPEG", "JPEG that is turned"])
    def test_is_known_without_decoding(self, case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "p").write_bytes(FILES[case])
        expected = read_image(tmp_path / "p").shape[:2]
        monkeypatch.setattr("topoloc.picture_header.read_image", None)
        assert size_of(tmp_path / "p") == expected

    def test_a_head_that_is_damaged_is_refused(self, tmp_path: Path) -> None:
        data = bytearray(FILES["PNG"])
        data[19] += 1  # a column more
        (tmp_path / "p").write_bytes(data)
        with pytest.raises(UnreadableImage):
            size_of(tmp_path / "p")
