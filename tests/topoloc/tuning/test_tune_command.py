"""``topoloc tune`` as a user types it: what it writes, what it proposes, and the one line that each mistake gets."""

from __future__ import annotations

import csv
import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensors.images import cut_views
from topoloc import plugins
from topoloc.cli.main import run
from topoloc.geometry import compose
from topoloc.localizer import Localizer
from topoloc.metrics import METRICS, Run, evaluate
from topoloc.odometry import OdometryNoise
from topoloc.recording import Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.tuning import Tuned, folds_of, plan_of
from topoloc.tuning.choice import Choice
from topoloc.tuning.evaluator import Evaluator
from topoloc.tuning.trial import DRAWS, Outcome
from topoloc.tuning.verdict import Verdict
from topoloc.tuning.written import set_words, settings_toml
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 96, 72)
PLACES = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
LAPS = 4
ACCURACY = next(metric for metric in METRICS if metric.name == "node_accuracy")
FEW = ("--try", "sensor.slots=4", "--try", "estimator.match_threshold=0.05,0.99", "--jobs", "1")


def noise_circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


@pytest.fixture(scope="session")
def lapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of four nodes with noise for panoramas; four laps past them, two views cut from each and then spoilt."""
    folder = tmp_path_factory.mktemp("lapped")
    rng = np.random.default_rng(7)
    nodes = tuple(Node(f"N{k}", f"place {k}", *place, 0.0, noise_circle(k)) for k, place in enumerate(PLACES))
    TopoMap("lapped", CAMERA, nodes).save(folder / "map")
    writer = RecordingWriter(folder / "recording", CAMERA)
    for time in range(2 * len(PLACES) * LAPS):
        node = nodes[time // 2 % len(PLACES)]
        assert node.panorama is not None
        image, heading = cut_views(node.panorama, 0.0, CAMERA)[time % 24]
        spoilt = np.where(rng.random((72, 96, 1)) < 0.88, rng.integers(0, 256, (72, 96, 3)), image).astype(np.uint8)
        truth = np.array([node.x, node.y, heading])
        raw = compose((3.0, -2.0, 2.0), truth + rng.normal(scale=(0.02, 0.02, 0.02)))
        writer.add(Frame(10.0 + time, raw, np.zeros(3), {"rgb": spoilt}), truth)
    writer.close()
    return folder


@pytest.fixture
def place(lapped: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    shutil.copytree(lapped, tmp_path, dirs_exist_ok=True)
    return tmp_path


def tune(folder: Path, output: Path, *more: str) -> list[str]:
    return ["tune", str(folder / "map"), str(folder / "recording"), "-o", str(output), *more]


@pytest.fixture(scope="module")
def done(lapped: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("done") / "tuned"
    assert run(tune(lapped, out, *FEW)) == 0
    return out


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "tune.csv").open(newline="") as file:
        return list(csv.DictReader(file))


class TestWrites:
    def test_these_files_and_no_others(self, done: Path) -> None:
        assert {path.name for path in done.iterdir()} == {"tune.csv", "settings.toml", "tune.png"}
        assert (done / "tune.png").read_bytes().startswith(b"\x89PNG")

    def test_all_that_was_tried_on_every_fold(self, done: Path) -> None:
        rows = rows_of(done)
        for settings in ("defaults", "sensor.slots=4", "estimator.match_threshold=0.05"):
            of_one = [row for row in rows if row["settings"] == settings]
            assert [row["fold"] for row in of_one] == [f"lap {number}" for number in range(1, LAPS + 1)]
            assert all(0.0 <= float(row["node_accuracy"]) <= 1.0 and float(row["look_ms"]) > 0.0 for row in of_one)
        assert rows[0]["role"].startswith("defaults") and rows[0]["odometry"].startswith("0.1 0.06")

    def test_what_was_refused_says_why(self, done: Path) -> None:
        """eps_M above eps_phi cannot be."""
        refused = [row for row in rows_of(done) if row["settings"] == "estimator.match_threshold=0.99"]
        assert len(refused) == 1 and "match_threshold <= head_threshold" in refused[0]["refused"]
        assert refused[0]["node_accuracy"] == ""

    def test_settings_are_toml_with_the_verdict(self, done: Path) -> None:
        text = (done / "settings.toml").read_text()
        assert text.startswith("# ") and set(tomllib.loads(text)) <= {"sensor", "estimator", "odometry"}

    def test_the_same_again_but_for_the_clock_and_what_it_tells(
        self, lapped: Path, done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(tune(lapped, tmp_path / "again", *FEW)) == 0
        first, second = (
            [{k: v for k, v in row.items() if not k.endswith("_ms")} for row in rows_of(folder)]
            for folder in (done, tmp_path / "again")
        )
        assert first == second
        assert (done / "settings.toml").read_bytes() == (tmp_path / "again" / "settings.toml").read_bytes()
        told = capsys.readouterr().out.splitlines()
        assert told[0].startswith("4 folds, lap 1 to lap 4: 8 to 8 looks each")
        assert any("noise of the odometer" in line for line in told)
        assert sum(line.startswith(("keep the defaults", "take the proposal")) for line in told) == 1
        assert told[-1].startswith("next: topoloc localize")


@pytest.fixture(scope="module")
def tuned(lapped: Path) -> Tuned:
    topo_map, recording = TopoMap.load(lapped / "map"), Recording.load(lapped / "recording")
    tuned = plan_of(topo_map, [recording], ACCURACY, tries=["sensor.slots=4"]).carry_out(jobs=1)
    words = (("odometry", "estimated"), ("sensor.clahe", "false"), ("sensor.slots", "4"))
    return replace(tuned, proposal=Choice(words, OdometryNoise(base_heading=0.02)))


class TestProposal:
    """What is proposed goes into ``topoloc localize`` word for word, and into the file by its worth."""

    def test_words(self, tuned: Tuned, lapped: Path, tmp_path: Path) -> None:
        words = set_words(tuned.proposal)
        assert words == ["sensor.clahe=false", "sensor.slots=4", "odometry.base_heading=0.02"]
        options = [part for word in words for part in ("--set", word)]
        folders = [str(lapped / "map"), str(lapped / "recording"), "-o", str(tmp_path / "run")]
        assert run(["localize", *folders, *options]) == 0

    def test_file(self, tuned: Tuned) -> None:
        sure = replace(tuned, verdict=Verdict(np.full(4, 0.1), 1 / 16))
        chance = replace(tuned, verdict=Verdict(np.full(4, 0.1), 0.5))
        table = {"sensor": {"clahe": False, "slots": 4}, "odometry": {"base_heading": 0.02}}
        assert tomllib.loads(settings_toml(sure)) == table
        assert tomllib.loads(settings_toml(chance)) == {}
        told = settings_toml(chance).splitlines()
        assert told[0].startswith("# keep the defaults") and "# slots = 4" in told


def test_a_fold_is_driven_as_localize_would(lapped: Path) -> None:
    """Looks that were remembered give what a localizer gives that looks itself."""
    topo_map, recording = TopoMap.load(lapped / "map"), Recording.load(lapped / "recording")
    plan = plan_of(topo_map, [recording], ACCURACY, tries=["sensor.slots=4"])
    outcome = plan.carry_out(jobs=1).outcomes[Choice()]
    for number, fold in enumerate(plan.folds):
        localizer = Localizer(topo_map, plugins.make_sensor("ima"), plugins.make_estimator("activity"))
        steps = []
        for frame in (recording.frame(picture) for picture in fold.pictures):
            localizer.step(frame)
            assert localizer.last is not None
            steps.append(localizer.last)
        assert all(step.kind != "gated" for step in steps)
        wanted = evaluate(Run.of(topo_map, steps, fold.truth))
        for name, values in outcome.metrics.items():
            assert values[number] == pytest.approx(np.nan if wanted[name] is None else wanted[name], nan_ok=True), name


class TestDraws:
    def outcomes(self, lapped: Path, estimator: str, words: Sequence[Choice], jobs: int = 1) -> list[Outcome]:
        topo_map, recording = TopoMap.load(lapped / "map"), Recording.load(lapped / "recording")
        evaluator = Evaluator(topo_map, folds_of([recording]), "ima", estimator, jobs=jobs)
        evaluator.try_all(words)
        return [evaluator.outcomes[choice] for choice in words]

    def test_random_numbers_are_drawn_several_times(self, lapped: Path) -> None:
        """The mean of ``DRAWS`` shares of 8 updates may be any 32nd; of a single drive it would be an 8th."""
        few = [Choice((("estimator.particles", str(count)),)) for count in (20, 21, 22)]
        found = self.outcomes(lapped, "particle", few)
        accuracies = np.concatenate([outcome.metrics["node_accuracy"] for outcome in found])
        assert (accuracies * 8.0 * DRAWS) == pytest.approx(np.round(accuracies * 8.0 * DRAWS))
        assert (np.abs(accuracies * 8.0 - np.round(accuracies * 8.0)) > 0.01).any()

    @pytest.mark.slow
    def test_several_processes_find_the_same(self, lapped: Path) -> None:
        few = [Choice((("estimator.particles", str(count)),)) for count in (20, 21)]
        for one, two in zip(*(self.outcomes(lapped, "particle", few, jobs) for jobs in (1, 2)), strict=True):
            assert one.metrics["node_accuracy"] == pytest.approx(two.metrics["node_accuracy"])


class TestMistakes:
    def says(self, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
        assert run(arguments) == 2
        *before, error = capsys.readouterr().err.splitlines()
        assert all("left out" in line for line in before)  # a command that is not installed says so
        return error

    def test_no_truth(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (place / "recording" / "groundtruth.txt").unlink()
        assert "has no groundtruth.txt" in self.says(tune(place, place / "out"), capsys)
        assert not (place / "out").exists()

    def test_too_short(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        lines = (place / "recording" / "rgb.txt").read_text().splitlines()
        (place / "recording" / "rgb.txt").write_text("\n".join(lines[:10]) + "\n")
        assert "record more laps" in self.says(tune(place, place / "out"), capsys)

    def test_the_map_was_built_of_it(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["map", "build", str(place / "recording"), "-o", str(place / "built")]) == 0
        capsys.readouterr()
        words = ["tune", str(place / "built"), str(place / "recording"), "-o", str(place / "out"), "--sensor", "pca"]
        error = self.says([*words, "--jobs", "1"], capsys)
        assert "recording: the map was built of it (100% of" in error and "record another drive" in error
        assert not (place / "out").exists()

    @pytest.mark.parametrize(
        ("more", "says"),
        [
            (("--try", "sensor.slot=4"), "nothing is called 'sensor.slot'"),
            (("--try", "sensor.slots=many"), "slots is 'many'; write a number"),
            (("--score", "nees"), "no score is called 'nees'"),
            (("--sensor", "imma"), "no sensor is called 'imma'"),
            (("--estimator", "none"), "no estimator is called 'none'"),
            (("--sensor", "fourier", "--try", "sensor.sigma_m=0.3"), "fourier needs omni.txt"),
        ],
    )
    def test_names(
        self, more: tuple[str, ...], says: str, lapped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert says in self.says(tune(lapped, tmp_path / "out", "--jobs", "1", *more), capsys)
        assert not (tmp_path / "out").exists()

    def test_no_picture_can_be_read(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for picture in (place / "recording").glob("rgb/*.png"):
            picture.write_bytes(b"no picture")
        assert "none of its pictures can be used" in self.says(tune(place, place / "out", "--jobs", "1"), capsys)

    def test_what_is_there_stays(self, lapped: Path, done: Path, capsys: pytest.CaptureFixture[str]) -> None:
        before = (done / "tune.csv").read_bytes()
        assert "already exists" in self.says(tune(lapped, done), capsys)
        assert (done / "tune.csv").read_bytes() == before


class TestLocalize:
    """The odometer's noise goes into ``topoloc localize``, too."""

    def localize(self, folder: Path, output: Path, *more: str) -> list[str]:
        return ["localize", str(folder / "map"), str(folder / "recording"), "-o", str(output), *more]

    def test_it_changes_what_a_filter_says(self, lapped: Path, tmp_path: Path) -> None:
        written = []
        for value in ("0.1", "0.9"):
            words = ("--estimator", "grid", "--set", f"odometry.distance_per_metre={value}")
            assert run(self.localize(lapped, tmp_path / value, *words)) == 0
            written.append((tmp_path / value / "steps.csv").read_bytes())
        assert written[0] != written[1]

    def test_unknown_ones_are_refused(self, lapped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(self.localize(lapped, tmp_path / "out", "--set", "odometry.slip=1")) == 2
        assert "settings of odometry: nothing is called 'slip'" in capsys.readouterr().err
