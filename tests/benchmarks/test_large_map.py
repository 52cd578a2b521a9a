"""Large maps: made of whole buildings, the same every time, gone on with after a break; and how they are measured."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from oracles.clearance import distance_to_segments

from benchmarks.large_map import LargeMap, folder, make_large_map, measuring, pictures
from benchmarks.large_map.__main__ import main
from benchmarks.large_map.agreement import NO_NODE, Answers, Share, agreements, answers_of, right
from benchmarks.large_map.fidelity import rows
from benchmarks.large_map.making import CONDITIONS, OFF, ON, PLACES, Plan
from benchmarks.large_map.measuring import Costs, Result, growth, seconds_by_turns
from benchmarks.large_map.sites import APART_M, sites_of
from benchmarks.large_map.tables import fidelity_table, growth_line
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.renderer import Scene
from sensors.ima import IMA
from sensors.images import clahe, grey, resize
from topoloc.cli.main import EXIT_USER_ERROR
from topoloc.errors import InputError, UserError
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera, TopoMap
from topoloc.types import Evidence, Frame

NODES, SEED, QUERIES = 24, 3, 12
"""A laboratory with its corridor and nine nodes of an office floor."""


def silent(done: int) -> None:
    """Progress that nobody looks at."""


@pytest.fixture(scope="module")
def large() -> LargeMap:
    return make_large_map(NODES, SEED, queries=QUERIES)


def test_a_smaller_map_is_the_beginning_of_a_larger_one() -> None:
    small, larger = list(sites_of(120, SEED)), list(sites_of(700, SEED))
    assert sum(site.count for site in small) == 120
    assert sum(site.count for site in larger) == 700
    for one, other in zip(small[:-1], larger, strict=False):
        assert (one.seed, one.kind, one.settings, one.count) == (other.seed, other.kind, other.settings, other.count)
        assert np.array_equal(one.places + one.shift, other.places + other.shift)
    last = len(small) - 1
    assert np.array_equal(small[last].places, larger[last].places[: small[last].count])


def test_buildings_stand_apart_and_have_seeds_that_nothing_else_has() -> None:
    sites = list(sites_of(1500, 1))
    assert len({site.seed for site in sites}) == len(sites)
    assert min(site.seed for site in sites) > 5_000
    spans = [(site.places + site.shift)[:, 1] for site in sites]
    gaps = [above.min() - below.max() for below, above in pairwise(spans)]
    assert min(gaps) == pytest.approx(APART_M)
    assert len({site.kind for site in sites}) == 4


def test_panoramas_are_those_of_ima_s_scale_and_no_edge_joins_two_buildings(large: LargeMap) -> None:
    topo_map = large.topo_map
    assert topo_map.filtered
    for node in topo_map.nodes:
        assert node.panorama is not None
        assert node.panorama.shape == (54, 648)
        assert node.panorama.std() > 10.0
    edges = np.asarray(topo_map.edges)
    apart = np.linalg.norm(topo_map.positions[edges[:, 0]] - topo_map.positions[edges[:, 1]], axis=1)
    assert apart.max() < 5.0
    assert (edges < 15).all(axis=1).any()
    assert (edges >= 15).all(axis=1).any()


def test_as_many_queries_are_on_nodes_as_off_them_at_the_same_nodes_under_every_condition(large: LargeMap) -> None:
    assert large.places == [OFF] * QUERIES + [ON] * QUERIES
    assert len(large.frames) == len(large.truth) == len(large.drawn_from) == 2 * QUERIES
    for group in (large.conditions[:QUERIES], large.conditions[QUERIES:]):
        assert {name: group.count(name) for name in CONDITIONS} == {"as mapped": 6, "old": 3, "lights": 3}
    assert large.conditions[:QUERIES] == large.conditions[QUERIES:]
    assert np.array_equal(large.nodes[:QUERIES], large.nodes[QUERIES:])
    assert np.abs(large.truth[:QUERIES] - large.truth[QUERIES:]).min() > 1e-6


def test_queries_stand_on_their_node_or_near_it_clear_of_furniture(large: LargeMap) -> None:
    plan = Plan(NODES, SEED, QUERIES)
    assert np.array_equal(large.nodes, plan.nodes_of_queries)
    away = np.linalg.norm(large.truth[:, :2] - large.topo_map.positions[large.nodes], axis=1)
    on = np.array(large.places) == ON
    assert (away[~on] <= large.spacing[large.nodes[~on]] / 2.0 + 1e-9).all()
    assert away[~on].max() > 0.2
    assert 0.01 < away[on].max() <= pictures.ON_NODE_M + 1e-9
    assert min(np.ptp(large.truth[on, 2]), np.ptp(large.truth[~on, 2])) > np.pi
    for site in plan.sites:
        first = plan.first_nodes[site.number]
        for query in np.flatnonzero((large.nodes >= first) & (large.nodes < first + site.count)).tolist():
            world = site.world(CONDITIONS[large.conditions[query]])
            faces = world.scene(site.seed, world.config.now()).faces
            standing = faces.ends[faces.heights[:, 0] < pictures.HEAD_M]
            at = large.truth[query, :2] - site.shift
            assert distance_to_segments(at[None], standing).min() >= pictures.CLEARANCE_M - 1e-9
    for frame in large.frames:
        assert frame.images["rgb"].shape == (288, 384)
        assert np.array_equal(frame.camera, [0.1, 0.0, 0.0])


def test_on_a_node_a_query_sees_what_the_map_has_there(large: LargeMap) -> None:
    """IMA, which matches on nodes, matches the true one better than from off it, as the building was mapped."""
    ima = IMA()
    ima.fit(large.topo_map)
    seen = [ima.observe(frame) for frame in large.frames]
    matches = np.array([one.match[node] for one, node in zip(seen, large.nodes, strict=True)])
    mapped = np.array(large.conditions[:QUERIES]) == "as mapped"
    off, on = matches.reshape(2, QUERIES)[:, mapped].mean(axis=1)
    assert on > off + 0.05


def test_where_nothing_is_free_the_robot_stands_on_its_node() -> None:
    world = LabWorld()
    scene = world.scene(0, world.mapped_at(0))
    lines = [(x, -2.0, x, 2.0) for x in np.linspace(-2.0, 2.0, 41)]
    faces = scene.faces
    crowded = replace(
        scene,
        faces=replace(
            faces,
            **{name: getattr(faces, name)[: len(lines)] for name in ("texture", "repeat", "offset", "shade")},
            ends=np.array(lines),
            heights=np.tile((0.0, 1.0), (len(lines), 1)),
        ),
    )

    reach = pictures.half_way(world, world.positions[0])
    assert reach == pytest.approx(0.5)

    def away(seen: Scene) -> float:
        pose = pictures.query_pose(seen, world.positions[0], reach, np.random.default_rng(0))
        return float(np.linalg.norm(pose[:2] - world.positions[0]))

    assert away(crowded) == 0.0
    assert 0.0 < away(scene) <= 0.5


def test_at_full_size_a_panorama_is_the_world_s_own_filtered_and_scaled() -> None:
    world = LabWorld()
    own = world.topo_map(5).nodes[2].panorama
    assert own is not None
    filtered = clahe(grey(own), THESIS.clahe_clip_limit, THESIS.clahe_tiles, 40.0)
    full = pictures.panorama(world, 5, 2, Camera())
    assert np.array_equal(full, resize(filtered, 648, 54))
    half = pictures.panorama(world, 5, 2)
    assert 0.9 < np.corrcoef(full.ravel(), half.ravel())[0, 1] < 1.0


def test_making_goes_on_where_it_was_broken_off(large: LargeMap, tmp_path: Path) -> None:
    plan, done = Plan(NODES, SEED, QUERIES), []

    def impatient(count: int) -> None:
        done.append(count)
        if sum(done) == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        folder.make_in(tmp_path, plan, impatient)
    with pytest.raises(InputError, match="not finished"):
        folder.load(tmp_path)
    done.clear()
    folder.make_in(tmp_path, plan, done.append)
    assert done == [15, *[1] * 9]
    assert_same(folder.load(tmp_path), large)
    with pytest.raises(InputError, match="another map"):
        folder.make_in(tmp_path, replace(plan, seed=4), silent)
    (tmp_path / "parts" / "0001.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match="no part"):
        folder.load(tmp_path)


def test_queries_on_nodes_are_added_without_rendering_panoramas_again(
    large: LargeMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = Plan(NODES, SEED, QUERIES)
    for number, site in enumerate(plan.sites):  # a folder of the time before there were any
        folder.keep(tmp_path / folder.PARTS.format(number), plan.make(site, silent))
    (tmp_path / folder.PLAN_FILE).write_text(json.dumps(asdict(plan)))
    with pytest.raises(InputError, match="no such file: the map is not finished"):
        folder.load(tmp_path)
    monkeypatch.setattr(Plan, "make", None)
    done: list[int] = []
    folder.make_in(tmp_path, plan, done.append)
    assert done == [15, 9]
    assert_same(folder.load(tmp_path), large)


def assert_same(one: LargeMap, other: LargeMap) -> None:
    """Bit by bit."""
    assert one.topo_map.nodes == other.topo_map.nodes
    assert np.array_equal(one.truth, other.truth)
    assert one.places == other.places
    assert one.conditions == other.conditions
    for ours, theirs in zip(one.topo_map.nodes, other.topo_map.nodes, strict=True):
        assert np.array_equal(np.asarray(ours.panorama), np.asarray(theirs.panorama))
    for ours_seen, theirs_seen in zip(one.frames, other.frames, strict=True):
        assert np.array_equal(ours_seen.images["rgb"], theirs_seen.images["rgb"])


@pytest.mark.parametrize("text", ["", "[]", '{"nodes": 3, "colour": 2}', "{"])
def test_a_folder_without_a_plan_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(InputError, match="no plan"):
        folder.load(tmp_path)


@pytest.mark.parametrize("values", [(0, 1, 1), (5, 0, 1), (5, 1, 0)])
def test_maps_that_cannot_be_made_are_refused(values: tuple[int, int, int]) -> None:
    with pytest.raises(UserError, match="cannot be made"):
        Plan(*values)


def test_queries_are_drawn_for_each_size_from_its_own_nodes() -> None:
    plan = Plan(5_000, 1, 100)
    assert plan.sizes == [300, 1_000, 3_000, 5_000]
    off, on = plan.nodes_of_queries.reshape(2, 4, 100)
    assert np.array_equal(off, on)
    drawn = off
    assert (drawn < np.array(plan.sizes)[:, None]).all()
    assert (drawn.max(axis=1) > 0.9 * np.array(plan.sizes)).all()


def test_a_subset_has_the_first_nodes_and_its_own_queries(large: LargeMap) -> None:
    several = replace(large, drawn_from=np.tile(np.where(np.arange(QUERIES) < 5, 15, NODES), 2))
    small = several.subset(15)
    assert len(small.topo_map.nodes) == 15
    assert np.asarray(small.topo_map.edges).max() < 15
    assert [frame.timestamp for frame in small.frames] == [0.0, 1.0, 2.0, 3.0, 4.0, 12.0, 13.0, 14.0, 15.0, 16.0]
    assert small.places == [OFF] * 5 + [ON] * 5
    few = several.subset(NODES, queries=2)
    assert [frame.timestamp for frame in few.frames] == [5.0, 6.0, 17.0, 18.0]
    assert few.conditions == [large.conditions[query] for query in (5, 6, 17, 18)]
    with pytest.raises(UserError, match="choose from: 24"):
        large.subset(300)


def evidence(nodes: Sequence[int], match: Sequence[float]) -> Evidence:
    """What a sensor says that cares for nothing but these."""
    count = len(nodes)
    ones = np.ones(count)
    return Evidence(
        np.zeros((count, 3)), np.array(nodes), np.array(match), 1.0 - np.array(match), np.zeros(count), ones, ones
    )


class Says:
    """A sensor that gives prepared answers, by timestamp."""

    needs = frozenset({"rgb"})

    def __init__(self, answers: Sequence[Evidence]) -> None:
        self._answers = answers

    def fit(self, topo_map: TopoMap) -> None:
        """Nothing to learn."""

    def observe(self, frame: Frame) -> Evidence:
        return self._answers[int(frame.timestamp)]


def answers(*seen: tuple[int, float]) -> Answers:
    """Best node and match of each query."""
    return Answers(np.array([node for node, _ in seen]), np.array([match for _, match in seen]))


def test_shares_count_what_they_say_on_nodes_and_off_them_apart(large: LargeMap) -> None:
    """Off: the same, a miss as good, a blind frame, a miss of a sure and right one; on: a right one, a better one."""
    few = LargeMap(
        large.topo_map, large.frames[:6], large.truth[:6], np.array([3, 0, 0, 1, 2, 2]), large.drawn_from[:6],
        ["as mapped", "old", "old", "lights", "as mapped", "old"], [OFF] * 4 + [ON] * 2,
    )  # fmt: skip
    exact = answers((3, 0.7), (20, 0.4), (NO_NODE, 0.0), (1, 0.9), (2, 0.6), (20, 0.5))
    coarse = answers((3, 0.7), (21, 0.395), (NO_NODE, 0.0), (20, 0.5), (2, 0.6), (2, 0.48))
    off, on = (agreements(few, exact, coarse)[place] for place in (OFF, ON))
    assert (off.same, off.same_if_sure, off.same_if_right) == (Share(2, 4), Share(1, 2), Share(1, 2))
    assert (off.as_good, off.right_exact, off.right_coarse) == (Share(3, 4), Share(2, 4), Share(1, 4))
    assert off.same_under == {"as mapped": Share(1, 1), "old": Share(1, 2), "lights": Share(0, 1)}
    assert off.row()["same"] == {"hits": 2, "of": 4, "low": 0.15, "high": 0.85}
    assert (on.same, on.same_if_sure, on.same_if_right) == (Share(1, 2), Share(1, 1), Share(1, 1))
    assert (on.as_good, on.right_exact, on.right_coarse) == (Share(1, 2), Share(1, 2), Share(2, 2))
    assert on.same_under == {"as mapped": Share(1, 1), "old": Share(0, 1), "lights": Share(0, 0)}


def test_a_sensor_s_answer_is_its_best_match_and_a_blind_frame_has_none(large: LargeMap) -> None:
    says = Says([evidence([7, 3], [0.2, 0.7]), Evidence.blind(), evidence([4, 5], [0.6, 0.6])])
    got = answers_of(says, large.frames[:3])
    assert got.best.tolist() == [3, NO_NODE, 4]
    assert got.match.tolist() == [0.7, 0.0, 0.6]


def test_a_neighbour_is_right_and_what_lies_farther_or_is_blind_is_not(large: LargeMap) -> None:
    three = replace(large, nodes=np.array([0, 0, 0]))  # nodes 1 m apart in the laboratory; 0, 1, 2 round a corner
    assert right(three, np.array([0, 1, 2])).tolist() == [True, True, False]
    assert right(three, np.array([NO_NODE, 23, 5])).tolist() == [False, False, True]


def test_each_sensor_is_timed_once_a_frame_and_none_is_always_first(large: LargeMap) -> None:
    order: list[tuple[int, float]] = []

    class Notes(Says):
        def __init__(self, which: int) -> None:
            super().__init__([evidence([which], [0.5])] * 4)
            self._which = which

        def observe(self, frame: Frame) -> Evidence:
            order.append((self._which, frame.timestamp))
            return super().observe(frame)

    assert seconds_by_turns([Notes(0), Notes(1)], large.frames[:4]).shape == (2, 4)
    assert order == [(0, 0.0), (1, 0.0), (1, 1.0), (0, 1.0), (0, 2.0), (1, 2.0), (1, 3.0), (0, 3.0)]


def test_wilson_s_interval() -> None:
    """Against values by hand: 8 of 10 gives 0.490 to 0.943."""
    assert Share(8, 10).interval == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert Share(10, 10).interval[1] == 1.0
    assert Share(0, 0).interval == (0.0, 1.0)
    assert np.isnan(Share(0, 0).value)


def test_growth_is_the_exponent() -> None:
    nodes = [300, 1000, 3000]
    assert growth(nodes, [0.1 * count**0.5 for count in nodes]) == pytest.approx(0.5)
    assert np.isnan(growth([300, 300], [1.0, 2.0]))


def test_growth_is_told_of_two_sizes_or_more() -> None:
    def result(nodes: int, candidates: int) -> Result:
        costs = Costs(1.0, 1.0, 1.0)
        return Result(nodes, candidates, {}, nodes / 10.0, nodes**0.5, (1.0, 1.0, 1.0), costs, costs)

    assert growth_line([]) == growth_line([result(300, 50)]) == growth_line([result(300, 50), result(300, 200)]) == ""
    told = growth_line([result(300, 50), result(300, 200), result(3000, 200)])
    assert told == "time of a look grows as 200 candidates: exact nodes^1.00, coarse nodes^0.50"


def test_fitting_is_watched_and_undone(large: LargeMap) -> None:
    got = measuring.fitted(large, {"zoom": 1.0})
    assert isinstance(got.sensor, IMA)
    assert got.sensor.config.zoom == 1.0
    assert got.costs.most_mb >= got.costs.held_mb > NODES * 54 * 648 / 1e6
    with pytest.raises(UserError, match="colour"):
        measuring.fitted(large, {"colour": 1})


def test_exact_ima_has_room_for_the_transforms_of_10000_panoramas(large: LargeMap) -> None:
    few = replace(large, drawn_from=np.full(2 * QUERIES, 6)).subset(6)
    kept, none = (measuring.fitted(few, given).costs.held_mb for given in (measuring.EXACT, {"memory_mb": 0.0}))
    assert 0.2 < (kept - none) / 6 < measuring.EXACT["memory_mb"] / 10_000


def test_the_commands_make_and_measure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made, results = tmp_path / "map", tmp_path / "results.json"
    assert main(["make", "--nodes", "8", "--seed", "3", "--queries", "4", "-o", str(made)]) == 0
    assert "8 nodes, 8 queries" in capsys.readouterr().out
    assert main(["measure", str(made), "--nodes", "8", "--json", str(results)]) == 0
    out = capsys.readouterr().out
    for place in (ON, OFF):
        assert f"| 8 | all | {place} | 100.0 (51.0 to 100.0) |" in out
    assert "| 8 | all |" in out[out.index("times faster") :]
    (row,) = json.loads(results.read_text())
    assert (row["nodes"], row["candidates"], row[ON]["same"]["hits"], row[OFF]["same"]["of"]) == (8, 0, 4, 4)
    assert main(["measure", str(made), "--nodes", "300"]) == EXIT_USER_ERROR
    assert capsys.readouterr().err == "large_map: no queries are drawn from the first 300 nodes; choose from: 8\n"
    assert main(["measure", str(tmp_path / "none")]) == EXIT_USER_ERROR
    assert "make the map with" in capsys.readouterr().err


@pytest.mark.slow
def test_ima_sees_on_half_size_pictures_what_it_sees_on_full_size_ones() -> None:
    """On a floor of 40 nodes: the same map, and two maps that differ no more from it than any two do."""
    got = {(row.name, row.place): row for row in rows(rooms=4, queries=30)}
    full, kept, half, other = dict.fromkeys(name for name, _ in got)
    for place in PLACES:
        usual = got[full, place]
        assert usual.same == 1.0
        assert got[kept, place].same > 0.75
        assert got[half, place].same > got[other, place].same - 0.15
        for row in (got[kept, place], got[half, place], got[other, place]):
            assert row.best == pytest.approx(usual.best, abs=0.025)
            assert row.match == pytest.approx(usual.match, abs=0.02)
            assert row.right == pytest.approx(usual.right, abs=0.1)
    assert got[full, ON].right > got[full, OFF].right + 0.1
    assert fidelity_table([got[full, ON]]).splitlines()[-1].startswith("| full size | on a node | 100 |")
