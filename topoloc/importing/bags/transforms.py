"""The transforms of ``/tf`` and ``/tf_static``: how one frame lies in another, at any time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.importing.bags.poses import PoseLog

Link = tuple[str, str]
"""A parent and its child."""


class Transforms:
    """Frames and how they lie in each other.

    They are kept as a graph, so that bags in which a frame has two parents can be read, too; between two frames the
    way over the fewest others counts. Between two readings it is interpolated; before the first and after the last the
    reading holds, so that one that never changes need not be in ``/tf_static``.
    """

    def __init__(self) -> None:
        self._changing: dict[Link, PoseLog] = {}
        self._fixed: dict[Link, PoseLog] = {}

    @property
    def _links(self) -> dict[Link, PoseLog]:
        return self._fixed | self._changing

    def add(self, parent: str, child: str, time: float | None, pose: tuple[float, ...]) -> None:
        """Keep where a child lies in its parent: x, y, z [m], qx, qy, qz, qw.

        Args:
            parent: a frame; a slash before it, as in early bags, means nothing.
            child: another.
            time: [s]; None: always, where the two are never sent with a time.
            pose: of the child.
        """
        link = (parent.lstrip("/"), child.lstrip("/"))
        links = self._fixed if time is None else self._changing
        links.setdefault(link, PoseLog()).add(time or 0.0, pose)

    def __contains__(self, frame: str) -> bool:
        return any(frame.lstrip("/") in link for link in self._links)

    def told(self) -> str:
        """All that is known, for people: ``map > odom, odom > base_link``."""
        return ", ".join(f"{parent} > {child}" for parent, child in sorted(self._links)) or "none"

    def times(self, target: str, source: str) -> Floats:
        """Times (N,) [s] of all readings on the way between two frames, where all that change are known.

        Raises:
            UserError: nothing leads from one to the other, nothing on the way changes, or never at the same time.
        """
        logs = [self._links[link] for link, _ in self._way(target, source)]
        read = [log.in_space()[0] for log in logs if len(log)]
        changing = [times for times in read if len(times) > 1]
        if not changing:
            raise UserError(f"{target}:{source}: no transform on the way ever changes; name two frames that move")
        times = np.unique(np.concatenate(changing))
        begin, end = max(one[0] for one in changing), min(one[-1] for one in changing)
        if begin > end:
            raise UserError(f"{target}:{source}: its transforms were never sent at the same time; record them together")
        return np.asarray(times[(times >= begin) & (times <= end)])

    def at(self, target: str, source: str, times: Floats) -> tuple[Floats, Rotation]:
        """Positions (T, 3) [m] and orientations (T) of one frame in another at times (T,) [s].

        Raises:
            UserError: nothing leads from one to the other.
        """
        positions, turns = np.zeros((len(times), 3)), Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1)))
        for link, down in self._way(target, source):
            step, turn = _interpolated(self._links[link], times)
            if not down:
                turn = turn.inv()
                step = -turn.apply(step)
            positions, turns = positions + turns.apply(step), turns * turn
        return positions, turns

    def _way(self, target: str, source: str) -> list[tuple[Link, bool]]:
        """The links from one frame to another, and whether each is gone from parent to child."""
        start, goal = target.lstrip("/"), source.lstrip("/")
        ways: dict[str, list[tuple[Link, bool]]] = {start: []}
        waiting = deque([start])
        while waiting and goal not in ways:
            frame = waiting.popleft()
            for link, down in self._from(frame):
                other = link[1] if down else link[0]
                if other not in ways:
                    ways[other] = [*ways[frame], (link, down)]
                    waiting.append(other)
        if goal not in ways:
            raise UserError(f"no transform leads from {start} to {goal}; the bag has: {self.told()}")
        return ways[goal]

    def _from(self, frame: str) -> Iterator[tuple[Link, bool]]:
        for link, log in self._links.items():
            if frame in link and len(log):
                yield link, frame == link[0]


def _interpolated(log: PoseLog, times: Floats) -> tuple[Floats, Rotation]:
    """Positions (T, 3) and orientations (T) at times (T,)."""
    known, positions, turns = log.in_space()
    if len(known) == 1:
        return np.tile(positions, (len(times), 1)), Rotation.from_quat(np.tile(turns.as_quat(), (len(times), 1)))
    within = np.clip(times, known[0], known[-1])
    between = np.column_stack([np.interp(within, known, positions[:, axis]) for axis in range(3)])
    return between, Slerp(known, turns)(within)
