"""A camera's clock that is seconds off the odometer's: told by turns, and by nothing else."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from topoloc.checks import check_recording
from topoloc.checks.clock import clock_findings
from topoloc.checks.shifts import Shift, shifts_of
from topoloc.files import write_image
from topoloc.geometry import Floats
from topoloc.importing.alongside import Alongside
from topoloc.recording import Recording, Track, write_track

STEP_S = 0.5
FRAMES = 60
PIXELS_A_DEGREE = 4
TIMES = np.arange(0.0, 80.0, 0.1)


def headings(seed: int = 5) -> Floats:
    """(N,) at ``TIMES``, radians: pieces of 2 s with a rate each, of which half go straight on."""
    rng = np.random.default_rng(seed)
    rates = rng.uniform(-25.0, 25.0, 40) * (rng.random(40) < 0.5)
    return np.asarray(np.deg2rad(np.cumsum(np.repeat(rates, 20)) * 0.1))


def recorded(folder: Path, late_s: float = 0.0, mirrored: bool = False, turning: Floats | None = None) -> Recording:
    """A robot that turns on the spot before a wall of blobs, 25 s in; its pictures have stamps ``late_s`` too late."""
    noise = np.random.default_rng(1).integers(0, 256, (120, 360 * PIXELS_A_DEGREE)).astype(np.uint8)
    around = np.concatenate([cv2.equalizeHist(cv2.GaussianBlur(noise, (0, 0), 2.5))] * 2, axis=1)
    heading = headings() if turning is None else turning
    stamps = 25.0 + STEP_S * np.arange(FRAMES)
    for i, seen in enumerate(np.rad2deg(np.interp(stamps, TIMES, heading))):
        left = round(-seen % 360.0 * PIXELS_A_DEGREE) % (360 * PIXELS_A_DEGREE)
        picture = around[:, left : left + 160]
        write_image(folder / f"{i}.png", np.ascontiguousarray(picture[:, ::-1] if mirrored else picture))
    (folder / "rgb.txt").write_text("".join(f"{time + late_s:.3f} {i}.png\n" for i, time in enumerate(stamps)))
    odometry = np.column_stack([np.zeros((len(TIMES), 2)), np.asarray(headings())])
    write_track(folder / "odometry.txt", list(TIMES), odometry)
    return Recording.load(folder)


@pytest.mark.parametrize(
    ("late_s", "when", "offset"),
    [(4.0, "4.0 s earlier", "4.0 s smaller"), (-12.5, "12.5 s later", "12.5 s larger")],
)
def test_clock_that_is_seconds_off(late_s: float, when: str, offset: str, tmp_path: Path) -> None:
    findings = check_recording(recorded(tmp_path, late_s)).findings
    (found,) = (finding for finding in findings if finding.severity == "serious")
    assert f"fit the odometer best {when} (correlation " in found.what
    assert f"--offset-s {offset}" in found.remedy


@pytest.mark.parametrize("mirrored", [False, True])
def test_one_clock_is_not_blamed(mirrored: bool, tmp_path: Path) -> None:
    """Nor one of pictures that turn the wrong way."""
    recording = recorded(tmp_path, mirrored=mirrored)
    assert not list(clock_findings(recording, shifts_of(recording)))


def test_pictures_of_another_drive(tmp_path: Path) -> None:
    recording = recorded(tmp_path, turning=headings(12))
    (found,) = clock_findings(recording, shifts_of(recording))
    assert "do not turn together" in found.what and found.severity == "warning"


def shifted(recording: Recording, heading: Floats, late_s: float, count: int = FRAMES) -> list[Shift]:
    """What exact pictures of these headings would show."""
    starts = 25.0 + STEP_S * np.arange(count)
    turned = np.interp(starts + STEP_S, TIMES, heading) - np.interp(starts, TIMES, heading)
    return [Shift(t + late_s, t + late_s + STEP_S, 0.0, 100.0 * px) for t, px in zip(starts, turned, strict=True)]


class TestNothingIsSaid:
    """Where turns cannot tell, though the pictures are late."""

    @pytest.fixture
    def recording(self, tmp_path: Path) -> Recording:
        return recorded(tmp_path)

    def odometry(self, recording: Recording, heading: Floats) -> Recording:
        write_track(recording.folder / "odometry.txt", list(TIMES), np.column_stack([np.zeros((800, 2)), heading]))
        return Recording.load(recording.folder)

    def test_but_something_where_they_can(self, recording: Recording) -> None:
        assert list(clock_findings(recording, shifted(recording, headings(), 4.0)))

    def test_of_less_than_a_frame_interval(self, recording: Recording) -> None:
        assert not list(clock_findings(recording, shifted(recording, headings(), 0.4)))

    def test_of_turns_that_come_back_in_step(self, recording: Recording) -> None:
        swaying = np.sin(2.0 * np.pi * TIMES / 10.0)
        drive = self.odometry(recording, swaying)
        assert not list(clock_findings(drive, shifted(recording, swaying, 4.0)))

    def test_of_a_single_turn(self, recording: Recording) -> None:
        once = np.clip(TIMES - 40.0, 0.0, 1.5)
        assert not list(clock_findings(self.odometry(recording, once), shifted(recording, once, 4.0)))

    def test_of_few_pairs(self, recording: Recording) -> None:
        assert not list(clock_findings(recording, shifted(recording, headings(), 4.0, count=19)))

    def test_of_a_robot_that_goes_straight_on(self, recording: Recording) -> None:
        straight = np.zeros(800)
        assert not list(clock_findings(self.odometry(recording, straight), shifted(recording, straight, 4.0)))


class TestHint:
    """Of the importers, where pictures lie outside a track at one end."""

    def lack(self, times: tuple[float, float], at: float) -> str:
        track = Track(np.arange(times[0], times[1] + 0.05, 0.1), np.zeros((round((times[1] - times[0]) * 10) + 1, 3)))
        beside = Alongside(track)
        beside.refuse_apart(0.0, 60.0)
        return beside.lack(at) or ""

    def test_odometry_that_is_as_much_longer_at_the_other_end(self) -> None:
        assert self.lack((12.5, 72.5), 3.0) == (
            "no odometer pose within 0.5 s; the pictures run from 0.000 to 60.000 s, the odometer poses from 12.500 to "
            "72.500 s: did you mean --offset-s 12.5 (added to one already given)?"
        )
        assert "--offset-s -8 " in self.lack((-8.0, 52.0), 57.0)

    def test_odometry_that_is_shorter(self) -> None:
        why = self.lack((12.5, 60.0), 3.0)
        assert "from 12.500 to 60.000 s" in why and "offset" not in why

    def test_pictures_that_all_lie_within(self) -> None:
        assert not self.lack((-0.3, 60.3), 3.0)
