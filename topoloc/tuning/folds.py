"""Recordings -> folds: parts that are driven apart from each other, each from an unknown start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats
from topoloc.odometry import MotionGate
from topoloc.recording import Picture, Recording, Track
from topoloc.tuning.laps import laps_of, stretches_of
from topoloc.types import Frame

FEWEST_LOOKS = 8
"""A fold of fewer looks than this tells nothing: most of them go into finding the start."""
WANTED, FEWEST = 4, 3
"""Laps are cut further until there are so many folds; with fewer than the other, nothing can be compared."""
TRUTH_WITHIN_S = 1.0
"""The truth of a frame is known if a reading is at most so far from it in time [s]."""


@dataclass(frozen=True)
class Fold:
    """A part of a recording: the frames that are looked at, whatever the settings.

    Attributes:
        name: for people.
        recording: whose part it is.
        pictures: (U,) of the main kind, whose frames opened the motion gate and have a known truth.
        truth: (U, 3) true poses of the robot, map frame.
    """

    name: str
    recording: Recording
    pictures: tuple[Picture, ...]
    truth: Floats

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """(U,) frames without their images."""
        return tuple(replace(self.recording.frame(picture), images={}) for picture in self.pictures)

    @property
    def metres(self) -> float:
        """Length of its true path from look to look [m]."""
        return float(np.linalg.norm(np.diff(self.truth[:, :2], axis=0), axis=1).sum())


def folds_of(recordings: Sequence[Recording], count: int | None = None) -> list[Fold]:
    """Cut recordings into folds.

    Args:
        recordings: each is cut into its laps, and each lap, where there are fewer than ``WANTED``, into as many equal
            stretches as it takes.
        count: cut each recording into so many stretches of equal length instead.

    Raises:
        UserError: a recording has no ground truth, one is named twice, or there is not enough for ``FEWEST`` folds.
    """
    _refuse_twice([recording.folder for recording in recordings])
    names = [recording.folder.name for recording in recordings]
    if len(set(names)) < len(names):
        names = [str(recording.folder) for recording in recordings]
    wholes = [_whole(recording, name * (len(names) > 1)) for recording, name in zip(recordings, names, strict=True)]
    laps = [lap for whole in wholes for lap in ([whole] if count else _laps_of(whole))]
    pieces = count or -(-WANTED // len(laps))
    folds = [fold for lap in laps for fold in _stretches_of(lap, pieces)]
    usable = [fold for fold in folds if len(fold.pictures) >= FEWEST_LOOKS]
    if len(usable) < (FEWEST if count is None else max(FEWEST, len(folds))):
        looks, where = sum(len(fold.pictures) for fold in folds), ", ".join(str(one.folder) for one in recordings)
        raise UserError(
            f"{where}: {looks} frames with known truth open the motion gate, in {len(folds)} parts; {FEWEST} or more "
            f"parts of {FEWEST_LOOKS} are needed: record more laps, or give --folds another number"
        )
    return usable


def _refuse_twice(folders: Sequence[Path]) -> None:
    """Settings would be measured on what they were chosen on."""
    resolved = [folder.resolve() for folder in folders]
    for folder, path in zip(folders, resolved, strict=True):
        if resolved.count(path) > 1:
            raise InputError(folder, "is named twice", "name each recording once")


def _whole(recording: Recording, name: str) -> Fold:
    pictures, truth = _looked_at(recording)
    return Fold(name, recording, pictures, truth)


def _laps_of(whole: Fold) -> list[Fold]:
    return _cut(whole, laps_of(whole.truth[:, :2]), "lap") if whole.pictures else [whole]


def _stretches_of(fold: Fold, count: int) -> list[Fold]:
    return _cut(fold, stretches_of(fold.truth[:, :2], count), "stretch") if fold.pictures else [fold]


def _cut(fold: Fold, parts: Sequence[slice], kind: str) -> list[Fold]:
    """The parts of a fold, numbered from 1; one that is all of it keeps its name."""
    if len(parts) == 1:
        return [fold]
    return [
        replace(fold, name=f"{fold.name} {kind} {number}".strip(), pictures=fold.pictures[part], truth=fold.truth[part])
        for number, part in enumerate(parts, start=1)
    ]


def _looked_at(recording: Recording) -> tuple[tuple[Picture, ...], Floats]:
    """Pictures whose frames open the motion gate, and the true poses (U, 3) there."""
    if recording.truth is None:
        raise InputError(
            recording.folder,
            "has no groundtruth.txt, and nothing else tells which settings are better",
            "record the true pose, too, or keep the defaults",
        )
    chosen: list[Picture] = []
    gate, last = MotionGate(), None
    for picture in recording.pictures[recording.kind]:
        if not _known(recording.truth, picture.time):
            continue
        frame = recording.frame(picture)
        if last is None or last.odometry is None or frame.odometry is None:
            opens = True
        else:
            opens = gate.opens(last.odometry, last.camera, frame.odometry, frame.camera)
        if opens:
            chosen.append(picture)
            last = frame
    truth = np.array([recording.truth.at(picture.time) for picture in chosen]).reshape(-1, 3)
    return tuple(chosen), truth


def _known(truth: Track, time: float) -> bool:
    """Whether the true pose at a time lies between readings, or next to one, not somewhere in a gap."""
    after = int(np.searchsorted(truth.times, time))
    near = truth.times[max(after - 1, 0) : after + 1]
    return bool(np.abs(near - time).min() <= TRUTH_WITHIN_S)
