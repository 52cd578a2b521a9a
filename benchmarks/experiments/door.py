"""5.1.1: a door opens and somebody comes through (Figures 5.3 and 5.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.standing import dips, draw_output, mean_of, output
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import DOOR_Y, LEFT, lab_scene
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.people import person
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.settings import WorldSettings
from topoloc.geometry import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEPS = 50
OPENS, OPEN, CLOSES, CLOSED = 6, 14, 36, 44
"""Time steps at which the door begins to open, stands open, begins to close, and is closed."""
COMES, GONE = 14, 36
"""Time steps between which somebody comes through: Figure 5.3 shows steps 5 to 45."""
FROM_M = 3.0
"""From the camera to the door, as the worlds were fitted (``benchmarks/realism.py``)."""
WAY = np.array([(LEFT - 1.5, DOOR_Y), (LEFT + 0.6, DOOR_Y), (LEFT + 1.2, DOOR_Y + 1.2)])
"""From the entry through the doorway and out of the view to the right [m]."""
VIEWS_M = (-0.4, 0.0, 0.4)
"""How far the cameras stand aside of the middle of the door [m]."""


def measure(seed: int) -> Measured:
    """The door before cameras at some places."""
    rng, effects = generator(seed, Stream.MEASUREMENT, 11), WorldSettings().effects
    angle, walker = opened(), way()
    event = angle > 0.0
    curves, rows = [], []
    for aside in VIEWS_M:
        pose = np.array([LEFT + FROM_M, DOOR_Y + aside, np.pi])
        who = int(rng.integers(8))
        scenes = [_scene(seed, float(wide), at, who) for wide, at in zip(angle, walker, strict=True)]
        curve = output(scenes, pose, effects, rng)
        crossed = (np.arange(STEPS) >= COMES) & (np.arange(STEPS) < GONE)
        row = dips(curve, event, angle)
        row["crossed"] = (row["free"] - float(curve[crossed].mean())) / row["free"]
        row["after"] = float(curve[CLOSED:].mean())
        rows.append(row)
        curves.append(curve.round(4).tolist())
    return {AS_PUBLISHED: {**mean_of(rows), "opened": angle.tolist(), "curves": curves}}


def opened() -> Floats:
    """(STEPS,) how far the door stands open, 0 to 1."""
    return np.interp(np.arange(STEPS), [0, OPENS, OPEN, CLOSES, CLOSED, STEPS], [0.0, 0.0, 1.0, 1.0, 0.0, 0.0])


def way() -> Floats:
    """(STEPS, 2) where somebody walks [m]; NaN before and after."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(WAY, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], GONE - COMES)
    walked = np.full((STEPS, 2), np.nan)
    walked[COMES:GONE] = np.column_stack([np.interp(at, length, WAY[:, axis]) for axis in (0, 1)])
    return walked


def _scene(seed: int, wide: float, at: Floats, who: int) -> Scene:
    scene = lab_scene(seed, Moment(doors=wide))
    return scene if np.isnan(at).any() else scene.with_faces(person(seed, at, 0.0, who))


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figure 5.4: IMA's output over time steps, with what happens below."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    draw_output(above, measured)
    above.set(xlabel="")
    above.legend(frameon=False)
    angle = measured[0][AS_PUBLISHED]["opened"]
    below.fill_between(np.arange(len(angle)), 100.0 * np.array(angle), color="0.7", label="door")
    below.axvspan(COMES, GONE - 1, ymax=0.3, color="0.3", label="somebody comes through")
    below.set(xlabel="time step", ylabel="door, %\nopen", ylim=(0, 110))
    below.legend(frameon=False, fontsize=7, loc="upper right")


EXPERIMENT = Experiment(
    name="door",
    title="A door opens and somebody comes through",
    source="5.1.1, Figures 5.3 and 5.4",
    about=(
        "A standing camera 3 m before the laboratory's door, at three places side by side: the door opens to 105 "
        "degrees, somebody comes through and walks out of the view, and the door closes. IMA compares every frame with "
        "a single reference image of the closed door, 72 columns, 8 slots, CLAHE, without zoom. The drop is the "
        "decrease of IMA's output as a share of its mean with the door closed. How far the authors' camera stood off "
        "is not told; 3 m is what the simulated laboratory was fitted with. Behind the door is a plain entry."
    ),
    measure=measure,
    quantities=(
        Quantity("free", "output with the door closed", "close to 1", "5.1.1"),
        Quantity("drop", "mean drop while the door is not closed", "close to 25 %", "Figure 5.4", percent=True),
        Quantity("crossed", "mean drop while somebody comes through", "close to 25 %", "Figure 5.4", percent=True),
        Quantity("deepest", "deepest drop", "-", "ours", percent=True),
        Quantity("inside", "share of the dips that lie between opening and closing", "all", "Figure 5.4", percent=True),
        Quantity("after", "output when the door is closed again", "-", "ours"),
    ),
    draw=draw,
)
