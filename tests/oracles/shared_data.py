"""The real photographs that some machines have beside the checkout; tests that need them are left out elsewhere."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from topoloc.files import read_image
from topoloc.topo_map import Camera

SHARED_DATA = Path(__file__).parents[3] / "shared" / "data"
RING6_SNAPSHOTS = SHARED_DATA / "ring6_lab" / "snapshots"
RING6_QUERIES = SHARED_DATA / "ring6_lab" / "queries"
CAMERA = Camera(40.0, 384, 288)


def yaws(folder: Path) -> dict[str, float]:
    """Heading of the optical axis [deg, ccw] by file name."""
    with (folder / "yaws.csv").open(newline="") as file:
        return {row["file"]: float(row["yaw_deg_ccw"]) for row in csv.DictReader(file)}


def placed_panorama(heading_deg: float = 90.0) -> tuple[np.ndarray, float]:
    """Panorama of the twelve snapshots placed by their true yaws, and the heading of its first column [deg]."""
    columns = CAMERA.panorama_columns()
    panorama = np.zeros((CAMERA.height, columns, 3), dtype=np.uint8)
    for name, yaw in yaws(RING6_SNAPSHOTS).items():
        middle = (heading_deg - yaw) / 360.0 * columns
        left = round(middle - CAMERA.width / 2)
        panorama[:, (left + np.arange(CAMERA.width)) % columns] = read_image(RING6_SNAPSHOTS / name)
    return panorama, heading_deg
