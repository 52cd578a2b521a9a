"""Frames of a video file with the times that it gives them, upright, one every so often."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.files import PICTURE_ENDINGS
from topoloc.importing.alongside import Alongside
from topoloc.importing.recording_sink import RecordingSink
from topoloc.importing.thinning import Thinning
from topoloc.types import Image

Size = tuple[int, int]
"""Columns and rows."""
LIKELY_FPS = (1.0, 480.0)
"""A file that tells another frame rate does not know it."""
CUT_SHORT_S, CUT_SHORT_SHARE = 0.5, 0.02
"""A video that ends so much, and by such a share, before its file says so, is damaged [s]."""


@dataclass(frozen=True)
class FramesRead:
    """How a video was read.

    Attributes:
        frames: of the file, whether they were taken or not.
        seconds: from the first of them to the last [s].
        guessed: of them that had no time of their own; each is one frame after the one before.
        missing: that the file announces, and that could not be read.
        width: of the pictures taken, pixels.
        height: of the pictures taken, pixels.
    """

    frames: int
    seconds: float
    guessed: int
    missing: int
    width: int
    height: int


class Video:
    """A video file that is open.

    Args:
        path: of the file.

    Attributes:
        fps: frames a second that the file tells; NaN where it does not.
        announced: frames that the file tells; 0 where it does not.
        turned_deg: by how much its frames are turned to be upright, as phones tell it, degrees clockwise.

    Raises:
        InputError: no such file, a picture, or none that OpenCV reads.
    """

    def __init__(self, path: Path) -> None:
        import cv2

        _refuse_what_is_no_video(path)
        # FFmpeg and OpenCV write lines of their own on what they cannot read; what they mean is told here.
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
        level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            self._capture: Any = cv2.VideoCapture(str(path))
        finally:
            cv2.utils.logging.setLogLevel(level)
        if not self._capture.isOpened():
            remedy = "copy it again from the camera; if a player shows it: ffmpeg -i FILE NEW.mp4"
            raise InputError(path, "is no video that can be read, or it lacks its end", remedy)
        self._path = path
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
        self.turned_deg = int(self._capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
        fps = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.fps = fps if LIKELY_FPS[0] <= fps <= LIKELY_FPS[1] else np.nan
        self.announced = max(0, int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)))
        self.guessed = 0

    @property
    def seconds(self) -> float:
        """How long the file says it is [s]; NaN where it does not."""
        return self.announced / self.fps if self.announced else np.nan

    def times(self) -> Iterator[float]:
        """Go from frame to frame, once; yields the time of each since the first [s], always increasing.

        Raises:
            InputError: there are neither times nor a frame rate.
        """
        import cv2

        first = before = None
        while self._capture.grab():
            stamp = 1e-3 * float(self._capture.get(cv2.CAP_PROP_POS_MSEC))
            first = stamp if first is None else first
            time = stamp - first
            if before is not None and not time > before:  # OpenCV gives the last frames of some files the time 0
                time = before + self._one_frame()
                self.guessed += 1
            before = time
            yield time

    def _one_frame(self) -> float:
        """How long a frame lasts [s]."""
        if np.isnan(self.fps):
            remedy = "give it some: ffmpeg -i FILE -r 30 NEW.mp4"
            raise InputError(self._path, "tells neither times nor a frame rate", remedy)
        return 1.0 / self.fps

    def frame(self) -> Image | None:
        """The frame that ``times`` stands at, RGB (rows, cols, 3), upright; None where it does not decode."""
        import cv2

        done, picture = self._capture.retrieve()
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8) if done else None

    def close(self) -> None:
        """Let go of the file; so does the end of a ``with``."""
        self._capture.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def import_frames(
    video: Video,
    sink: RecordingSink,
    thinning: Thinning,
    alongside: Alongside,
    offset_s: float = 0.0,
    width: int | None = None,
    progress: Callable[[], object] = lambda: None,
) -> FramesRead:
    """Put the frames of a video into a recording, as JPEG, and the tracks beside them.

    Args:
        video: read to the end of the stretch.
        sink: what is left out, such as frames without a place on the tracks, is noted there.
        thinning: which frames are taken.
        alongside: the tracks.
        offset_s: time of the first frame on the tracks' clock [s].
        width: columns to make the frames narrower to; None, or more than they have: as they are.
        progress: called for each frame of the file.

    Raises:
        UserError: tracks and video have no moment in common.
    """
    if not np.isnan(video.seconds):
        alongside.refuse_apart(offset_s + thinning.start_s, offset_s + min(video.seconds, thinning.end_s))
    frames, last, taken, size, whole = 0, 0.0, None, (0, 0), True
    for time in video.times():
        if time > thinning.end_s:
            whole = False
            break
        frames, last = frames + 1, time
        progress()
        if thinning.takes(time, taken):
            taken = time
            size = _keep(video, sink, alongside.lack(offset_s + time), offset_s + time, width) or size
    alongside.write(sink)
    if taken is None:
        sink.drop("frame", "lies outside of --start and --end", frames)
    missing = _missing(video, frames, last) if whole else 0
    sink.drop("frame", "is announced but cannot be read; the file is damaged or cut short", missing)
    return FramesRead(frames, last, video.guessed, missing, *size)


def _keep(video: Video, sink: RecordingSink, why_not: str | None, time: float, width: int | None) -> Size | None:
    """Put the frame that a video stands at into a recording; returns its size, or None where it is left out."""
    picture = video.frame() if why_not is None else None
    if picture is None:
        sink.drop("frame", why_not or "does not decode")
        return None
    picture = _narrowed(picture, width)
    sink.picture("rgb", time, picture, ".jpg")
    return picture.shape[1], picture.shape[0]


def _missing(video: Video, frames: int, last: float) -> int:
    """How many of the frames that the file announces could not be read, where its end is missing."""
    if np.isnan(video.seconds):
        return 0
    lost_s = video.seconds - (last + 1.0 / video.fps if frames else 0.0)
    short = lost_s > max(CUT_SHORT_S, CUT_SHORT_SHARE * video.seconds)
    return max(1, round(lost_s * video.fps)) if short else 0


def _narrowed(picture: Image, width: int | None) -> Image:
    """A picture of at most so many columns, of the same aspect ratio to a pixel of rounding."""
    import cv2

    rows, columns = picture.shape[:2]
    if width is None or width >= columns:
        return picture
    size = (width, max(1, round(rows * width / columns)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _refuse_what_is_no_video(path: Path) -> None:
    """Raise ``InputError`` for what OpenCV would not open, or would open as something else."""
    pictures = "'topoloc import images' takes a folder of pictures"
    if path.is_dir():
        raise InputError(path, "is a folder", pictures)
    if not path.is_file():
        raise InputError(path, "no such file", "name a video file")
    if path.suffix.lower() in PICTURE_ENDINGS:
        raise InputError(path, "is a picture", pictures)


def every_of(every_s: float | None, fps: float | None, default_s: float) -> float:
    """Seconds from frame to frame, told as such or as frames a second. Raises ``UserError`` where both are told."""
    if every_s is not None and fps is not None:
        raise UserError("--every and --fps say the same thing; give one of the two")
    if fps is None:
        return default_s if every_s is None else every_s
    if not 0.0 < fps < np.inf:
        raise UserError(f"--fps is {fps:g}; give frames a second, above 0")
    return 1.0 / fps
