"""A localizer for a running robot: messages come in as they like, from any thread; one thread works on them."""

from __future__ import annotations

import time as clocks
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event

import numpy as np
from numpy.typing import ArrayLike

from topoloc.errors import UserError
from topoloc.estimate import estimate_from
from topoloc.geometry import Floats, between, compose
from topoloc.interfaces import Sensor
from topoloc.lens import Lens
from topoloc.live.mailbox import ImageData, Letter, Mailbox
from topoloc.live.odometer import Odometer, Reading
from topoloc.live.pictures import Straightener
from topoloc.live.report import LiveConfig, LiveCounts, LiveReport, Tally
from topoloc.live.saved_belief import SavedBelief, save
from topoloc.localizer import Localizer, Step
from topoloc.topo_map import Camera, TopoMap
from topoloc.types import Estimate, Evidence, Frame, Status, WeightedPoses

__all__ = ["LiveConfig", "LiveCounts", "LiveLocalizer", "LiveReport"]

POLL_S = 0.02
"""A picture that waits for the odometer, and the wish to stop, are looked at so often [s]."""


@dataclass(frozen=True)
class _Look:
    """The last picture that was worked on.

    Attributes:
        time: its stamp, or that of the last report of silence after it [s].
        estimate: at the picture.
        belief: after the last look, at this picture or one before.
        since: (3,) motion between the two.
        saved: what a restart needs.
        ridden: (3,) motion from the picture to ``time``; readings older than that may be forgotten.
    """

    time: float
    estimate: Estimate
    belief: WeightedPoses
    since: Floats
    saved: SavedBelief
    ridden: Floats = field(default_factory=lambda: np.zeros(3))


class LiveLocalizer:
    """Takes pictures and odometry as they arrive, and reports where the robot is.

    ``on_odometry`` and ``on_image`` may be called from any thread; they neither wait nor raise, and what they cannot
    use they count. ``work`` and ``run`` are for one thread.

    Args:
        localizer: a fresh one; it is shown frames in the order of time.
        camera_pose: (3,) of the camera on the robot; heading = optical axis.
        lens: how the pictures are bent; None: not at all.
        camera: the pinhole camera that the pictures are of, once they are straightened.
        config: how patient it is.
        state: where the robot was when it was last at work; None: it may be anywhere.
        state_file: where to save that, every ``config.save_every_s`` and at the end of ``run``; None: nowhere.
        rng: the estimator's random numbers where it starts anew, from ``state`` or after a clock was set back.
        clock: of arrivals and of ``run`` [s].
    """

    def __init__(
        self,
        localizer: Localizer,
        camera_pose: ArrayLike,
        lens: Lens | None,
        camera: Camera,
        config: LiveConfig = LiveConfig(),  # noqa: B008 - frozen
        state: SavedBelief | None = None,
        *,
        state_file: Path | None = None,
        rng: np.random.Generator | int = 0,
        clock: Callable[[], float] = clocks.monotonic,
    ) -> None:
        self.config, self.clock, self.state_file = config, clock, state_file
        self.topo_map = localizer.topo_map
        self._localizer, self._camera_pose = localizer, np.array(camera_pose, dtype=np.float64)
        self._rng, self._state = np.random.default_rng(rng), state
        self._tally = Tally()
        self._mailbox, self._odometer = Mailbox(config, self._tally), Odometer(config, self._tally)
        self._pictures = Straightener(lens, camera, self.topo_map.camera)
        self._held: tuple[Letter, float] | None = None  # the picture that waits for its odometry, and since when
        self._working = False
        self._last: _Look | None = None
        self._told = -np.inf  # timestamp of the last report
        self._heard: tuple[int, float] | None = None  # how many pictures had come, and when the last did
        self._silence_told = -np.inf
        self._saved_at: float | None = None
        self._problem = ""

    def on_odometry(self, time: float, pose: ArrayLike) -> None:
        """A reading of the odometer: its raw pose (3,) [m, m, rad] at a time [s]. Late ones are sorted in."""
        self._odometer.add(time, pose)

    def on_image(self, time: float, data: ImageData, camera_pose: ArrayLike | None = None) -> None:
        """A picture, which from now on belongs to the localizer.

        One waits; a younger one takes its place.

        Args:
            time: when it was taken, on the odometry's clock [s].
            data: an encoded picture, one as uint8 (rows, cols[, 3]) in RGB order, or straightened ones by kind.
            camera_pose: (3,) of the camera on the robot, where a pan head turned it.
        """
        pose = self._camera_pose if camera_pose is None else np.array(camera_pose, dtype=np.float64)
        self._mailbox.put(Letter(time, data, pose, self.clock()))

    @property
    def counts(self) -> LiveCounts:
        """What became of the messages so far."""
        return self._tally.counts()

    @property
    def is_idle(self) -> bool:
        """Whether every picture that came was worked on."""
        return self._mailbox.is_empty and not self._working  # in this order: what is taken is being worked on

    def run(self, report: Callable[[LiveReport], None], stop: Event) -> None:
        """Work until ``stop`` is set, then save the belief. ``report`` is called in this thread."""
        try:
            while not stop.is_set():
                said = self.work(self.clock())
                if said is not None:
                    report(said)
                elif self._held is None:
                    self._mailbox.wait(POLL_S)
                else:
                    stop.wait(POLL_S / 4)
        finally:
            self.save_state()

    def work(self, now: float) -> LiveReport | None:
        """Work on one picture, if one waits and its odometry is there.

        Args:
            now: any clock that goes forward; messages may be stamped by another [s].

        Returns:
            None where there is nothing to say; while the camera is silent, a report of that every now and then.

        Raises:
            UserError: the first picture does not suit the map's camera or the lens.
        """
        self._working = True
        try:
            return self._work(now)
        finally:
            self._working = self._held is not None

    def _work(self, now: float) -> LiveReport | None:
        if self._held is None:
            letter = self._mailbox.take()
            self._held = None if letter is None else (letter, now)
        silent_s = self._silent_for(now)
        if self._held is None:
            return self._silence(silent_s, now)
        letter, since = self._held
        if self._odometer.is_worth_waiting_for(letter.time):
            if now - since < self.config.odometry_wait_s:
                return None
            self._odometer.alive = False  # until a reading comes, the next pictures do not wait for it
        self._held = None
        said = self._step(letter)
        self._save_now_and_then(now)
        return said

    def save_state(self) -> None:
        """Save the belief, if there is one and a place for it. Raises ``UserError`` where it cannot be written."""
        if self.state_file is not None and self._last is not None:
            save(self.state_file, self._last.saved, self.topo_map)

    def _silent_for(self, now: float) -> float:
        """Since when no new picture came, by the caller's clock [s]."""
        heard = self._mailbox.heard
        if self._heard is None or self._heard[0] != heard:
            self._heard, self._silence_told = (heard, now), -np.inf
        return now - self._heard[1]

    def _silence(self, silent_s: float, now: float) -> LiveReport | None:
        """A report that no picture comes, if that is so for long, and was not just told."""
        if silent_s < max(self.config.camera_silent_s, 1e-9):
            return None
        if now - self._silence_told < self.config.tell_silence_every_s:
            return None
        self._silence_told = now
        newest = self._odometer.newest()
        why = (
            f"the camera is silent for {silent_s:.1f} s" if self._mailbox.heard else f"no picture for {silent_s:.1f} s"
        )
        last = self._last or self._before_the_first(-np.inf if newest is None else newest[0])
        time = last.time if newest is None else max(newest[0], last.time)
        ridden = compose(last.ridden, self._odometer.between(last.time, time))
        if self._last is not None:
            self._last = replace(last, time=time, ridden=ridden)
        lost = replace(_carried(last.estimate, ridden, self._localizer), status=Status.LOST)
        return self._report(
            max(time, self._told), lost, why, replace(last, since=compose(last.since, ridden)), silent_s
        )

    def _before_the_first(self, time: float) -> _Look:
        """What is known before the first picture: the saved belief, or nothing."""
        belief = self._localizer.estimator.belief if self._state is None else self._state.belief
        estimate = estimate_from(belief, self.topo_map, rule=self._localizer.rule)
        if self._state is None:
            estimate = replace(estimate, node=None, probability=0.0)
        moment = time if np.isfinite(time) else 0.0
        return _Look(moment, estimate, belief, np.zeros(3), SavedBelief(belief, None, moment))

    def _step(self, letter: Letter) -> LiveReport:
        """Work on a picture."""
        reading = self._odometer.at(letter.time)
        words = [self._begin(letter, reading), reading.why]
        frame = Frame(letter.time, reading.pose, letter.camera, self._pictures.images(letter.time, letter.data))
        estimate = self._localizer.step(frame)
        step = self._localizer.last
        assert step is not None  # one was just made
        self._tally.add("used", *(["unreadable"] if step.kind == "unreadable" else []))
        words.append(step.problem if step.problem else "the picture says nothing" if step.kind == "blind" else "")
        self._last = self._looked(letter, reading, step)
        last, timestamp = self._last, letter.time
        if timestamp < self._told:  # silence was told of a later time
            timestamp, motion = self._told, self._odometer.between(letter.time, self._told)
            estimate = _carried(estimate, motion, self._localizer)
            last = replace(last, since=compose(last.since, motion))
        why = "; ".join(word for word in (*words, self._problem) if word)
        return self._report(timestamp, estimate, why, last, self.clock() - letter.arrived, step)

    def _begin(self, letter: Letter, reading: Reading) -> str:
        """Start the localizer from a belief, where there is a saved one or the pictures' clock was set back."""
        if letter.set_back and self._last is not None:
            self._tally.add("restarts")
            self._state, self._told = self._last.saved, -np.inf
        if self._state is None:
            return ""
        prior, how = self._state.prior(reading.raw, letter.time, self._localizer.noise)
        self._state, before = None, self._localizer
        self._localizer = Localizer(
            self.topo_map,
            _Fitted(before.sensor),
            before.estimator,
            rng=self._rng,
            prior=prior,
            gate=before.gate,
            noise=before.noise,
            upkeep=before.upkeep,
        )
        if letter.set_back:
            return f"the clock was set back by {letter.set_back:.1f} s: started anew from the belief, {how}"
        return f"started from the saved belief, {how}"

    def _looked(self, letter: Letter, reading: Reading, step: Step) -> _Look:
        """What is remembered of a picture: within the motion gate the belief stays that of the last look."""
        if step.kind == "gated" and self._last is not None:
            since = between(self._last.estimate.pose, step.estimate.pose)
            since = compose(self._last.since, since)
            return replace(self._last, time=letter.time, estimate=step.estimate, since=since, ridden=np.zeros(3))
        belief = self._localizer.estimator.belief
        return _Look(letter.time, step.estimate, belief, np.zeros(3), SavedBelief(belief, reading.raw, letter.time))

    def _report(
        self, timestamp: float, estimate: Estimate, why: str, look: _Look, seconds: float, step: Step | None = None
    ) -> LiveReport:
        self._told = timestamp
        node_id = None if estimate.node is None else self.topo_map.nodes[estimate.node].id
        return LiveReport(
            timestamp, estimate, estimate.status, why, look.belief, look.since, node_id, self.counts, seconds, step
        )

    def _save_now_and_then(self, now: float) -> None:
        """A robot that runs must not stop because a disk is full: the next reports tell it."""
        if self._saved_at is not None and now - self._saved_at < self.config.save_every_s:
            return
        self._saved_at = now
        try:
            self.save_state()
            self._problem = ""
        except UserError as error:
            self._tally.add("unsaved")
            self._problem = f"the belief is not saved: {error}"


class _Fitted:
    """A sensor that was fitted to the map already, for a localizer that starts anew."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor, self.needs = sensor, sensor.needs

    def fit(self, topo_map: TopoMap) -> None:
        """It was."""

    def observe(self, frame: Frame) -> Evidence:
        return self._sensor.observe(frame)


def _carried(estimate: Estimate, motion: Floats, localizer: Localizer) -> Estimate:
    """An estimate that rides on a motion (3,), and is the less sure of its pose."""
    if not motion.any():
        return estimate
    noise = localizer.noise.motion(np.zeros(3), motion).covariance
    return replace(estimate, pose=compose(estimate.pose, motion), covariance=estimate.covariance + noise)
