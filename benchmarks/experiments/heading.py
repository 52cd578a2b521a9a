"""5.1.4: ten turns on a node, the heading by the odometer and by vision (Figure 5.19)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.photograph import node_matches, photograph
from benchmarks.experiments.picture import PUBLISHED, THESIS
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LabWorld, lab_scene
from benchmarks.worlds.odometer import Drift, odometer
from sensors.ima import IMA
from topoloc.geometry import Floats, compose, wrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TURNS, READINGS, STEPS = 10, 8, 36
"""Ten turns, a reading every 45 degrees; the odometer adds up steps of 10 degrees."""
NODES = (2, 0, 4, 6)
"""The centre, node 3, and three more."""


def measure(seed: int) -> Measured:
    """Ten turns on each of some nodes."""
    world, sensor = LabWorld(), IMA()
    sensor.fit(world.topo_map(seed))
    scene, rng = lab_scene(seed), generator(seed, Stream.MEASUREMENT, 14)
    odometry, vision, right = [], [], []
    for node in NODES:
        drift = odometer_error(generator(seed, Stream.MEASUREMENT, 14, node))
        odometry.append(drift)
        for heading in wrap(np.arange(TURNS * READINGS) * 2.0 * np.pi / READINGS):
            pose = compose(np.array([*world.positions[node], heading]), world.mount)
            image = photograph(scene, pose, world.config.effects, rng, world.config.turning_shake_px)
            match, headings = node_matches(sensor, image, world.mount)
            vision.append(float(np.rad2deg(wrap(headings[node] - heading))))
            right.append(match.argmax() == node)
    return {AS_PUBLISHED: summary(np.array(odometry), np.array(vision), np.array(right))}


def odometer_error(rng: np.random.Generator) -> Floats:
    """(TURNS * READINGS,) how far the odometer's heading has drifted at each reading [degrees ccw]."""
    steps = np.zeros((TURNS * STEPS, 3))
    steps[:, 2] = 2.0 * np.pi / STEPS
    said = np.unwrap(odometer(steps, np.zeros(3), Drift(), rng)[:, 2])
    real = np.arange(len(said)) * 2.0 * np.pi / STEPS
    at = np.arange(TURNS * READINGS) * 2.0 * np.pi / READINGS
    return np.asarray(np.rad2deg(np.interp(at, real, said - real)))


def summary(odometry: Floats, vision: Floats, right: np.ndarray) -> dict[str, object]:
    """What 5.1.4 says.

    Args:
        odometry: (nodes, readings) error of the odometer's heading [degrees].
        vision: (nodes * readings,) error of the matched heading on the node's own panorama [degrees].
        right: whether the node had the best match of all.
    """
    return {
        "odometer seventh": float(odometry[:, 7 * READINGS].mean()),
        "odometer last": float(odometry[:, -1].mean()),
        "vision largest": float(np.abs(vision).max()),
        "vision median": float(np.median(np.abs(vision))),
        "vision within": float((np.abs(vision) <= 10.0).mean()),
        "vision grows": float(np.abs(vision).reshape(len(odometry), -1)[:, -READINGS:].mean() - np.abs(vision).mean()),
        "right node": float(right.mean()),
        "right within": float((np.abs(vision)[right] <= 10.0).mean()),
        "odometry": odometry.round(2).tolist(),
        "vision": vision.reshape(len(odometry), -1).round(2).tolist(),
    }


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figure 5.19: heading over real angle in [-180, 180), first seed, node 3; and all errors of vision."""
    above, below = figure.subplots(2, 1, sharex=True)
    real = np.arange(TURNS * READINGS) * 360.0 / READINGS
    own = measured[0][AS_PUBLISHED]
    for key, label, colour in (("odometry", "odometer", PUBLISHED), ("vision", "vision", THESIS)):
        error = np.array(own[key][0])
        above.plot(real, (real + error + 180.0) % 360.0 - 180.0, ".-", color=colour, linewidth=0.6, markersize=3)
        below.plot(real, error, color=colour, label=label)
    everything = np.concatenate([np.array(one[AS_PUBLISHED]["vision"]) for one in measured])
    below.plot(real, everything.T, ".", color=THESIS, markersize=1, alpha=0.4)
    for edge in (-10.0, 10.0):
        below.axhline(edge, color="black", linewidth=0.6, linestyle=":")
    above.set(ylabel="heading [deg]", yticks=range(-180, 181, 90))
    below.set(ylabel="error [deg]", xlabel="real angle [deg]", xticks=range(0, 3601, 360), ylim=(-75, 25))
    below.legend(frameon=False, fontsize=8, loc="lower left")


EXPERIMENT = Experiment(
    name="heading",
    title="Heading by vision in ten turns",
    source="5.1.4, Figure 5.19",
    about=(
        "Ten turns on each of four nodes of the laboratory, soon after the map was made, a reading every 45 degrees; "
        "the thesis turned on one node. The odometer's errors were fitted to the published 45 degrees after seven "
        "turns on other seeds, so that row is no result. The error of vision is that of the direction matched in the "
        "node's own panorama; the goal for right updates is our own: those in which that node matches best of all."
    ),
    measure=measure,
    quantities=(
        Quantity("odometer seventh", "odometer's error after seven turns, degrees", "-45", "5.1.4", 0),
        Quantity("odometer last", "the same at the last reading, degrees", "-", "ours", 0),
        Quantity("vision largest", "largest error of vision, degrees", "at most 10", "5.1.4", 1),
        Quantity("vision within", "readings of vision within 10 degrees", "always", "5.1.4", 3, percent=True),
        Quantity("vision median", "median error of vision, degrees", "-", "ours", 1),
        Quantity("vision grows", "mean error in the tenth turn above that of all, degrees", "0", "5.1.4", 1),
        Quantity("right node", "readings whose best match is the node", "-", "ours", 3, percent=True),
        Quantity("right within", "of these, within 10 degrees (goal: 99 %)", "-", "goal", 3, percent=True),
    ),
    draw=draw,
)
