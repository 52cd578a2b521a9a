"""The live localizer: whatever order messages come in, whatever is missing. Times are the tests' own."""

from __future__ import annotations

import io
import threading
from collections.abc import Sequence
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image as Pictures

from topoloc.errors import UserError
from topoloc.geometry import compose
from topoloc.lens import Lens
from topoloc.live.engine import LiveConfig, LiveLocalizer, LiveReport
from topoloc.live.saved_belief import SavedBelief, load, save
from topoloc.localizer import Localizer
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Frame, Image, Motion, Status, WeightedPoses

CAMERA = Camera(60.0, 8, 6)
NO_ODOMETER = LiveConfig(odometry_wait_s=0.0)
THE_MAP = TopoMap("toy", CAMERA, tuple(Node(f"N{i}", f"place {i}", float(i), 0.0) for i in range(6)))
MOUNT = np.zeros(3)
SIDEWAYS = np.array([0.0, 0.0, np.pi / 2])


class GreySensor:
    """A picture of grey level 10 k was taken at node k; black says nothing."""

    needs = frozenset({"rgb"})

    def __init__(self) -> None:
        self.fitted, self.seen = 0, [np.zeros(0)]

    def fit(self, topo_map: TopoMap) -> None:
        self.fitted += 1

    def observe(self, frame: Frame) -> Evidence:
        image = frame.images["rgb"]
        node, one = int(image.flat[0]) // 10, np.ones(1)
        self.seen.append(image)
        if not image.any():
            return Evidence.blind()
        pose = np.array([[float(node), 0.0, frame.camera[2]]])
        return Evidence(pose, np.array([node]), 0.9 * one, 0.1 * one, 2.0 * one, 0.3 * one, 20.0 * one)


class Believer:
    """Believes the last evidence, carried and widened by every motion since."""

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        self.prior = prior
        self._belief = WeightedPoses.uniform(np.zeros((1, 3))) if prior is None else prior

    def predict(self, motion: Motion) -> None:
        moved = compose(self._belief.poses, motion.delta)
        self._belief = WeightedPoses(moved, self._belief.log_weights, self._belief.spread + np.diag(motion.covariance))

    def update(self, evidence: Evidence) -> float | None:
        if evidence.is_blind:
            return None
        self._belief = WeightedPoses.uniform(evidence.poses, (0.01, 0.01, 0.01))
        return 0.0

    @property
    def belief(self) -> WeightedPoses:
        return self._belief


def made(config: LiveConfig = LiveConfig(), state: SavedBelief | None = None, **more: object) -> LiveLocalizer:  # noqa: B008
    localizer = Localizer(THE_MAP, GreySensor(), Believer())
    return LiveLocalizer(localizer, MOUNT, None, CAMERA, config, state, clock=lambda: 0.0, **more)  # type: ignore[arg-type]


def at_node(node: int) -> Image:
    return np.full((6, 8, 3), 10 * node, dtype=np.uint8)


def encoded(node: int) -> bytes:
    buffer = io.BytesIO()
    Pictures.fromarray(at_node(node)).save(buffer, "PNG")
    return buffer.getvalue()


def pose(x: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([x, 0.0, 0.0])


def said(live: LiveLocalizer, now: float) -> LiveReport:
    report = live.work(now)
    assert report is not None
    return report


def drive(live: LiveLocalizer, nodes: Sequence[int], start: float = 0.0, step: float = 1.0) -> list[LiveReport]:
    """Drive from node to node, a second each, with odometry that is right."""
    reports = []
    for i, node in enumerate(nodes):
        time = start + step * i
        live.on_odometry(time, pose(node))
        live.on_image(time, at_node(node))
        reports.append(said(live, time))
    return reports


def test_a_drive() -> None:
    live = made()
    reports = drive(live, [1, 2, 3])
    assert [report.node_id for report in reports] == ["N1", "N2", "N3"]
    assert [report.timestamp for report in reports] == [0.0, 1.0, 2.0]
    assert {report.status for report in reports} == {Status.LOCALIZED} and {report.why for report in reports} == {""}
    assert reports[-1].estimate.pose == pytest.approx([3.0, 0.0, 0.0])
    assert reports[-1].belief.poses[0] == pytest.approx([3.0, 0.0, 0.0])
    assert live.work(2.1) is None
    assert (reports[-1].counts.frames, reports[-1].counts.used, reports[-1].counts.odometry) == (3, 3, 3)


def test_encoded_pictures_are_the_same() -> None:
    live = made(NO_ODOMETER)
    live.on_image(0.0, encoded(4))
    assert said(live, 1.0).node_id == "N4"


class TestMailbox:
    def test_the_youngest_picture_takes_the_place_of_those_that_wait(self) -> None:
        live = made()
        for time in (0.0, 0.1, 0.2):
            live.on_odometry(time, pose(0.0))
        for time, node in ((0.0, 1), (0.2, 3), (0.1, 2)):
            live.on_image(time, at_node(node))
        report = said(live, 5.0)
        assert (report.node_id, report.timestamp) == ("N3", 0.2)
        assert live.work(5.0) is None
        assert (report.counts.frames, report.counts.dropped, report.counts.used) == (3, 2, 1)

    def test_what_is_not_younger_than_the_last_is_late(self) -> None:
        live = made()
        drive(live, [1, 2])
        for time in (0.5, 1.0):
            live.on_image(time, at_node(5))
        assert live.work(1.1) is None and live.counts.late == 2

    def test_a_rate_passes_over_what_comes_sooner(self) -> None:
        live = made(LiveConfig(most_hz=2.0))
        used = []
        for i in range(10):
            live.on_odometry(0.1 * i, pose(0.1 * i))
            live.on_image(0.1 * i, at_node(1))
            report = live.work(0.1 * i)
            used += [] if report is None else [report.timestamp]
        assert used == [0.0, 0.5] and live.counts.skipped == 8

    def test_a_time_that_is_none_is_counted(self) -> None:
        live = made()
        live.on_image(np.nan, at_node(1))
        assert live.work(0.0) is None and live.counts.bad == 1


class TestOdometry:
    def test_a_picture_waits_for_the_reading_after_it_but_not_for_ever(self) -> None:
        live = made()
        live.on_odometry(0.0, pose(0.0))
        live.on_image(0.1, at_node(1))
        assert live.work(10.0) is None and not live.is_idle
        live.on_image(0.15, at_node(2))
        live.on_odometry(0.2, pose(0.2))
        assert said(live, 10.05).timestamp == 0.1
        assert said(live, 10.05).timestamp == 0.15
        live.on_image(0.3, at_node(3))
        assert live.work(10.1) is None and live.work(10.29) is None
        assert said(live, 10.31).timestamp == 0.3
        live.on_image(0.35, at_node(4))
        assert said(live, 10.31).timestamp == 0.35, "an odometer that kept one waiting in vain keeps no other"

    def test_without_an_odometer_it_does_not_matter(self) -> None:
        live = made()
        live.on_image(0.0, at_node(1))
        assert live.work(0.0) is None
        assert said(live, 0.2).why == ""
        live.on_image(0.3, at_node(2))
        assert (said(live, 0.3).node_id, live.counts.odometry) == ("N2", 0)

    def test_one_that_went_silent_is_told(self) -> None:
        live = made()
        drive(live, [1, 2])
        live.on_image(2.0, at_node(3))
        report = said(live, 2.0)
        assert (report.node_id, report.status) == ("N3", Status.LOCALIZED)
        assert (
            report.why
            == "no odometry: the nearest reading is 1.0 s older than the picture (live.odometry_wait_s is 0.2)"
        )

    def test_one_that_lags_too_far_is_not_waited_for(self) -> None:
        live = made()
        for i in range(20):
            live.on_odometry(0.1 * i, pose(0.0))
            live.on_image(0.1 * i + 0.4, at_node(1))
            assert said(live, 0.1 * i).timestamp == 0.1 * i + 0.4

    def test_a_reset_is_an_unknown_motion_once(self) -> None:
        live = made()
        drive(live, [4, 5])
        live.on_odometry(2.0, pose(-20.0))
        live.on_image(2.0, at_node(0))
        report = said(live, 2.0)
        assert "jumped by 25.0 m: the motion meanwhile is unknown" in report.why and report.counts.jumps == 1
        assert report.estimate.pose == pytest.approx([5.0, 0.0, 0.0]), "nor does a blind picture move it"
        live.on_odometry(3.0, pose(-20.5))
        live.on_image(3.0, at_node(0))
        assert said(live, 3.0).estimate.pose == pytest.approx([4.5, 0.0, 0.0])

    def test_within_the_gate_pose_and_belief_ride_on_it(self) -> None:
        live = made()
        drive(live, [2])
        for time, x in ((1.0, 2.1), (2.0, 2.2)):
            live.on_odometry(time, pose(x))
            live.on_image(time, at_node(5))
            report = said(live, time)
        assert report.step is not None and report.step.kind == "gated"
        assert report.estimate.pose == pytest.approx([2.2, 0.0, 0.0])
        assert report.belief.poses[0] == pytest.approx([2.2, 0.0, 0.0])


class TestSilence:
    def test_a_silent_camera_turns_the_status_and_the_pose_rides_on(self) -> None:
        live = made()
        drive(live, [1])
        live.on_odometry(2.5, pose(1.8))
        assert live.work(1.9) is None
        report = said(live, 2.5)
        assert (report.status, report.estimate.status) == (Status.LOST, Status.LOST)
        assert report.why == "the camera is silent for 2.5 s"
        assert (report.timestamp, report.step) == (2.5, None)
        assert report.estimate.pose == pytest.approx([1.8, 0.0, 0.0]) and report.node_id == "N1"
        assert report.belief.poses[0] == pytest.approx([1.8, 0.0, 0.0])
        assert report.estimate.covariance[0, 0] > 0.01
        assert live.work(2.6) is None, "told a moment ago"
        assert said(live, 3.6).why == "the camera is silent for 3.6 s"
        live.on_odometry(4.0, pose(3.0))
        live.on_image(4.0, at_node(3))
        back = said(live, 4.0)
        assert (back.status, back.why, back.node_id) == (Status.LOCALIZED, "", "N3")
        assert live.work(5.9) is None, "silence is counted from the last picture"

    def test_it_rides_on_longer_than_readings_are_kept(self) -> None:
        live = made(LiveConfig(odometry_keep_s=5.0))
        drive(live, [1])
        found = []
        for second in range(1, 21):
            live.on_odometry(float(second), pose(1.0 + 0.1 * second))
            report = live.work(float(second))
            found += [] if report is None else [(report.estimate.pose[0], report.belief.poses[0, 0])]
        assert found == [pytest.approx((1.0 + 0.1 * second,) * 2) for second in range(2, 21)]
        live.on_odometry(21.0, pose(3.1))
        live.on_image(21.0, at_node(3))
        assert said(live, 21.0).estimate.pose == pytest.approx([3.0, 0.0, 0.0]), "as the picture says"

    def test_a_picture_within_the_gate_after_it_is_not_moved_twice(self) -> None:
        live = made()
        drive(live, [1])
        for second in (3.0, 4.0):
            live.on_odometry(second, pose(1.2))
            assert said(live, second).belief.poses[0] == pytest.approx([1.2, 0.0, 0.0])
        live.on_odometry(5.0, pose(1.25))
        live.on_image(5.0, at_node(1))
        report = said(live, 5.0)
        assert report.step is not None and report.step.kind == "gated"
        assert report.belief.poses[0] == pytest.approx([1.25, 0.0, 0.0])
        live.on_odometry(8.0, pose(1.3))
        assert said(live, 8.0).belief.poses[0] == pytest.approx([1.3, 0.0, 0.0])

    def test_a_jump_of_the_odometer_is_left_out_and_what_follows_counts(self) -> None:
        live = made()
        drive(live, [1])
        for second, x, wanted in ((3.0, 1.5, 1.5), (4.0, 50.0, 1.5), (5.0, 50.4, 1.9)):
            live.on_odometry(second, pose(x))
            assert said(live, second).estimate.pose[0] == pytest.approx(wanted)

    def test_no_picture_ever(self) -> None:
        live = made()
        assert live.work(100.0) is None
        report = said(live, 102.0)
        assert (report.status, report.node_id, report.why) == (Status.LOST, None, "no picture for 2.0 s")

    def test_the_same_picture_again_and_again_is_silence(self) -> None:
        live = made()
        drive(live, [1])
        for now in (0.5, 1.0, 1.5):
            live.on_image(0.0, at_node(1))
            assert live.work(now) is None
        assert said(live, 2.0).status is Status.LOST

    def test_a_picture_from_before_the_silence_was_told_does_not_turn_time_back(self) -> None:
        live = made()
        drive(live, [1])
        live.on_odometry(3.0, pose(2.5))
        assert said(live, 3.0).timestamp == 3.0
        live.on_odometry(2.0, pose(2.0))
        live.on_image(2.0, at_node(2))
        report = said(live, 3.1)
        assert report.step is not None and (report.timestamp, report.step.timestamp) == (3.0, 2.0)
        assert report.estimate.pose == pytest.approx([2.5, 0.0, 0.0])
        assert report.belief.poses[0] == pytest.approx([2.5, 0.0, 0.0])
        assert report.step.estimate.pose == pytest.approx([2.0, 0.0, 0.0])


class TestPictures:
    def test_what_does_not_decode_is_blind_and_counted(self) -> None:
        live = made()
        drive(live, [1, 2])
        for i, data in enumerate((b"", b"hello", encoded(3)[:45], np.zeros((6, 8), np.float32), np.zeros(0, np.uint8))):
            live.on_odometry(2.0 + i, pose(3.0 + i))
            live.on_image(2.0 + i, data)  # type: ignore[arg-type]
            report = said(live, 2.0 + i)
            assert report.counts.unreadable == i + 1 and report.why
        assert drive(live, [3], start=9.0)[0].node_id == "N3"

    def test_the_first_of_another_shape_is_the_users_mistake_a_later_one_a_bad_picture(self) -> None:
        live = made(NO_ODOMETER)
        live.on_image(0.0, np.full((8, 8, 3), 10, np.uint8))
        with pytest.raises(UserError, match=r"is 8x8, but the map's camera has 8x6.*; set the camera"):
            live.work(1.0)
        live = made(NO_ODOMETER)
        drive(live, [1])
        live.on_image(1.0, np.full((8, 8, 3), 10, np.uint8))
        assert "is 8x8" in said(live, 9.0).why

    def test_the_lens_is_taken_out_and_the_mount(self) -> None:
        sensor = GreySensor()
        lens = Lens("pinhole", 6.93, 6.93, 3.5, 2.5, (0.8, 0.0, 0.0, 0.0))
        live = LiveLocalizer(
            Localizer(THE_MAP, sensor, Believer()), SIDEWAYS, lens, CAMERA, NO_ODOMETER, clock=lambda: 0.0
        )
        picture = np.random.default_rng(0).integers(0, 256, (6, 8, 3)).astype(np.uint8)
        live.on_image(0.0, picture)
        said(live, 1.0)
        assert np.array_equal(sensor.seen[-1], lens.straighten(picture, CAMERA))
        assert not np.array_equal(sensor.seen[-1], picture)
        live.on_image(1.0, at_node(2))
        assert said(live, 1.0).estimate.pose[2] == pytest.approx(0.0), "the camera looks sideways, not the robot"

    def test_a_pan_head_may_turn_the_camera(self) -> None:
        live = made(NO_ODOMETER)
        live.on_image(0.0, at_node(2), SIDEWAYS)
        assert said(live, 1.0).estimate.pose[2] == pytest.approx(0.0)

    def test_straightened_pictures_by_kind_pass_through(self) -> None:
        live = made(NO_ODOMETER)
        live.on_image(0.0, {"rgb": np.full((3, 3), 40, np.uint8)})
        assert said(live, 1.0).node_id == "N4"


class TestClock:
    def test_a_clock_that_was_set_back_starts_anew_from_the_belief(self) -> None:
        live = made()
        drive(live, [1, 2], start=100.0)
        for time in (1.0, 1.1):
            live.on_odometry(time, pose(2.0))
            live.on_image(time, at_node(0))
            assert live.work(101.0 + time) is None
        live.on_odometry(1.2, pose(2.0))
        live.on_image(1.2, at_node(0))
        report = said(live, 103.0)
        assert "the clock was set back by 99.8 s: started anew from the belief" in report.why
        assert (report.timestamp, report.node_id, report.status) == (1.2, "N2", Status.LOCALIZED)
        assert report.counts.restarts == 1
        assert drive(live, [3, 4], start=2.0)[-1].node_id == "N4"

    def test_the_sensor_is_not_fitted_again(self) -> None:
        sensor = GreySensor()
        live = LiveLocalizer(Localizer(THE_MAP, sensor, Believer()), MOUNT, None, CAMERA, clock=lambda: 0.0)
        for start in (100.0, 50.0, 10.0):
            for i in range(4):
                live.on_image(start + i, at_node(1))
                live.work(start)
                live.work(start + 1.0)
        assert (live.counts.restarts, sensor.fitted) == (2, 1)

    def test_late_pictures_are_no_clock(self) -> None:
        live = made()
        drive(live, [1, 2, 3], start=100.0)
        for late in (95.0, 94.0, 93.0):
            live.on_image(late, at_node(0))
        for late, node in ((95.0, 4), (96.0, 5)):
            drive(live, [node], start=late + 8.0)
            live.on_image(late, at_node(0))
            assert live.work(104.0) is None
        assert live.counts.restarts == 0 and live.counts.late == 5


BASE = [(0.1 * i, 0.3 * i) for i in range(20)]
"""Times and positions of a drive: there is a picture at each, and odometry at each and half way to the next."""


@given(st.data())
@settings(max_examples=20, deadline=None)
def test_no_order_delay_repetition_or_loss_does_harm(data: st.DataObject) -> None:
    live = made()
    messages = [("image", time, x) for time, x in BASE] + [("odometry", time, x) for time, x in BASE]
    messages += [("odometry", time + 0.05, x + 0.15) for time, x in BASE]
    fates = data.draw(st.lists(st.sampled_from([0, 1, 1, 1, 2]), min_size=len(messages), max_size=len(messages)))
    arrivals = [
        (time + data.draw(st.floats(0.0, 1.5)), kind, time, x)
        for (kind, time, x), copies in zip(messages, fates, strict=True)
        for _ in range(copies)
    ]
    reports = []
    for now, kind, time, x in sorted(arrivals):
        live.on_image(time, at_node(1)) if kind == "image" else live.on_odometry(time, pose(x))
        reports += [live.work(now)]
    reports += [live.work(10.0 + 0.3 * i) for i in range(8)]
    times = [report.timestamp for report in reports if report is not None]
    assert times == sorted(times)
    counts = live.counts
    assert counts.frames == counts.used + counts.dropped + counts.late and counts.jumps == counts.restarts == 0
    assert live.is_idle


@given(st.randoms(use_true_random=False))
@settings(max_examples=8, deadline=None)
def test_odometry_in_any_order_before_its_picture_gives_the_same_answers(random: object) -> None:
    def answers(shuffled: bool) -> list[tuple[float, ...]]:
        live, found = made(), []
        readings = [(time + 0.02 * k, x + 0.05 * k) for time, x in BASE for k in range(5)]
        for time, x in BASE:
            batch = [reading for reading in readings if reading[0] <= time + 0.081]
            readings = [reading for reading in readings if reading[0] > time + 0.081]
            if shuffled:
                batch = batch + batch[::2]
                random.shuffle(batch)  # type: ignore[attr-defined]
            for reading in batch:
                live.on_odometry(reading[0], pose(reading[1]))
            live.on_image(time + 0.033, at_node(round(x) % 6))
            report = said(live, time)
            found.append((report.timestamp, *report.estimate.pose, *report.estimate.covariance.flat))
        return found

    assert answers(shuffled=True) == answers(shuffled=False)


class TestState:
    def test_a_restart_comes_back_from_its_saved_belief(self, tmp_path: Path) -> None:
        path = tmp_path / "deep" / "belief"
        drive(made(state_file=path), [1, 2])
        saved = load(path, THE_MAP)
        assert saved is not None and saved.time == 0.0, "the next is due in five seconds"
        live = made(LiveConfig(save_every_s=0.0), saved, state_file=path)
        live.on_odometry(8.0, pose(3.0))
        live.on_image(8.0, at_node(0))
        report = said(live, 0.0)
        assert report.why == "started from the saved belief, moved by the odometry since; the picture says nothing"
        assert (report.node_id, report.estimate.pose[0], report.status) == ("N3", 3.0, Status.LOCALIZED)
        again = load(path, THE_MAP)
        assert again is not None and (again.time, again.odometry is not None) == (8.0, True)

    def test_before_the_first_picture_it_is_lost_where_it_was(self) -> None:
        saved = SavedBelief(WeightedPoses.uniform(np.array([[4.0, 0.0, 0.0]])), None, 0.0)
        live = made(state=saved)
        live.work(0.0)
        report = said(live, 3.0)
        assert (report.status, report.node_id, report.estimate.pose[0]) == (Status.LOST, "N4", 4.0)

    def test_run_saves_at_its_end_and_hands_on_what_it_says(self, tmp_path: Path) -> None:
        live, stop, reports = made(state_file=tmp_path / "belief"), threading.Event(), []
        live.on_odometry(0.0, pose(1.0))
        live.on_image(0.0, at_node(1))

        def report(said: LiveReport) -> None:
            reports.append(said)
            (tmp_path / "belief").unlink()
            stop.set()

        live.run(report, stop)
        assert [one.node_id for one in reports] == ["N1"] and (tmp_path / "belief").exists()

    def test_a_full_disk_stops_no_robot(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        live = made(LiveConfig(save_every_s=0.0), state_file=tmp_path / "file" / "belief")
        reports = drive(live, [1, 2])
        assert "the belief is not saved" in reports[1].why and reports[1].counts.unsaved == 1
        assert reports[1].status is Status.LOCALIZED

    def test_what_is_written_is_what_was_believed(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(0)
        belief = WeightedPoses(rng.normal(size=(50, 3)), rng.normal(size=50), np.array([0.1, 0.2, 0.3]))
        saved = SavedBelief(belief, np.array([1.0, 2.0, 3.0]), 12.5)
        save(tmp_path / "belief", saved, THE_MAP)
        back = load(tmp_path / "belief", THE_MAP)
        assert back is not None and back.time == 12.5 and np.array_equal(back.belief.spread, belief.spread)
        assert sorted(map(tuple, back.belief.poses)) == sorted(map(tuple, belief.poses))
        assert back.odometry is not None and back.odometry.tolist() == [1.0, 2.0, 3.0]
        save(tmp_path / "belief", replace(saved, odometry=None), THE_MAP)
        back = load(tmp_path / "belief", THE_MAP)
        assert back is not None and back.odometry is None
        assert [path.name for path in tmp_path.iterdir()] == ["belief"]


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match=r"camera_silent_s is -1\.0"):
        LiveConfig(camera_silent_s=-1.0)


def test_counts_are_all_there() -> None:
    assert set(astuple(made().counts)) == {0}
