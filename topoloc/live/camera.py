"""A camera at a computer: its pictures as they come, and how it is found again after it was unplugged."""

from __future__ import annotations

import time as clocks
from collections.abc import Callable
from threading import Event
from typing import Any, Protocol

import numpy as np

from topoloc.errors import UserError
from topoloc.live.engine import LiveLocalizer
from topoloc.topo_map import Camera

TRY_AGAIN_S = 0.5
"""After a picture that did not come, the camera is asked again after so long [s]."""
PATIENCE = 4
"""After so many that did not come, it is opened anew."""


class Capture(Protocol):
    """What is used of ``cv2.VideoCapture``."""

    def isOpened(self) -> bool:  # noqa: N802
        """Whether there is a camera."""

    def read(self) -> tuple[bool, Any]:
        """Whether there was a picture, and the picture, uint8 (rows, cols, 3) in BGR order."""

    def release(self) -> None:
        """Let go of it."""


def open_camera(device: str, size: Camera | None = None) -> Capture:
    """Open a camera.

    Args:
        device: its number, or a path such as ``/dev/video0``.
        size: ask for pictures of this many columns and rows; None: whatever it gives.

    Raises:
        UserError: there is no such camera, or it is in use.
    """
    import cv2

    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        capture: Any = cv2.VideoCapture(int(device) if device.isdecimal() else device)
        opened: Capture = capture
    finally:
        cv2.utils.logging.setLogLevel(level)
    if not opened.isOpened():
        raise UserError(f"camera {device}: cannot be opened; is it plugged in, free and yours to read? or name another")
    if size is not None:
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, size.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size.height)
    return opened


class CameraFeed:
    """Hands on the pictures of a camera, stamped when they were read; a camera that fails is opened again.

    Args:
        capture: an open camera.
        reopen: opens it again. Raises ``UserError`` while that is not possible.
        clock: that pictures are stamped by; Unix time by default, as robots' drivers stamp their odometry [s].
        wait: so many seconds; returns whether to stop. By default waits for the event to stop.
    """

    def __init__(
        self,
        capture: Capture,
        reopen: Callable[[], Capture],
        clock: Callable[[], float] = clocks.time,
        wait: Callable[[float], bool] | None = None,
    ) -> None:
        self._capture, self._reopen, self._clock, self._wait = capture, reopen, clock, wait

    def __call__(self, live: LiveLocalizer, stop: Event) -> None:
        """Hand on pictures until told to stop."""
        pause = self._wait or stop.wait
        missed = 0
        try:
            while not stop.is_set():
                done, picture = self._capture.read()
                if done:
                    missed = 0
                    live.on_image(self._clock(), np.ascontiguousarray(picture[..., ::-1]))
                    continue
                missed += 1
                if missed % PATIENCE == 0:
                    self._open_again()
                if pause(TRY_AGAIN_S):
                    return
        finally:
            self._capture.release()

    def _open_again(self) -> None:
        """A camera that was unplugged is another one to the system; until it is back the localizer says LOST."""
        self._capture.release()
        try:
            self._capture = self._reopen()
        except UserError:
            return
