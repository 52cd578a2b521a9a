"""The lens of a camera, from pictures of a chessboard, by OpenCV's calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from topoloc.camera.jackknife import jackknife
from topoloc.errors import InputError, UserError
from topoloc.files import read_image
from topoloc.geometry import Floats
from topoloc.going_through import Track, in_silence
from topoloc.lens import Lens
from topoloc.topo_map import Camera
from topoloc.types import Image

LEAST_TILT = 0.15
"""Boards that all face the same way, to this, leave the focal length open [rad]."""
LEAST_BOARDS = 6
"""Fewer boards leave the lens open."""
SEARCH_COLUMNS = 1000
"""In wider pictures boards are first looked for in a reduced one."""
REFINE_SHARE = 0.3
"""Corners are refined in a window of this share of the distance between two."""
HOW_TO = "hold a flat board still, near and far, tilted, and into all corners of the picture"


@dataclass(frozen=True)
class ChessboardLens:
    """A lens found from pictures of a chessboard.

    Attributes:
        lens: its model, intrinsics and distortion.
        camera: the pinhole camera with the same focal length, of which straightened pictures are.
        hfov_sd_deg: standard deviation of the camera's field of view, degrees.
        rms_px: root mean square distance of the corners from where the lens has them, pixels.
        boards: pictures with a whole board.
        pictures: pictures looked through.
        seen: share of the picture's width and height that corners were seen in.
    """

    lens: Lens
    camera: Camera
    hfov_sd_deg: float
    rms_px: float
    boards: int
    pictures: int
    seen: tuple[float, float]


def lens_from_chessboards(
    pictures: Sequence[Path],
    board: tuple[int, int],
    model: Literal["pinhole", "fisheye"] = "pinhole",
    track: Track = in_silence,
) -> ChessboardLens:
    """Find a lens from pictures of a flat chessboard. How large its squares are does not matter.

    Args:
        pictures: files, all of one size, as the camera recorded them.
        board: inner corners, columns and rows: a usual board of 8 x 8 squares has 7 x 7.
        model: of the lens; a fish-eye sees 120 degrees and more.
        track: goes through the pictures.

    Raises:
        UserError: too few boards are found, sizes differ, or no lens fits.
    """
    if min(board) < 3:
        raise UserError(f"a board of {board[0]}x{board[1]} inner corners is too small; write columns x rows, as in 9x6")
    found: list[Floats] = []
    size: tuple[int, int] | None = None
    for number in track(range(len(pictures)), "looking for boards"):
        image = read_image(pictures[number])
        here = (image.shape[1], image.shape[0])
        if size is not None and here != size:
            problem = f"is {here[0]}x{here[1]}, others are {size[0]}x{size[1]}"
            raise InputError(pictures[number], problem, "take pictures of one size")
        size = here
        corners = corners_of(image, board)
        found += [] if corners is None else [corners]
    if size is None or len(found) < LEAST_BOARDS:
        problem = f"{len(found)} of {len(pictures)} pictures show a whole board of {board[0]}x{board[1]} inner corners"
        remedy = f"{LEAST_BOARDS} or more are needed, 20 are better: {HOW_TO}; count corners inside the board"
        raise UserError(f"{problem}; {remedy}")
    lens, rms = _calibrated(found, board, size, model)
    spans = np.ptp(np.concatenate(found), axis=0) / size
    camera = Camera(lens.hfov_deg(size[0]), *size)

    def field(kept: NDArray[np.bool_]) -> float:
        return _calibrated([found[number] for number in np.flatnonzero(kept)], board, size, model)[0].hfov_deg(size[0])

    sd = jackknife(len(found), field)
    return ChessboardLens(lens, camera, sd, rms, len(found), len(pictures), (float(spans[0]), float(spans[1])))


def corners_of(image: Image, board: tuple[int, int]) -> Floats | None:
    """Inner corners (columns * rows, 2) of a board in a picture [pixels]; None where it is not seen whole."""
    import cv2

    grey: Any = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    scale = min(1.0, SEARCH_COLUMNS / grey.shape[1])
    small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1.0 else grey
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    seen, corners = cv2.findChessboardCorners(small, board, flags=flags)
    if not seen:
        return None
    rough = (np.asarray(corners, dtype=np.float32).reshape(-1, 2) + 0.5) / scale - 0.5
    gap = np.linalg.norm(np.diff(rough.reshape(board[1], board[0], 2), axis=1), axis=2).min()
    reach = max(2, int(REFINE_SHARE * gap))
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
    fine = cv2.cornerSubPix(grey, rough[:, None].astype(np.float32), (reach, reach), (-1, -1), until)
    return np.asarray(fine, dtype=np.float64).reshape(-1, 2)


def _calibrated(
    found: Sequence[Floats], board: tuple[int, int], size: tuple[int, int], model: Literal["pinhole", "fisheye"]
) -> tuple[Lens, float]:
    """The lens that fits corners best, and its error [pixels]."""
    import cv2

    flat = np.zeros((board[0] * board[1], 3))
    flat[:, :2] = np.mgrid[: board[0], : board[1]].T.reshape(-1, 2)
    try:
        if model == "fisheye":
            home: Any = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2  # OpenCV 4, OpenCV 5
            flags = home.CALIB_RECOMPUTE_EXTRINSIC | home.CALIB_FIX_SKEW
            boards = [flat[None]] * len(found)
            seen = [corners[None] for corners in found]
            done: Any = cv2.fisheye.calibrate(boards, seen, size, np.eye(3), np.zeros(4), flags=flags)
        else:
            boards = [flat.astype(np.float32)] * len(found)
            seen = [corners.astype(np.float32) for corners in found]
            done = cv2.calibrateCamera(boards, seen, size, None, None)
    except cv2.error:
        done = None
    if done is None or done[1][0, 0] <= 0.0 or _tilt(done[3]) < LEAST_TILT:
        raise UserError(f"no {model} lens fits the {len(found)} boards found; {HOW_TO}, or try another --model")
    rms, matrix, bent = done[:3]
    fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Lens(model, fx, fy, cx, cy, tuple(float(one) for one in np.ravel(bent))), float(rms)


def _tilt(turns: Sequence[Any]) -> float:
    """How far (at the most) a board faces away from where boards face in the mean [rad]; turns are rotation vectors."""
    from scipy.spatial.transform import Rotation

    normals = Rotation.from_rotvec(np.array(turns, dtype=np.float64).reshape(-1, 3)).as_matrix()[:, :, 2]
    mean = normals.mean(axis=0)
    return float(np.arccos(np.clip(normals @ mean / np.linalg.norm(mean), -1.0, 1.0)).max())
