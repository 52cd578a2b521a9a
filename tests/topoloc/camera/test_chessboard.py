"""Lenses from drawn chessboards, bent by known coefficients (simulated)."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from topoloc.camera.chessboard import LEAST_BOARDS, corners_of, lens_from_chessboards
from topoloc.errors import InputError, UserError
from topoloc.files import write_image
from topoloc.lens import Lens
from topoloc.types import Image

SIZE = (480, 360)
BOARD = (7, 5)
FINER = 2
LENSES = {
    "pinhole": Lens("pinhole", 330.0, 328.0, 236.0, 183.5, (-0.22, 0.06, 0.001, -0.0008, 0.0)),
    "fisheye": Lens("fisheye", 210.0, 210.0, 242.0, 178.0, (0.05, -0.012, 0.003, -0.001)),
}


@lru_cache
def rays(model: str) -> np.ndarray:
    """What each point of a finer picture looks along, (rows, columns, 2) at depth 1."""
    lens = LENSES[model]
    x, y = np.meshgrid(*((np.arange(n * FINER) + 0.5) / FINER - 0.5 for n in SIZE))
    points = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    matrix = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    straighten = cv2.fisheye.undistortPoints if model == "fisheye" else cv2.undistortPoints
    straight = np.asarray(straighten(points, matrix, np.array(lens.coefficients)))
    return straight.reshape(SIZE[1] * FINER, SIZE[0] * FINER, 2)


def picture_of_board(model: str, turn: np.ndarray, middle: np.ndarray) -> Image:
    """A board turned by a rotation vector, its middle at a place, in lengths of a square."""
    rotation, _ = cv2.Rodrigues(turn)
    homography = np.column_stack([np.asarray(rotation)[:, :2], middle])
    seen = np.concatenate([rays(model), np.ones((*rays(model).shape[:2], 1))], axis=2) @ np.linalg.inv(homography).T
    place = seen[:, :, :2] / seen[:, :, 2:]
    half = np.array([BOARD[0] + 1, BOARD[1] + 1]) / 2.0
    squares = np.floor(place + half).astype(int).sum(axis=2) % 2
    inside = (np.abs(place) < half).all(axis=2)
    fine = np.where(inside, np.where(squares, 235, 20), 235).astype(np.uint8)
    fine[(np.abs(place) > half + 1.0).any(axis=2)] = 130
    return np.asarray(cv2.resize(fine, SIZE, interpolation=cv2.INTER_AREA))


def boards(folder: Path, model: str, count: int, seed: int = 0) -> list[Path]:
    rng = np.random.default_rng(seed)
    paths = []
    for number in range(count):
        depth = rng.uniform(9.0, 14.0)
        middle = np.array([rng.uniform(-0.35, 0.35) * depth, rng.uniform(-0.22, 0.22) * depth, depth])
        paths.append(folder / f"{number}.png")
        write_image(paths[-1], picture_of_board(model, rng.uniform(-0.5, 0.5, 3), middle))
    return paths


@pytest.mark.parametrize("model", ["pinhole", pytest.param("fisheye", marks=pytest.mark.slow)])
def test_lens_comes_back(tmp_path: Path, model: str) -> None:
    """What counts: where points come to lie. Coefficients stand in for each other."""
    true = LENSES[model]
    found = lens_from_chessboards(boards(tmp_path, model, 12), BOARD, true.model)
    assert found.boards >= 9 and found.pictures == 12
    assert found.rms_px < 0.2
    assert found.hfov_sd_deg < 1.0
    assert found.lens.fx == pytest.approx(true.fx, rel=0.01)
    assert (found.lens.cx, found.lens.cy) == pytest.approx((true.cx, true.cy), abs=2.0)
    assert found.camera.hfov_deg == pytest.approx(true.hfov_deg(SIZE[0]), rel=0.01)
    points = np.array([(x, y, 1.0) for x in np.linspace(-0.5, 0.5, 7) for y in np.linspace(-0.35, 0.35, 5)])
    assert np.linalg.norm(recorded_at(found.lens, points) - recorded_at(true, points), axis=1).max() < 1.5


def recorded_at(lens: Lens, points: np.ndarray) -> np.ndarray:
    """Where a lens records points (N, 3): pixels (N, 2), by OpenCV's own projection."""
    matrix = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    zero, bent = np.zeros(3), np.array(lens.coefficients)
    project = cv2.fisheye.projectPoints if lens.model == "fisheye" else cv2.projectPoints
    seen, _ = project(points[:, None], zero, zero, matrix, bent)
    return np.asarray(seen).reshape(-1, 2)


def test_corners_of_a_large_picture_are_exact() -> None:
    """Three times as large: searched in a reduced picture, refined in the whole one."""
    small = picture_of_board("pinhole", np.array([0.1, 0.2, 0.05]), np.array([0.0, 0.0, 11.0]))
    corners = corners_of(small, BOARD)
    enlarged = np.asarray(cv2.resize(small, None, fx=3.0, fy=3.0, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    large = corners_of(enlarged, BOARD)
    assert corners is not None and large is not None
    assert np.abs((large + 0.5) / 3.0 - 0.5 - corners).max() < 0.1


class TestRefused:
    def test_too_few_boards(self, tmp_path: Path) -> None:
        paths = boards(tmp_path, "pinhole", LEAST_BOARDS - 1)
        with pytest.raises(UserError, match=f"of {LEAST_BOARDS - 1} pictures show a whole board of 7x5.*or more are"):
            lens_from_chessboards(paths, BOARD)

    def test_another_board(self, tmp_path: Path) -> None:
        with pytest.raises(UserError, match="0 of 2 pictures show a whole board of 9x6"):
            lens_from_chessboards(boards(tmp_path, "pinhole", 2), (9, 6))

    def test_sizes_that_differ(self, tmp_path: Path) -> None:
        paths = boards(tmp_path, "pinhole", 1)
        write_image(tmp_path / "other.png", np.zeros((300, 400), dtype=np.uint8))
        with pytest.raises(InputError, match=r"other.png: is 400x300, others are 480x360"):
            lens_from_chessboards([*paths, tmp_path / "other.png"], BOARD)

    def test_no_pictures(self) -> None:
        with pytest.raises(UserError, match="0 of 0 pictures"):
            lens_from_chessboards([], BOARD)

    def test_board_too_small(self) -> None:
        with pytest.raises(UserError, match="2x6 inner corners is too small"):
            lens_from_chessboards([], (2, 6))

    @pytest.mark.parametrize("model", ["pinhole", "fisheye"])
    def test_same_view_again_and_again(self, tmp_path: Path, model: str) -> None:
        """Boards that face the camera all alike leave the focal length open."""
        picture = picture_of_board(model, np.zeros(3), np.array([0.0, 0.0, 11.0]))
        paths = [tmp_path / f"{number}.png" for number in range(LEAST_BOARDS)]
        for path in paths:
            write_image(path, picture)
        with pytest.raises(UserError, match=f"no {model} lens fits.*tilted"):
            lens_from_chessboards(paths, BOARD, LENSES[model].model)
