"""Odometry and truth that were recorded beside the pictures, in files of their own."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.importing.recording_sink import RecordingSink
from topoloc.recording import Track

REACH_S = 0.5
"""A picture farther from the next reading than this cannot be placed [s]; between rarer readings, than their step."""


@dataclass(frozen=True)
class Alongside:
    """Tracks on the pictures' clock.

    Attributes:
        odometry: of the odometer, or None.
        truth: of the robot, or None.
    """

    odometry: Track | None = None
    truth: Track | None = None
    _hints: dict[str, str] = field(default_factory=dict, init=False, repr=False, compare=False)

    def lack(self, time: float) -> str | None:
        """Why a picture of this time [s] has no place on the tracks; None where it has one."""
        for name, times, reach in self._reaches:
            after = int(np.searchsorted(times, time))
            within = reach if 0 < after < len(times) else REACH_S
            if np.abs(times[max(after - 1, 0) : after + 1] - time).min() > within:
                outside = not 0 < after < len(times)
                return f"no {name} within {within:g} s{self._hints.get(name, '') if outside else ''}"
        return None

    @cached_property
    def _reaches(self) -> list[tuple[str, Floats, float]]:
        """What each track is called, its times, and how far from the next of them pictures may lie between two [s]."""
        named = (("odometer pose", self.odometry), ("true pose", self.truth))
        return [(name, track.times, _reach(track.times)) for name, track in named if track is not None]

    def refuse_apart(self, first: float, last: float) -> None:
        """Raise ``UserError`` where a track has not a single moment with pictures from ``first`` to ``last`` [s].

        Where it lacks an end of theirs, ``lack`` tells both spans from now on, and which offset would join them.
        """
        for name, times, _ in self._reaches:
            if times[0] - REACH_S > last or times[-1] + REACH_S < first:
                raise UserError(
                    f"the pictures run from {first:.3f} to {last:.3f} s, the {name}s from {times[0]:.3f} to "
                    f"{times[-1]:.3f} s; give --offset-s, the time of the first picture on the clock of the CSV file"
                )
            self._hints[name] = _hint(f"{name}s", times, first, last)

    def write(self, sink: RecordingSink) -> None:
        """Hand the tracks to a recording."""
        for track, keep in ((self.odometry, sink.odometry), (self.truth, sink.truth)):
            if track is not None:
                for time, pose in zip(track.times, track.poses, strict=True):
                    keep(float(time), pose)


def _reach(times: Floats) -> float:
    return max(REACH_S, float(np.median(np.diff(times)))) if len(times) > 1 else REACH_S


def _hint(names: str, times: Floats, first: float, last: float) -> str:
    """What to say of pictures from ``first`` to ``last`` [s] that lie outside a track's times; empty if none do."""
    early, late = float(times[0]) - first, last - float(times[-1])
    if max(early, late) <= REACH_S:
        return ""
    spans = f"; the pictures run from {first:.3f} to {last:.3f} s, the {names} from {times[0]:.3f} to {times[-1]:.3f} s"
    if early + late > REACH_S:  # what one end lacks, the other does not have
        return spans
    return f"{spans}: did you mean --offset-s {round(early, 3):g} (added to one already given)?"
