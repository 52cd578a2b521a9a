"""Files appear whole or not at all, and nobody's files are lost."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pictures

from topoloc import files
from topoloc.errors import InputError, OutputExists, UnreadableImage, UserError
from topoloc.files import (
    new_folder,
    read_depth,
    read_image,
    read_text,
    refuse_to_overwrite,
    write_csv,
    write_image,
    write_text,
)


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


class Stop(Exception):
    pass


class TestOneFile:
    def test_written_and_replaced_whole(self, tmp_path: Path) -> None:
        path = tmp_path / "deep" / "down" / "a.txt"
        write_text(path, "älter\n")
        write_text(path, "neu\n")
        assert content(tmp_path) == {"deep/down/a.txt": b"neu\n"}

    @pytest.mark.parametrize("step", ["fsync", "replace"])
    @pytest.mark.parametrize("old", [None, b"old"])
    def test_an_exception_half_way_leaves_nothing_and_keeps_the_old_file(
        self, step: str, old: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        if old is not None:
            (tmp_path / "a.txt").write_bytes(old)

        def fail(*_: object) -> None:
            raise Stop

        monkeypatch.setattr(os if step == "fsync" else Path, step, fail)
        with pytest.raises(Stop):
            write_text(tmp_path / "a.txt", "new")
        assert content(tmp_path) == ({} if old is None else {"a.txt": old})

    def test_a_full_disk_is_one_clear_line(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def full(_: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(UserError, match=r"a\.txt: cannot be written \(No space left on device\); choose"):
            write_text(tmp_path / "a.txt", "new")
        assert content(tmp_path) == {}

    def test_a_place_below_a_file(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("x")
        with pytest.raises(UserError, match=r"cannot be written .*; "):
            write_text(tmp_path / "file" / "a.txt", "new")

    def test_others_may_read_it_as_the_umask_says(self, tmp_path: Path) -> None:
        before = os.umask(0o022)
        try:
            write_text(tmp_path / "a.txt", "x")
        finally:
            os.umask(before)
        assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o644

    def test_csv(self, tmp_path: Path) -> None:
        write_csv(tmp_path / "a.csv", ("id", "name"), [(1, "a,b"), (2, 'q"')])
        assert (tmp_path / "a.csv").read_bytes() == b'id,name\n1,"a,b"\n2,"q"""\n'


class TestNewFolder:
    def test_appears_at_the_end(self, tmp_path: Path) -> None:
        with new_folder(tmp_path / "deep" / "run") as folder:
            (folder / "a.txt").write_text("a")
            assert not (tmp_path / "deep" / "run").exists()
        assert content(tmp_path) == {"deep/run/a.txt": b"a"}

    def test_an_empty_folder_may_be_filled(self, tmp_path: Path) -> None:
        (tmp_path / "run").mkdir()
        with new_folder(tmp_path / "run") as folder:
            (folder / "a.txt").write_text("a")
        assert content(tmp_path) == {"run/a.txt": b"a"}

    @pytest.mark.parametrize("error", [Stop, KeyboardInterrupt])
    @pytest.mark.parametrize("overwrite", [False, True])
    def test_an_exception_half_way_leaves_nothing(
        self, error: type[BaseException], overwrite: bool, tmp_path: Path
    ) -> None:
        if overwrite:
            (tmp_path / "run").mkdir()
            (tmp_path / "run" / "a.txt").write_text("old")
        before = content(tmp_path)

        def half_a_run() -> None:
            with new_folder(tmp_path / "run", overwrite) as folder:
                (folder / "a.txt").write_text("new")
                raise error

        with pytest.raises(error):
            half_a_run()
        assert content(tmp_path) == before
        assert [p.name for p in tmp_path.iterdir()] == (["run"] if overwrite else [])

    def test_overwriting_keeps_what_it_does_not_replace(self, tmp_path: Path) -> None:
        run = tmp_path / "run"
        (run / "pictures").mkdir(parents=True)
        (run / "notes.txt").write_text("mine")
        (run / "a.txt").write_text("old")
        (run / "pictures" / "old.png").write_text("old")
        with new_folder(run, overwrite=True) as folder:
            (folder / "a.txt").write_text("new")
            (folder / "pictures").mkdir()
            (folder / "pictures" / "new.png").write_text("new")
        assert content(tmp_path) == {"run/notes.txt": b"mine", "run/a.txt": b"new", "run/pictures/new.png": b"new"}
        assert [p.name for p in tmp_path.iterdir()] == ["run"]

    def test_a_file_in_its_place(self, tmp_path: Path) -> None:
        (tmp_path / "run").write_text("mine")
        for overwrite in (False, True):
            with pytest.raises(UserError), new_folder(tmp_path / "run", overwrite) as folder:
                (folder / "a.txt").write_text("new")
        assert content(tmp_path) == {"run": b"mine"}
        assert [p.name for p in tmp_path.iterdir()] == ["run"]

    def test_below_a_file(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("mine")
        with pytest.raises(UserError, match=r"file/run: cannot be written"), new_folder(tmp_path / "file" / "run"):
            pytest.fail("there is no place to write to")
        assert content(tmp_path) == {"file": b"mine"}

    def test_others_may_enter_it_as_the_umask_says(self, tmp_path: Path) -> None:
        before = os.umask(0o022)
        try:
            with new_folder(tmp_path / "run"):
                pass
        finally:
            os.umask(before)
        assert stat.S_IMODE((tmp_path / "run").stat().st_mode) == 0o755


def test_refusing_to_overwrite(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("x")
    refuse_to_overwrite(tmp_path / "new")
    refuse_to_overwrite(tmp_path / "empty")
    refuse_to_overwrite(tmp_path / "file", overwrite=True)
    refuse_to_overwrite(tmp_path, overwrite=True)
    for path in (tmp_path, tmp_path / "file"):
        with pytest.raises(OutputExists, match=r"already exists; .*--overwrite"):
            refuse_to_overwrite(path)


class TestReading:
    @pytest.mark.parametrize(
        ("data", "problem"), [(None, "no such file"), (b"\xff\xfe", "UTF-8"), ("folder", "directory")]
    )
    def test_text_that_cannot_be_read(self, data: bytes | str | None, problem: str, tmp_path: Path) -> None:
        path = tmp_path / "a.txt"
        if data == "folder":
            path.mkdir()
        elif isinstance(data, bytes):
            path.write_bytes(data)
        with pytest.raises(InputError, match=rf"a\.txt: .*{problem}.*; mend it"):
            read_text(path, "mend it")

    def test_a_byte_order_mark_is_no_text(self, tmp_path: Path) -> None:
        (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbfid")
        assert read_text(tmp_path / "a.txt", "") == "id"

    @pytest.mark.parametrize("data", [None, b"", b"text", b"\x89PNG\r\n\x1a\n", bytes(range(256)) * 9])
    def test_an_image_that_cannot_be_read(self, data: bytes | None, tmp_path: Path) -> None:
        if data is not None:
            (tmp_path / "a.png").write_bytes(data)
        with pytest.raises(UnreadableImage, match=r"a\.png: .*; "):
            read_image(tmp_path / "a.png")

    def test_a_path_that_no_system_knows(self) -> None:
        with pytest.raises(UnreadableImage):
            read_image(Path("a\0.png"))


class TestImages:
    RNG = np.random.default_rng(0)

    def test_colours_come_back_in_their_order(self, tmp_path: Path) -> None:
        image = self.RNG.integers(0, 256, (5, 7, 3)).astype(np.uint8)
        write_image(tmp_path / "a.png", image)
        assert np.array_equal(read_image(tmp_path / "a.png"), image)

    def test_grey_comes_back_as_three_equal_channels(self, tmp_path: Path) -> None:
        image = self.RNG.integers(0, 256, (5, 7)).astype(np.uint8)
        write_image(tmp_path / "a.png", image)
        assert np.array_equal(read_image(tmp_path / "a.png"), np.repeat(image[..., None], 3, axis=2))

    def test_a_name_with_letters_beyond_ascii(self, tmp_path: Path) -> None:
        image = np.zeros((2, 2, 3), dtype=np.uint8)
        write_image(tmp_path / "Tür ☃.png", image)
        assert np.array_equal(read_image(tmp_path / "Tür ☃.png"), image)

    @pytest.mark.parametrize("name", ["a", "a.xyz", "a.csv"])
    def test_a_name_that_ends_in_no_format(self, name: str, tmp_path: Path) -> None:
        with pytest.raises(UserError, match=r"\.png"):
            write_image(tmp_path / name, np.zeros((2, 2), dtype=np.uint8))
        assert content(tmp_path) == {}


class TestDepth:
    LEVELS = np.arange(1 << 16, dtype=np.uint16).reshape(256, 256)

    @pytest.mark.parametrize("name", ["d.png", "d.PNG"])
    def test_each_of_the_levels_comes_back(self, name: str, tmp_path: Path) -> None:
        write_image(tmp_path / name, self.LEVELS)
        read = read_depth(tmp_path / name)
        assert read.dtype == np.uint16 and np.array_equal(read, self.LEVELS)

    def test_the_file_is_one_that_other_tools_read_as_16_bits(self, tmp_path: Path) -> None:
        write_image(tmp_path / "d.png", self.LEVELS)
        header = (tmp_path / "d.png").read_bytes()[16:26]
        assert header == (256).to_bytes(4, "big") * 2 + bytes([16, 0]), "16 bits, grey"

    @pytest.mark.parametrize("mode", ["I;16", "I;16B", "I"])
    def test_written_by_others(self, mode: str, tmp_path: Path) -> None:
        """Pillow's modes for 16 bits; some of its versions read a 16-bit PNG as 32-bit integers."""
        of_mode = {"I;16": "<u2", "I;16B": ">u2", "I": "<i4"}[mode]
        data = self.LEVELS.astype(of_mode).tobytes()
        Pictures.frombytes(mode, (256, 256), data).save(tmp_path / "d.tif")
        assert np.array_equal(read_depth(tmp_path / "d.tif"), self.LEVELS)

    def test_read_as_an_image_it_keeps_the_upper_eight_bits(self, tmp_path: Path) -> None:
        write_image(tmp_path / "d.png", self.LEVELS)
        image = read_image(tmp_path / "d.png")
        assert image.dtype == np.uint8 and np.array_equal(image, np.repeat(self.LEVELS[..., None] >> 8, 3, axis=2))

    @pytest.mark.parametrize("shape", [(4, 5), (4, 5, 3)])
    def test_eight_bits_are_no_depth(self, shape: tuple[int, ...], tmp_path: Path) -> None:
        write_image(tmp_path / "d.png", np.zeros(shape, dtype=np.uint8))
        with pytest.raises(InputError, match=r"d\.png: is no grey picture of 16 bits; save") as caught:
            read_depth(tmp_path / "d.png")
        assert not isinstance(caught.value, UnreadableImage), "it must stop the run, not pass for a blind frame"

    def test_levels_beyond_16_bits_are_no_depth(self, tmp_path: Path) -> None:
        Pictures.fromarray(np.array([[70_000]], dtype=np.int32)).save(tmp_path / "d.tif")
        with pytest.raises(InputError, match=r"d\.tif: is no grey picture"):
            read_depth(tmp_path / "d.tif")

    def test_a_file_that_does_not_decode(self, tmp_path: Path) -> None:
        (tmp_path / "d.png").write_text("hello")
        with pytest.raises(UnreadableImage, match=r"d\.png: does not decode"):
            read_depth(tmp_path / "d.png")

    @pytest.mark.parametrize("name", ["d.jpg", "d.bmp"])
    def test_a_format_that_would_drop_bits(self, name: str, tmp_path: Path) -> None:
        with pytest.raises(UserError, match=r"16 bits.*\.png"):
            write_image(tmp_path / name, self.LEVELS)
        assert content(tmp_path) == {}


def test_a_write_that_fails_in_the_middle_of_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match="No space left"), new_folder(tmp_path / "run") as folder:
        files.write_text(folder / "a.txt", "x")
    assert list(tmp_path.iterdir()) == []
