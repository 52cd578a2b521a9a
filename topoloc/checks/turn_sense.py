"""Whether pictures move as the odometer says: the scene goes to the right while the robot turns to the left (ours)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from topoloc.checks.finding import Finding
from topoloc.checks.shifts import Shift, shifts_of
from topoloc.recording import Recording

LEAST_TURNS = 5
MOST_AGAINST = 0.7
"""So many must tell, and this share of them go the wrong way, before it is a finding."""


def sense_findings(recording: Recording, shifts: Sequence[Shift] | None = None) -> Iterator[Finding]:
    """A finding where the pictures go the wrong way round as the camera turns.

    Args:
        recording: which.
        shifts: of its pictures; None: they are measured here.

    Raises:
        InputError: a picture that cannot be read.
    """
    turns = [shift for shift in (shifts_of(recording) if shifts is None else shifts) if shift.turned_deg != 0.0]
    told = [turn.right_px * np.sign(turn.turned_deg) for turn in turns if abs(turn.right_px) > 0.0]
    against = sum(right < 0.0 for right in told)
    if len(turns) >= LEAST_TURNS and len(told) >= LEAST_TURNS and against >= MOST_AGAINST * len(told):
        what = f"in {against} of {len(told)} turns the pictures move the wrong way"
        remedy = "look whether they are mirror-flipped or upside down, or the odometer's heading grows clockwise"
        yield Finding(str(recording.folder / f"{recording.kind}.txt"), what, remedy, "serious")
