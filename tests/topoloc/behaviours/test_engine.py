"""The behaviour engine: init once, action until done or stopped, and no exception is lost. Nothing sleeps."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable

import pytest

from topoloc.behaviours import Behaviour, Engine

PATIENCE_S = 10.0
"""Nothing here takes that long: a test that waits so long has failed."""


class Counter(Behaviour):
    """Counts its calls; each action may do something besides."""

    def __init__(self, actions: int, does: Callable[[int], object] = lambda number: None) -> None:
        self.inits, self.actions = 0, 0
        self.threads: set[int] = set()
        self._last, self._does = actions, does

    def init(self) -> None:
        self.inits += 1

    def action(self) -> bool:
        self.threads.add(threading.get_ident())
        self.actions += 1
        self._does(self.actions)
        return self.actions < self._last


def broken(number: int) -> None:
    raise ZeroDivisionError("in the action")


@pytest.fixture
def engine() -> Engine:
    return Engine(pause_s=0.0, patience_s=PATIENCE_S)


def test_runs_a_behaviour_until_it_is_done(engine: Engine) -> None:
    behaviour = Counter(5)
    engine.run(behaviour, PATIENCE_S)
    assert (behaviour.inits, behaviour.actions) == (1, 5)
    assert threading.get_ident() not in behaviour.threads and len(behaviour.threads) == 1


def test_init_is_called_the_first_time_only(engine: Engine) -> None:
    behaviour = Counter(1)
    for _ in range(3):
        engine.run(behaviour, PATIENCE_S)
    assert (behaviour.inits, behaviour.actions) == (1, 3)


def test_an_init_that_failed_is_tried_again(engine: Engine) -> None:
    class Shy(Counter):
        def init(self) -> None:
            super().init()
            if self.inits == 1:
                raise OSError("no camera yet")

    behaviour = Shy(1)
    with pytest.raises(OSError, match="no camera"):
        engine.run(behaviour, PATIENCE_S)
    engine.run(behaviour, PATIENCE_S)
    assert (behaviour.inits, behaviour.actions) == (2, 1)


def test_stop_lets_the_action_under_way_end_and_none_follow(engine: Engine) -> None:
    under_way, go_on = threading.Event(), threading.Event()

    def hold(number: int) -> None:
        under_way.set()
        assert go_on.wait(PATIENCE_S)

    behaviour = Counter(10**9, hold)
    engine.start(behaviour)
    assert under_way.wait(PATIENCE_S)
    stopping = threading.Thread(target=engine.stop)
    stopping.start()
    (activity,) = engine._activities
    assert activity.stopped.wait(PATIENCE_S)
    go_on.set()
    stopping.join(PATIENCE_S)
    assert not stopping.is_alive() and behaviour.actions == 1


def test_behaviours_run_side_by_side(engine: Engine) -> None:
    """Two that wait for each other in each action: one after the other they never would meet."""
    meeting = threading.Barrier(2)
    first, second = (Counter(20, lambda number: meeting.wait(PATIENCE_S)) for _ in range(2))
    engine.start(first)
    engine.run(second, PATIENCE_S)
    engine.wait(first, PATIENCE_S)
    assert (first.actions, second.actions) == (20, 20)


class TestExceptions:
    def test_reach_whoever_waits_with_their_traceback(self, engine: Engine) -> None:
        with pytest.raises(ZeroDivisionError) as caught:
            engine.run(Counter(3, broken), PATIENCE_S)
        assert "broken" in [frame.name for frame in traceback.extract_tb(caught.value.__traceback__)]
        engine.stop()  # told once

    def test_reach_whoever_stops(self, engine: Engine) -> None:
        failed = threading.Event()
        behaviour = Counter(3, broken)
        behaviour.failed = lambda error: failed.set()  # type: ignore[method-assign]
        with pytest.raises(ZeroDivisionError), engine:
            engine.start(behaviour)
            assert failed.wait(PATIENCE_S)

    def test_do_not_hide_the_callers_own(self, engine: Engine) -> None:
        failed = threading.Event()
        behaviour = Counter(3, broken)
        behaviour.failed = lambda error: failed.set()  # type: ignore[method-assign]
        with pytest.raises(KeyError) as caught, engine:
            engine.start(behaviour)
            assert failed.wait(PATIENCE_S)
            raise KeyError("the caller's")
        assert ["ZeroDivisionError" in note for note in caught.value.__notes__] == [True]

    def test_of_several_none_is_lost(self, engine: Engine) -> None:
        for _ in range(2):
            engine.start(Counter(1, broken))
        with pytest.raises(ZeroDivisionError) as caught:
            engine.stop()
        assert len(caught.value.__notes__) == 1


def test_a_behaviour_that_does_not_end_is_named() -> None:
    go_on = threading.Event()
    behaviour = Counter(1, lambda number: go_on.wait(PATIENCE_S))
    engine = Engine(patience_s=0.0)
    engine.start(behaviour)
    with pytest.raises(TimeoutError, match="Counter is still at work after 0"):
        engine.wait(behaviour, 0.0)
    with pytest.raises(ValueError, match="Counter is running already"):
        engine.start(behaviour)
    with pytest.raises(TimeoutError, match="Counter is still in its action"):
        engine.stop()
    go_on.set()
    engine.wait(behaviour, PATIENCE_S)


def test_what_was_never_started_cannot_be_waited_for(engine: Engine) -> None:
    with pytest.raises(ValueError, match="Counter was not started"):
        engine.wait(Counter(1))
    with pytest.raises(ValueError, match="pause_s is -1"):
        Engine(pause_s=-1.0)
