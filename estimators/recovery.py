"""How likely it is that the robot is not where the past says: carried off, or the belief went wrong."""

from __future__ import annotations

RECOVERY = 0.001
"""Probability, at an update after one that saw something, that the robot is anywhere in the free area (ours)."""
RECOVERY_BLIND = 0.1
"""The same at the first update that sees something after any number of blind ones (ours).

Who carries a robot off covers its camera ("depriving the robot of the video input and repositioning it", thesis 5.2.2),
and one whose camera is covered may have been turned or moved (5.2.7). One probability for both would either lose the
belief to a few looks in a row that match a wrong place, or be slow after a kidnapping.
"""


def check_recovery(recovery: float, recovery_blind: float) -> None:
    """Raise ``ValueError`` for probabilities that cannot be."""
    for name, value in {"recovery": recovery, "recovery_blind": recovery_blind}.items():
        if not 0.0 <= value <= 0.5:
            raise ValueError(f"{name} is {value}; it must lie in [0, 0.5]")
