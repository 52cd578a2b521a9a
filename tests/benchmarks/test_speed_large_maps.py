"""Large maps beside exact IMA and beside the first time: small, on whether they agree alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from benchmarks.speed import large_maps
from benchmarks.speed.case import Pair
from benchmarks.speed.large_maps import (
    CAMERA,
    NEEDED_GB,
    ZOOM,
    MapOnDisk,
    NoiseMap,
    cases,
    ima_candidates,
    map_open,
    same_answers,
    same_looks,
    zoomed_view,
)
from sensors.coarse_stage import CoarseStage
from sensors.ima import IMA, IMAConfig
from sensors.slot_correlation import Reference
from topoloc.picture_index import STORE_FOLDER
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image, Ints

NODES, CANDIDATES, QUERIES = 40, 10, 25


@pytest.fixture(scope="module")
def noise() -> NoiseMap:
    return NoiseMap(NODES)


@pytest.fixture(scope="module")
def pair() -> Pair:
    """On the map of ``noise``; not to be changed."""
    return ima_candidates(NODES, QUERIES, CANDIDATES).prepare()


@pytest.fixture(scope="module")
def seen(pair: Pair) -> Evidence:
    """What exact IMA says of some frame."""
    evidence = pair.peers()
    assert isinstance(evidence, Evidence)
    return evidence


class Says:
    """A sensor that says what it was given, look by look, over and over."""

    needs = frozenset({"rgb"})

    def __init__(self, looks: Sequence[Evidence]) -> None:
        self._again = cycle(looks)

    def fit(self, topo_map: TopoMap) -> None:
        del topo_map

    def observe(self, frame: Frame) -> Evidence:
        del frame
        return next(self._again)


def without_the_best(evidence: Evidence) -> Evidence:
    kept = np.arange(len(evidence.nodes)) != evidence.match.argmax()
    columns = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
    return replace(evidence, **{name: getattr(evidence, name)[kept] for name in columns})


# --- a look ---------------------------------------------------------------------------------------------------------


def test_candidates_agree_with_exact_ima(pair: Pair, seen: Evidence) -> None:
    assert pair.agree()
    few = pair.ours()
    assert isinstance(few, Evidence)
    assert (len(few.nodes), len(seen.nodes)) == (CANDIDATES, NODES)


def test_a_coarse_stage_that_leaves_the_best_node_out_is_told(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    def first_ones(stage: CoarseStage, picture: Image, count: int) -> Ints:
        del stage, picture
        return np.arange(count)

    monkeypatch.setattr(CoarseStage, "candidates", first_ones)
    assert not pair.agree()


@pytest.mark.parametrize(("wrong", "expected"), [(1, True), (2, False)])
def test_one_query_in_a_hundred_may_have_another_node(
    noise: NoiseMap, seen: Evidence, wrong: int, expected: bool
) -> None:
    other = Says([without_the_best(seen)] * wrong + [seen] * (100 - wrong))
    assert same_answers(other, Says([seen]), noise.queries(1) * 100) is expected


@pytest.mark.parametrize(("off", "expected"), [(1e-6, True), (1e-4, False)])
def test_other_matches_of_the_same_nodes_are_told(noise: NoiseMap, seen: Evidence, off: float, expected: bool) -> None:
    other = Says([replace(seen, match=seen.match - off)])
    assert same_answers(other, Says([seen]), noise.queries(1)) is expected


def test_exact_ima_makes_nothing_anew(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    """Or the peer would take three times as long as it needs to."""

    def deviations(reference: Reference, block: slice) -> None:
        raise AssertionError(f"transforms of {len(reference)} panoramas are made again, {block}")

    for look in (pair.ours, pair.peers):
        look()
    monkeypatch.setattr(Reference, "_deviations", deviations)
    pair.peers()
    with pytest.raises(AssertionError, match=f"transforms of {CANDIDATES} panoramas"):
        pair.ours()


# --- the queries ----------------------------------------------------------------------------------------------------


def test_a_view_without_zoom_is_cut_out(noise: NoiseMap) -> None:
    circle, last = noise.circles[0], CAMERA.panorama_columns() - 10
    rows = slice(noise.margin, noise.margin + CAMERA.height)
    columns = np.arange(last, last + CAMERA.width) % CAMERA.panorama_columns()
    assert np.array_equal(zoomed_view(circle, last, 1.0), circle[rows][:, columns])
    panorama = noise.topo_map.nodes[0].panorama
    assert panorama is not None
    assert np.array_equal(panorama, circle[rows])


@pytest.mark.parametrize("zoom", [ZOOM, 1.0 / ZOOM])
def test_zoom_is_about_the_middle(zoom: float) -> None:
    rows = CAMERA.height + 2 * NoiseMap(1).margin
    ramp = np.tile(np.arange(CAMERA.panorama_columns()) % 256, (rows, 1)).astype(np.uint8)
    left = 80
    view = zoomed_view(ramp, left, zoom)
    across = np.arange(CAMERA.width) - (CAMERA.width - 1) / 2.0
    expected = left + (CAMERA.width - 1) / 2.0 + across / zoom
    np.testing.assert_allclose(view, np.tile(expected, (CAMERA.height, 1)), atol=0.6)
    assert np.ptp(zoomed_view(ramp.T[:rows].repeat(9, axis=1), 0, zoom)[:, 0]) == pytest.approx(53.0 / zoom, abs=1.1)


def test_queries_differ_and_are_the_same_again(noise: NoiseMap) -> None:
    few, more = noise.queries(3), NoiseMap(NODES).queries(5)
    for first, second in zip(few, more, strict=False):
        assert np.array_equal(first.images["rgb"], second.images["rgb"])
    assert len({frame.images["rgb"].tobytes() for frame in more}) == 5


# --- opening --------------------------------------------------------------------------------------------------------


def test_an_opened_map_says_what_it_said_the_first_time() -> None:
    pair = map_open(12, 5).prepare()
    assert pair.agree()
    again, first = pair.ours(), pair.peers()
    assert isinstance(again, IMA) and isinstance(first, IMA)
    frames = NoiseMap(12).queries(2)
    assert same_looks(again, first, frames)
    assert not same_looks(again, Says([first.observe(frames[1])]), frames)


@pytest.mark.parametrize("name", ["match", "log_likelihoods"])
def test_other_answers_of_an_opened_map_are_told(noise: NoiseMap, seen: Evidence, name: str) -> None:
    frames = noise.queries(1)
    changed = getattr(seen, name).copy()
    changed[0] += 1e-9
    assert same_looks(Says([seen]), Says([seen]), frames)
    assert not same_looks(Says([replace(seen, **{name: changed})]), Says([seen]), frames)


def test_only_the_first_opening_prepares_the_panoramas(noise: NoiseMap, monkeypatch: pytest.MonkeyPatch) -> None:
    prepared: list[str] = []
    of_map = IMA._prepared_map

    def counted(sensor: IMA, topo_map: TopoMap) -> object:
        prepared.append(topo_map.name)
        return of_map(sensor, topo_map)

    monkeypatch.setattr(IMA, "_prepared_map", counted)
    held = MapOnDisk(NoiseMap(3).topo_map, IMAConfig(candidates=2))
    for opened, expected in ((held.open, 1), (held.open, 1), (held.open_as_new, 2), (held.open, 2)):
        opened()
        assert len(prepared) == expected
    assert (held.folder / STORE_FOLDER).is_dir()


def test_the_folder_goes_when_nobody_needs_it() -> None:
    held = MapOnDisk(NoiseMap(3).topo_map, IMAConfig())
    around = held.folder.parent
    assert around.is_dir()
    del held
    assert not around.exists()


# --- what is measured -----------------------------------------------------------------------------------------------


def test_many_nodes_need_memory(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = Pair(lambda: None, lambda: None, lambda: True)
    monkeypatch.setattr(large_maps, "_looks", lambda *given: nothing)
    for memory_gb, expected in ((NEEDED_GB, ["1,000", "10,000"]), (2.0, ["1,000"])):
        looks = [case for case in cases(memory_gb) if case.what == "ima-candidates"]
        assert [case.size.split()[2] for case in looks] == expected
        assert looks[0].prepare() is nothing
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "ima-candidates: 10,000 nodes left out: they need 7.5 GB of memory, this machine has 2.0\n"
