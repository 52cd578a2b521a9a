"""The two steps of the tracker that the thesis printed number by number (Tables 5.7 and 5.8), done again by ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.experiments.methods import Method
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from estimators.activity import ActivityTracker, Hypotheses, TrackerStep
from topoloc.geometry import rotate
from topoloc.types import Evidence, Motion


@dataclass(frozen=True)
class PrintedStep:
    """A step from printed origins to printed destinations; an id that ends in v is the virtual one.

    Attributes:
        origins: activity by id.
        best: origin that had won.
        moved: (3,) by the odometer, map frame [m, m, rad].
        match: of the normal destinations, by id.
        activity: of the destinations, by id, as printed.
        off_deg: how far the heading of each destination is off, by id, degrees. The thesis does not print headings;
            these are rebuilt: with them the printed activities come out to the last digit.
    """

    origins: Mapping[str, float]
    best: str
    moved: tuple[float, float, float]
    match: Mapping[str, float]
    activity: Mapping[str, float]
    off_deg: Mapping[str, float]

    def done_by(self, tracker: ActivityTracker, with_headings: bool) -> TrackerStep:
        """The step as a tracker does it, with the rebuilt headings or with none known."""
        off = np.deg2rad([self.off_deg[name] for name in self.activity]) * with_headings
        origins, virtual = list(self.origins), float(off[-1])  # the virtual destination is printed last
        tracker.reset(LabWorld().layout(), np.random.default_rng(0))
        tracker.restore(self._origins(with_headings), origins.index(self.best), virtual)
        x, y, turned = self.moved
        tracker.predict(Motion(np.array([*rotate((x, y), -virtual), turned]), np.eye(3) * 1e-4))
        tracker.update(self._evidence(turned + off[:-1], with_headings))
        assert tracker.last is not None  # an update was just made
        return tracker.last

    def measured(self, method: Method) -> dict[str, float]:
        """Activities of the destinations, by id, and whether node 1, the right one in both tables, won.

        First with the rebuilt headings, then without any, those keys ending in "bare".
        """
        values: dict[str, float] = {}
        for suffix, with_headings in (("", True), (" bare", False)):
            _, tracker = method.make()
            step = self.done_by(tracker, with_headings)
            activity = zip(self.activity, step.destinations.activity, strict=True)
            values |= {f"{name}{suffix}": float(value) for name, value in activity}
            values[f"won{suffix}"] = float(step.node == node_of("1"))
        return values

    def _origins(self, with_headings: bool) -> Hypotheses:
        count = len(self.origins)
        return Hypotheses(
            nodes=np.array([node_of(name) for name in self.origins]),
            headings=np.full(count, 0.0 if with_headings else np.nan),
            match=np.full(count, np.nan),
            activity=np.array(list(self.origins.values())),
            virtual=np.array([name.endswith("v") for name in self.origins]),
        )

    def _evidence(self, headings: np.ndarray, with_headings: bool) -> Evidence:
        nodes, match = np.array([node_of(name) for name in self.match]), np.array(list(self.match.values()))
        ones = np.ones(len(nodes))
        poses = np.column_stack([LabWorld().positions[nodes], headings])
        return Evidence(poses, nodes, match, 1.0 - match, 0.0 * ones, ones, ones * (1.0 if with_headings else 0.0))


def node_of(name: str) -> int:
    """Index of a node of the laboratory, virtual or not."""
    return [place.id for place in LAB_PLACES].index(name.rstrip("v"))


TABLE_5_7 = PrintedStep(
    origins={"1": 0.470396, "1v": 0.529604},
    best="1v",
    moved=(0.0, 0.0, float(np.deg2rad(30.0))),  # "performing a rotation"; how far does not matter
    match={"1": 0.611119, "2": 0.65027},
    activity={"1": 0.418523, "2": 0.249694, "1v": 0.331782},
    off_deg={"1": 9.1805050, "2": 10.0, "1v": 9.5181776},
)
TABLE_5_8 = PrintedStep(
    origins={"1": 0.235045, "8": 0.341719, "4": 0.129596, "8v": 0.29364},
    best="8",
    moved=(1.0, 0.0, 0.0),
    match={"2": 0.541098},
    activity={"2": 0.441696, "1v": 0.558304},
    off_deg={"2": 10.0, "1v": 6.2508840},
)
