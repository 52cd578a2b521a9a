"""What behaviours ask of a robot: it looks, says what its odometer reads, and turns.

``topoloc.active.Robot`` is another thing: it carries out an ``Action`` that was chosen for it, and looks there, all in
one call. These protocols keep looking and moving apart, since one behaviour may look while another one drives.
"""

from __future__ import annotations

from typing import Protocol

from topoloc.geometry import Floats
from topoloc.types import Frame


class Watcher(Protocol):
    """Something with a camera, moving or carried about. Behaviours call it from threads of their own."""

    def look(self) -> Frame:
        """The camera's picture, and the odometer at that moment; waits for the camera. Later frames have later times.

        A robot at rest may give the same frame, of the same time, again.
        """


class MobileRobot(Watcher, Protocol):
    """A robot that turns on the spot. Safe to call from several threads, of which one at a time moves it."""

    def odometry(self) -> Floats:
        """(3,) raw pose of the odometer now [m, m, rad]."""

    def turn(self, angle: float) -> None:
        """Turn on the spot by about so much [rad], counter-clockwise positive; returns when it stands still again.

        Wheels are imprecise: what came of it is read from the odometer.
        """
