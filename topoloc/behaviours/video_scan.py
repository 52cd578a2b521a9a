"""Taking a panorama as a behaviour (thesis 4.2.3): the robot turns, takes snapshots, and closes the circle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from topoloc import plugins
from topoloc.behaviours.closing import edges_of, likeness
from topoloc.behaviours.engine import Behaviour
from topoloc.behaviours.robot import MobileRobot
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Image

TURN = 2.0 * np.pi
ALIKE = 0.22
"""Two views with a likeness above this overlap; chosen on laboratories 1000 to 1002: 1 in 20 that do not have it."""
NEAREST_DEG = 2.0
"""A snapshot that comes nearer to a full turn than this, or goes beyond it, is the first one again; degrees."""
SAME_VIEW, STANDS = 0.6, 0.05
"""A likeness above this, at a shift below this share of a view, is a robot that stands still."""


@dataclass(frozen=True)
class ScanSettings:
    """How a robot turns for a panorama, and when its pictures count as closed.

    Attributes:
        hfov_deg: horizontal field of view of the camera, degrees.
        step_deg: turn between two snapshots as the odometer tells it, degrees (5.1.2).
        tolerance_deg: a step is made once the odometer is this near to it, degrees.
        most_commands: turns that the robot is told for one step at most.
        odometer_error: largest error of a turn as the odometer tells it, as a share of it; 0.06 is the thesis's turn
            that ended up to 20 degrees short (5.1.2).
        astray_deg: a snapshot may lie this far from where the odometer says, once that is scaled to the turn that the
            pictures tell, degrees.
        overlap_deg: the last view must overlap the first by this much even if the odometer is as wrong as it may be,
            degrees.
        most_snapshots: no more are taken.
        method: of reconstruction; see 'topoloc list panoramas'.
    """

    hfov_deg: float = Camera.hfov_deg
    step_deg: float = THESIS.panorama_step_deg
    tolerance_deg: float = 4.0
    most_commands: int = 5
    odometer_error: float = 0.06
    astray_deg: float = 8.0
    overlap_deg: float = 8.0
    most_snapshots: int = 20
    method: str = "circle"

    def __post_init__(self) -> None:
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {self.hfov_deg}; it must lie between 0 and 180")
        if not 0.0 < self.tolerance_deg < self.step_deg:
            raise ValueError(f"tolerance_deg is {self.tolerance_deg}; it must lie between 0 and step_deg")
        longest = (self.step_deg + self.tolerance_deg) * (1.0 + self.odometer_error)
        if not (0.0 <= self.odometer_error < 0.5 and longest < self.hfov_deg):
            raise ValueError(
                f"step_deg is {self.step_deg}; with tolerance_deg and odometer_error a step comes to {longest:.1f} "
                f"degrees, and neighbours overlap only below hfov_deg, {self.hfov_deg:g}"
            )
        if not self.astray_deg > 0.0:
            raise ValueError(f"astray_deg is {self.astray_deg}; it must be above 0")
        if not 0.0 <= self.overlap_deg < self.hfov_deg:
            raise ValueError(f"overlap_deg is {self.overlap_deg}; it must lie between 0 and hfov_deg")
        if self.most_commands < 1 or self.most_snapshots * self.step_deg < 360.0:
            raise ValueError("most_commands must be at least 1, and most_snapshots enough for a whole turn")


class Reconstruction(Protocol):
    """What a method of ``topoloc.panoramas`` makes of snapshots."""

    @property
    def image(self) -> Image:
        """Full circle, uint8 (rows, columns[, 3]), columns clockwise, black where no snapshot lies."""

    @property
    def headings(self) -> Floats:
        """(S,) of each snapshot's optical axis [rad, ccw]."""

    @property
    def heading(self) -> float:
        """Of the left edge of the first column [rad, ccw]."""

    @property
    def filled(self) -> float:
        """Share of the columns that some snapshot covers."""


@dataclass(frozen=True)
class ScannedCircle:
    """A closed panorama, ready for a node.

    Attributes:
        panorama: uint8 (rows, columns[, 3]), columns clockwise, linear in angle.
        heading: of the left edge of its first column [rad, ccw], as ``nodes.csv`` wants it: half a view to the left of
            the first snapshot's axis (2.3), so that scans that begin with one heading suit a text map.
        camera: that the snapshots were taken with.
        filtered: whether they had gone through CLAHE, see ``TopoMap.filtered``.
        headings: (S,) of the optical axes of the snapshots it is made of, as the pictures tell them [rad, ccw].
        turned: (T,) how far the robot had turned clockwise at each snapshot taken, as the odometer tells it [rad].
        turn: how far it truly had turned at the last of them, as the pictures tell it [rad].
    """

    panorama: Image = field(repr=False)
    heading: float
    camera: Camera
    filtered: bool
    headings: Floats
    turned: Floats
    turn: float

    def node(self, identity: str, x: float, y: float, name: str = "") -> Node:
        """A node at x, y [m] with this panorama."""
        return Node(identity, name or identity, x, y, self.heading, self.panorama)


class VideoScan(Behaviour):
    """Turns clockwise on the spot, a snapshot each action, until the pictures close; then ``circle`` is the panorama.

    A step is turned until the odometer says so. The circle is closed when

    1. the odometer's turn, made smaller by ``odometer_error``, lets the last view overlap the first by ``overlap_deg``;
    2. the last picture is like the first, shifted by no more than the odometer allows: the shift tells the whole turn,
       and with it how much the odometer was wrong;
    3. the method of reconstruction leaves no column empty, and places no snapshot farther than ``astray_deg`` from
       where the odometer, corrected, says. Snapshots after the first that closes the circle are left out.

    Until then snapshots are added: a turn whose odometer promised more than the wheels did ends short (5.1.2).

    A camera ahead of the robot's axis moves as the robot turns, and near things cross its picture faster than the robot
    turns, 4 % at 0.1 m and things 2.5 m away: ``circle`` finds by itself how wide the views seem from the axis.

    Args:
        robot: stands on the place.
        heading: of the robot at the start, map frame [rad, ccw].
        settings: how it turns.
        method_settings: of the reconstruction, but for field of view, start and step, which the scan tells it.
    """

    def __init__(
        self,
        robot: MobileRobot,
        heading: float,
        settings: ScanSettings | None = None,
        method_settings: Mapping[str, Any] | None = None,
    ) -> None:
        self._robot, self._heading = robot, heading
        self._settings, self._method_settings = settings or ScanSettings(), dict(method_settings or {})
        self._circle: ScannedCircle | None = None
        self._is_over = False

    def init(self) -> None:
        """Forget all snapshots, and take the odometer as it stands."""
        self._snapshots: list[Image] = []
        self._edges: list[Floats] = []
        self._turned: list[float] = []
        self._start = 0.0
        self._sum, self._reading = 0.0, float(self._robot.odometry()[2])
        self._circle, self._filters, self._is_over = None, False, False

    def action(self) -> bool:
        """A step of the turn, a snapshot, and a look whether the circle is closed.

        Raises:
            UserError: the robot does not turn, gives no picture, or has turned full circle and the pictures still do
                not close.
        """
        if self._is_over:
            self.init()  # started again, after the end or a failure: from the first snapshot
        if self._snapshots:
            self._turn_on()
        self._take_snapshot()
        if not self._must_overlap():
            return True
        made, complaint = self._closed()
        if made is None:
            self._refuse_endless(complaint)
            return True
        self._circle, self._is_over = made, True
        return False

    def failed(self, error: BaseException) -> None:
        """The next action begins anew."""
        del error  # whoever waits for the scan is told by the engine
        self._is_over = True

    @property
    def circle(self) -> ScannedCircle:
        """The closed panorama.

        Raises:
            ValueError: the scan is not done.
        """
        if self._circle is None:
            raise ValueError("the scan is not done; run it to its end first")
        return self._circle

    def _clockwise(self) -> float:
        """How far the odometer has turned clockwise since the start [rad]."""
        now = float(self._robot.odometry()[2])
        self._sum -= float(wrap(now - self._reading))
        self._reading = now
        return self._sum

    def _turn_on(self) -> None:
        """Turn by a step: as often as it takes, and back where it was too far."""
        step, tolerance = np.deg2rad(self._settings.step_deg), np.deg2rad(self._settings.tolerance_deg)
        goal = self._turned[-1] + step
        for _ in range(self._settings.most_commands):
            self._robot.turn(self._clockwise() - goal)
            left = goal - self._clockwise()
            if abs(left) <= tolerance:
                return
        if abs(left) > step / 2.0:
            raise UserError(
                f"the robot does not turn as told: after {self._settings.most_commands} commands its odometer says "
                f"{np.rad2deg(step - left):.1f} of {self._settings.step_deg:g} degrees; look at motors, brakes and the "
                f"sign of the odometer's heading (counter-clockwise is positive)"
            )

    def _take_snapshot(self) -> None:
        frame = self._robot.look()
        if "rgb" not in frame.images:
            listed = ", ".join(sorted(frame.images)) or "none"
            raise UserError(f"a scan needs rgb pictures, the robot's frames have {listed}; name its pictures 'rgb'")
        if not self._snapshots:
            self._start = float(wrap(self._heading + frame.camera[2]))
        picture = np.asarray(frame.images["rgb"], dtype=np.uint8)
        if self._snapshots and picture.shape != self._snapshots[0].shape:
            raise UserError(
                f"the camera gave pictures of {self._snapshots[0].shape} and {picture.shape}; keep one size"
            )
        self._snapshots.append(picture)
        self._edges.append(edges_of(self._snapshots[-1]))
        self._turned.append(self._clockwise())
        if len(self._edges) > 1:
            self._refuse_standstill()

    def _refuse_standstill(self) -> None:
        """Raise ``UserError`` where a picture shows what the one before it showed: wheels may turn in vain."""
        shift, alike = likeness(*self._edges[-2:])
        if alike[np.abs(shift) < STANDS].max() > SAME_VIEW:
            step = np.rad2deg(self._turned[-1] - self._turned[-2])
            raise UserError(
                f"the robot stands still: its odometer says {step:.0f} degrees, and snapshot {len(self._edges)} shows "
                f"what the one before it does; look whether the wheels slip and the camera is alive"
            )

    def _must_overlap(self) -> bool:
        """Condition 1."""
        least = self._turned[-1] * (1.0 - self._settings.odometer_error)
        return bool(least + np.deg2rad(self._settings.hfov_deg - self._settings.overlap_deg) >= TURN)

    def _closed(self) -> tuple[ScannedCircle | None, str]:
        """The panorama; or None, and why conditions 2 and 3 do not hold."""
        error = self._settings.odometer_error
        shift, alike = likeness(self._edges[-1], self._edges[0])
        beyond = TURN - shift * np.deg2rad(self._settings.hfov_deg)  # the whole turn, for each shift
        allowed = np.abs(beyond / self._turned[-1] - 1.0) <= error
        if not allowed.any() or alike[allowed].max() < ALIKE:
            return None, "the last is not like the first"
        turn = float(beyond[allowed][alike[allowed].argmax()])
        made, complaint = self._reconstructed(self._of_one_turn(np.array(self._turned) * turn / self._turned[-1]))
        if made is None:
            return None, complaint
        rows, columns = self._snapshots[0].shape[:2]
        camera = Camera(self._settings.hfov_deg, columns, rows)
        first = float(wrap(self._start + np.deg2rad(self._settings.hfov_deg) / 2.0))
        beside = float(wrap(made.heading - first)) / TURN * made.image.shape[1]
        panorama = np.roll(made.image, -round(beside), axis=1)
        return ScannedCircle(panorama, first, camera, self._filters, made.headings, np.array(self._turned), turn), ""

    def _of_one_turn(self, angles: Floats) -> Floats:
        """Those of the angles (T,) [rad] up to the first whose view reaches the first view again, none beyond it."""
        short = angles[angles <= TURN - np.deg2rad(NEAREST_DEG)]
        reaching = np.flatnonzero(short >= TURN - np.deg2rad(self._settings.hfov_deg - self._settings.overlap_deg))
        return np.asarray(short[: reaching[0] + 1] if len(reaching) else short)

    def _reconstructed(self, angles: Floats) -> tuple[Reconstruction | None, str]:
        """What the method makes of the first snapshots, turned clockwise by angles (S,) [rad]: condition 3."""
        try:
            maker = self._make_method(angles)
            made: Reconstruction = maker.reconstruct(self._snapshots[: len(angles)])
        except UserError as error:
            if not hasattr(error, "pair"):  # a gap between two, as ``sensors.panorama`` tells it
                raise
            return None, str(error).partition(";")[0]  # the remedy here is another one
        if made.filled < 1.0:
            return None, f"{360.0 * (1.0 - made.filled):.0f} degrees of the panorama stay empty"
        astray = np.rad2deg(np.abs(wrap(made.headings - (self._start - angles))))
        worst = int(astray.argmax())
        if astray[worst] > self._settings.astray_deg:
            return None, f"the method places snapshot {worst + 1} {astray[worst]:.0f} degrees from the odometer's place"
        self._filters = bool(getattr(maker.config, "clahe", False))
        return made, ""

    def _make_method(self, angles: Floats) -> Any:
        """The method of reconstruction, told what it can be told."""
        known = plugins.options(plugins.load(plugins.PANORAMAS, self._settings.method))
        told = {
            "hfov_deg": self._settings.hfov_deg,
            "start_deg": float(np.rad2deg(self._start)),
            "step_deg": float(np.rad2deg(angles[-1])) / (len(angles) - 1),
        }
        settings = self._method_settings | {key: value for key, value in told.items() if key in known}
        return plugins.make(plugins.PANORAMAS, self._settings.method, settings)

    def _refuse_endless(self, complaint: str) -> None:
        """Raise ``UserError`` where further snapshots cannot help: the turn is full however wrong the odometer is."""
        full = self._turned[-1] * (1.0 - self._settings.odometer_error) >= TURN
        if full or len(self._snapshots) >= self._settings.most_snapshots:
            raise UserError(
                f"the pictures do not close: {len(self._snapshots)} snapshots over {np.rad2deg(self._turned[-1]):.0f} "
                f"degrees by the odometer, and {complaint}; take them with more light or smaller steps, correct "
                f"hfov_deg, try another method, or look whether the wheels slip"
            )


def add_node(topo_map: TopoMap | None, node: Node, circle: ScannedCircle, name: str = "map") -> TopoMap:
    """A map with a node more, or with another panorama for the node of the same id (map-learning, thesis 4.2.3).

    Args:
        topo_map: the map so far; None begins one.
        node: as ``ScannedCircle.node`` makes it.
        circle: that it was made of.
        name: of a map that is begun.

    Raises:
        UserError: the map's panoramas are of another camera, or filtered where this one is not, or the reverse.
    """
    if topo_map is None:
        return TopoMap(name, circle.camera, (node,), filtered=circle.filtered)
    if (topo_map.camera, topo_map.filtered) != (circle.camera, circle.filtered):
        raise UserError(
            f"map {topo_map.name!r} has panoramas of {topo_map.camera}, filtered: {topo_map.filtered}, this one is of "
            f"{circle.camera}, filtered: {circle.filtered}; scan with the same camera and method"
        )
    ids = [one.id for one in topo_map.nodes]
    if node.id in ids:
        nodes = tuple(node if one.id == node.id else one for one in topo_map.nodes)
    else:
        nodes = (*topo_map.nodes, node)
    return replace(topo_map, nodes=nodes, edges=None if topo_map.edges_are_guessed else topo_map.edges)


def save_node(folder: Path | str, node: Node, circle: ScannedCircle) -> TopoMap:
    """Put a node on the map in a folder, as ``add_node`` does; a folder that is not there is begun."""
    place = Path(folder)
    before = TopoMap.load(place) if place.exists() else None
    topo_map = add_node(before, node, circle, place.name)
    topo_map.save(place, overwrite=True)
    return topo_map
