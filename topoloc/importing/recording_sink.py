"""Where importers put what they read: pictures and poses in any order become a recording, and what is lost is told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from topoloc.errors import UserError
from topoloc.files import write_bytes, write_image, write_text
from topoloc.geometry import Floats
from topoloc.recording import KINDS, write_track
from topoloc.rig_file import Rig, write_rig
from topoloc.types import Pixels

OWNED = (
    *(f"{kind}.txt" for kind in KINDS),
    *("odometry.txt", "groundtruth.txt", "pan.txt", "camera.toml", "rooms.csv", "origin.toml"),
)
"""Files of an earlier recording that --overwrite of any importer removes where they are not written again."""
SAME_TIME_S = 1e-6
"""Times are written to the microsecond: what is nearer in time than this has the same time [s]."""


@dataclass(frozen=True)
class Imported:
    """What came of an import.

    Attributes:
        frames: pictures written, by kind.
        odometry: odometer poses written.
        truth: true poses written.
        seconds: from the first picture to the last.
        dropped: how many were left out, by what they were and why.
    """

    frames: Mapping[str, int]
    odometry: int
    truth: int
    seconds: float
    dropped: Mapping[tuple[str, str], int] = field(default_factory=dict)


class RecordingSink:
    """Writes a recording of pictures and poses that come in any order; keeps none of the pictures in memory.

    Args:
        folder: to write into; made where it does not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._pictures: dict[str, list[tuple[float, str]]] = {}
        self._written: Counter[str] = Counter()
        self._odometry: list[tuple[float, Floats]] = []
        self._truth: list[tuple[float, Floats]] = []
        self._dropped: Counter[tuple[str, str]] = Counter()

    def picture(self, kind: str, time: float, data: bytes | Pixels, suffix: str = ".png") -> str | None:
        """Write a picture; returns its name, for ``withdraw``, None where it is left out.

        Args:
            kind: ``rgb``, ``omni``, ``right`` or ``depth``.
            time: [s].
            data: an encoded file, kept to the byte, or pixels: uint8 (rows, cols[, 3]), depth uint16 (rows, cols).
            suffix: of the file's name, such as ``.jpg``; pixels are encoded by it.

        Raises:
            ValueError: there is no such kind.
        """
        if kind not in KINDS:
            raise ValueError(f"{kind!r} is no kind of picture; choose from: {', '.join(KINDS)}")
        if not np.isfinite(time):
            self.drop(f"{kind} picture", "its time is no number")
            return None
        name = f"{kind}/{self._written[kind]:06d}{suffix}"
        if isinstance(data, bytes):
            write_bytes(self._folder / name, data)
        else:
            write_image(self._folder / name, data)
        self._written[kind] += 1
        self._pictures.setdefault(kind, []).append((float(time), name))
        return name

    def withdraw(self, kind: str, names: Collection[str], why: str) -> None:
        """Delete pictures of a kind that were written, and note why they are left out."""
        self._pictures[kind] = [item for item in self._pictures.get(kind, []) if item[1] not in names]
        for name in names:
            (self._folder / name).unlink()
        self.drop(f"{kind} picture", why, len(names))

    def odometry(self, time: float, pose: Sequence[float] | Floats) -> None:
        """Keep a raw pose (3,) of the odometer [m, m, rad]."""
        self._keep(self._odometry, "odometer pose", time, pose)

    def truth(self, time: float, pose: Sequence[float] | Floats) -> None:
        """Keep a true pose (3,) of the robot's axis [m, m, rad]."""
        self._keep(self._truth, "true pose", time, pose)

    def _keep(self, poses: list[tuple[float, Floats]], what: str, time: float, pose: Any) -> None:
        values = np.asarray(pose, dtype=np.float64)
        if np.isfinite(values).all() and np.isfinite(time):
            poses.append((float(time), values))
        else:
            self.drop(what, "is not finite")

    def drop(self, what: str, why: str, count: int = 1) -> None:
        """Note that something is left out, and why; nothing where the count is 0."""
        if count:
            self._dropped[what, why] += count

    def close(self, rig: Rig | None = None) -> Imported:
        """Write the lists, sorted by time, and ``camera.toml``.

        Raises:
            UserError: there is no picture to localize by.
        """
        if not any(self._pictures.get(kind) for kind in ("rgb", "omni")):
            raise UserError("nothing was imported: there is no picture in it that could be used" + self._losses())
        frames = {kind: self._write_list(kind) for kind in self._pictures if self._pictures[kind]}
        odometry = self._write_poses("odometry.txt", "odometer pose", self._odometry)
        truth = self._write_poses("groundtruth.txt", "true pose", self._truth)
        if rig is not None and rig != Rig():
            write_rig(self._folder / "camera.toml", rig)
        main = next(kind for kind in ("rgb", "omni") if frames.get(kind))
        times = [time for time, _ in self._pictures[main]]
        return Imported(frames, odometry, truth, max(times) - min(times), dict(self._dropped))

    def _losses(self) -> str:
        """What was left out, as the end of an error."""
        told = "; ".join(f"{count} {what}: {why}" for (what, why), count in self._dropped.items())
        return f" ({told})" if told else ""

    def _write_list(self, kind: str) -> int:
        """Write ``rgb.txt`` and the like; returns how many pictures it lists. Those of equal times go."""
        listed = sorted(self._pictures[kind])
        first = _first_of_each([time for time, _ in listed])
        for (_, name), keep in zip(listed, first, strict=True):
            if not keep:
                (self._folder / name).unlink()
        self.drop(f"{kind} picture", "another has the same time", int((~first).sum()))
        lines = [f"{time:.6f} {name}" for (time, name), keep in zip(listed, first, strict=True) if keep]
        write_text(self._folder / f"{kind}.txt", "\n".join(["# timestamp path", *lines, ""]))
        return len(lines)

    def _write_poses(self, name: str, what: str, poses: list[tuple[float, Floats]]) -> int:
        """Write ``odometry.txt`` or ``groundtruth.txt``; returns how many poses it has. Those of equal times go."""
        if not poses:
            return 0
        by_time = sorted(poses, key=lambda item: item[0])
        first = _first_of_each([time for time, _ in by_time])
        self.drop(what, "another has the same time", int((~first).sum()))
        kept = [item for item, keep in zip(by_time, first, strict=True) if keep]
        write_track(self._folder / name, [time for time, _ in kept], np.array([pose for _, pose in kept]))
        return len(kept)


def _first_of_each(times: Sequence[float]) -> np.ndarray:
    """Which of sorted times (N,) are not the same, as they are written, as the one before."""
    written = np.round(np.asarray(times) / SAME_TIME_S)
    return np.concatenate([[True], np.diff(written) > 0]) if len(written) else np.zeros(0, dtype=bool)
