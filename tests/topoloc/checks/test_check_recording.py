"""What is wrong with a recording's clock, odometer, truth and pictures: each with a place, a remedy, how bad."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from topoloc.checks import Finding, check_recording
from topoloc.cli.main import run
from topoloc.files import write_image
from topoloc.geometry import Floats
from topoloc.recording import Recording, write_track
from topoloc.types import Image

COUNT = 30
TIMES = np.linspace(10.0, 10.0 + 0.5 * (COUNT - 1), COUNT)
PATH = np.column_stack([0.2 * np.arange(COUNT), np.zeros((COUNT, 2))])


def noise(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (6, 8, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((4, 4, 1), dtype=np.uint8))


def make(
    folder: Path,
    picture: Callable[[int], Image] = noise,
    times: Floats = TIMES,
    odometry: tuple[Floats, Floats] | None = (TIMES, PATH),
    truth: tuple[Floats, Floats] | None = (TIMES, PATH),
) -> list[Finding]:
    """The findings of a recording of a robot that drives straight on."""
    for i in range(len(times)):
        write_image(folder / f"{i}.png", picture(i))
    (folder / "camera.toml").write_text("hfov_deg = 40\nwidth = 32\nheight = 24\n")
    (folder / "rgb.txt").write_text("".join(f"{time} {i}.png\n" for i, time in enumerate(times)))
    for name, track in (("odometry.txt", odometry), ("groundtruth.txt", truth)):
        if track is not None:
            write_track(folder / name, list(track[0]), track[1])
    return list(check_recording(Recording.load(folder)).findings)


def test_nothing_is_found_where_nothing_is_wrong(tmp_path: Path) -> None:
    assert not make(tmp_path)


def one(findings: list[Finding], part: str) -> Finding:
    (found,) = (finding for finding in findings if part in finding.what)
    return found


def test_field_of_view_that_nobody_tells(tmp_path: Path) -> None:
    make(tmp_path)
    (tmp_path / "camera.toml").unlink()
    (found,) = check_recording(Recording.load(tmp_path)).findings
    assert found.severity == "note" and "topoloc camera turn" in found.remedy


def test_few_frames(tmp_path: Path) -> None:
    found = one(make(tmp_path, times=TIMES[:5]), "5 frames only")
    assert found.severity == "note"


def test_frames_far_apart(tmp_path: Path) -> None:
    found = make(tmp_path, odometry=(TIMES, PATH * 8.0), truth=None)
    assert "the longest 1.6 m" in one(found, "29 of 29 steps").what


@pytest.mark.parametrize(
    ("picture", "what"),
    [
        (lambda i: np.full((24, 32, 3), 3, np.uint8), "is very dark"),
        (lambda i: np.full((24, 32, 3), 252, np.uint8), "is overexposed"),
        (lambda i: np.full((24, 32, 3), 128, np.uint8), "is all of one grey"),
    ],
    ids=["dark", "bright", "grey"],
)
@pytest.mark.parametrize(("share", "severity"), [(0.9, "serious"), (0.2, "warning")])
def test_pictures_that_show_nothing_are_one_finding(
    picture: Callable[[int], Image], what: str, share: float, severity: str, tmp_path: Path
) -> None:
    found = one(make(tmp_path, lambda i: picture(i) if i < share * COUNT else noise(i)), what)
    assert found.severity == severity
    assert f"{round(share * COUNT)} of {COUNT} pictures" in found.what
    assert "lines 1, 2, 3, 4" in found.where


def test_frozen_camera(tmp_path: Path) -> None:
    found = one(make(tmp_path, lambda i: noise(7) if 10 <= i < 15 else noise(i)), "same as the one before")
    assert found.what.startswith("4 pictures")
    assert "lines 12, 13, 14, 15" in found.where


def test_gap_in_the_odometry_counts_where_frames_lie_in_it(tmp_path: Path) -> None:
    dense = np.linspace(10.0, 25.0, 301)
    held = (dense < 15.0) | (dense > 18.0)
    path = np.column_stack([0.4 * (dense - 10.0), np.zeros((len(dense), 2))])
    found = one(make(tmp_path, odometry=(dense[held], path[held])), "no pose for 3")
    assert "over 7 frames" in found.what or "over 6 frames" in found.what


def test_truth_that_was_lost_for_a_while(tmp_path: Path) -> None:
    dense = np.linspace(10.0, 25.0, 301)
    held = (dense < 15.0) | (dense > 18.0)
    path = np.column_stack([0.4 * (dense - 10.0), np.zeros((len(dense), 2))])
    found = one(make(tmp_path, odometry=(dense, path), truth=(dense[held], path[held])), "no pose for 3")
    assert "groundtruth.txt" in found.where


def test_two_clocks(tmp_path: Path) -> None:
    found = one(make(tmp_path, odometry=(TIMES - 1000.0, PATH)), "lie outside its times: they begin +1000.0 s")
    assert found.severity == "serious"


def test_jump_in_heading(tmp_path: Path) -> None:
    turned = PATH.copy()
    turned[12:, 2] = np.deg2rad(170.0)
    dense = np.linspace(10.0, 10.0 + 0.1 * (COUNT - 1), COUNT)
    found = one(make(tmp_path, times=dense, odometry=(dense, turned), truth=None), "the odometer turns 1700 degrees/s")
    assert found.severity == "serious"


def test_stamps_in_bursts_are_no_jumps(tmp_path: Path) -> None:
    """50 readings a second, every tenth stamped nearly a step late."""
    dense = np.linspace(10.0, 25.0, 751)
    path = np.column_stack([0.4 * (dense - 10.0), np.zeros((len(dense), 2))])
    late = dense + np.where(np.arange(len(dense)) % 10 == 5, 0.0195, 0.0)
    assert not make(tmp_path, odometry=(late, path), truth=None)


def test_jumps_are_one_finding(tmp_path: Path) -> None:
    thrown = PATH.copy()
    thrown[5::2, 1] = 9.0
    assert "jumps 24 more times" in one(make(tmp_path, odometry=(TIMES, thrown), truth=None), "moves 18").what


def test_odometer_of_another_scale(tmp_path: Path) -> None:
    assert "is 17.4 m long, the true one 5.8 m" in one(make(tmp_path, odometry=(TIMES, PATH * 3.0)), "path is").what


def test_truth_that_ends_early(tmp_path: Path) -> None:
    found = one(make(tmp_path, truth=(TIMES[:20], PATH[:20])), "lie outside its times")
    assert "groundtruth.txt" in found.where and found.what.startswith("9 of 30")


def test_exit_code_and_json_are_for_scripts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make(tmp_path, times=TIMES[:5])
    assert run(["check", str(tmp_path)]) == 0, "a note alone does not fail"
    assert "- note: " in capsys.readouterr().out
    assert run(["check", str(tmp_path), "--fail-on", "note", "--json"]) == 1
    (report,) = json.loads(capsys.readouterr().out)
    assert report["findings"][0]["severity"] == "note"
    assert set(report["findings"][0]) == {"where", "what", "remedy", "severity"}


def test_map_comes_first(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    make(tmp_path)
    assert run(["check", str(tmp_path), str(tmp_path)]) == 2
    assert "name the map first" in capfd.readouterr().err
