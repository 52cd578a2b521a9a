"""The yaw of the camera on the robot, from points and from a drive in a drawn room (simulated)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from topoloc.camera.level import View, turned
from topoloc.camera.mount_yaw import MovedPoints, estimate_mount_yaw, fitted, searched, straight_pairs
from topoloc.errors import InputError, UserError
from topoloc.geometry import wrap
from topoloc.recording import Recording

PAIRS, EACH = 10, 60


def seen(view: View, yaw: float, backward: bool = False, seed: int = 0) -> MovedPoints:
    """Things 1 to 6 m away, seen before and after steps of 0.2 to 0.6 m with small turns of robot and pan head."""
    rng = np.random.default_rng(seed)

    def each(low: float, high: float) -> np.ndarray:
        return np.repeat(rng.uniform(low, high, PAIRS), EACH)

    turn, pan, step = each(-0.05, 0.05), each(-0.3, 0.3), each(0.2, 0.6)
    direction = each(-0.1, 0.1) + (np.pi if backward else 0.0)
    left = direction - yaw - pan  # of the way, counter-clockwise from the optical axis
    moved = step[:, None] * np.column_stack([-np.sin(left), np.zeros(len(left)), np.cos(left)])
    before = rng.uniform((-1.0, -0.7), (1.0, 0.7), (len(turn), 2))
    things = view.rays(before) * rng.uniform(1.0, 6.0, (len(turn), 1))
    after = view.points(turned(things - moved, turn)) + rng.normal(0.0, 0.0015, before.shape)
    wrong = rng.random(len(turn)) < 0.15
    after[wrong] = rng.uniform(-1.0, 1.0, (int(wrong.sum()), 2))
    return MovedPoints(before, after, turn, direction, pan, np.repeat(np.arange(PAIRS), EACH))


@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 180.0, 20.0, -35.0, -120.0])
@pytest.mark.parametrize(("hfov_deg", "pitch_deg", "backward"), [(40.0, 0.0, False), (62.0, 10.0, True)])
def test_yaw_comes_back(yaw_deg: float, hfov_deg: float, pitch_deg: float, backward: bool) -> None:
    true = replace(View.of(hfov_deg), pitch=np.deg2rad(pitch_deg))
    points = seen(true, float(np.deg2rad(yaw_deg)), backward)
    level = View.of(hfov_deg)
    view, yaw = fitted(points, level, searched(points, level))
    assert abs(np.rad2deg(wrap(yaw - np.deg2rad(yaw_deg)))) < 1.0
    assert points.away(view, yaw) > 0.85
    assert points.away(view, yaw + np.pi) < 0.15


def test_drive_in_a_room(straight: Path) -> None:
    """The camera looks 35 degrees to the right and 8 down; camera.toml tells neither."""
    found = estimate_mount_yaw(Recording.load(straight))
    assert found.yaw_deg == pytest.approx(-35.0, abs=2.0)
    assert found.sd_deg < 2.0
    assert found.driven_m == pytest.approx(2.0, abs=0.01)


def test_pairs_are_of_straight_drives_only() -> None:
    spot = np.column_stack([np.zeros((5, 2)), np.deg2rad(10.0) * np.arange(5)])
    straight = np.column_stack([0.1 * np.arange(1, 9), np.zeros(8), np.full(8, spot[-1, 2])])
    bend = np.column_stack([0.8 + 0.1 * np.arange(1, 9), np.zeros(8), spot[-1, 2] + 0.3 * np.arange(1, 9)])
    pairs = straight_pairs(np.concatenate([spot, straight, bend]))
    assert pairs and all(4 <= first < second <= 12 for first, second in pairs)


class TestRefused:
    def test_no_field_of_view(self, straight: Path) -> None:
        with pytest.raises(InputError, match=r"tells no field of view.*topoloc camera turn"):
            estimate_mount_yaw(replace(Recording.load(straight), camera=None))

    def test_no_odometry(self, straight: Path) -> None:
        with pytest.raises(InputError, match=r"has no odometry\.txt"):
            estimate_mount_yaw(replace(Recording.load(straight), odometry=None))

    def test_turn_on_the_spot(self, circle: Path) -> None:
        with pytest.raises(UserError, match=r"0 pairs of frames of a straight drive.*drive straight ahead"):
            estimate_mount_yaw(Recording.load(circle))

    @pytest.mark.slow
    def test_pictures_out_of_order(self, straight: Path) -> None:
        recording = Recording.load(straight)
        files = [picture.path for picture in recording.pictures["rgb"]]
        order = np.random.default_rng(0).permutation(len(files))
        mixed = [replace(one, path=files[other]) for one, other in zip(recording.pictures["rgb"], order, strict=True)]
        with pytest.raises(InputError, match="moves as on a straight drive"):
            estimate_mount_yaw(replace(recording, pictures={"rgb": mixed}))
