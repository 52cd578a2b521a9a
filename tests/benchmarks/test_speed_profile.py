"""The profile of an update: time goes to our functions, and parts and limits are told."""

from __future__ import annotations

import json
from cProfile import Profile

import numpy as np
import pytest

from benchmarks.speed import profile as profiling
from benchmarks.speed import profile_look as looking
from benchmarks.speed.least_work import Work, look_work, step_work
from benchmarks.speed.machine import Limits
from benchmarks.speed.own_functions import ROOT, Function, own_shares
from benchmarks.speed.profile import PARTS, Part, Profiled, profile_pair
from benchmarks.speed.profile_look import profile_look
from benchmarks.speed.screen import make_console, print_profiles
from topoloc.geometry import circular_mean, wrap
from topoloc.testing import toy_map

LIMITS = Limits(copy_gb_s=10.0, read_gb_s=8.0, matmul32_gflop_s=50.0, matmul64_gflop_s=25.0)


def clicks() -> object:
    """A clock that ticks once each time it is looked at: shares then count calls, not time."""
    count = iter(range(10**9))
    return lambda: next(count)


def test_time_of_others_code_is_that_of_our_function_which_called_it() -> None:
    profile = Profile(clicks())  # type: ignore[arg-type]
    profile.runcall(wrap, np.linspace(-9.0, 9.0, 50))
    shares = own_shares(profile)
    assert [function.name for function, _ in shares] == ["topoloc.geometry.wrap"]
    assert shares[0][0].what.startswith("Angles (...) [rad] brought")
    assert shares[0][1] == 1.0


def test_shares_are_ordered_and_sum_to_one() -> None:
    profile = Profile(clicks())  # type: ignore[arg-type]
    profile.runcall(circular_mean, np.linspace(0.0, 1.0, 9))
    profile.runcall(lambda: toy_map().positions)
    shares = own_shares(profile)
    names = [function.name for function, _ in shares]
    assert "topoloc.geometry.circular_mean" in names and "topoloc.topo_map.TopoMap.positions" in names
    assert not any(name.startswith(("benchmarks", "tests", "numpy")) for name in names)
    taken = [share for _, share in shares]
    assert taken == sorted(taken, reverse=True) and sum(taken) == pytest.approx(1.0)


def test_the_rooms_are_where_they_are_looked_for() -> None:
    assert (ROOT / "topoloc" / "geometry.py").is_file()


def test_a_pair_is_profiled_part_by_part(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(profiling, "UPDATES", 6)
    monkeypatch.setattr(profiling, "PASSES", 1)
    profiling.laboratory.cache_clear()
    try:
        told = profile_pair("pca", "grid")
    finally:
        profiling.laboratory.cache_clear()
    assert [part.name for part in told.parts] == list(PARTS)
    functions = {part.name: {function.name.split(".")[0] for function, _ in part.shares} for part in told.parts}
    assert "sensors" in functions["look"] and "estimators" in functions["predict"]
    assert all(part.ms > 0.0 for part in told.parts)
    assert [part.work is not None for part in told.parts] == [True, True, True, False]
    rows = json.loads(json.dumps(told.rows()))
    assert sum(row["ours_ms"] for row in rows if row["what"] == "profile") == pytest.approx(told.ms, rel=0.01)
    assert [row["part"] for row in rows if row["what"] == "profile-least"] == ["look", "predict", "update"]


def test_a_look_on_a_large_map_has_the_least_work_of_its_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(looking, "NODES", 6)
    monkeypatch.setattr(looking, "LOOKS", 1)
    told = profile_look()
    (part,) = told.parts
    assert (told.name, part.name) == ("ima, a look on a map of 6 made panoramas", "look")
    assert part.work is not None and part.work.flops32 == 8 * 6 * 54 * 324 * 8 * 3
    assert part.work.read > 6 * 54 * 648  # scaled panoramas, and what is made of them
    assert {function.name.split(".")[0] for function, _ in part.shares} >= {"sensors"}
    assert part.ms > 0.0


def test_the_table_names_what_is_worth_it(capsys: pytest.CaptureFixture[str]) -> None:
    shares = tuple((Function(f"sensors.a.f{k}", f"Does {k}."), share) for k, share in enumerate((0.5, 0.48, 0.02)))
    parts = (Part("look", 8.0, shares, Work(8e6)), Part("predict", 2.0, (), None))
    print_profiles(make_console(), [Profiled("a with b", parts)], LIMITS)
    out = capsys.readouterr().out
    assert "a with b: 10.0 ms" in out
    assert "1.00 (x 8.0)" in out  # 8 MB at 8 GB/s are 1 ms
    assert "look, least work: 8.0 MB read\n" in out
    assert " f0 " in out and "40 %" in out and " f2 " not in out


def test_the_least_work_is_counted() -> None:
    eight = toy_map(4, 2)
    look = look_work("ima", eight, 1000)
    # 8 panoramas, 54 rows, 324 frequencies, 8 slots, 3 zooms, 8 operations
    assert (look.read, look.flops32) == (1000, 8 * 8 * 54 * 324 * 8 * 3)
    grid = step_work("grid", "update", eight, 8 * 500)
    assert (grid.read, grid.written, grid.flops64) == (4000, 4000, 2 * 500 * 8)
    assert look_work("histogram", eight, 7) == Work(7)
