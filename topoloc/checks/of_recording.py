"""A recording looked over."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from topoloc.checks.clock import clock_findings
from topoloc.checks.finding import Finding, Report, Severity, listed
from topoloc.checks.lightness import flaw_of
from topoloc.checks.shifts import shifts_of
from topoloc.checks.turn_sense import sense_findings
from topoloc.errors import InputError, UnreadableImage, UserError
from topoloc.geometry import Floats, between
from topoloc.going_through import Track, in_silence
from topoloc.recording import Picture, Recording
from topoloc.recording import Track as Poses
from topoloc.types import Pixels

GAP_FACTOR = 10.0
"""A pause so many times longer than the median step in time is a gap."""
JUMP_M_PER_S = 5.0
"""A robot that one odometer reading makes this fast has jumped [m/s]."""
JUMP_DEG_PER_S = 720.0
"""Or turning this fast [degrees/s]."""
LEAST_STEP_S = 0.1
"""Speeds are told over this time at least: stamps may come in bursts [s]."""
FEW_FRAMES = 20
"""Fewer frames do not show whether a localizer settles."""
FAR_STEP_M = 1.0
"""Frames farther apart than this leave a filter without a look for long [m]."""
OUTSIDE_S = 0.5
"""Frames may lie so long before the first or after the last reading of the odometer [s]."""
OTHER_SCALE = 1.25
"""The odometer's path may be so many times longer, or shorter, than the true one."""
LEAST_PATH_M = 2.0
"""Shorter paths say nothing about the odometer's scale [m]."""
FIELD_OFF = 0.1
"""A field of view that differs from the one found in turns by this share is wrong."""


def check_recording(recording: Recording, track: Track = in_silence) -> Report:
    """Look a recording over: its pictures, its clock, its odometer beside its truth, its camera.

    Args:
        recording: whose lists were read.
        track: goes through numbers and may show how far it is.
    """
    pictures = recording.pictures[recording.kind]
    where = str(recording.folder / f"{recording.kind}.txt")
    times = np.array([picture.time for picture in pictures])
    parts = [name for name in ("odometry", "truth", "pan") if getattr(recording, name) is not None]
    beside = f", with {', '.join(parts)}" if parts else ""
    summary = f"recording: {len(pictures)} frames in {times[-1] - times[0]:.1f} s{beside}"
    found = [*_counts(recording, where), *_camera_told(recording)]
    found += [*_picture_findings(recording, where, track), *_gaps(pictures, where)]
    if recording.odometry is None:
        what = "there is no odometry.txt"
        remedy = "record the odometer: without it each frame stands alone"
        found.append(Finding(str(recording.folder), what, remedy, "warning"))
    else:
        found += _odometry_findings(recording, recording.odometry, times)
        if recording.kind == "rgb":
            found += _camera_findings(recording, track)
    if recording.truth is not None:
        found += _truth_findings(recording, recording.truth, times)
    return Report(summary, tuple(found))


def _counts(recording: Recording, where: str) -> Iterator[Finding]:
    """Too few frames, or frames too far apart."""
    count = len(recording)
    if count < FEW_FRAMES:
        what, remedy = f"there are {count} frames only", "record more: a localizer needs some to settle"
        yield Finding(where, what, remedy, "serious" if count < 3 else "note")
    if recording.odometry is None:
        return
    poses = np.array([recording.odometry.at(picture.time) for picture in recording.pictures[recording.kind]])
    steps = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    far = int((steps > FAR_STEP_M).sum())
    if far > 0.1 * max(1, len(steps)):
        longest = f"the longest {steps.max():.1f} m"
        what = f"{far} of {len(steps)} steps between frames are longer than {FAR_STEP_M:g} m, {longest}"
        yield Finding(where, what, "record more frames a second, or drive slower", "warning")


def _gaps(pictures: Sequence[Picture], where: str) -> Iterator[Finding]:
    steps = np.diff([picture.time for picture in pictures])
    if len(steps) > 2:
        for i in np.flatnonzero(steps > GAP_FACTOR * np.median(steps)).tolist():
            what = f"line {pictures[i + 1].line} comes {steps[i]:.1f} s after the frame before"
            yield Finding(where, what, "cut the recording there", "warning")


class _Looks:
    """What is wrong with single pictures, gathered as they go by."""

    def __init__(self, where: str) -> None:
        self._where = where
        self.sizes: dict[tuple[int, int], int] = {}
        self.broken: list[Finding] = []
        self.flawed: dict[tuple[str, str], list[int]] = {}
        self.frozen: list[int] = []
        self._last: tuple[Pixels, Floats | None] | None = None

    def add(self, picture: Picture, image: Pixels, odometry: Floats | None) -> None:
        """Look at a picture that could be read."""
        self.sizes.setdefault((image.shape[1], image.shape[0]), picture.line)
        flaw = flaw_of(image)
        if flaw is not None:
            self.flawed.setdefault((flaw.what, flaw.remedy), []).append(picture.line)
        if self._last is not None and odometry is not None and self._last[1] is not None:
            moved = between(self._last[1], odometry)
            if np.abs(moved).max() > 0.05 and np.array_equal(self._last[0], image):
                self.frozen.append(picture.line)
        self._last = image, odometry

    def findings(self, count: int) -> Iterator[Finding]:
        """One of each kind, with the lines that it is on."""
        yield from self.broken
        for (what, remedy), lines in self.flawed.items():
            places = f"lines {listed([str(line) for line in lines])}" if len(lines) > 1 else f"line {lines[0]}"
            told = f"{len(lines)} of {count} pictures: each {what}" if len(lines) > 1 else f"the picture {what}"
            severity: Severity = "serious" if len(lines) > 0.5 * count else "warning"
            yield Finding(f"{self._where}, {places}", told, remedy, severity)
        if self.frozen:
            what = f"{len(self.frozen)} pictures are the same as the one before, though the robot moved"
            where = f"{self._where}, lines {listed([str(line) for line in self.frozen])}"
            yield Finding(where, what, "the camera froze, or pictures were written twice: take them out", "warning")
        if len(self.sizes) > 1:
            told = ", ".join(f"{width}x{height} (line {line})" for (width, height), line in self.sizes.items())
            yield Finding(self._where, f"pictures of different sizes: {told}", "scale them to one size", "serious")


def _picture_findings(recording: Recording, where: str, track: Track) -> Iterator[Finding]:
    pictures = recording.pictures[recording.kind]
    looks = _Looks(where)
    for number in track(range(len(pictures)), "looking at pictures"):
        picture = pictures[number]
        frame = recording.frame(picture)
        try:
            looks.add(picture, frame.images[recording.kind], frame.odometry)
        except UnreadableImage as error:
            what = f"{picture.path.name} {error.problem}"
            looks.broken.append(Finding(f"{where}, line {picture.line}", what, error.remedy, "warning"))
        except InputError as error:
            place = f"{error.path}, line {error.line}" if error.line is not None else str(error.path)
            looks.broken.append(Finding(place, error.problem, error.remedy, "serious"))
    yield from looks.findings(len(pictures))


def _odometry_findings(recording: Recording, poses: Poses, times: Floats) -> Iterator[Finding]:
    """Jumps, gaps, and frames outside its times."""
    where = str(recording.folder / "odometry.txt")
    if len(poses.times) > 1:
        yield from _jumps(poses, where)
        yield from _holes(poses, where, times)
    outside = int(((times < poses.times[0] - OUTSIDE_S) | (times > poses.times[-1] + OUTSIDE_S)).sum())
    if outside:
        what = f"{outside} of {len(times)} frames lie outside its times"
        if outside == len(times):
            what += f": they begin {times[0] - poses.times[0]:+.1f} s after its first reading"
        yield Finding(where, what, "record both with one clock", "serious" if outside > 0.5 * len(times) else "warning")


def _holes(poses: Poses, where: str, times: Floats) -> Iterator[Finding]:
    """Stretches without poses that frames were taken in."""
    steps = np.diff(poses.times)
    for i in np.flatnonzero((steps > GAP_FACTOR * np.median(steps)) & (steps > OUTSIDE_S)).tolist():
        inside = int(((times > poses.times[i]) & (times < poses.times[i + 1])).sum())
        if inside:
            what = f"no pose for {steps[i]:.1f} s from {poses.times[i]:.3f} s on, over {inside} frames"
            yield Finding(where, what, "what lies between is interpolated: take these frames out", "warning")


def _jumps(poses: Poses, where: str) -> Iterator[Finding]:
    """Readings that no robot gives, in one finding; stamps that come in bursts are no jumps."""
    moved = between(poses.poses[:-1], poses.poses[1:])
    steps = np.maximum(np.diff(poses.times), LEAST_STEP_S)
    speed, spin = np.hypot(moved[:, 0], moved[:, 1]) / steps, np.abs(np.rad2deg(moved[:, 2])) / steps
    jumps = np.flatnonzero((speed > JUMP_M_PER_S) | (spin > JUMP_DEG_PER_S))
    if len(jumps):
        first = jumps[0]
        how = f"moves {speed[first]:.1f} m/s" if speed[first] > JUMP_M_PER_S else f"turns {spin[first]:.0f} degrees/s"
        what = f"at {poses.times[first + 1]:.3f} s the odometer {how}"
        what += f", and jumps {len(jumps) - 1} more times" if len(jumps) > 1 else ""
        yield Finding(where, what, "look for lost readings, or millimetres instead of metres", "serious")


def _truth_findings(recording: Recording, truth: Poses, times: Floats) -> Iterator[Finding]:
    """Frames outside its times, and an odometer of another scale."""
    where = str(recording.folder / "groundtruth.txt")
    outside = int(((times < truth.times[0] - OUTSIDE_S) | (times > truth.times[-1] + OUTSIDE_S)).sum())
    if outside:
        what = f"{outside} of {len(times)} frames lie outside its times"
        yield Finding(where, what, "cut them off: metrics would take its first or last pose for them", "warning")
    if len(truth.times) > 1:
        yield from _holes(truth, where, times)
    if recording.odometry is None:
        return
    true, measured = (_length(np.array([poses.at(time) for time in times])) for poses in (truth, recording.odometry))
    if min(true, measured) > LEAST_PATH_M and not 1.0 / OTHER_SCALE < measured / true < OTHER_SCALE:
        what = f"the odometer's path is {measured:.1f} m long, the true one {true:.1f} m"
        remedy = "correct the wheels' scale, or the units of one of them"
        yield Finding(str(recording.folder / "odometry.txt"), what, remedy, "serious")


def _length(poses: Floats) -> float:
    return float(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).sum())


def _camera_told(recording: Recording) -> Iterator[Finding]:
    """Whether the field of view is known."""
    if recording.camera is None and recording.kind == "rgb":
        what = "nobody tells the field of view"
        remedy = "write hfov_deg, width and height there; 'topoloc camera turn RECORDING --write' measures it"
        yield Finding(str(recording.folder / "camera.toml"), what, remedy, "note")


def _camera_findings(recording: Recording, track: Track) -> Iterator[Finding]:
    """Another clock, pictures that go the wrong way round in turns, a field of view that turns do not bear out."""
    try:
        shifts = shifts_of(recording, track)
    except InputError:
        return  # a picture that cannot be read is a finding of its own
    wrong = list(clock_findings(recording, shifts)) or list(sense_findings(recording, shifts))
    yield from wrong
    if wrong or recording.camera is None:
        return
    from topoloc.camera.field_of_view import estimate_field_of_view

    try:
        found = estimate_field_of_view(recording, track=track)
    except UserError:
        return  # nothing turned on the spot: there is nothing to measure it by
    told = recording.camera.hfov_deg
    off = abs(found.hfov_deg / told - 1.0)
    if off > FIELD_OFF and abs(found.hfov_deg - told) > 3.0 * found.sd_deg:
        what = f"hfov_deg is {told:g}, but pictures in turns fit {found.hfov_deg:.1f} +- {found.sd_deg:.1f}"
        remedy = "correct it, see 'topoloc camera turn'; or correct the odometer's turning"
        yield Finding(str(recording.folder / "camera.toml"), what, remedy, "serious" if off > 0.2 else "warning")


def frames_apart(recording: Recording, most: int) -> list[Picture]:
    """At most so many pictures, evenly picked."""
    pictures = recording.pictures[recording.kind]
    chosen = np.unique(np.linspace(0, len(pictures) - 1, most).round().astype(int))
    return [pictures[i] for i in chosen]
