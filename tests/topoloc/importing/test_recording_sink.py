"""Pictures and poses in any order become a recording, and what is lost is told."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc.cli.imported import tell
from topoloc.errors import UserError
from topoloc.importing import RecordingSink
from topoloc.recording import Recording
from topoloc.rig_file import Mount, Rig
from topoloc.topo_map import Camera

PICTURE = np.full((12, 16, 3), 90, dtype=np.uint8)


@settings(max_examples=20)
@given(order=st.permutations(range(6)))
def test_any_order_gives_the_same_recording(tmp_path_factory: pytest.TempPathFactory, order: list[int]) -> None:
    folder = tmp_path_factory.mktemp("sink")
    sink = RecordingSink(folder)
    for i in order:
        sink.picture("rgb", 10.0 + i, PICTURE + np.uint8(i))
        sink.odometry(10.0 + i, [float(i), 0.0, 0.1])
    imported = sink.close(Rig(Camera(60.0, 16, 12), Mount(yaw_deg=90.0)))
    recording = Recording.load(folder)
    assert [int(frame.images["rgb"][0, 0, 0]) for frame in recording] == [90, 91, 92, 93, 94, 95]
    assert [float(frame.odometry[0]) for frame in recording if frame.odometry is not None] == [0, 1, 2, 3, 4, 5]
    assert recording.mount.yaw_deg == 90.0
    assert (imported.frames, imported.odometry, imported.seconds, imported.dropped) == ({"rgb": 6}, 6, 5.0, {})


def test_encoded_pictures_are_kept_to_the_byte(tmp_path: Path) -> None:
    data = cv2.imencode(".jpg", PICTURE)[1].tobytes()
    sink = RecordingSink(tmp_path)
    sink.picture("rgb", 1.0, data, ".jpg")
    sink.close()
    assert (tmp_path / "rgb" / "000000.jpg").read_bytes() == data
    assert not (tmp_path / "camera.toml").exists()


def test_what_is_withdrawn_is_gone_and_told(tmp_path: Path) -> None:
    sink = RecordingSink(tmp_path)
    names = [sink.picture("rgb", float(i), PICTURE + np.uint8(i)) for i in range(3)]
    assert names[1] is not None
    sink.withdraw("rgb", {names[1]}, "is not 16x12 as most are")
    sink.picture("rgb", 3.0, PICTURE + np.uint8(3))
    imported = sink.close()
    assert [int(frame.images["rgb"][0, 0, 0]) for frame in Recording.load(tmp_path)] == [90, 92, 93]
    assert len(list((tmp_path / "rgb").iterdir())) == 3
    assert imported.dropped == {("rgb picture", "is not 16x12 as most are"): 1}


def test_what_is_lost_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sink = RecordingSink(tmp_path)
    for time in (1.0, 2.0, 2.0, float("nan")):
        sink.picture("rgb", time, PICTURE)
    sink.truth(1.0, [0.0, np.nan, 0.0])
    sink.truth(1.0, [0.0, 0.0, 0.0])
    sink.drop("frame", "no odometry within 0.5 s", 3)
    imported = sink.close()
    tell(tmp_path, imported)
    shown = capsys.readouterr().out
    assert "2 rgb pictures in 1.0 s" in shown
    assert "odometry: no poses; ground truth: 1 poses" in shown
    assert "dropped: 1 x rgb picture: another has the same time" in shown
    assert "dropped: 1 x rgb picture: its time is no number" in shown
    assert "dropped: 1 x true pose: is not finite" in shown
    assert "dropped: 3 x frame: no odometry within 0.5 s" in shown
    assert f"next: topoloc check {tmp_path}" in shown
    assert len(list((tmp_path / "rgb").iterdir())) == 2, "the picture of the same time is gone from the disk, too"


def test_nothing_to_localize_by_is_a_mistake(tmp_path: Path) -> None:
    sink = RecordingSink(tmp_path)
    sink.picture("depth", 1.0, np.zeros((4, 4), dtype=np.uint16))
    sink.drop("message", "is of a type that is not read", 7)
    with pytest.raises(UserError, match=r"no picture in it .* \(7 message: is of a type that is not read\)"):
        sink.close()


def test_unknown_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="choose from: rgb, omni, right, depth"):
        RecordingSink(tmp_path).picture("thermal", 1.0, PICTURE)
