"""5.1.3: a turn on a node, soon after and the day after, with people, and beside a node one metre away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.photograph import node_matches, photograph
from benchmarks.experiments.picture import OTHER, OURS, THESIS
from benchmarks.worlds.builders import Thing
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LabWorld, furniture, lab_scene
from benchmarks.worlds.moment import Moment, as_they_stand
from benchmarks.worlds.people import person
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import effects_at
from sensors.ima import IMA
from topoloc.geometry import Floats, compose, wrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NODES = (2, 0, 4, 6)
"""The centre, node 3, which Figure 5.11 shows, and three more."""
FRAMES = 36
HEADINGS = np.linspace(-np.pi, np.pi, FRAMES, endpoint=False)
"""One frame every 10 degrees; the robot turned at 10 degrees a second."""
DAY = 0.5
"""Age of the day after: half of the world's two days."""
PASSINGS = (4, 13, 22, 31)
"""Frames A, B, C, D in which the person stands right in front of the camera."""
STEPS_ACROSS_DEG = {-1: 12.0, 0: 0.0, 1: -12.0}
"""Bearing of the person by frame around such a passing [deg, ccw]."""
PERSON_M = 1.0
WRONG = np.deg2rad(20.0)
"""A position in the panorama is wrong if it is half a view off."""
TOWARDS = np.deg2rad(20.0)
"""A direction is looked at when it is no farther than half a view from the optical axis."""
CUPBOARD, SHELVES = (3.04, 3.45), ((1.5, -2.12), (2.62, -2.12))
"""Middles of the furniture that the worst frames showed (Figure 5.12) in our laboratory [m]."""


class SeatedLab(LabWorld):
    """The laboratory whose map was made while more people sat at their desks than later.

    Args:
        seated: share of the chairs that were taken, 0 to 1, as ``Moment`` counts them.
    """

    def __init__(self, seated: float) -> None:
        super().__init__(WorldSettings())
        self.seated = seated

    def mapped_at(self, place: int) -> Moment:
        """With people on their chairs."""
        return Moment(seated=self.seated)


@dataclass(frozen=True)
class Turn:
    """What IMA says in a full turn, (FRAMES,) each.

    Attributes:
        own: match with the node's own panorama.
        other: with one of the panoramas one metre away.
        off: error of the position in the own panorama, as a heading [rad].
    """

    own: Floats
    other: Floats
    off: Floats

    @property
    def wrong(self) -> int:
        """Frames whose position in the panorama is wrong."""
        return int((np.abs(self.off) > WRONG).sum())


def measure(seed: int) -> Measured:
    """Turns on some nodes, as four of them were published."""
    seated, desk = someone(seed)
    world, sensor = SeatedLab(seated), IMA()
    sensor.fit(world.topo_map(seed))
    rng = generator(seed, Stream.MEASUREMENT, 12)
    rows: list[dict[str, float]] = []
    curves: dict[str, Any] = {}
    for node in NODES:
        turns = {
            "fresh": _turned(world, sensor, seed, node, Moment(seated=seated), rng, False),
            "left": _turned(world, sensor, seed, node, Moment(), rng, False),
            "day": _turned(world, sensor, seed, node, Moment(age=DAY), rng, False),
            "people": _turned(world, sensor, seed, node, Moment(age=DAY), rng, True),
        }
        rows.append(_row(turns, world.positions[node], desk))
        if node == NODES[0]:
            curves = {key: turn.own.round(4).tolist() for key, turn in turns.items()}
            curves["other"] = turns["people"].other.round(4).tolist()
            curves["wrong"] = {key: np.flatnonzero(np.abs(turn.off) > WRONG).tolist() for key, turn in turns.items()}
            worst = HEADINGS[int(turns["fresh"].own.argmin())]
            named = bool(towards(np.array([worst]), world.positions[node], (CUPBOARD, *SHELVES)).any())
    mean = {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
    return {AS_PUBLISHED: {**mean, "worst looks at": float(named), "curves": curves}}


def someone(seed: int) -> tuple[float, tuple[float, float]]:
    """The least share of seated people with which one more chair is taken than without, and where it stands [m]."""
    things = furniture(generator(seed, Stream.FURNITURE))
    usual = _taken(things, Moment(), seed)
    for share in np.linspace(0.01, 1.0, 100):
        more = _taken(things, Moment(seated=float(share)), seed)
        if len(more) > len(usual):
            return float(share), next(at for at in more if at not in usual)
    raise AssertionError("at a share of 1 every chair is taken")


def _taken(things: Sequence[Thing], moment: Moment, seed: int) -> list[tuple[float, float]]:
    later = as_they_stand(things, moment, generator(seed, Stream.LATER))
    return [thing.pose[:2] for thing in later if thing.kind == "taken_chair"]


def _turned(
    world: LabWorld, sensor: IMA, seed: int, node: int, moment: Moment, rng: np.random.Generator, people: bool
) -> Turn:
    """A turn on a node at a moment; with ``people``, somebody passes the camera four times."""
    config, positions = world.config, world.positions
    scene, effects = lab_scene(seed, moment), effects_at(config.effects, moment)
    near = np.flatnonzero(np.abs(np.linalg.norm(positions - positions[node], axis=1) - 1.0) < 0.1)
    beside = int(near[0])
    rows = []
    for frame, heading in enumerate(HEADINGS):
        camera = compose(np.array([*positions[node], heading]), world.mount)
        view = passed(scene, seed, camera, frame) if people else scene
        image = photograph(view, camera, effects, rng, config.turning_shake_px)
        match, headings = node_matches(sensor, image, world.mount)
        rows.append((match[node], match[beside], float(wrap(headings[node] - heading))))
    return Turn(*np.array(rows).T)


def passed(scene: Scene, seed: int, camera: Floats, frame: int) -> Scene:
    """The scene with somebody one metre before the camera (3,), in the frames of the passings."""
    for passing, who in zip(PASSINGS, range(len(PASSINGS)), strict=True):
        if frame - passing in STEPS_ACROSS_DEG:
            bearing = np.deg2rad(STEPS_ACROSS_DEG[frame - passing])
            at = compose(camera, (PERSON_M * np.cos(bearing), PERSON_M * np.sin(bearing), 0.0))
            return scene.with_faces(person(seed, at[:2], float(camera[2]), who))
    return scene


def towards(headings: Floats, place: Floats, things: Sequence[tuple[float, float]]) -> np.ndarray:
    """Which headings (N,) look from a place (2,) at any of some things [m]."""
    ahead = np.asarray(things) - place
    bearing = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.asarray((np.abs(wrap(headings[:, None] - bearing)) <= TOWARDS).any(axis=1))


def _row(turns: dict[str, Turn], place: Floats, desk: tuple[float, float]) -> dict[str, float]:
    """What 5.1.3 says of the curves."""
    fresh, left, day, people = turns["fresh"], turns["left"], turns["day"], turns["people"]
    there, at_passing = towards(HEADINGS, place, (desk,)), passing_frames()
    return {
        "fresh mean": float(fresh.own.mean()),
        "fresh worst": float(fresh.own.min()),
        "fresh wrong": float(fresh.wrong),
        "left mean": float(left.own.mean()),
        "left wrong": float(left.wrong),
        "left there": float((fresh.own - left.own)[there].mean()),
        "left elsewhere": float((fresh.own - left.own)[~there].mean()),
        "day mean": float(day.own.mean()),
        "day wrong": float(day.wrong),
        "people mean": float(people.own.mean()),
        "people wrong": float(people.wrong),
        "people passing": float(people.own[at_passing].mean()),
        "people between": float(people.own[~at_passing].mean()),
        "other mean": float(people.other.mean()),
        "other higher": float((people.other > people.own).mean()),
        "other higher between": float((people.other > people.own)[~at_passing].mean()),
    }


def passing_frames() -> np.ndarray:
    """(FRAMES,) whether somebody stands before the camera."""
    frames = np.arange(FRAMES)
    return np.isin(frames, [passing + step for passing in PASSINGS for step in STEPS_ACROSS_DEG])


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figures 5.12 to 5.15: the turn on node 3, first seed; crosses are wrong positions."""
    curves = measured[0][AS_PUBLISHED]["curves"]
    degrees = np.rad2deg(HEADINGS) % 360.0
    order = np.argsort(degrees)
    panels = (
        ("soon after (5.12)", ("fresh", "soon after", THESIS), ("left", "the person has left", OURS)),
        ("the day after (5.13)", ("fresh", "soon after", THESIS), ("day", "the day after", OURS)),
        ("with people (5.14)", ("day", "the day after", THESIS), ("people", "somebody passes", OURS)),
        ("one metre away (5.15)", ("people", "own panorama", OURS), ("other", "panorama one metre away", OTHER)),
    )
    for axes, (title, *lines) in zip(figure.subplots(2, 2, sharex=True, sharey=True).flat, panels, strict=True):
        for key, label, colour in lines:
            curve = np.array(curves[key])
            axes.plot(degrees[order], curve[order], color=colour, linewidth=1.2, label=label)
            at = np.array(curves["wrong"].get(key, []), dtype=int)
            axes.plot(degrees[at], curve[at], "x", color=colour)
        if "people" in (key for key, *_ in lines):
            for name, passing in zip("ABCD", PASSINGS, strict=True):
                axes.annotate(name, (degrees[passing], 0.97), ha="center", fontsize=8)
        axes.set_title(title, fontsize=8)
        axes.legend(frameon=False, fontsize=7, loc="lower left")
        axes.set(ylim=(0.0, 1.05), xticks=range(0, 361, 90))
    figure.supxlabel("heading [deg]", fontsize=9)
    figure.supylabel("IMA output", fontsize=9)


EXPERIMENT = Experiment(
    name="turning",
    title="A turn on a node",
    source="5.1.3, Figures 5.11 to 5.15",
    about=(
        "The robot turns once on each of four nodes of the laboratory, a frame every 10 degrees, with the default "
        "settings of 5.2, zoom included. One more person than later sits at a desk while the map is made; soon after "
        "he is still there, then he has left. The day after is age 0.5 of the world's two days: light, chairs and "
        "small things. With people: the day after, and somebody passes the camera four times, A to D, one metre away, "
        "three frames each, in which he takes more than half of the view. One metre away: the same frames with a "
        "neighbour's panorama. A position in the panorama is wrong if it is more than 20 degrees off. The thesis "
        "turned on one node."
    ),
    measure=measure,
    quantities=(
        Quantity("fresh mean", "soon after: mean output", "above 0.8", "Figure 5.12"),
        Quantity("fresh worst", "soon after: worst output of a turn", "about 0.7", "Figure 5.12"),
        Quantity(
            "worst looks at", "node 3: the worst looks at cupboard or shelves", "yes", "Figure 5.12", percent=True
        ),
        Quantity("fresh wrong", "soon after: wrong positions in a turn", "0", "5.1.3"),
        Quantity("left mean", "a person has left: mean output", "-", "Figure 5.12"),
        Quantity("left wrong", "a person has left: wrong positions in a turn", "0", "5.1.3"),
        Quantity("left there", "a person has left: loss where he sat", "a loss", "Figure 5.12", 3),
        Quantity("left elsewhere", "a person has left: loss elsewhere", "none", "Figure 5.12", 3),
        Quantity("day mean", "the day after: mean output", "a small decrease", "Figure 5.13"),
        Quantity("day wrong", "the day after: wrong positions in a turn", "1", "Figure 5.13"),
        Quantity("people mean", "with people: mean output", "-", "Figure 5.14"),
        Quantity("people passing", "with people: mean output at A to D", "-", "Figure 5.14"),
        Quantity("people between", "with people: mean output between", "-", "Figure 5.14"),
        Quantity("people wrong", "with people: wrong positions in a turn", "1", "Figure 5.14"),
        Quantity("other mean", "one metre away: mean output", "not very low", "Figure 5.15"),
        Quantity("other higher", "one metre away: higher than the own", "seldom", "Figure 5.15", percent=True),
        Quantity("other higher between", "the same, nobody passing", "-", "ours", percent=True),
    ),
    draw=draw,
)
