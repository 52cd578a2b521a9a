"""Recordings without pictures: a robot that goes round and round, with an odometer and the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from topoloc.geometry import compose
from topoloc.recording import Picture, Recording, Track
from topoloc.tuning import Fold


def poses_on_a_circle(count: int, a_lap: int = 20) -> np.ndarray:
    """(count, 3) around a circle of radius 2 m, headings along it: 0.63 m and 18 degrees from one to the next."""
    angle = 2.0 * np.pi * np.arange(count) / a_lap
    return np.column_stack([2.0 * np.cos(angle), 2.0 * np.sin(angle), angle + np.pi / 2.0])


def recording_of(truth: np.ndarray, odometry: np.ndarray | None = None, name: str = "drive") -> Recording:
    """A recording of poses (N, 3), one a second, whose pictures do not exist."""
    times = np.arange(float(len(truth)))
    pictures = [Picture(time, Path(f"{number}.png"), number + 1) for number, time in enumerate(times)]
    track = None if odometry is None else Track(times, odometry)
    return Recording(Path(name), "rgb", {"rgb": pictures}, odometry=track, truth=Track(times, truth))


def fold_of(steps: np.ndarray, errors: np.ndarray) -> Fold:
    """A fold whose odometer tells motions ``steps`` (N, 3), and whose true ones are those plus ``errors``."""
    told, true = [np.zeros(3)], [np.zeros(3)]
    for step, error in zip(steps, errors, strict=True):
        told.append(compose(told[-1], step))
        true.append(compose(true[-1], step + error))
    recording = recording_of(np.array(true), np.array(told))
    return Fold("made", recording, tuple(recording.pictures["rgb"]), np.array(true))
