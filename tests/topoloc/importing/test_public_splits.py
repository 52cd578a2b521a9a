"""Splits of public sets: complete, disjoint, on a disk a scenario a pair; and what papers report of a run."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from oracles.made_public_sets import BEGIN_S, CAR_STEPS, STEPS, make_cold, make_idol2, make_robotcar, times_of, way

from benchmarks.scenarios.recorded import recorded
from topoloc.cli import main
from topoloc.cli.main import run
from topoloc.cli.score import score
from topoloc.errors import InputError, UserError
from topoloc.importing.public import cold_splits, idol2_splits, robotcar_splits
from topoloc.importing.public.answers import Answers
from topoloc.importing.public.room_rate import node_rooms, pose_errors, room_rate
from topoloc.importing.public.splits import Split, find, pairs_of
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap

ALL = {"cold": cold_splits.SPLITS, "idol2": idol2_splits.SPLITS, "oxford": robotcar_splits.SPLITS}
NAMES = {
    "cold": re.compile(r"(freiburg|saarbruecken|ljubljana)/seq[1-4]_(cloudy|night|sunny)\d"),
    "idol2": idol2_splits.SEQUENCE,
    "oxford": robotcar_splits.TRAVERSAL,
}
EVERY = [(name, split) for name, splits in ALL.items() for split in splits.values()]


@pytest.fixture(scope="module", autouse=True)
def one_app() -> Iterator[None]:
    """The command line is put together once."""
    app = main.build_app()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", lambda: app)
        yield


class TestSplits:
    @pytest.mark.parametrize(("name", "split"), EVERY, ids=[f"{name}-{split.name}" for name, split in EVERY])
    def test_they_are_whole_and_disjoint(self, name: str, split: Split) -> None:
        assert split.pairs and split.source and split.figure
        assert len({pair.name for pair in split.pairs}) == len(split.pairs)
        assert set(split.sequences) == {one for pair in split.pairs for one in (*pair.train, pair.query)}
        for pair in split.pairs:
            assert pair.query not in pair.train and "/" not in pair.name
            assert all(NAMES[name].fullmatch(one) for one in (*pair.train, pair.query))

    @pytest.mark.parametrize("name", ALL)
    def test_they_are_listed_without_a_folder(self, name: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["import", name, "--list-splits"]) == 0
        told = capsys.readouterr().out
        for split in ALL[name].values():
            assert split.name in told and split.source in told and split.figure in told
            assert all(f"localized {pair.query}" in told for pair in split.pairs)

    def test_what_is_only_remembered_is_said_to_be(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["import", "idol2", "--list-splits"]) == 0
        assert capsys.readouterr().out.count("as remembered") == len(idol2_splits.SPLITS)

    def test_half_a_year_lies_between_the_pairs_of_one_split(self) -> None:
        for pair in idol2_splits.SPLITS["minnie-half-a-year"].pairs:
            assert pair.train[0][-1] == "1" and pair.query[-1] == "3" and pair.train[0][:-1] == pair.query[:-1]
        assert all(pair.train[0][:3] != pair.query[:3] for pair in idol2_splits.TRANSFER.pairs)


class TestFinding:
    @pytest.mark.parametrize(
        ("path", "name"),
        [
            ("cold-freiburg/part_a/seq2_cloudy3", "freiburg/seq2_cloudy3"),
            ("cold-saarbruecken_part_b_seq4_sunny1", "saarbruecken/seq4_sunny1"),
            ("Saarbrucken/seq1_night2", "saarbruecken/seq1_night2"),
            ("fr_seq3_sunny2", "freiburg/seq3_sunny2"),
            ("Ljubljana/deep/er/seq1_cloudy1", "ljubljana/seq1_cloudy1"),
            ("somewhere/seq1_cloudy1", None),
            ("freiburg/first_drive", None),
        ],
    )
    def test_cold(self, tmp_path: Path, path: str, name: str | None) -> None:
        (tmp_path / path / "std_cam").mkdir(parents=True)
        assert cold_splits.find_cold(tmp_path) == ({} if name is None else {name: [tmp_path / path]})

    def test_idol2_unpacked_into_a_folder_of_its_name(self, tmp_path: Path) -> None:
        (tmp_path / "min_cloudy1" / "min_cloudy1" / "png").mkdir(parents=True)
        (tmp_path / "dum_night4" / "png").mkdir(parents=True)
        assert idol2_splits.find_idol2(tmp_path) == {
            "min_cloudy1": [tmp_path / "min_cloudy1" / "min_cloudy1"],
            "dum_night4": [tmp_path / "dum_night4"],
        }

    def test_missing_ones_are_one_line(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        make_cold(tmp_path / "cold-freiburg" / "seq2_cloudy3")
        words = ["import", "cold", str(tmp_path), "--split", "freiburg-light", "-o", str(tmp_path / "made")]
        assert run(words) == 2
        told = capsys.readouterr().err
        assert told.count("\n") == 1 and "3 of 4 sequences" in told
        assert "freiburg/seq2_cloudy2, freiburg/seq2_night2, freiburg/seq2_sunny2" in told
        assert not (tmp_path / "made").exists()

    def test_one_that_lies_there_twice(self, tmp_path: Path) -> None:
        split = Split("s", pairs_of(("a",), ["b"]), "us", True, "none")
        found: Mapping[str, list[Path]] = {"a": [tmp_path / "1", tmp_path / "2"], "b": [tmp_path]}
        with pytest.raises(UserError, match="a lies there twice"):
            find(split, tmp_path, found)

    def test_an_unknown_split(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["import", "cold", str(tmp_path), "--split", "x", "-o", str(tmp_path / "made")]) == 2
        assert "freiburg-light, lantern" in capsys.readouterr().err

    def test_maps_need_a_camera(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        words = [str(tmp_path), "-o", str(tmp_path / "made"), "--split"]
        assert run(["import", "idol2", *words, "minnie-same-light"]) == 2
        assert "--hfov-deg" in capsys.readouterr().err
        assert run(["import", "cold", *words, "freiburg-light", "--camera", "omni"]) == 2
        assert "take std" in capsys.readouterr().err


@pytest.fixture(scope="module")
def freiburg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The split freiburg-light of made sequences, imported: the queries are darker and were taken later."""
    root = tmp_path_factory.mktemp("cold")
    lights = {"cloudy3": 1.0, "cloudy2": 0.9, "night2": 0.5, "sunny2": 0.8}
    for day, (light, brightness) in enumerate(lights.items()):
        make_cold(root / "cold-freiburg" / f"seq2_{light}", BEGIN_S + 86400.0 * day, brightness)
    words = ["import", "cold", str(root), "--split", "freiburg-light", "-o", str(root / "made"), "--spacing-m", "0.5"]
    assert run(words) == 0
    return root / "made"


NIGHT = "freiburg-seq2_night2-on-freiburg-seq2_cloudy3"


class TestASplitOnADisk:
    def test_each_pair_is_a_scenario(self, freiburg: Path) -> None:
        pairs = sorted(path.name for path in freiburg.iterdir() if path.name != "train")
        assert pairs == [f"freiburg-seq2_{light}-on-freiburg-seq2_cloudy3" for light in ("cloudy2", "night2", "sunny2")]
        for name in pairs:
            case = recorded(freiburg / name)
            assert case.settings["frames"] == 2 * STEPS
        drive = Recording.load(freiburg / NIGHT / "recording")
        assert drive.pictures["rgb"][0].time == pytest.approx(BEGIN_S + 2 * 86400.0, abs=1e-5)
        told = tomllib.loads((freiburg / NIGHT / "pair.toml").read_text())
        assert told["train"] == ["freiburg/seq2_cloudy3"] and told["query"] == "freiburg/seq2_night2"

    def test_nodes_have_rooms(self, freiburg: Path) -> None:
        the_map = TopoMap.load(freiburg / NIGHT / "map")
        rooms = node_rooms(the_map, freiburg / "train" / "freiburg-seq2_cloudy3")
        assert len(rooms) == len(the_map.nodes) > 5
        for node in the_map.nodes:
            if node.x < (STEPS - 1) * 0.25:
                assert rooms[node.id] == "CR-A"
            elif node.y > 0.2:
                assert rooms[node.id] == "2PO1-A"

    def test_a_run_is_scored(self, freiburg: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        pair = freiburg / NIGHT
        words = ["localize", str(pair / "map"), str(pair / "recording"), "-o", str(tmp_path / "run")]
        assert run([*words, "--sensor", "pca", "--estimator", "particle"]) == 0
        answers = Answers.read(tmp_path / "run/steps.csv", pair / "recording")
        rate = room_rate(answers, pair / "node_rooms.csv")
        assert rate is not None and rate.pictures == 2 * STEPS and rate.rate > 0.7
        assert sum(pictures for pictures, _ in rate.by_room.values()) == rate.pictures
        errors = pose_errors(answers)
        assert errors is not None and np.median(errors.metres) < 0.3 and np.median(errors.degrees) < 20.0
        capsys.readouterr()
        score(tmp_path / "run", pair)
        told = capsys.readouterr().out
        assert re.search(rf"without a step\W+0\W+frames of {2 * STEPS}", told)
        assert "right rooms" in told and "position, mean" in told and "TripletNetworks" in told

    def test_a_map_of_two_traversals(self, tmp_path: Path) -> None:
        train, (first, second) = robotcar_splits.LOOP_TRAIN, robotcar_splits.LOOP.pairs
        for day, name in enumerate((*train, first.query, second.query)):
            make_robotcar(tmp_path / "set" / name, BEGIN_S + 1000.0 * day, shift=(0.5 * day, 0.0))
        words = ["import", "oxford", str(tmp_path / "set"), "--split", "loop", "-o", str(tmp_path / "made")]
        assert run([*words, "--width", "64", "--every", "0.4"]) == 0
        made = Recording.load(tmp_path / "made" / "train" / "+".join(train))
        query = Recording.load(tmp_path / "made" / second.name / "recording")
        assert len(made) == 2 * len(query) == 2 * CAR_STEPS
        assert made.odometry is None and query.odometry is not None and query.truth is not None
        np.testing.assert_allclose(query.truth.poses[0], [1.5, 0.0, 0.0], atol=1e-3)
        assert len(TopoMap.load(tmp_path / "made" / second.name / "map").nodes) >= 5
        assert (tmp_path / "made" / "origin.toml").exists()

    def test_idol2(self, tmp_path: Path) -> None:
        for pair in (split := idol2_splits.SPLITS["minnie-half-a-year"]).pairs:
            for name in (*pair.train, pair.query):
                make_idol2(tmp_path / "set" / name)
        words = ["import", "idol2", str(tmp_path / "set"), "--split", split.name, "-o", str(tmp_path / "made")]
        assert run([*words, "--hfov-deg", "50"]) == 0
        assert recorded(tmp_path / "made" / split.pairs[2].name).settings["frames"] == 2 * STEPS


class TestScores:
    def steps(self, folder: Path, rows: list[str]) -> Path:
        folder.mkdir(exist_ok=True)
        head = "timestamp,x,y,heading_deg,node,probability,status,match,kind"
        (folder / "steps.csv").write_text("\n".join([head, *rows]) + "\n")
        return folder / "steps.csv"

    @pytest.fixture
    def recording(self, tmp_path: Path) -> Path:
        make_cold(tmp_path / "seq")
        assert run(["import", "cold", str(tmp_path / "seq"), "-o", str(tmp_path / "recording")]) == 0
        (tmp_path / "node_rooms.csv").write_text("node,room\nA,CR-A\nB,2PO1-A\n")
        return tmp_path / "recording"

    def test_every_frame_with_a_room_counts(self, recording: Path, tmp_path: Path) -> None:
        named = ["A", "A", "B", ""] + ["B"] * 3 + ["Z"]
        frames = [0, 1, 2, 3, STEPS, STEPS + 1, STEPS + 2, STEPS + 3]
        times = times_of(2 * STEPS)[frames]
        rows = [f"{time:.6f},0,0,0,{node},0.9,LOCALIZED,,step" for time, node in zip(times, named, strict=True)]
        answers = Answers.read(self.steps(tmp_path / "run", rows), recording)
        rate = room_rate(answers, tmp_path / "node_rooms.csv")
        assert rate is not None and answers.missing == 2 * STEPS - 8
        assert (rate.pictures, rate.named, rate.right) == (2 * STEPS, 7, 5)
        assert rate.by_room == {"CR-A": (STEPS, 2), "2PO1-A": (STEPS, 3)} and rate.rate == 5 / (2 * STEPS)

    def test_errors(self, recording: Path, tmp_path: Path) -> None:
        rows = []
        for time, (x, y, angle) in zip(times_of(2 * STEPS), way(), strict=True):
            rows.append(f"{time:.6f},{x + 3.0:.4f},{y - 4.0:.4f},{np.rad2deg(angle) - 350.0:.3f},A,0.9,LOCALIZED,,step")
        errors = pose_errors(Answers.read(self.steps(tmp_path / "run", rows), recording))
        assert errors is not None
        np.testing.assert_allclose(errors.metres, 5.0, atol=1e-3)
        np.testing.assert_allclose(errors.degrees, 10.0, atol=0.01)
        assert errors.within(4.9) == 0.0 and errors.within(5.1) == 1.0

    def test_a_frame_without_a_step_is_within_no_distance(self, recording: Path, tmp_path: Path) -> None:
        time, (x, y, _) = times_of(2 * STEPS)[5], way()[5]
        steps = self.steps(tmp_path / "run", [f"{time:.6f},{x:.4f},{y:.4f},0,A,0.9,LOCALIZED,,step"])
        errors = pose_errors(Answers.read(steps, recording))
        assert errors is not None and len(errors.metres) == 1 and errors.missing == 2 * STEPS - 1
        assert errors.within(25.0) == pytest.approx(1 / (2 * STEPS))

    @pytest.mark.parametrize("off_s", [-0.05, 100.0])
    def test_a_run_of_another_drive_is_refused(self, recording: Path, tmp_path: Path, off_s: float) -> None:
        first, second = times_of(2 * STEPS)[[0, 1]]
        rows = [f"{time:.6f},0,0,0,A,0.9,LOCALIZED,,step" for time in (first, second + off_s)]
        with pytest.raises(InputError, match=r"1 of 2 steps are at no time of .*rgb.txt; name the run of this"):
            Answers.read(self.steps(tmp_path / "run", rows), recording)

    def test_a_run_without_steps_is_refused(self, recording: Path, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="holds no steps"):
            Answers.read(self.steps(tmp_path / "run", []), recording)

    def test_without_rooms_there_is_no_rate(self, recording: Path, tmp_path: Path) -> None:
        row = f"{times_of(1)[0]:.6f},0,0,0,A,0.9,LOCALIZED,,step"
        answers = Answers.read(self.steps(tmp_path / "run", [row]), recording)
        assert room_rate(answers, tmp_path / "none.csv") is None
        (recording / "rooms.csv").unlink()
        assert room_rate(answers, tmp_path / "node_rooms.csv") is None

    def test_a_folder_that_is_no_pair(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="name the folder of a pair"):
            score(tmp_path, tmp_path)
