"""A sensor and an estimator on a recording, as ``topoloc localize`` runs them, beside the truth."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.own_data.driving import true_poses
from topoloc import plugins
from topoloc.geometry import Floats, compose
from topoloc.localizer import Localizer, Step
from topoloc.metrics import Run
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap

FILTER_SEED = 0
"""Of the estimator's random numbers, as ``topoloc localize`` has it."""


def localized(topo_map: TopoMap, recording: Recording, sensor: str, estimator: str) -> list[Step]:
    """A step for each frame."""
    made = plugins.make_sensor(sensor), plugins.make_estimator(estimator)
    localizer, steps = Localizer(topo_map, *made, rng=FILTER_SEED), []
    for frame in recording.on(topo_map.camera):
        localizer.step(frame)
        assert localizer.last is not None  # a step was just made
        steps.append(localizer.last)
    return steps


def judged(topo_map: TopoMap, recording: Recording, steps: list[Step], origin: Floats | None = None) -> Run:
    """The steps beside the truth.

    Args:
        topo_map: whose nodes stand where they truly are.
        recording: that was localized.
        steps: one of each frame.
        origin: (3,) true pose of the origin that the estimates count from; None: they are in the frame of the truth.
    """
    if origin is not None:
        steps = [
            replace(step, estimate=replace(step.estimate, pose=compose(origin, step.estimate.pose))) for step in steps
        ]
    return Run.of(topo_map, steps, true_poses(recording))
