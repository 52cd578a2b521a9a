"""The behaviour engine: ``init`` once, ``action`` again and again, each behaviour in a thread (thesis 4.2.1)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from threading import Event, Thread
from types import TracebackType
from typing import Self


class Behaviour(ABC):
    """A small task of a robot, as a behaviour module of Miro is (thesis 4.2.1)."""

    @abstractmethod
    def init(self) -> None:
        """All that is needed before the first action; called once, when the behaviour is first started."""

    @abstractmethod
    def action(self) -> bool:
        """A short piece of the work, called periodically; returns whether there is more to do."""

    def failed(self, error: BaseException) -> None:  # noqa: B027  (most behaviours have nobody waiting)
        """Told, in the behaviour's own thread, that ``init`` or ``action`` raised; wakes those who wait for it."""


class _Activity:
    """A behaviour at work in its thread."""

    def __init__(self, behaviour: Behaviour, is_ready: bool, pause_s: float) -> None:
        self.behaviour, self.is_ready = behaviour, is_ready
        self.stopped = Event()
        self.error: BaseException | None = None
        self._pause_s = pause_s
        self.thread = Thread(target=self._work, name=type(behaviour).__name__, daemon=True)

    def _work(self) -> None:
        try:
            if not self.is_ready:
                self.behaviour.init()
                self.is_ready = True
            while not self.stopped.is_set() and self.behaviour.action():
                self.stopped.wait(self._pause_s)
        except BaseException as error:
            self.error = error  # with its traceback; whoever waits or stops raises it
            self.behaviour.failed(error)

    def take_error(self) -> BaseException | None:
        """What went wrong, told once; None where nothing did, or where it was told already."""
        error, self.error = self.error, None
        return error


class Engine:
    """Runs behaviours, each in a thread of its own, until they are done or are stopped.

    What a behaviour raises is raised again, with its traceback, by ``wait`` or ``stop``, whichever comes first; leaving
    the ``with`` block stops. There are no priorities and no arbiter of Miro's: at most one of the behaviours that run
    together may move the robot.

    Args:
        pause_s: between two actions of a behaviour [s].
        patience_s: how long ``stop`` waits for the actions that are under way [s].
    """

    def __init__(self, pause_s: float = 0.02, patience_s: float = 10.0) -> None:
        if not (pause_s >= 0.0 and patience_s >= 0.0):
            raise ValueError(f"pause_s is {pause_s} and patience_s {patience_s}; neither may be negative")
        self._pause_s, self._patience_s = pause_s, patience_s
        self._activities: list[_Activity] = []

    def start(self, behaviour: Behaviour) -> None:
        """Start a behaviour, or go on with one that was stopped: ``init`` is called the first time only.

        Raises:
            ValueError: it is running already.
        """
        before = self._activity(behaviour)
        if before is not None:
            if before.thread.is_alive():
                raise ValueError(f"{type(behaviour).__name__} is running already; stop it first")
            self._activities.remove(before)
        activity = _Activity(behaviour, before is not None and before.is_ready, self._pause_s)
        self._activities.append(activity)
        activity.thread.start()

    def wait(self, behaviour: Behaviour, timeout_s: float | None = None) -> None:
        """Wait until a behaviour has no more to do, and raise what it raised.

        Raises:
            ValueError: it was never started.
            TimeoutError: it is still at work.
        """
        activity = self._activity(behaviour)
        if activity is None:
            raise ValueError(f"{type(behaviour).__name__} was not started")
        activity.thread.join(timeout_s)
        if activity.thread.is_alive():
            raise TimeoutError(f"{type(behaviour).__name__} is still at work after {timeout_s} s")
        _raise_together([activity.take_error()])

    def run(self, behaviour: Behaviour, timeout_s: float | None = None) -> None:
        """Start a behaviour and wait until it is done."""
        self.start(behaviour)
        self.wait(behaviour, timeout_s)

    def stop(self) -> None:
        """Let each behaviour finish the action under way and no more, and raise what they raised.

        Raises:
            TimeoutError: one is still in its action after ``patience_s``; its thread ends with the program.
        """
        _raise_together(self._stopped())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        errors = self._stopped()
        if error is None:
            _raise_together(errors)
        else:
            _note_others(error, errors)

    def _activity(self, behaviour: Behaviour) -> _Activity | None:
        return next((one for one in self._activities if one.behaviour is behaviour), None)

    def _stopped(self) -> list[BaseException | None]:
        """What each behaviour raised, once all are told to stop and those that can have ended."""
        for activity in self._activities:
            activity.stopped.set()
        errors: list[BaseException | None] = []
        for activity in self._activities:
            activity.thread.join(self._patience_s)
            name = activity.thread.name
            stuck = TimeoutError(f"{name} is still in its action {self._patience_s:g} s after it was told to stop")
            errors.append(stuck if activity.thread.is_alive() else activity.take_error())
        return errors


def _raise_together(errors: list[BaseException | None]) -> None:
    """Raise the first error, if there is one, with a note for each of the others."""
    first = next((error for error in errors if error is not None), None)
    if first is not None:
        _note_others(first, errors)
        raise first


def _note_others(error: BaseException, others: list[BaseException | None]) -> None:
    for other in others:
        if other is not None and other is not error:
            error.add_note(f"besides, a behaviour raised {other!r}")
