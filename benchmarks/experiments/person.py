"""5.1.1: a person walks through the view of a standing camera (Figures 5.1 and 5.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.standing import dips, draw_output, mean_of, output
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LAB_PLACES, lab_scene
from benchmarks.worlds.people import clear_distance, person
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.settings import WorldSettings
from topoloc.geometry import Floats, compose
from topoloc.topo_map import Camera

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEPS, COMES, LEAVES = 40, 8, 32
"""Time steps; those between which the person walks: Figure 5.1 shows him at steps 10 to 30."""
WIDTH_M = 0.45
HALF_WIDTH = float(np.tan(np.deg2rad(Camera.hfov_deg) / 2.0))
"""Half the width of the view, one metre away [m]."""
AWAY_M = WIDTH_M / 0.25 / (2.0 * HALF_WIDTH)
"""How far from the camera someone ``WIDTH_M`` wide takes a quarter of the view, as in 5.1.1 [m]."""
NODES = (0, 2, 4, 6)


def measure(seed: int) -> Measured:
    """One passing before each of some views."""
    scene, effects = lab_scene(seed), WorldSettings().effects
    rng = generator(seed, Stream.MEASUREMENT, 10)
    aside = path()
    covered = covered_share(aside)
    curves, rows = [], []
    for node in NODES:
        place = np.array(LAB_PLACES[node][2:])
        pose = np.array([*place, clearest_heading(scene, place)])
        who = int(rng.integers(8))
        scenes = [with_person(scene, seed, pose, float(left), who) for left in aside]
        curve = output(scenes, pose, effects, rng)
        curves.append(curve.round(4).tolist())
        row = dips(curve, covered > 0.0, covered)
        whole = covered > 0.99 * covered.max()
        rows.append(row | {"in view": (row["free"] - float(curve[whole].mean())) / row["free"]})
    return {
        AS_PUBLISHED: {
            **mean_of(rows),
            "covered": float(covered.max()),
            "covered share": covered.tolist(),
            "curves": curves,
        }
    }


def path() -> Floats:
    """(STEPS,) how far the person is to the left of the optical axis [m]; well out of view at both ends."""
    edge = AWAY_M * HALF_WIDTH + WIDTH_M / 2.0
    return np.interp(np.arange(STEPS), [0, COMES, LEAVES, STEPS - 1], [1.5 * edge, edge, -edge, -1.5 * edge])


def covered_share(aside: Floats) -> Floats:
    """Share of the view's width that the person takes at each place."""
    half = AWAY_M * HALF_WIDTH
    left, right = np.minimum(aside + WIDTH_M / 2.0, half), np.maximum(aside - WIDTH_M / 2.0, -half)
    return np.asarray(np.maximum(left - right, 0.0) / (2.0 * half))


def clearest_heading(scene: Scene, place: Floats) -> float:
    """Of twelve headings [rad] the one in which the view is free the farthest, so that somebody can walk there."""
    bearings = np.linspace(-0.5, 0.5, 5) * np.deg2rad(Camera.hfov_deg)
    headings = np.linspace(-np.pi, np.pi, 12, endpoint=False)
    free = [min(clear_distance(scene.faces, place, heading + bearing) for bearing in bearings) for heading in headings]
    return float(headings[int(np.argmax(free))])


def with_person(scene: Scene, seed: int, camera: Floats, aside: float, who: int) -> Scene:
    """Somebody ``AWAY_M`` ahead of the camera (3,) and ``aside`` to the left of its axis, walking to the right."""
    at = compose(camera, (AWAY_M, aside, 0.0))
    return scene.with_faces(person(seed, at[:2], float(camera[2] - np.pi / 2.0), who))


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figure 5.2: IMA's output over time steps, with the share of the view that the person takes below."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    draw_output(above, measured)
    above.set(xlabel="")
    above.legend(frameon=False)
    share = measured[0][AS_PUBLISHED]["covered share"]
    below.fill_between(np.arange(len(share)), 100.0 * np.array(share), color="0.7", step="mid")
    below.set(xlabel="time step", ylabel="person,\n% of view", ylim=(0, 40))


EXPERIMENT = Experiment(
    name="person",
    title="A person walks through the view",
    source="5.1.1, Figures 5.1 and 5.2",
    about=(
        "A standing camera at four nodes of the laboratory; someone walks from the left to the right, as far away as "
        "makes him a quarter of the view wide. IMA compares every frame with a single reference image, 72 columns, 8 "
        "slots, CLAHE, without zoom. The drop is the decrease of IMA's output as a share of its mean with nobody in "
        "view; a dip is a step in the lower half of the curve's range. Simulated people have legs and heads "
        "narrower than their trunks, and leave some of their quarter free: the drop stays below a quarter."
    ),
    measure=measure,
    quantities=(
        Quantity("free", "output with nobody in view", "close to 1", "5.1.1"),
        Quantity("in view", "drop with the person wholly in view", "about 25 %", "Figure 5.2", percent=True),
        Quantity("drop", "mean drop from entering to leaving", "-", "ours", percent=True),
        Quantity("deepest", "deepest drop", "-", "ours", percent=True),
        Quantity("covered", "share of the view that the person takes", "a quarter", "5.1.1", percent=True),
        Quantity("inside", "share of the dips that lie at the person's passing", "all", "Figure 5.2", percent=True),
        Quantity("proportion", "correlation of drop and share taken", "proportional", "5.1.1"),
    ),
    draw=draw,
)
