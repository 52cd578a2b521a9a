"""What can be set of every simulated drive: changes of the world, events, camera, route and odometer."""

from __future__ import annotations

from dataclasses import dataclass, field

from benchmarks.worlds.drive import Route
from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.odometer import Drift
from benchmarks.worlds.snapshots import Scan

MOST_FRAMES = 100_000
MOST = {
    "laps": 10_000.0,
    "kidnap_laps": 10.0,
    "shake_px": 100.0,
    "turning_shake_px": 100.0,
    "grille_shake_px": 100.0,
    "camera_ahead_m": 0.5,
    "stereo_baseline_m": 0.5,
}
"""What is beyond is a slip of the finger: a camera outside of the robot, a horizon outside of the picture."""
APART = 2
"""A kidnapping and a turn by hand take two frames each."""
SITTING = 0.8
"""Share of the chairs that are sat on, for each share of frames with people: 5.2.4 has two people who also sit."""


@dataclass(frozen=True)
class WorldSettings:
    """What happens on a drive, what has changed since the map was made, and how well camera and odometer work.

    Attributes:
        laps: rounds driven; ``updates`` overrules it.
        updates: number of frames; 0 takes ``laps``.
        age: time since the map was made, 0 to 1, where 1 is the thesis's two days: light from another side, glare,
            chairs, people on them and small things moved.
        people: share of the frames with someone before the camera, 0 to 1; they stay or walk along for some frames, and
            others sit on chairs.
        doors: how far the doors stand open during the drive, 0 to 1; 1 is 105 degrees. Where the way leads through
            them, 0.9 at least.
        bulbs: share of the light that comes from bulbs in place of the tubes, 0 to 1.
        daylight: share of the light that comes through the windows, lamps off, 0 to 1.
        covered: indices of frames with a covered camera.
        covered_share: share of further frames with a covered camera, 0 to 1; they come in a row.
        kidnap_at: index of the frame at which the robot is carried on along its route, its camera covered for two
            frames, and the odometer knows nothing; -1 never.
        kidnap_laps: how far it is carried, rounds of the tour; on a random route, to a place that is not near.
        turned_at: index of the frame at which the robot is turned by hand and the odometer knows nothing; at the next
            one it has turned back by itself; -1 never.
        turned_deg: how far it is turned, degrees counter-clockwise; the thesis has -90.
        shake_px: standard deviation of the horizon while driving, rows of a picture of 384 x 288 that is 40 degrees
            wide; sideways and in roll it is 0.7 of that.
        turning_shake_px: the same while the robot turns on the spot, such rows.
        grille_shake_px: what a heating grille in the floor adds to it, such rows.
        camera_ahead_m: camera ahead of the axis of rotation, metres.
        stereo_baseline_m: distance of a second camera to the right of the first, metres; 0: none.
        depth: whether each frame comes with its true depth up to 13 m, true or false.
        effects: errors of the sensor.
        scan: how the robot turned for the map's panoramas.
        route: how the robot drives around the nodes.
        drift: errors of the odometer.
    """

    laps: float = 3.0
    updates: int = 0
    age: float = 0.0
    people: float = 0.0
    doors: float = 0.0
    bulbs: float = 0.0
    daylight: float = 0.0
    covered: tuple[int, ...] = ()
    covered_share: float = 0.0
    kidnap_at: int = -1
    kidnap_laps: float = 0.5
    turned_at: int = -1
    turned_deg: float = -90.0
    shake_px: float = 4.0
    turning_shake_px: float = 3.0
    grille_shake_px: float = 4.0
    camera_ahead_m: float = 0.10
    stereo_baseline_m: float = 0.0
    depth: bool = False
    effects: SensorEffects = field(default_factory=SensorEffects)
    scan: Scan = field(default_factory=Scan)
    route: Route = field(default_factory=Route)
    drift: Drift = field(default_factory=Drift)

    def __post_init__(self) -> None:
        for name in ("age", "people", "doors", "bulbs", "daylight", "covered_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and 1")
        if self.bulbs + self.daylight > 1.0:
            raise ValueError(
                f"bulbs {self.bulbs} and daylight {self.daylight} are shares of one light: at most 1 in all"
            )
        for name, most in MOST.items():
            if not 0.0 <= getattr(self, name) <= most:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and {most:g}")
        if self.updates < 0:
            raise ValueError(f"updates is {self.updates}; write a number of frames, or 0 to count laps")

    def now(self) -> Moment:
        """How the world is during the drive."""
        return Moment(self.age, self.doors, self.bulbs, self.daylight, SITTING * self.people)

    def check_events(self, frames: int) -> None:
        """Raise ``ValueError`` for events that a drive of so many frames never comes to, or that come at once."""
        if not 1 <= frames <= MOST_FRAMES:
            raise ValueError(
                f"laps {self.laps} and updates {self.updates} make {frames} frames; 1 to {MOST_FRAMES} can be made"
            )
        for name in ("kidnap_at", "turned_at"):
            if not -1 <= getattr(self, name) < frames:
                value = getattr(self, name)
                raise ValueError(f"{name} is {value}; with {frames} frames it lies between -1 and the last")
        if min(self.kidnap_at, self.turned_at) >= 0 and abs(self.kidnap_at - self.turned_at) < APART:
            raise ValueError(
                f"kidnap_at is {self.kidnap_at} and turned_at {self.turned_at}; take frames {APART} apart at least"
            )
        if any(not 0 <= index < frames for index in self.covered):
            raise ValueError(f"covered is {self.covered}; with {frames} frames indices lie between 0 and the last")
