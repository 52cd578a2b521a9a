"""Real photographs through the files and the command line: the conventions hold from end to end."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
from oracles.shared_data import CAMERA, RING6_QUERIES, RING6_SNAPSHOTS, placed_panorama, yaws

from topoloc.cli.main import run
from topoloc.files import read_image
from topoloc.geometry import wrap
from topoloc.topo_map import Node, TopoMap

pytestmark = pytest.mark.skipif(not RING6_QUERIES.is_dir(), reason="the real photographs are not on this machine")


def test_headings_of_the_queries_in_steps_csv(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A map of one node, a recording of 18 views without odometry: each heading within 1 degree."""
    panorama, heading = placed_panorama()
    TopoMap("ring6", CAMERA, (Node("lab", "lab", 0.0, 0.0, float(np.deg2rad(heading)), panorama),)).save(
        tmp_path / "map"
    )
    truth = yaws(RING6_QUERIES)
    recording = tmp_path / "recording"
    recording.mkdir()
    for name in truth:
        shutil.copy(RING6_QUERIES / name, recording / name)
    (recording / "rgb.txt").write_text("".join(f"{i}.0 {name}\n" for i, name in enumerate(truth)))
    arguments = ["localize", str(tmp_path / "map"), str(recording), "-o", str(tmp_path / "run")]
    assert run([*arguments, "--estimator", "best-match"]) == 0
    with (tmp_path / "run" / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["node"] for row in rows] == ["lab"] * 18
    errors = [
        abs(float(np.rad2deg(wrap(np.deg2rad(float(row["heading_deg"]) - yaw)))))
        for row, yaw in zip(rows, truth.values(), strict=True)
    ]
    assert max(errors) < 1.0
    assert "18 update" in capsys.readouterr().out


def test_panorama_of_the_snapshots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is made, and says honestly that the published method leaves a gap on these."""
    target = tmp_path / "lab.png"
    assert run(["panorama", str(RING6_SNAPSHOTS), "-o", str(target), "--start-deg", "15"]) == 0
    assert read_image(target).shape == (288, 3456, 3)
    with target.with_suffix(".csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["file"] for row in rows] == list(yaws(RING6_SNAPSHOTS))
    assert float(rows[0]["heading_deg"]) == pytest.approx(15.0)
    assert float(rows[1]["heading_deg"]) == pytest.approx(-15.0, abs=2.0)
    assert "stay empty" in capsys.readouterr().err
