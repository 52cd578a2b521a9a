"""Place recognition across two laps: the arithmetic by hand, and the goals on the real corridor where it lies by."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from oracles.shared_data import SHARED_DATA

from benchmarks.place_recognition import (
    FRAME_M,
    Found,
    Laps,
    PairSensor,
    Row,
    alone,
    competitors,
    correlation,
    figure,
    in_sequence,
    measure,
    scaled,
    table,
)
from topoloc.errors import InputError
from topoloc.files import write_image
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Image

CAMERA = Camera(60.0, 96, 72)
CORRIDOR = SHARED_DATA / "corridor_two_laps"
on_the_corridor = pytest.mark.skipif(not CORRIDOR.is_dir(), reason="the real photographs are not on this machine")


def line(nodes: int = 12) -> TopoMap:
    return TopoMap("line", nodes=tuple(Node(str(k), str(k), FRAME_M * k, 0.0) for k in range(nodes)), camera=CAMERA)


def look(topo_map: TopoMap, best: int, second: int | None = None) -> Evidence:
    """Says one node, and a second one a little less."""
    count = len(topo_map.nodes)
    match = np.full(count, 0.2)
    match[best] = 0.6
    if second is not None:
        match[second] = 0.55
    ones = np.ones(count)
    poses = np.column_stack([topo_map.positions, np.zeros(count)])
    return Evidence(poses, np.arange(count), match, 1.0 - match, 8.0 * (match - 0.4), 0.3 * ones, 20.0 * ones)


def picture(seed: int) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (6, 8, 3)).astype(np.uint8).repeat(12, 0).repeat(12, 1)


def write_laps(folder: Path, pairs: str) -> Path:
    """Three places, twice each."""
    lines = []
    for number in range(6):
        write_image(folder / "rgb" / f"{number + 1}.png", picture(number % 3))
        lines.append(f"{number}.0 rgb/{number + 1}.png")
    (folder / "rgb.txt").write_text("\n".join(lines) + "\n")
    (folder / "loop_pairs.csv").write_text("query_image,earlier_image\n" + pairs)
    return folder


def test_laps_are_read_and_earlier_frames_of_the_second_left_out(tmp_path: Path) -> None:
    laps = Laps.load(write_laps(tmp_path, "4,1\n5,2\n6,3\n6,4\n"))
    assert (len(laps.first), len(laps.second)) == (3, 3)
    np.testing.assert_array_equal(laps.right, np.eye(3, dtype=np.bool_))
    np.testing.assert_allclose(laps.topo_map.positions[:, 0], [0.0, FRAME_M, 2.0 * FRAME_M])


def test_a_small_pair_of_laps_is_recognized_and_what_cannot_says_why(tmp_path: Path) -> None:
    laps = Laps.load(write_laps(tmp_path, "4,1\n5,2\n6,3\n"))
    found = measure("correlation", lambda: PairSensor(correlation, scaled), laps)
    assert found.alone is not None
    assert found.alone.first_matches == 3
    refused = measure("fourier", competitors()["fourier"], laps)
    assert refused.alone is None
    assert "panoramas" in refused.reason
    lines = table([found, refused]).splitlines()
    assert lines[2].startswith("| correlation | 3 | 1.00 | 1.00 |")
    assert lines[3].startswith("| fourier | cannot: ")
    assert len(figure([found, refused]).axes[0].lines) == 1


@pytest.mark.parametrize("pairs", ["4\n", "4,one\n", "4,1,2\n", "9,1\n", "1,1\n", ""])
def test_a_list_of_pairs_that_is_none_is_refused(tmp_path: Path, pairs: str) -> None:
    with pytest.raises(InputError, match="loop_pairs"):
        Laps.load(write_laps(tmp_path, pairs))


def test_a_folder_without_laps_is_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks.place_recognition", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "loop_pairs.csv" in done.stderr
    assert "Traceback" not in done.stderr


def test_correlation_is_one_for_the_same_picture_shifted() -> None:
    wide = np.random.default_rng(0).uniform(0.0, 255.0, (54, 90))
    one, other = wide[:, :72], wide[:, 10:82]
    assert correlation(one, one) == pytest.approx(1.0)
    assert correlation(one, other, most_shift=0.25) == pytest.approx(1.0)
    assert correlation(one, other) < 0.5


def test_precision_and_recall_by_hand() -> None:
    """Right, right, wrong, right, no answer: by sureness; two are equally sure."""
    found = Found(np.array([0.9, 0.7, 0.8, 0.7, -np.inf]), np.array([True, True, True, False, False]))
    precision, recall = found.curve()
    np.testing.assert_allclose(precision, [1.0, 1.0, 3.0 / 4.0])
    np.testing.assert_allclose(recall, [0.2, 0.4, 0.6])
    assert found.first_matches == 3
    assert found.recall_at_full_precision() == pytest.approx(0.4)
    assert found.average_precision() == pytest.approx(0.2 + 0.2 + 0.2 * 0.75)


def test_nothing_right_has_no_recall() -> None:
    found = Found(np.array([0.5, 0.4]), np.array([False, False]))
    assert (found.recall_at_full_precision(), found.average_precision()) == (0.0, 0.0)


def test_a_blind_query_has_no_answer_alone_and_goes_on_in_sequence() -> None:
    the_map = line()
    seen = [look(the_map, 3), look(the_map, 4), Evidence.blind(), look(the_map, 6)]
    right = np.zeros((4, 12), dtype=np.bool_)
    right[np.arange(4), np.arange(3, 7)] = True
    np.testing.assert_array_equal(alone(seen, right).right, [True, True, False, True])
    assert alone(seen, right).sure[2] == -np.inf
    np.testing.assert_array_equal(in_sequence(seen, the_map, right).right, [True] * 4)


def test_a_sequence_corrects_a_wrong_look_and_knows_nothing_of_later_ones() -> None:
    the_map, right = line(), np.zeros((6, 12), dtype=np.bool_)
    right[np.arange(6), np.arange(2, 8)] = True
    seen = [look(the_map, 2 + step) for step in range(6)]
    seen[4] = look(the_map, 11, second=6)
    assert not alone(seen, right).right[4]
    whole = in_sequence(seen, the_map, right)
    assert whole.right.all()
    part = in_sequence(seen[:4], the_map, right[:4])
    np.testing.assert_allclose(part.sure, whole.sure[:4])
    assert (np.diff(whole.sure[:4]) > 0.0).all(), "looks that agree make surer"


@cache
def corridor() -> Laps:
    return Laps.load(CORRIDOR)


@cache
def on(name: str) -> Row:
    return measure(name, competitors()[name], corridor())


@on_the_corridor
def test_the_protocol_is_that_of_the_published_figures() -> None:
    """44 queries, 40 frames in the map: whole-image correlation finds 17, as the data's own notes say."""
    assert corridor().right.shape == (44, 40)
    found = on("whole-image correlation").alone
    assert found is not None
    assert found.first_matches == 17


@on_the_corridor
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "first_matches", "in_a_sequence"),
    [("pca", 0, 27), ("histogram", 0, 31), ("local", 42, 0), ("ima, single images", 23, 31)],
)
def test_goals_on_the_corridor(name: str, first_matches: int, in_a_sequence: int) -> None:
    row = on(name)
    assert row.alone is not None and row.sequence is not None
    assert row.alone.first_matches >= first_matches
    assert row.sequence.first_matches >= in_a_sequence


@on_the_corridor
@pytest.mark.parametrize("name", ["fourier", "disparity"])
def test_who_cannot_says_so(name: str) -> None:
    assert on(name).alone is None
    assert on(name).reason
