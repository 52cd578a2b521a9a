"""5.2.2: the robot starts anywhere, and it is kidnapped: how many updates until the right node is named."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.conditions import CONDITIONS
from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED, Experiment, Measured, Quantity
from benchmarks.experiments.kidnappings import KIDNAPPINGS, LOOKS, kidnapped, looks_until_right
from benchmarks.experiments.methods import METHODS, Method
from benchmarks.experiments.picture import OURS, THESIS
from benchmarks.experiments.tracking import Fitted, Tracked, tracked_frames
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.world import KIDNAP_COVERED, Simulation
from topoloc.metrics import Bools
from topoloc.thesis import THESIS as THESIS_SETTINGS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SEEN_UNDER = ("fresh", "old")
STARTS = range(0, 24, 3)
"""Frames that the robot is switched on at, all round the tour."""
FIRST_FRAMES = 12
"""That it drives from there."""
MANY_LOOKS = 6


def measure(seed: int) -> Measured:
    """Starts and kidnappings, with fresh and with old panoramas; one map and one way."""
    topo_map = LabWorld().topo_map(seed)
    carried = {
        name: [LabWorld(kidnapped(CONDITIONS[name], *event)).film(seed) for event in KIDNAPPINGS] for name in SEEN_UNDER
    }
    driven = {name: LabWorld(CONDITIONS[name]).film(seed) for name in SEEN_UNDER}
    result: dict[str, dict[str, Any]] = {}
    matched: dict[tuple[str, int], Bools] = {}
    for column, method in METHODS.items():
        fitted, values = Fitted(method, topo_map), dict[str, Any]()
        for name in SEEN_UNDER:
            starts = _started(Simulation(topo_map, *driven[name]), method, fitted)
            values |= {f"{key} {name}": value for key, value in starts.items()}
            recoveries = []
            for film, (at, _) in zip(carried[name], KIDNAPPINGS, strict=True):
                run = tracked_frames(topo_map, *film, method, fitted)
                looks = matched.setdefault((name, at), _has_match(run))  # the published IMA's, for every method
                recoveries.append(_recovery(run, at, looks))
            values |= {f"{key} {name}": value for key, value in _summary(recoveries).items()}
        result[column] = values
    return result


def _started(drive: Simulation, method: Method, fitted: Fitted) -> dict[str, float]:
    """Switched on at frames all round the tour: mean activity, share right at first, updates until right."""
    runs = [
        tracked_frames(drive.topo_map, drive.frames[at:end], drive.truth[at:end], method, fitted)
        for at, end in ((start, start + FIRST_FRAMES) for start in STARTS)
    ]
    updates = np.array([updates_until_right(run) for run in runs])
    return {
        "origin": float(np.mean([run.steps[0].origins.activity.mean() for run in runs])),
        "first": float(np.mean([run.right[np.flatnonzero(run.said >= 0)[:1]].any() for run in runs])),
        "started": float(updates[np.isfinite(updates)].mean()) if np.isfinite(updates).any() else float("nan"),
        "started late": float(np.mean(updates > LOOKS)),
    }


def updates_until_right(run: Tracked) -> float:
    """Updates up to the first that names a right node; infinite if none does."""
    return looks_until_right(np.ones(len(run.right), dtype=bool), run.right)


def _has_match(run: Tracked) -> Bools:
    """(U,) which updates have a match above the thesis's threshold."""
    return np.array([look.match.max(initial=0.0) > THESIS_SETTINGS.match_threshold for look in run.evidence])


def _recovery(run: Tracked, kidnapped_at: int, matched: Bools) -> tuple[float, float, float]:
    """What a kidnapping took, and what came after it.

    Args:
        run: of one method.
        kidnapped_at: frame.
        matched: (U,) which updates count as looks.

    Returns:
        Looks up to the first right one, all updates with the camera free up to it, and the share of right updates from
        there on; infinite and NaN where it is never found.
    """
    after = run.frames >= kidnapped_at
    free, right = (run.frames >= kidnapped_at + KIDNAP_COVERED)[after], run.right[after]
    looks, updates = (looks_until_right(counted, right) for counted in (matched[after], free))
    return looks, updates, float(right[right.argmax() :].mean()) if right.any() else float("nan")


def _summary(recoveries: Sequence[tuple[float, float, float]]) -> dict[str, Any]:
    """Of a seed's kidnappings."""
    looks, updates, then = np.array(recoveries).T
    found = np.isfinite(looks)
    return {
        "three": float(np.mean(looks <= LOOKS)),
        "six": float(np.mean(looks <= MANY_LOOKS)),
        "six updates": float(np.mean(updates <= MANY_LOOKS)),
        "looks": float(looks[found].mean()) if found.any() else float("nan"),
        "then": float(then[found].mean()) if found.any() else float("nan"),
        "all looks": looks.tolist(),
    }


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Share of the kidnappings that are over after so many looks."""
    axes, most = figure.add_subplot(), 12
    for column, colour in ((AS_PUBLISHED, THESIS), (IMPROVED, OURS)):
        for name, dashes in zip(SEEN_UNDER, ("-", "--"), strict=True):
            looks = np.concatenate([one[column][f"all looks {name}"] for one in measured])
            share = [float(np.mean(looks <= number)) for number in range(most + 1)]
            axes.step(
                range(most + 1), share, where="post", color=colour, ls=dashes, label=f"{column}, {name} panoramas"
            )
    axes.axvspan(2, 3, color="0.9", zorder=0, label="published: no more than two or three")
    axes.set(
        xticks=range(most + 1),
        xlim=(0, most),
        ylim=(0, 1.02),
        xlabel="updates with a match since the kidnapping",
        ylabel="share found",
    )
    axes.legend(frameon=False, fontsize=8, loc="lower right")


def _rows(name: str) -> tuple[Quantity, ...]:
    goal = {"fresh": 85, "old": 60}[name]
    return (
        Quantity(f"first {name}", f"starts: the first node named is right, {name}", "no: 5 for 1", "5.2.2", 2, True),
        Quantity(f"started {name}", f"starts: updates until right, {name}", "a few", "5.2.2", 1),
        Quantity(f"started late {name}", f"starts: not right within 3 updates, {name}", "-", "ours", 2, True),
        Quantity(f"looks {name}", f"kidnapped: looks until right, where found, {name}", "at most 2 or 3", "5.2.2", 1),
        Quantity(f"three {name}", f"right within 3 looks, {name} (goal: {goal} %)", "all", "5.2.2", 2, True),
        Quantity(f"six {name}", f"right within 6 looks, {name} (goal: 95 %)", "all", "5.2.2", 2, True),
        Quantity(f"six updates {name}", f"right within 6 updates of any kind, {name}", "-", "ours", 2, True),
        Quantity(f"then {name}", f"right updates once it was found, {name}", "-", "ours", 2, True),
    )


EXPERIMENT = Experiment(
    name="kidnapping",
    title="Initial position and kidnapped robot",
    source="5.2.2",
    about=(
        "The robot is switched on at eight frames round the tour and knows nothing. Then, four times a seed, it is "
        "carried 0.3 to 0.7 rounds on, camera covered for two frames, odometer not influenced. A look is an update in "
        "which the published IMA has a match above 0.5, for both methods; counted are the looks up to the first that "
        "names a right node (0.25 m), fresh panoramas and two days old. The thesis counts from where the robot is "
        "close to a node; here it is put down anywhere on its way, between nodes too, 28 to 34 cm off them when it "
        "passes."
    ),
    measure=measure,
    quantities=(
        Quantity("origin fresh", "activity of each origin at the start", "0.125", "5.2.2", 3),
        *(row for name in SEEN_UNDER for row in _rows(name)),
    ),
    draw=draw,
)
