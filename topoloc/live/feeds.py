"""A live localizer with what feeds it: each feed in a thread of its own, the localizer in the caller's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import Protocol

from topoloc.live.engine import LiveLocalizer
from topoloc.live.report import LiveReport

POLL_S = 0.01
"""At the end of the pictures, it is looked so often whether all were worked on [s]."""
PATIENCE_S = 2.0
"""A feed that is told to stop may take so long, in a read that hangs; its thread ends with the program [s]."""


class Feed(Protocol):
    """Hands messages to a localizer, until it has none left or is told to stop."""

    def __call__(self, live: LiveLocalizer, stop: Event) -> None:
        """Do so, in a thread of its own."""


def run_fed(
    live: LiveLocalizer,
    pictures: Feed,
    others: Sequence[Feed],
    report: Callable[[LiveReport], None],
    stop: Event,
) -> None:
    """Work until the pictures end and all were worked on, or until ``stop`` is set; then save the belief.

    Args:
        live: works in this thread.
        pictures: when this feed ends, all ends.
        others: may end before.
        report: is called in this thread.
        stop: ends it early; it is set when this returns.

    Raises:
        Exception: what a feed raised, after all have stopped.
    """
    errors: list[BaseException] = []

    def guarded(feed: Feed, is_main: bool) -> None:
        try:
            feed(live, stop)
            while is_main and not live.is_idle and not stop.wait(POLL_S):
                pass
        except BaseException as error:
            errors.append(error)
            stop.set()
        if is_main:
            stop.set()

    threads = [Thread(target=guarded, args=(feed, False), daemon=True) for feed in others]
    threads.append(Thread(target=guarded, args=(pictures, True), daemon=True))
    for thread in threads:
        thread.start()
    try:
        live.run(report, stop)
    finally:
        stop.set()
        for thread in threads:
            thread.join(PATIENCE_S)
    if errors:
        raise errors[0]
