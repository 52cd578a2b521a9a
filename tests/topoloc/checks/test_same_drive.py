"""A map is told to be built of a recording: by its views or panoramas, scaled or not, and never by another drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from topoloc.checks.same_drive import ITS_OWN, from_this_recording
from topoloc.geometry import compose
from topoloc.mapping.building import BuildConfig, build_map
from topoloc.recording import Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera, TopoMap
from topoloc.types import Frame

CAMERA = Camera(60.0, 32, 24)
MOUNT = np.array([0.1, 0.05, 0.3])
FRAMES = 24


def drive(folder: Path, seed: int, kind: str = "rgb") -> Recording:
    """Poses on a bend, the same for each seed; the pictures are noise of the seed."""
    rng, columns = np.random.default_rng(seed), CAMERA.panorama_columns() if kind == "omni" else CAMERA.width
    writer = RecordingWriter(folder, CAMERA, panorama=kind == "omni")
    for time in range(FRAMES):
        truth = np.array([0.4 * time, 0.01 * time**2, 0.05 * time])
        picture = rng.integers(0, 256, (CAMERA.height, columns, 3)).astype(np.uint8)
        writer.add(Frame(5.0 + time, compose((3.0, -2.0, 2.0), truth), MOUNT, {kind: picture}), truth)
    writer.close()
    return Recording.load(folder)


def built(recording: Recording, folder: Path, config: BuildConfig) -> TopoMap:
    """The map as a user reads it."""
    build_map(recording, config).topo_map.save(folder)
    return TopoMap.load(folder)


@pytest.mark.parametrize("kind", ["rgb", "omni"])
@pytest.mark.parametrize(
    "config",
    [BuildConfig(), BuildConfig(view_size=(16, 12)), BuildConfig(poses="odometry")],
    ids=["as it is", "scaled", "by odometry"],
)
def test_its_own_and_another(tmp_path: Path, kind: str, config: BuildConfig) -> None:
    recording = drive(tmp_path / "own", 1, kind)
    topo_map = built(recording, tmp_path / "map", config)
    assert bool(topo_map.views) == (kind == "rgb")
    assert from_this_recording(topo_map, recording) == 1.0
    assert from_this_recording(topo_map, drive(tmp_path / "another", 2, kind)) == 0.0


def test_a_part_of_the_drive_that_the_map_was_built_of(tmp_path: Path) -> None:
    recording = drive(tmp_path / "own", 1)
    topo_map = built(recording, tmp_path / "map", BuildConfig())
    half = replace(recording, pictures={"rgb": recording.pictures["rgb"][FRAMES // 2 :]})
    assert ITS_OWN < 0.4 < from_this_recording(topo_map, half) < 0.6


def test_without_poses_or_pictures_nothing_is_told(tmp_path: Path) -> None:
    recording = drive(tmp_path / "own", 1)
    topo_map = built(recording, tmp_path / "map", BuildConfig())
    assert from_this_recording(topo_map, replace(recording, truth=None, odometry=None)) == 0.0
    assert from_this_recording(replace(topo_map, views=()), recording) == 0.0
    for picture in recording.pictures["rgb"]:
        picture.path.write_bytes(b"no picture")
    assert from_this_recording(topo_map, recording) == 0.0
