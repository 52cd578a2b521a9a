"""``steps.csv``: what a localizer answered, a row per frame, beside the truth where that is known."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from topoloc.errors import InputError
from topoloc.files import read_text, write_csv
from topoloc.geometry import Floats
from topoloc.localizer import Step
from topoloc.topo_map import TopoMap

STEP_COLUMNS = ("timestamp", "x", "y", "heading_deg", "node", "probability", "status", "match", "kind")
TRUTH_COLUMNS = ("true_x", "true_y", "true_heading_deg", "right")


@dataclass(frozen=True)
class Steps:
    """The columns of a ``steps.csv`` that has the truth.

    Attributes:
        poses, truth: (N, 3) estimated and true poses of the robot [m, m, rad].
        nodes: (N,) ids of the named nodes; empty where none was named.
        probability: (N,) that the named node is right.
        status: (N,) names of ``topoloc.types.Status``.
        kind: (N,) of the step, as ``topoloc.localizer.Step`` has it.
        right: (N,) whether the named node is right; False where the gate stayed closed.
    """

    poses: Floats
    truth: Floats
    nodes: NDArray[np.str_]
    probability: Floats
    status: NDArray[np.str_]
    kind: NDArray[np.str_]
    right: NDArray[np.bool_]

    @property
    def updated(self) -> NDArray[np.bool_]:
        """(N,) which frames were updates: those that metrics count."""
        return np.asarray(self.kind != "gated")


def write_steps(path: Path, topo_map: TopoMap, steps: Sequence[Step]) -> None:
    """Write the answers of a localizer, without the truth."""
    write_csv(path, STEP_COLUMNS, [step_cells(topo_map, step) for step in steps])


def steps_text(topo_map: TopoMap, steps: Sequence[Step], truth: Floats, right: NDArray[np.bool_]) -> str:
    """A ``steps.csv`` with the truth, as a text.

    Args:
        topo_map: whose nodes are named.
        steps: one a frame.
        truth: (N, 3) true poses of the robot.
        right: (N,) whether the named node is right; it is told of updates only.
    """
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(STEP_COLUMNS + TRUTH_COLUMNS)
    for step, pose, hit in zip(steps, truth, right, strict=True):
        told = "" if step.kind == "gated" else str(int(hit))
        writer.writerow((*step_cells(topo_map, step), *_pose_cells(pose), told))
    return buffer.getvalue()


def read_steps(path: Path) -> Steps:
    """A ``steps.csv`` that has the truth. Raises ``InputError`` where it is missing, or no such table."""
    remedy = "name the folder of a benchmark run, or restore the file"
    lines = list(csv.reader(io.StringIO(read_text(path, remedy))))
    if not lines or tuple(lines[0]) != STEP_COLUMNS + TRUTH_COLUMNS:
        raise InputError(path, "does not have the columns of a steps.csv with truth", remedy, line=1)
    try:
        table = np.array(lines[1:], dtype=np.str_).reshape(-1, len(lines[0]))
        column = dict(zip(lines[0], table.T, strict=True))
        poses, truth = (
            np.column_stack(
                [column[f"{prefix}{name}"].astype(np.float64) for name in ("x", "y")]
                + [np.deg2rad(column[f"{prefix}heading_deg"].astype(np.float64))]
            )
            for prefix in ("", "true_")
        )
        probability = column["probability"].astype(np.float64)
    except ValueError:
        raise InputError(path, "is no table of steps", remedy) from None
    right = column["right"] == "1"
    return Steps(poses, truth, column["node"], probability, column["status"], column["kind"], right)


def step_cells(topo_map: TopoMap, step: Step) -> tuple[str, ...]:
    """A row of ``steps.csv`` without the truth, under ``STEP_COLUMNS``."""
    estimate = step.estimate
    return (
        f"{step.timestamp:.6f}",
        *_pose_cells(estimate.pose),
        "" if estimate.node is None else topo_map.nodes[estimate.node].id,
        f"{estimate.probability:.9g}",
        estimate.status.value,
        "" if step.match is None else f"{step.match:.4f}",
        step.kind,
    )


def _pose_cells(pose: Floats) -> tuple[str, str, str]:
    x, y, theta = pose
    return f"{x:.4f}", f"{y:.4f}", f"{np.rad2deg(theta):.2f}"
