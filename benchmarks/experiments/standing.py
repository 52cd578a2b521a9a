"""A standing camera before which something happens (thesis 5.1.1): IMA's output over time steps, and its dips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments.experiment import AS_PUBLISHED, Measured
from benchmarks.experiments.photograph import photograph
from benchmarks.experiments.picture import THESIS
from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.renderer import Scene
from sensors.ima import IMA, IMAConfig
from topoloc.geometry import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Bools = NDArray[np.bool_]
PLAIN = IMAConfig(zoom=1.0)
"""As in 5.2, but without zoom, which the thesis brings in later (5.1.5)."""


def output(scenes: Sequence[Scene], pose: Floats, effects: SensorEffects, rng: np.random.Generator) -> Floats:
    """IMA's output (T,) at each time step against a single reference image of the first scene.

    Args:
        scenes: T of them, what there is to see at each step.
        pose: (3,) of the standing camera [m, m, rad].
        effects: errors of the sensor.
        rng: draws them.
    """
    sensor = IMA(PLAIN)
    reference = photograph(scenes[0], pose, effects, rng, still=True)
    return np.array(
        [sensor.compare(photograph(scene, pose, effects, rng, still=True), reference)[0] for scene in scenes]
    )


def dips(match: Floats, event: Bools, covered: Floats) -> dict[str, float]:
    """What 5.1.1 says of a curve.

    Args:
        match: (T,) IMA's output.
        event: (T,) whether something is in view that the reference does not have.
        covered: (T,) share of the view's columns that it takes.

    Returns:
        ``free``, the mean output while nothing is there; ``drop``, the mean decrease while there is, as a share of it,
        ``deepest`` the largest; ``inside``, the share of dips (steps in the lower half of the curve's range) that lie
        at the event; ``proportion``, the correlation of decrease and covered share.
    """
    free = float(match[~event].mean())
    low = match < (free + match.min()) / 2.0
    decrease = (free - match) / free
    return {
        "free": free,
        "drop": float(decrease[event].mean()),
        "deepest": float(decrease.max()),
        "inside": float(event[low].mean()),
        "proportion": float(np.corrcoef(decrease, covered)[0, 1]),
    }


def mean_of(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """The mean of each key."""
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}


def draw_output(axes: Axes, measured: Sequence[Measured], key: str = "curves") -> None:
    """Curves over time steps of all seeds, those of the first seed's first view strong."""
    curves = np.array([curve for one in measured for curve in one[AS_PUBLISHED][key]])
    steps = np.arange(curves.shape[1])
    axes.plot(steps, curves.T, color="0.8", linewidth=0.6)
    axes.plot(steps, curves.mean(axis=0), color=THESIS, label="mean")
    axes.plot(steps, curves[0], color="black", linewidth=1.0, label="first seed, first view")
    axes.set(xlabel="time step", ylabel="IMA output", ylim=(0.3, 1.02))
