"""What was worked out from a map comes back as it was, as long as the map is the same, whatever happens to the disk."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from oracles.spoil import Spoil, remove, rewrite, write
from PIL import Image as Pictures

import topoloc.file_stamp
import topoloc.map_store
from topoloc.array_folder import Arrays
from topoloc.errors import InputError
from topoloc.file_stamp import FileStamp, digest_of
from topoloc.files import write_image
from topoloc.map_store import MOST_KEPT, precomputed
from topoloc.thesis_map import save_thesis_map
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Image

CAMERA = Camera(40.0, 48, 36)
LONG_AGO_NS = 10**18
"""In the year 2001."""


def picture(seed: int, columns: int = 432) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (36, columns, 3), dtype=np.uint8)


def write_plainly(path: Path, image: Image) -> None:
    """As PNG whose size does not depend on its pixels."""
    Pictures.fromarray(image).save(path, "PNG", compress_level=0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    nodes = tuple(Node(str(k), f"place {k}", float(k), 0.0, 0.0, picture(k)) for k in range(3))
    views = (View(np.array([0.1, 0.2, 0.3]), picture(9, 48)),)
    TopoMap("m", CAMERA, nodes, views=views).save(tmp_path / "m")
    for k in range(3):
        write_plainly(tmp_path / "m" / "panoramas" / f"{k}.png", picture(k))
    return tmp_path / "m"


def grow_old(folder: Path) -> None:
    """Let the pictures have been written long ago, as those of most maps were."""
    for path in folder.rglob("*.png"):
        os.utime(path, ns=(LONG_AGO_NS, LONG_AGO_NS))


@dataclass
class Maker:
    """Builds from a map's pictures, and counts how often it is asked to."""

    topo_map: TopoMap
    built: int = 0
    more: dict[str, np.ndarray] = field(default_factory=dict)

    def __call__(self) -> Arrays:
        self.built += 1
        panoramas = [node.panorama for node in self.topo_map.nodes if node.panorama is not None]
        return {"mean": np.array([image.mean() for image in panoramas]), "first": np.stack(panoramas)} | self.more


def opened(folder: Path, name: str = "toy", settings: object = (1, 2.5)) -> tuple[int, Arrays]:
    """How often something had to be built for a map that is opened now, and what came of it."""
    make = Maker(TopoMap.load(folder))
    arrays = precomputed(make.topo_map, name, settings, make)
    plain = Maker(make.topo_map)()
    assert arrays.keys() == plain.keys()
    for key, array in arrays.items():
        assert array.dtype == plain[key].dtype and np.array_equal(array, plain[key]), key
        assert not array.flags.writeable
    return make.built, arrays


def results(folder: Path, name: str = "toy") -> list[Path]:
    return sorted((folder / ".topoloc").glob(f"{name}.*"))


def hidden(folder: Path) -> set[str]:
    return {path.name for path in (folder / ".topoloc").glob(".*")} - {".gitignore", ".toy.lock"}


class TestKept:
    def test_made_once(self, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
        assert [opened(folder)[0] for _ in range(3)] == [1, 0, 0]
        assert len(results(folder)) == 1 and hidden(folder) == set()
        assert (folder / ".topoloc" / ".gitignore").read_text() == "*\n"
        assert capfd.readouterr() == ("", "")

    def test_arrays_of_all_kinds_come_back(self, folder: Path) -> None:
        the_map = TopoMap.load(folder)
        more = {
            "empty": np.zeros((0, 3), np.float32),
            "single": np.array(3.5),
            "columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
            "strided": np.arange(10)[::3],
            "yes": np.array([True, False]),
            "swapped": np.arange(3, dtype=">i4"),
        }
        for built in (1, 0):
            make = Maker(the_map, more=more)
            arrays = precomputed(the_map, "toy", (), make)
            assert make.built == built
            for key, array in more.items():
                assert array.dtype == arrays[key].dtype and array.shape == arrays[key].shape
                assert np.array_equal(array, arrays[key])

    @pytest.mark.parametrize("bad", [{"no-name": np.zeros(1)}, {"things": np.array([{}], dtype=object)}])
    def test_what_cannot_be_kept_is_the_programmers_mistake(self, bad: dict[str, np.ndarray], folder: Path) -> None:
        the_map = TopoMap.load(folder)
        with pytest.raises(ValueError, match=r"name|pickle|Object"):
            precomputed(the_map, "toy", (), lambda: bad)
        assert results(folder) == [] and hidden(folder) == set()
        with pytest.raises(ValueError, match="no name for a folder"):
            precomputed(the_map, "../toy", (), Maker(the_map))

    def test_a_build_that_fails_leaves_nothing(self, folder: Path) -> None:
        def fail() -> Arrays:
            raise InputError(folder, "is bad", "mend it")

        with pytest.raises(InputError, match="is bad"):
            precomputed(TopoMap.load(folder), "toy", (1, 2.5), fail)
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]

    def test_other_settings_other_name_other_versions(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        @dataclass(frozen=True)
        class Settings:
            columns: int = 72
            zoom: float = 1.2

        assert [opened(folder, settings=Settings())[0] for _ in range(2)] == [1, 0]
        assert opened(folder, settings=Settings(zoom=1.2 + 1e-12))[0] == 1
        assert opened(folder, "other", Settings())[0] == 1
        monkeypatch.setattr(topoloc.map_store, "version", lambda package: f"{package} of tomorrow")
        assert [opened(folder, settings=Settings())[0] for _ in range(2)] == [1, 0]
        monkeypatch.undo()
        assert opened(folder, settings=Settings())[0] == 0, "two installations do not drive each other out"

    def test_those_last_used_are_kept(self, folder: Path) -> None:
        opened(folder, "toy-2", 0)
        made: list[Path] = []
        for number in range(MOST_KEPT):
            assert opened(folder, settings=number)[0] == 1
            made += set(results(folder)) - set(made)
        for age, path in enumerate(made):
            os.utime(path, ns=(LONG_AGO_NS + age, LONG_AGO_NS + age))
        assert opened(folder, settings=0)[0] == 0
        assert opened(folder, settings=99)[0] == 1
        assert len(results(folder)) == MOST_KEPT and set(made) - set(results(folder)) == {made[1]}
        assert opened(folder, "toy-2", 0)[0] == 0, "names are counted apart"

    def test_saving_over_the_map_drops_it(self, folder: Path) -> None:
        opened(folder)
        the_map = TopoMap.load(folder)
        the_map.save(folder, overwrite=True)
        assert not (folder / ".topoloc").exists()
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]


def exchange(one: Path, other: Path) -> None:
    first = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(first)


def for_each(pattern: str, change: Callable[[Path], object]) -> Spoil:
    """Change what is below a folder and has such a name."""

    def act(folder: Path) -> None:
        for path in list(folder.rglob(pattern)):
            change(path)

    return act


OTHERS: dict[str, Spoil] = {
    "a pixel": lambda folder: write_plainly(folder / "panoramas/1.png", changed(picture(1))),
    "a pixel of a view": lambda folder: write_image(folder / "views/00000.png", changed(picture(9, 48))),
    "two panoramas exchanged": lambda folder: exchange(folder / "panoramas/0.png", folder / "panoramas/1.png"),
    "a position": rewrite("nodes.csv", "1.0,", "1.0000001,"),
    "a heading": rewrite("nodes.csv", "1.0,0.0,0,", "1.0,0.0,1,"),
    "an id": lambda folder: [
        rewrite("nodes.csv", "\n2,", "\n7,")(folder),
        rewrite("edges.csv", "1,2\n", "1,7\n")(folder),
    ],
    "an edge": rewrite("edges.csv", "1,2\n", ""),
    "a pose": rewrite("views.csv", "0.1", "0.11"),
    "no view": remove("views.csv"),
    "the camera": rewrite("map.toml", "hfov_deg = 40.0", "hfov_deg = 40.1"),
    "filtered": rewrite("map.toml", "filtered = false", "filtered = true"),
    "the free area": rewrite("map.toml", "free = []", "free = [[[0, 0], [1, 0], [1, 1]]]"),
    "a node less": rewrite("nodes.csv", "panoramas/2.png", ""),
}

SAME: dict[str, Spoil] = {
    "nothing": lambda folder: None,
    "a touch": for_each("*", Path.touch),
    "a fresh checkout": for_each("*.png", lambda path: path.write_bytes(path.read_bytes())),
    "new modes": for_each("*.png", lambda path: path.chmod(0o600)),
    "names for people": rewrite("nodes.csv", "place 1", "the door"),
    "the map's name": rewrite("map.toml", '"m"', '"n"'),
    "another name of a file": lambda folder: [
        (folder / "panoramas/1.png").rename(folder / "one.png"),
        rewrite("nodes.csv", "panoramas/1.png", "one.png")(folder),
    ],
    "no index": remove(".topoloc/index.json"),
    "an index of rubbish": write(".topoloc/index.json", "rubbish"),
    "an index of another kind": write(".topoloc/index.json", "[1]"),
    "an index with wrong rows": write(".topoloc/index.json", '{"format": 1, "began_ns": 1, "pictures": {"a": [1]}}'),
    "an index without rows": write(".topoloc/index.json", '{"format": 1, "began_ns": 1, "pictures": 3}'),
    "an index from the future": rewrite(".topoloc/index.json", '"format": 1', '"format": 2'),
}


def changed(image: Image) -> Image:
    """One grey level of one pixel is another."""
    other = image.copy()
    other[20, 30, 1] ^= 1
    return other


def read_by(monkeypatch: pytest.MonkeyPatch, module: str) -> list[str]:
    """Names of the files that a module asks for a digest of, in order, from now on."""
    names: list[str] = []

    def recording(path: Path) -> str:
        names.append(path.name)
        return digest_of(path)

    monkeypatch.setattr(f"{module}.digest_of", recording)
    return names


class TestContent:
    @pytest.mark.parametrize("old", [True, False])
    @pytest.mark.parametrize("case", OTHERS)
    def test_another_map_is_prepared_anew(self, case: str, old: bool, folder: Path) -> None:
        if old:
            grow_old(folder)
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]
        OTHERS[case](folder)
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]
        assert len(results(folder)) == 1, "what was made of the map as it was is of no use any more"

    @pytest.mark.parametrize("case", SAME)
    def test_the_same_map_is_not(self, case: str, folder: Path) -> None:
        assert opened(folder)[0] == 1
        SAME[case](folder)
        assert opened(folder)[0] == 0

    def test_a_copy_brings_it_along(self, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        assert opened(folder)[0] == 1
        shutil.copytree(folder, tmp_path / "copy")
        folder.rename(tmp_path / "elsewhere")
        assert opened(tmp_path / "copy")[0] == 0
        read = read_by(monkeypatch, "topoloc.array_folder")
        assert opened(tmp_path / "copy")[0] == 0 and read == [], "it was looked through once"

    def test_pictures_are_not_read_again(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(topoloc.file_stamp, "GRAIN_NS", -(10**18))  # as if they were old
        read = read_by(monkeypatch, "topoloc.pictures")
        make = Maker(TopoMap.load(folder))
        precomputed(make.topo_map, "toy", (), make)
        assert sorted(read) == ["0.png", "00000.png", "1.png", "2.png"]
        read.clear()
        with monkeypatch.context() as blind:
            blind.setattr("topoloc.map_folder.size_of", None)
            precomputed(TopoMap.load(folder), "toy", (), make)
        assert make.built == 1 and read == []
        (folder / "panoramas" / "2.png").touch()
        for _ in range(2):
            precomputed(TopoMap.load(folder), "toy", (), make)
        assert make.built == 1 and read == ["2.png"]

    def test_a_part_of_the_map_forgets_nothing_of_the_others(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(topoloc.file_stamp, "GRAIN_NS", -(10**18))
        opened(folder)
        (folder / "panoramas" / "0.png").touch()
        read = read_by(monkeypatch, "topoloc.pictures")
        the_map = TopoMap.load(folder)
        part = Maker(replace(the_map, nodes=the_map.nodes[:2], edges=None))
        precomputed(part.topo_map, "toy", (), part)
        opened(folder)
        assert read == ["0.png"]

    def test_nor_does_it_make_the_others_older(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """A picture that was too young to be believed when it was read is so after the index was written again."""
        whole = FileStamp.of
        monkeypatch.setattr(FileStamp, "of", lambda path: whole(path)._replace(changed_ns=0, inode=0))
        opened(folder)
        path = folder / "panoramas" / "2.png"
        before = path.stat()
        monkeypatch.setattr("topoloc.picture_index.disk_time", lambda _: before.st_mtime_ns + 10**12)
        the_map = TopoMap.load(folder)
        part = Maker(replace(the_map, nodes=the_map.nodes[:2], edges=None))
        precomputed(part.topo_map, "toy", (), part)
        write_plainly(path, changed(picture(2)))
        os.utime(path, ns=(before.st_mtime_ns, before.st_mtime_ns))
        assert opened(folder)[0] == 1

    @pytest.mark.parametrize("settled", [True, False])
    def test_a_pixel_changed_and_the_time_put_back(
        self, settled: bool, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Noticed in pictures that were written long before the index by the time that nobody can set."""
        path = folder / "panoramas" / "1.png"
        grow_old(folder)
        if settled:
            monkeypatch.setattr(topoloc.file_stamp, "GRAIN_NS", -(10**18))
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]
        before = path.stat()
        write_plainly(path, changed(picture(1)))
        os.utime(path, ns=(LONG_AGO_NS, LONG_AGO_NS))
        assert (path.stat().st_size, path.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)
        assert opened(folder)[0] == 1

    def test_what_was_decoded_before_such_a_change_is_not_used(self, folder: Path) -> None:
        grow_old(folder)
        the_map = TopoMap.load(folder)
        assert np.array_equal(np.asarray(the_map.nodes[1].panorama), picture(1))
        write_plainly(folder / "panoramas" / "1.png", changed(picture(1)))
        grow_old(folder)
        assert np.array_equal(precomputed(the_map, "toy", (), Maker(the_map))["first"][1], changed(picture(1)))

    @pytest.mark.parametrize("old", [True, False])
    def test_where_times_can_be_put_back(self, old: bool, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """On a disk without that time, a young picture is read again, and an old one believed: that is not noticed."""
        whole = FileStamp.of
        monkeypatch.setattr(FileStamp, "of", lambda path: whole(path)._replace(changed_ns=0, inode=0))
        path = folder / "panoramas" / "1.png"
        if old:
            grow_old(folder)
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]
        before = path.stat()
        write_plainly(path, changed(picture(1)))
        os.utime(path, ns=(before.st_mtime_ns, before.st_mtime_ns))
        make = Maker(TopoMap.load(folder))
        precomputed(make.topo_map, "toy", (1, 2.5), make)
        assert make.built == (0 if old else 1)

    def test_a_picture_that_changes_while_it_is_prepared(self, folder: Path) -> None:
        """What comes of it is nobody's."""
        the_map = TopoMap.load(folder)

        def build() -> Arrays:
            write_plainly(folder / "panoramas" / "2.png", picture(5))
            return {"first": np.zeros(3)}

        assert np.array_equal(precomputed(the_map, "toy", (1, 2.5), build)["first"], np.zeros(3))
        assert results(folder) == []
        with pytest.raises(
            InputError, match=r"nodes\.csv, line 4: the picture 2\.png was changed .*; open the map again"
        ):
            precomputed(the_map, "toy", (1, 2.5), build)
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]


UNWRITABLE: dict[str, Spoil] = {
    "a file for the store": write(".topoloc", "in the way"),
    "a folder for the lock": lambda folder: (folder / ".topoloc" / ".toy.lock").mkdir(parents=True),
}
if hasattr(os, "geteuid") and os.geteuid() != 0:  # nothing keeps root from writing
    UNWRITABLE["a read-only folder"] = lambda folder: folder.chmod(0o555)
    UNWRITABLE["a read-only store"] = lambda folder: (folder / ".topoloc").mkdir(mode=0o555)


class TestNotKept:
    def test_a_map_in_memory_or_partly_so(self, folder: Path, tmp_path: Path) -> None:
        loaded = TopoMap.load(folder)
        new = replace(loaded.nodes[1], panorama=picture(77))
        for the_map in (
            replace(loaded, nodes=(loaded.nodes[0], new, loaded.nodes[2])),
            replace(loaded, views=(replace(loaded.views[0], image=picture(78, 48)),)),
            TopoMap("made", CAMERA, (Node("a", "a", 0.0, 0.0, 0.0, picture(0)),)),
        ):
            make = Maker(the_map)
            for _ in range(2):
                assert not precomputed(the_map, "toy", (1, 2.5), make)["mean"].flags.writeable
            assert make.built == 2
        assert not (folder / ".topoloc").exists()

    def test_a_map_without_pictures_and_a_text_map(self, folder: Path, tmp_path: Path) -> None:
        TopoMap("bare", CAMERA, (Node("a", "a", 0.0, 0.0),)).save(tmp_path / "bare")
        whole = TopoMap.load(folder)
        named = tuple(replace(node, name=node.id) for node in whole.nodes)
        save_thesis_map(replace(whole, nodes=named, views=()), tmp_path / "m.txt")
        before = set(tmp_path.rglob("*"))
        for path in (tmp_path / "bare", tmp_path / "m.txt"):
            make = Maker(TopoMap.load(folder))
            for _ in range(2):
                precomputed(TopoMap.load(path), "toy", (), make)
            assert make.built == 2
        assert set(tmp_path.rglob("*")) == before

    def test_a_part_of_the_map_is_another_map(self, folder: Path) -> None:
        opened(folder)
        whole = TopoMap.load(folder)
        part = Maker(replace(whole, nodes=whole.nodes[:2], edges=None))
        assert len(precomputed(part.topo_map, "toy", (1, 2.5), part)["mean"]) == 2
        assert part.built == 1
        assert opened(folder)[0] == 1

    @pytest.mark.parametrize("case", UNWRITABLE)
    def test_nothing_can_be_written(self, case: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
        UNWRITABLE[case](folder)
        assert [opened(folder)[0] for _ in range(2)] == [1, 1]
        out, err = capfd.readouterr()
        assert out == "" and err.count("\n") == 1, "said once"
        assert err.startswith(f"warning: {folder / '.topoloc'}: cannot be written (") and "is not kept" in err

    def test_what_is_there_is_used_where_nothing_can_be_written(
        self, folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        opened(folder)

        def refuse(*_: object, **__: object) -> None:
            raise OSError(30, "Read-only file system")

        for holder, name in ((os, "utime"), (Path, "replace"), (tempfile, "mkstemp")):
            monkeypatch.setattr(holder, name, refuse)
        assert opened(folder)[0] == 0
        assert capfd.readouterr().err == ""


def in_the_way(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("in the way")


def a_folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


def overwritten(path: Path, place: int) -> None:
    with path.open("r+b") as file:
        file.seek(place)
        file.write(b"\x7f\x01\x7f")


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut off": lambda result: os.truncate(result / "first.npy", 5000),
    "without bytes": lambda result: (result / "first.npy").write_bytes(b""),
    "rubbish": lambda result: (result / "mean.npy").write_bytes(b"rubbish" * 100),
    "another value": lambda result: overwritten(result / "first.npy", 4000),
    "another head": lambda result: overwritten(result / "first.npy", 20),
    "another shape": lambda result: np.save(result / "mean.npy", np.zeros(2)),
    "a pickle": lambda result: np.save(result / "mean.npy", np.array([None, {}]), allow_pickle=True),
    "an array is gone": lambda result: (result / "mean.npy").unlink(),
    "no list": lambda result: (result / "arrays.json").unlink(),
    "a list of rubbish": lambda result: (result / "arrays.json").write_text("rubbish"),
    "a list of another kind": lambda result: (result / "arrays.json").write_text("[]"),
    "a list with wrong rows": lambda result: (result / "arrays.json").write_text('{"mean": 3}'),
    "a list with empty rows": lambda result: (result / "arrays.json").write_text('{"mean": []}'),
    "a list that leads elsewhere": lambda result: (result / "arrays.json").write_text(
        '{"../../../x": [1, 2, 3, 4, "5"]}'
    ),
    "it is a file": in_the_way,
    "an array is a folder": lambda result: a_folder_instead(result / "mean.npy"),
}


class TestDamage:
    @pytest.mark.parametrize("case", DAMAGES)
    def test_what_is_damaged_is_made_again(self, case: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
        opened(folder)
        DAMAGES[case](results(folder)[0])
        assert [opened(folder)[0] for _ in range(2)] == [1, 0]
        assert len(results(folder)) == 1 and hidden(folder) == set()
        assert capfd.readouterr().err == ""

    def test_what_is_in_use_may_go(self, folder: Path) -> None:
        _, arrays = opened(folder)
        before = {key: array.copy() for key, array in arrays.items()}
        shutil.rmtree(folder / ".topoloc")
        assert opened(folder)[0] == 1
        assert all(np.array_equal(arrays[key], before[key]) for key in before)


PROCESS = """
import os, resource, signal, sys, time
from pathlib import Path
import numpy as np
import topoloc.file_lock
from topoloc.map_store import precomputed
from topoloc.topo_map import TopoMap

the_map = TopoMap.load(sys.argv[1])
here = Path(sys.argv[1]).parent

def build():
    with (here / "log").open("a") as log:
        log.write("built\\n")
    {act}
    return {{"first": np.stack([node.panorama for node in the_map.nodes]), "zeros": np.zeros(10**6)}}

{prepare}
arrays = precomputed(the_map, "toy", (), build)
print(int(arrays["first"].sum()), len(arrays["zeros"]))
"""
UNTIL_TOLD = 'print("building", flush=True)\n    while not (here / "go").exists(): time.sleep(0.01)'
IMPATIENT = "topoloc.file_lock.PATIENCE_S = 0.0"
DIE_WHILE_WRITING = """
def half(file, array, allow_pickle):
    file.write(b"half of it")
    file.flush()
    os.kill(os.getpid(), signal.SIGKILL)
np.save = half
"""
LITTLE_ROOM = "resource.setrlimit(resource.RLIMIT_FSIZE, (10**6, 10**6))"


def process(folder: Path, act: str = "pass", prepare: str = "") -> subprocess.Popen[str]:
    code = PROCESS.format(act=act, prepare=prepare)
    return subprocess.Popen(
        [sys.executable, "-c", code, str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.skipif(sys.platform == "win32", reason="no signals and no locks there")
class TestProcesses:
    def expected(self) -> str:
        return f"{sum(int(picture(k).sum()) for k in range(3))} {10**6}\n"

    def test_the_second_waits_for_the_first(self, folder: Path) -> None:
        first = process(folder, act=UNTIL_TOLD)
        assert first.stdout is not None and first.stdout.readline() == "building\n"
        second = process(folder, prepare=IMPATIENT)
        assert second.stderr is not None
        assert second.stderr.readline() == f"waiting: another process prepares toy in {folder / '.topoloc'}\n"
        (folder.parent / "go").touch()
        assert first.communicate() == (self.expected(), "")
        assert second.communicate() == (self.expected(), "")
        assert (folder.parent / "log").read_text() == "built\n"
        assert len(results(folder)) == 1 and hidden(folder) == set()

    def test_without_locks_both_are_right(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """The second is done before the first, which throws its own away."""
        monkeypatch.setattr(topoloc.map_store, "wait_for", lambda *_: False)
        make = Maker(TopoMap.load(folder))
        theirs: list[os.stat_result] = []

        def slowly() -> Arrays:
            opened(folder)
            theirs.append(results(folder)[0].stat())
            return make()

        arrays = precomputed(make.topo_map, "toy", (1, 2.5), slowly)
        assert np.array_equal(arrays["mean"], make()["mean"])
        assert len(results(folder)) == 1 and hidden(folder) == set()
        assert opened(folder)[0] == 0

    def test_a_process_that_is_killed_while_it_writes(self, folder: Path) -> None:
        killed = process(folder, prepare=DIE_WHILE_WRITING)
        assert killed.communicate() == ("", "") and killed.returncode < 0
        left = hidden(folder)
        assert len(left) == 1 and results(folder) == [], "or this test sees nothing"
        again = process(folder)
        assert again.communicate() == (self.expected(), "")
        assert hidden(folder) == set() and len(results(folder)) == 1

    def test_a_disk_without_room(self, folder: Path) -> None:
        small = process(folder, prepare=LITTLE_ROOM)
        out, err = small.communicate()
        assert out == self.expected()
        assert err.count("\n") == 1 and err.startswith(f"warning: {folder / '.topoloc'}: cannot be written (")
        assert results(folder) == [] and hidden(folder) == set()


def test_the_list_tells_of_every_file(folder: Path) -> None:
    opened(folder)
    (result,) = results(folder)
    said = json.loads((result / "arrays.json").read_text())
    assert {f"{name}.npy" for name in said} | {"arrays.json"} == {path.name for path in result.iterdir()}
    for name, (*stamp, digest) in said.items():
        assert FileStamp.of(result / f"{name}.npy") == tuple(stamp)
        assert digest_of(result / f"{name}.npy") == digest
