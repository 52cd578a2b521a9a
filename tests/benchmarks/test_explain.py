"""``topoloc explain``: the thesis's Table 5.7 as it prints it, every estimator, what is drawn, and what is refused."""

from __future__ import annotations

import io
import json
import shutil
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from rich.console import Console

from benchmarks import replay
from benchmarks.choice import Choice, suite_of
from benchmarks.cli.explain import explain
from benchmarks.explanation import Explanation, Rerun, draw_explanation, print_explanation, run_again
from benchmarks.explanation import explain as explain_step
from benchmarks.explanation.explanation import led_to, shares_of
from benchmarks.results import ResultsFile
from benchmarks.run_files import steps_path
from benchmarks.runner import run_suite
from benchmarks.scenarios import Case
from benchmarks.workers import in_processes
from estimators.activity import ActivityTracker, Hypotheses, action_model
from sensors.images import cut_views
from topoloc.errors import InputError, OutputExists, UnknownName, UserError
from topoloc.files import pictures_in, read_image
from topoloc.geometry import compose
from topoloc.localizer import Localizer
from topoloc.plugins import ESTIMATORS, make_estimator, make_sensor, names
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Evidence, Frame, Image, Motion, WeightedPoses

CAMERA = Camera(40.0, 96, 72)
NAN = float("nan")
DRIVE = ((0, 0, 0.0), (0, 2, 0.0), (1, 2, 0.0), (1, 2, 0.05), (1, 4, 0.0), (2, 4, 0.0), (2, 6, 0.0))
"""Node, which of its 24 views, metres on from the node; the frame GATED lies within the motion gate."""
UNREADABLE, GATED, BLACK, LAST = 1, 3, 5, 6
SENSORS = ("ima", "histogram", "ima-robust+histogram", "fourier")


def circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


def noise_map() -> TopoMap:
    return TopoMap("tiny", CAMERA, tuple(Node(f"N{k}", f"place {k}", float(k), 0.5, 1.0, circle(k)) for k in range(3)))


def noise_drive(topo_map: TopoMap) -> list[tuple[Frame, np.ndarray]]:
    """Frames and true poses; one frame is black."""
    driven = []
    for time, (index, view, ahead) in enumerate(DRIVE):
        node = topo_map.nodes[index]
        assert node.panorama is not None
        image, heading = cut_views(node.panorama, node.heading, CAMERA)[view]
        truth = np.array([node.x + ahead, node.y, heading])
        picture = np.zeros_like(image) if time == BLACK else image
        driven.append((Frame(10.0 + time, compose((3.0, -2.0, 2.0), truth), np.zeros(3), {"rgb": picture}), truth))
    return driven


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a benchmark run: a tiny recorded drive, every estimator, two seeds."""
    folder = tmp_path_factory.mktemp("explained")
    noise_map().save(folder / "tiny" / "map")
    writer = RecordingWriter(folder / "tiny" / "recording", CAMERA)
    for frame, truth in noise_drive(noise_map()):
        writer.add(frame, truth)
    writer.close()
    pictures_in(folder / "tiny" / "recording" / "rgb")[UNREADABLE].write_text("no picture")
    choice = Choice((str(folder / "tiny"),), SENSORS, tuple(names(ESTIMATORS)), seeds=2, updates=1)
    place = folder / "run"
    place.mkdir()
    (place / "config.toml").write_text(tomli_w.dumps({"run": asdict(choice)}))
    with ResultsFile(place / "results.csv") as results:
        run_suite(suite_of(choice), results, partial(in_processes, jobs=1))
    return place


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of the time goes into the picture."""
    monkeypatch.setattr("benchmarks.cli.explain._draw", lambda path, again, told: None)


def again(run: Path, sensor: str, estimator: str, frame: int) -> Rerun:
    from benchmarks.choice import read_choice

    return run_again(suite_of(read_choice(run)), ("tiny", sensor, estimator, 0), frame)


def printed(told: Explanation) -> str:
    text = io.StringIO()
    print_explanation(told, Console(file=text, width=80, markup=False, emoji=False, highlight=False))
    return text.getvalue()


def cells(text: str) -> list[list[str]]:
    return [line.split() for line in text.splitlines()]


def table_5_7() -> ActivityTracker:
    """The tracker after the step of Table 5.7; the deviations of the headings as in ``test_activity.py``."""
    places = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0), (0.0, 1.0), (-1.0, 1.0), (-1.0, 0.0)]
    nodes = tuple(Node(str(k), str(k), x, y) for k, (x, y) in enumerate(places, start=1))
    tracker = ActivityTracker()
    tracker.reset(TopoMap("lab", Camera(), nodes), np.random.default_rng(0))
    activity, virtual = np.array([0.470396, 0.529604]), np.array([False, True])
    start = Hypotheses(np.zeros(2, dtype=np.int64), np.zeros(2), np.full(2, NAN), activity, virtual)
    tracker.restore(start, 1, np.deg2rad(9.5181776))
    tracker.predict(Motion(np.array([0.0, 0.0, np.deg2rad(30.0)]), np.eye(3) * 1e-4))
    match = np.array([0.611119, 0.65027])
    poses = np.array([[0.0, 0.0, np.deg2rad(39.180505)], [1.0, 0.0, np.deg2rad(40.0)]])
    tracker.update(Evidence(poses, np.arange(2), match, 1.0 - match, match, np.full(2, 0.4), np.full(2, 20.0)))
    return tracker


def told_of(account: replay.Account, **changes: Any) -> Explanation:
    """An explanation around an account, in a laboratory of eight nodes."""
    answer = replay.Answer("update", 0.0, 0.0, 39.2, 0, 0.7, "LOCALIZED", True, [], account)
    parts: dict[str, Any] = {
        "scenario": "lab",
        "sensor": "ima",
        "estimator": "activity",
        "seed": 0,
        "recorded": True,
        "frame": 4,
        "frames": 9,
        "last_update": 4,
        "nodes": [str(k) for k in range(1, 9)],
        "answer": answer,
        "truth": (0.0, 0.0, 40.0),
        "true_node": 0,
        "error_m": 0.0,
        "error_deg": 0.8,
        "verdict": "right",
        "look": replay.Look(4, [replay.Hypothesis(1, 0.6503, 2.0, 1.0, 0.0, 40.0)], [], ""),
        "shown": [0, 1],
        "shares": shares_of(WeightedPoses.uniform(np.zeros((1, 3))), np.zeros(1, dtype=np.int64)),
        "led": led_to(account, 1.0),
    }
    return Explanation(**(parts | changes))


def test_it_prints_the_numbers_of_table_5_7() -> None:
    account = replay.account_of(table_5_7())
    assert account is not None
    lines = cells(printed(told_of(account)))
    start = next(k for k, line in enumerate(lines) if line[:1] == ["origin"])
    first, second, third = lines[start + 2 : start + 5]
    assert (first[0], first[2], first[3:5]) == ("1", "0.4704", ["1", "*"])  # the winner is marked
    assert (first[6], first[8]) == ("0.6111", "0.4185")
    assert (second[0], second[2], second[3]) == ("1v", "0.5296", "2")
    assert (second[5], second[7]) == ("0.6503", "0.2497")
    assert (third[0], third[2], third[4]) == ("1v", "0.5000", "0.3318")
    deviations = next(k for k, line in enumerate(lines) if line[:2] == ["destination", "from"])
    assert lines[deviations + 2] == ["1", "*", "0.00", "m", "9.2°", "0.00", "m", "9.2°"]
    assert lines[deviations + 3] == ["2", "1.00", "m", "10.0°", "1.00", "m", "10.0°"]


def test_where_origins_and_odometry_lead_is_the_prediction_of_3_22() -> None:
    tracker = table_5_7()
    account, step = replay.account_of(tracker), tracker.last
    assert account is not None and step is not None
    predicted = action_model(step.delta_l, step.delta_phi) @ step.origins.activity
    np.testing.assert_allclose(led_to(account, 1.0), predicted / predicted.sum(), atol=2e-4)


def test_where_they_lead_is_the_prediction_whatever_power_of_the_match_counts() -> None:
    """(3.23) with a power of the match: activity = match ** power * prediction, made one."""
    predicted, match, power = np.array([0.5, 0.3, 0.2]), np.array([0.6, 0.8, 0.5]), 3.0
    activity = match**power * predicted / np.sum(match**power * predicted)
    lines = [replay.Line(k, 0.0, float(match[k]), float(activity[k]), False) for k in range(3)]
    account = replay.Account("normal", lines, lines, 1, [[0.0] * 3] * 3, [[0.0] * 3] * 3)
    np.testing.assert_allclose(led_to(account, power), predicted, atol=1e-4)


def test_what_came_of_it_is_told() -> None:
    account = replay.account_of(table_5_7())
    assert account is not None
    assert "matched destination won" in printed(told_of(account))
    other = replace(told_of(account).answer, node=1)
    assert "names another node" in printed(told_of(account, answer=other))
    none = replace(account, kind="supposed", destinations=[], winner=None, delta_l=[], delta_phi_deg=[])
    text = printed(told_of(none))
    assert "supposed from the odometry" in text
    assert "Deviations" not in text


def test_only_the_most_active_are_printed() -> None:
    account = replay.account_of(table_5_7())
    assert account is not None
    line = account.origins[0]
    many = [replace(line, node=k % 8, activity=0.001 * k) for k in range(14)]
    wide = replace(account, origins=many, delta_l=[[14.531] * 14] * 3, delta_phi_deg=[[177.8] * 14] * 3)
    text = printed(told_of(wide))
    assert "Less active origins left out: 4." in text  # of the table
    assert "Less active origins left out: 10." in text  # of the deviations
    assert "destinations left out" not in text
    assert "0.0040" in text and "0.0030" not in text
    assert ["1", "*", *["14.53", "m", "177.8°"] * 4] in cells(text)  # as wide as a terminal may need


def test_a_belief_is_shared_out_by_nearest_node() -> None:
    belief = WeightedPoses(np.zeros((4, 3)), np.log([0.4, 0.3, 0.2, 0.1]))
    shares = shares_of(belief, np.array([2, 0, 2, 5]))
    assert [(one.node, one.share) for one in shares] == [(2, 0.6), (0, 0.3), (5, 0.1)]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("estimator", names(ESTIMATORS))
def test_every_estimator_is_explained_and_answers_as_in_the_run(
    estimator: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    explain(run, step=LAST, estimator=estimator, seed=1)
    out, err = capsys.readouterr()
    assert err == ""  # else it would have differed
    assert f"tiny (recorded), ima with {estimator}, seed 1: frame 6 of 0 to 6" in out
    assert "The first of the run was taken, since not named: --scenario, --sensor." in out
    assert "The frame's slots on the panorama of node" in out
    assert "The belief by nearest node" in out
    assert ("Table 5.7" in out) == (estimator in ("activity", "activity-offset"))


def test_the_picture_lies_in_the_folder_or_where_it_was_asked_for(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    explain(run, step=2)
    path = run / "explain-tiny-ima-activity-0-2.png"
    assert capsys.readouterr().out.endswith(f"{path}\n")
    assert read_image(path).shape[1] == 1210
    chosen = tmp_path / "why.png"
    chosen.write_text("mine")
    with pytest.raises(OutputExists):
        explain(run, step=2, output=chosen)
    assert chosen.read_text() == "mine"
    explain(run, step=2, output=chosen, overwrite=True)
    assert chosen.read_bytes() == path.read_bytes()
    with pytest.raises(UserError, match=r"end the name in \.png"):
        explain(run, step=2, output=tmp_path / "why.pdf")


@pytest.mark.usefixtures("undrawn")
def test_json_holds_what_the_tables_show(run: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    explain(run, step=2, as_json=True, output=tmp_path / "a.png")
    told = json.loads(capsys.readouterr().out)
    assert (told["scenario"], told["sensor"], told["frame"], told["frames"]) == ("tiny", "ima", 2, 7)
    assert (told["answer"]["node"], told["true_node"], told["verdict"]) == (1, 1, "right")
    assert told["shown"][0] == 1
    assert [slots["node"] for slots in told["look"]["slots"]] == told["shown"]
    assert len(told["look"]["slots"][0]["value"]) == 8
    account = told["answer"]["account"]
    assert len(account["delta_l"]) == len(account["destinations"]) == len(told["led"])
    assert told["picture"] == str(tmp_path / "a.png")


def test_a_gated_frame_says_so_and_names_the_last_update(run: Path) -> None:
    told = explain_step(again(run, "ima", "activity", GATED))
    assert (told.look, told.verdict, told.last_update) == (None, "", GATED - 1)
    text = printed(told)
    assert "no look was taken" in text
    assert f"The last update was frame {GATED - 1}" in text
    assert "Table 5.7" not in text


def test_a_covered_lens_is_told_and_drawn(run: Path) -> None:
    done = again(run, "ima", "activity", BLACK)
    told = explain_step(done)
    assert told.look is not None
    assert (told.look.hypotheses, told.look.slots, told.answer.kind) == ([], [], "blind")
    assert "covered, flat, or without contrast" in printed(told)
    titles = [axes.get_title(loc="left") for axes in draw_explanation(done, told).axes]
    assert any(title.startswith(f"node {told.nodes[told.shown[0]]}") for title in titles)


def test_a_picture_that_cannot_be_read_is_told(run: Path) -> None:
    done = again(run, "ima", "grid", UNREADABLE)
    told = explain_step(done)
    assert told.answer.kind == "unreadable"
    assert "does not decode" in printed(told)
    frame = draw_explanation(done, told).axes[0]
    assert frame.texts[0].get_text() == "no picture that can be read"


@pytest.mark.parametrize(("sensor", "slots"), [("ima", 8), ("ima-robust+histogram", 8), ("histogram", 0)])
def test_slots_are_drawn_where_a_sensor_has_or_fuses_them(sensor: str, slots: int, run: Path) -> None:
    done = again(run, sensor, "grid", 2)
    told = explain_step(done)
    assert told.look is not None
    assert [len(one.value) for one in told.look.slots] == [slots] * (3 if slots else 0)
    frame = next(
        axes for axes in draw_explanation(done, told).axes if axes.get_title(loc="left") == "what the camera sees"
    )
    assert [text.get_text() for text in frame.texts] == [str(number + 1) for number in range(slots)]


def test_named_best_and_true_node_are_looked_at(run: Path) -> None:
    told = explain_step(again(run, "ima", "dead-reckoning", LAST))
    assert told.look is not None
    assert {told.answer.node, told.look.hypotheses[0].node, told.true_node} <= set(told.shown)


def test_where_the_map_has_views_those_are_drawn() -> None:
    """The nearest to the pose of each hypothesis: here the very view that the frame is."""
    circles = noise_map()
    drive = noise_drive(circles)
    views = [
        View(np.array([n.x, n.y, h]), image)
        for n, k in zip(circles.nodes, range(3), strict=True)
        for image, h in cut_views(circle(k), 1.0, CAMERA)
    ]
    topo_map = replace(circles, nodes=tuple(replace(n, panorama=None) for n in circles.nodes), views=tuple(views))
    case = Case(topo_map, [frame for frame, _ in drive], np.array([truth for _, truth in drive]))
    sensor, estimator = make_sensor("histogram"), make_estimator("grid")
    localizer = Localizer(topo_map, sensor, estimator)
    localizer.step(case.frames[0])
    assert localizer.last is not None
    done = Rerun(("toy", "histogram", "grid", 0), False, case, [localizer.last], sensor, estimator)
    told = explain_step(done)
    drawn = {axes.get_xlabel(): axes for axes in draw_explanation(done, told).axes}
    x, y, heading = case.truth[0]
    shown = drawn[f"the map's view from {x:.2f}, {y:.2f} m, {np.rad2deg(heading):.0f}°"]
    np.testing.assert_array_equal(shown.images[0].get_array(), case.frames[0].images["rgb"])


@pytest.mark.usefixtures("undrawn")
def test_an_answer_that_differs_from_the_runs_is_told(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(run, tmp_path / "run")
    path = tmp_path / "run" / steps_path("tiny", "ima", "activity", 0)
    lines = path.read_text().splitlines()
    lines[3] = lines[3].replace(",N1,", ",N2,")
    path.write_text("\n".join([*lines[:5], ""]))
    explain(tmp_path / "run", step=2)
    err = capsys.readouterr().err
    assert err.startswith("warning: another version or machine?")
    assert err.endswith("differs: node N2 there, N1 here\n")
    explain(tmp_path / "run", step=5)
    assert "its last frame is 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "problem"),
    [
        ({"scenario": "nowhere"}, "no scenario of this run is called 'nowhere'; choose from: tiny"),
        ({"sensor": "pca"}, "no sensor of this run is called 'pca'; choose from: ima, histogram"),
        ({"estimator": "magic"}, "no estimator of this run is called 'magic'; choose from: activity, "),
        ({"seed": 7}, "no seed of this run is called '7'; choose from: 0, 1"),
    ],
)
def test_what_the_run_does_not_have(asked: dict[str, Any], problem: str, run: Path) -> None:
    with pytest.raises(UnknownName, match=problem):
        explain(run, step=0, **asked)


def test_bad_steps_folders_and_runs_without_a_result(run: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--step is 7; the drive of tiny has the frames 0 to 6"):
        explain(run, step=7)
    with pytest.raises(InputError, match=r"config\.toml: no such file; name the folder of a benchmark run"):
        explain(tmp_path, step=0)
    with pytest.raises(UserError, match=r"tiny with fourier and activity, seed 0 is unavailable \(needs omni images"):
        explain(run, step=0, sensor="fourier")
    shutil.copytree(run, tmp_path / "run")
    results = tmp_path / "run" / "results.csv"
    results.write_text("".join(line for line in results.read_text().splitlines(True) if ",ima,grid,0," not in line))
    with pytest.raises(UserError, match=r"tiny with ima and grid, seed 0 was not run yet; .*--resume"):
        explain(tmp_path / "run", step=0, estimator="grid")
