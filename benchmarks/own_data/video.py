"""What is lost where a drive comes through a video file and CSV files instead of pictures as they were taken."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.own_data.driving import drive_of
from benchmarks.own_data.localizing import judged, localized
from benchmarks.own_data.own_table import Figures, OwnTable, mean, span
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import SECONDS_PER_FRAME, World
from topoloc.errors import UserError
from topoloc.files import read_image, write_text
from topoloc.importing import RecordingSink
from topoloc.importing.alongside import Alongside
from topoloc.importing.odometry_csv import read_poses_csv
from topoloc.importing.thinning import Thinning
from topoloc.importing.video import Video, import_frames
from topoloc.metrics import Run, evaluate
from topoloc.recording import Recording, Track
from topoloc.rig_file import Rig
from topoloc.topo_map import TopoMap

PAIRS = {"ima": "activity", "pca": "particle"}
"""Sensors with their estimators."""
CODEC, SUFFIX = "mp4v", ".mp4"
"""MPEG-4 part 2, which OpenCV's wheels can write."""
OFFSET_S = 12.5
"""Time of the first frame on the CSV files' clock [s]."""


def measure(seed: int, kind: type[World] = LabWorld) -> Iterator[Figures]:
    """The drive as it was, then through a video."""
    world = kind(WorldSettings())
    topo_map = world.topo_map(seed)
    with TemporaryDirectory() as name:
        folder = Path(name)
        drive = drive_of(world, seed, folder / "drive")
        as_it_was = _runs(topo_map, drive)
        yield {**_figures(as_it_was), "size": sum(one.path.stat().st_size for one in drive.pictures["rgb"]) / 1e6}
        video = write_video(drive, folder / f"drive{SUFFIX}")
        through = _runs(topo_map, imported(drive, video, folder))
        gained = {
            f"`{sensor}`, more right": float(through[sensor].right.sum()) - float(as_it_was[sensor].right.sum())
            for sensor in PAIRS
        }
        yield {**_figures(through), **gained, "size": video.stat().st_size / 1e6}


def write_video(drive: Recording, path: Path) -> Path:
    """The pictures of a drive as a video; returns its path.

    Raises:
        UserError: OpenCV was built without the codec.
    """
    import cv2

    rows, columns = read_image(drive.pictures["rgb"][0].path).shape[:2]
    code = cv2.VideoWriter.fourcc(*CODEC)
    writer = cv2.VideoWriter(str(path), code, 1.0 / SECONDS_PER_FRAME, (columns, rows))
    if not writer.isOpened():
        raise UserError(f"OpenCV cannot write {CODEC} videos here; install opencv-python-headless")
    for picture in drive.pictures["rgb"]:
        writer.write(cv2.cvtColor(read_image(picture.path), cv2.COLOR_RGB2BGR))
    writer.release()
    return path


def imported(drive: Recording, video: Path, folder: Path) -> Recording:
    """The drive as ``topoloc import video`` makes it of a video and CSV files, written below a folder."""
    assert drive.odometry is not None and drive.truth is not None and drive.camera is not None  # simulated ones have
    tracks = {"odometry": drive.odometry, "truth": drive.truth}
    read = {name: read_poses_csv(_write_csv(track, folder / f"{name}.csv")) for name, track in tracks.items()}
    sink, opened = RecordingSink(folder / "imported"), Video(video)
    import_frames(opened, sink, Thinning(), Alongside(**read), OFFSET_S)
    opened.close()
    sink.close(Rig(drive.camera, drive.mount))
    return Recording.load(folder / "imported")


def _write_csv(track: Track, path: Path) -> Path:
    """A track as loggers write it: milliseconds, tenths of millimetres, hundredths of degrees."""
    lines = ["time_ms,x_mm,y_mm,heading_deg"]
    for time, (x, y, heading) in zip(track.times, track.poses, strict=True):
        lines.append(f"{1e3 * (time + OFFSET_S):.0f},{1e3 * x:.1f},{1e3 * y:.1f},{np.rad2deg(heading):.2f}")
    write_text(path, "\n".join([*lines, ""]))
    return path


def _runs(topo_map: TopoMap, recording: Recording) -> dict[str, Run]:
    """By sensor."""
    return {
        sensor: judged(topo_map, recording, localized(topo_map, recording, sensor, estimator))
        for sensor, estimator in PAIRS.items()
    }


def _figures(runs: dict[str, Run]) -> dict[str, float]:
    figures = {}
    for sensor, run in runs.items():
        values = evaluate(run)
        named = {f"`{sensor}`": values["node_accuracy"], f"position, `{sensor}`": values["position_median_m"]}
        figures.update({name: value for name, value in named.items() if value is not None})
    return figures


VIDEO = OwnTable(
    name="video",
    page="import.md",
    about=(
        "Simulated laboratory, three laps a seed: share of the updates in the right node and median position error of "
        + ", ".join(f"`{sensor}` with `{estimator}`" for sensor, estimator in PAIRS.items())
        + "; by how many updates a drive has more right ones through the video, least and most."
    ),
    seeds=(7, 8, 9),
    heads=("drive",),
    rows=(("PNG files, as it was",), ("MP4 and CSV files",)),
    columns={
        **{
            name: form
            for sensor in PAIRS
            for name, form in (
                (f"`{sensor}`", mean(2)),
                (f"position, `{sensor}`", mean(2, " m")),
                (f"`{sensor}`, more right", span),
            )
        },
        "size": mean(1, " MB"),
    },
    measure=measure,
)
