"""The time of a message: its own stamp, or when it was received where it carries none."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, Literal

from topoloc.importing.bags.bag import NS, TRANSFORMS, Bag, Message

TimeSource = Literal["header", "received"]
LOOKED_AT = 5
"""So many first messages of a topic decide whether it is stamped at all: in simulations the first may be zero."""


class Clock:
    """Tells the times of messages, and counts those that go back.

    Attributes:
        unstamped: topics whose times are those of receipt since their messages carry none.
        backwards: by topic, how many messages have a time before that of the one before.
    """

    def __init__(self, source: TimeSource) -> None:
        self._source = source
        self._last: dict[str, float] = {}
        self.unstamped: list[str] = []
        self.backwards: Counter[str] = Counter()

    def look_at(self, bag: Bag, topic: str) -> Message | None:
        """Decide by a topic's first messages whether it is stamped; returns the first that decodes."""
        first = []
        for message in bag.messages([topic]):
            if message.content is not None:
                first.append(message)
            if len(first) == LOOKED_AT:
                break
        stamps = [_seconds(header) for message in first for header in headers_of(message)]
        if stamps and 2 * sum(stamp == 0.0 for stamp in stamps) > len(stamps) and topic not in self.unstamped:
            self.unstamped.append(topic)
        return first[0] if first else None

    def time(self, message: Message, header: Any, of: str = "") -> float | None:
        """The time [s] of a message or, ``of`` telling which, of one of its parts; None where it has no stamp.

        Args:
            message: whose topic has been looked at.
            header: its own or its part's.
            of: distinguishes the parts whose times are held against each other.
        """
        if self._source == "received" or message.topic in self.unstamped:
            time = message.received
        else:
            time = _seconds(header)
            if time == 0.0:
                return None
        key = message.topic + of
        self.backwards[message.topic] += time < self._last.get(key, time)
        self._last[key] = time
        return time


def headers_of(message: Message) -> Sequence[Any]:
    """The headers in a message: one, or one for each transform."""
    content: Any = message.content
    return [part.header for part in content.transforms] if message.kind == TRANSFORMS else [content.header]


def _seconds(header: Any) -> float:
    return float(header.stamp.sec + header.stamp.nanosec * NS)
