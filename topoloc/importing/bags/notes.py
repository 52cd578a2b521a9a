"""What is strange in a bag, though it was read: clocks, gaps, and truth that ends too soon."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from topoloc.geometry import Floats
from topoloc.importing.bags.frames import FAR_S
from topoloc.importing.bags.stamps import Clock
from topoloc.recording import Track


def of_clock(clock: Clock) -> Iterator[str]:
    """Topics without stamps, and those whose time goes back."""
    for topic in clock.unstamped:
        yield f"{topic} has no stamps; the times it was received at are taken"
    for topic, count in clock.backwards.items():
        if count:
            yield f"{topic} goes back in time {count} times (played in a loop?); it is sorted by time"


def of_odometry(odometry: Track | None, pictures: Floats) -> Iterator[str]:
    """Pictures, times (N,) [s], around which the odometry has a hole, and that there is none."""
    if odometry is None:
        yield "no odometry: nothing tells how the robot moves; --odometry-tf odom:base_link takes it from transforms"
        return
    if len(odometry.times) < 2:
        return
    after = np.searchsorted(odometry.times, pictures).clip(1, len(odometry.times) - 1)
    inside = (pictures >= odometry.times[0]) & (pictures <= odometry.times[-1])
    holes = np.where(inside, odometry.times[after] - odometry.times[after - 1], 0.0)
    if (holes > FAR_S).any():
        worst = int(holes.argmax())
        where = f"the longest {holes[worst]:.1f} s, at {pictures[worst]:.3f}"
        count = int((holes > FAR_S).sum())
        yield f"{count} pictures lie in holes of the odometry of more than {FAR_S:g} s, {where}: it is interpolated"


def of_truth(truth: Track | None, pictures: Floats) -> Iterator[str]:
    """Pictures, times (N,) [s], before or after the true poses, which stand still there."""
    if truth is None:
        return
    away = (pictures < truth.times[0] - FAR_S) | (pictures > truth.times[-1] + FAR_S)
    if away.any():
        first, last = truth.times[0], truth.times[-1]
        span = f"which are of {first:.1f} to {last:.1f} s"
        yield f"{int(away.sum())} pictures are before or after the true poses, {span}: cut them off with --start, --end"
