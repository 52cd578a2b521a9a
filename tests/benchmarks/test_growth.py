"""Points, exponents, what is left out, and that what grows does what it should."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields
from functools import partial

import numpy as np
import pytest

from benchmarks.speed import growers as growing
from benchmarks.speed import growth as measuring
from benchmarks.speed import machine
from benchmarks.speed.grid import Hall
from benchmarks.speed.growers import (
    CELLS,
    LAYERS,
    NODES,
    PARTICLES,
    ROOM_MB,
    Pictured,
    circles,
    frames_of,
    growers,
    panoramas,
    views,
)
from benchmarks.speed.growth import Grower, Growth, Point, SetUp, Step, exponent, grow, measure_point
from benchmarks.speed.growth_plot import COLOURS, draw_growth
from benchmarks.speed.machine import Limits
from benchmarks.speed.screen import make_console, print_growths
from estimators.baselines import DeadReckoning
from sensors.fourier import FourierSignature
from sensors.ima import IMA, IMAConfig
from sensors.pca import PCAMap
from topoloc.errors import UserError
from topoloc.interfaces import Sensor
from topoloc.types import Evidence

MB = 125_000
"""Numbers of 8 bytes in 10^6 bytes."""


def point(size: int, ms: float, took_s: float = 1.0, fit_mb: float = 1.0) -> Point:
    return Point(size, ms, ms, ms, 11, 0.1, fit_mb, 1.0, 1.0, took_s)


def growth(sizes: tuple[int, ...], times: tuple[float, ...], left_out: tuple[tuple[int, str], ...] = ()) -> Growth:
    points = tuple(point(size, ms) for size, ms in zip(sizes, times, strict=True))
    return Growth(Grower("sleeper", "naps", sizes, idle), points, left_out)


def idle(size: int) -> SetUp:
    return lambda: lambda: None


# --- a point --------------------------------------------------------------------------------------------------------


def test_memory_is_told_apart_kept_at_the_peak_and_while_setting_up() -> None:
    def prepare(size: int) -> SetUp:
        made = np.ones(50 * MB)  # the map's: no memory of what is measured

        def set_up() -> Step:
            np.ones(8 * MB)  # gone when it is set up
            kept = made[: 3 * MB].copy()
            later: list[np.ndarray] = []

            def step() -> None:
                if not later:
                    later.append(kept[: 2 * MB].copy())  # made at the first look and kept
                kept + later[0].sum()  # 3 MB for a moment

            return step

        return set_up

    told = measure_point(Grower("a", "b", (1,), prepare), 1)
    assert told.fit_mb == pytest.approx(8.0, abs=0.1)
    assert told.kept_mb == pytest.approx(5.0, abs=0.1)
    assert told.peak_mb == pytest.approx(3.0, abs=0.1)
    assert told.ms > 0.0 and told.ms_low <= told.ms <= told.ms_high


# --- exponents ------------------------------------------------------------------------------------------------------


def test_the_exponent_is_that_of_a_power() -> None:
    sizes = (10, 100, 1000, 10_000)
    for k in (0.0, 0.5, 1.0, 2.0):
        slope, error = exponent(sizes, [3.0 * size**k for size in sizes])
        assert slope == pytest.approx(k, abs=1e-9) and error == pytest.approx(0.0, abs=1e-6)


def test_the_error_tells_what_is_no_power() -> None:
    bent, straight = exponent((1, 10, 100), (1.0, 1.0, 10.0)), exponent((1, 10, 100), (1.0, 3.0, 10.0))
    assert bent[1] > 0.2
    assert straight[1] < 0.05
    assert np.isnan(exponent((1, 10), (1.0, 2.0))[1])
    assert np.isnan(exponent((1,), (1.0,))[0])


def test_the_last_tenfold_leaves_out_what_does_not_grow() -> None:
    told = growth((8, 30, 100, 300, 1000), (1.0, 1.0, 1.0, 3.0, 10.0))
    assert told.last_tenfold[0] == pytest.approx(1.0, abs=0.05)
    assert told.exponent[0] < 0.6


# --- which sizes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("budget_s", "fit_mb", "measured"),
    [(1e9, 1.0, (1, 10, 100, 1000)), (12.0, 1.0, (1, 10)), (1e9, 40.0, (1, 10, 100))],
)
def test_sizes_end_where_time_or_memory_would(
    monkeypatch: pytest.MonkeyPatch, budget_s: float, fit_mb: float, measured: tuple[int, ...]
) -> None:
    def linear(grower: Grower, size: int) -> Point:
        return point(size, 1.0, took_s=0.9 * size, fit_mb=fit_mb * size)

    done: list[None] = []
    monkeypatch.setattr(measuring, "measure_point", linear)
    monkeypatch.setattr(measuring, "machines_memory_gb", lambda: 64.0)
    told = grow(Grower("a", "b", (1, 10, 100, 1000), idle), budget_s, lambda: done.append(None))
    assert len(done) == 4
    assert tuple(one.size for one in told.points) == measured
    assert [size for size, _ in told.left_out] == [size for size in (1, 10, 100, 1000) if size not in measured]


@pytest.mark.parametrize(("memory_gb", "measured"), [(1.0, 1), (10.0, 2), (float("inf"), 3)])
def test_no_size_takes_more_than_half_of_the_machines_memory(
    monkeypatch: pytest.MonkeyPatch, memory_gb: float, measured: int
) -> None:
    monkeypatch.setattr(measuring, "measure_point", lambda grower, size: point(size, 1.0, fit_mb=100.0 * size))
    monkeypatch.setattr(measuring, "machines_memory_gb", lambda: memory_gb)
    told = grow(Grower("a", "b", (1, 10, 55), idle), float("inf"), list)
    assert len(told.points) == measured


def test_a_size_that_is_refused_is_told() -> None:
    def prepare(size: int) -> SetUp:
        if size > 1:
            raise UserError("the map spans too much")
        return idle(size)

    told = grow(Grower("a", "b", (1, 10), prepare), float("inf"), list)
    assert told.left_out == ((10, "the map spans too much"),)


# --- what is told ---------------------------------------------------------------------------------------------------


def test_rows_are_json_even_where_there_is_no_exponent() -> None:
    rows = json.loads(json.dumps(growth((8,), (2.0,)).rows(), allow_nan=False))
    assert rows[0]["what"] == "growth" and rows[0]["number"] == 8 and rows[0]["ours_ms"] == 2.0
    assert rows[1] == {
        "what": "growth-exponent",
        "size": "by naps",
        "of": "sleeper",
        "by": "naps",
        "exponent": None,
        "exponent_error": None,
        "last_tenfold": None,
        "last_tenfold_error": None,
    }


def test_the_table_has_exponent_and_what_was_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    print_growths(make_console(), [growth((10, 100, 1000), (1.0, 10.0, 100.0), ((9000, "would take about 8 s"),))])
    out = capsys.readouterr().out
    assert "exponent of naps: 1.00 ± 0.00" in out
    assert "9,000 naps left out: would take about 8 s" in out


def test_the_picture_has_a_panel_for_each_thing_that_grows() -> None:
    other = Growth(Grower("walker", "steps", (1, 2), idle), (point(1, 1.0), point(2, 2.0)))
    figure = draw_growth([growth((8, 30), (1.0, 2.0)), other, growth((8, 30), (1.0, 3.0))])
    assert [axes.get_xlabel() for axes in figure.axes] == ["naps", "steps"]
    legend = figure.axes[0].get_legend()
    assert legend is not None and len(legend.get_texts()) == 3


def test_the_picture_has_every_row_however_many() -> None:
    rows = [growth((8, 30), (1.0, 2.0 + k)) for k in range(len(COLOURS) + 2)]
    axes = draw_growth(rows).axes[0]
    assert len(axes.containers) == len(rows)
    lines = [line for line in axes.lines if line.get_marker() not in ("None", "_", "|")]
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == len(rows)


# --- what grows -----------------------------------------------------------------------------------------------------


def test_every_row_can_be_measured_at_its_smallest() -> None:
    rows = growers()
    assert {row.by for row in rows} == {"nodes", "particles", "cells"}
    assert len({(row.name, row.by) for row in rows}) == len(rows)
    for row in rows:
        step = row.prepare(row.sizes[0])()
        step()
        step()


def test_sizes_are_those_of_the_issue() -> None:
    assert (NODES[0], NODES[-1]) == (8, 10_000)
    assert (PARTICLES[0], PARTICLES[-1]) == (100, 1_000_000)
    assert all(0.9e4 * 10**k < cells < 1.1e4 * 10**k for k, cells in enumerate(CELLS))


def test_nothing_is_prepared_of_the_evidence_of_an_update() -> None:
    seen: list[Evidence] = []

    class Watching(DeadReckoning):
        def update(self, evidence: Evidence) -> None:
            seen.append(evidence)
            assert set(vars(evidence)) == {field.name for field in fields(Evidence)}  # no cached property
            evidence.log_likelihood(np.zeros((1, 2)), np.zeros((1, 1)))

    step = growing._updates(Watching, 8)()
    for _ in range(2 * growing.ROUND):
        step()
    assert len(set(map(id, seen))) == 2 * growing.ROUND


def test_a_grid_has_as_many_cells_as_it_says() -> None:
    side = round((CELLS[0] / LAYERS) ** 0.5)
    hall = Hall(side, side, LAYERS)
    _, _, free = hall.topo_map.free_cells(hall.resolution_m, hall.resolution_m)
    assert LAYERS * free.sum() == CELLS[0]


@pytest.mark.parametrize(("make", "pictured"), [(IMA, panoramas), (PCAMap, views), (FourierSignature, circles)])
def test_sensors_recognise_what_they_are_shown(make: Callable[[], Sensor], pictured: Pictured) -> None:
    pictures = pictured(12)
    sensor = make()
    sensor.fit(pictures.topo_map)
    for frame in frames_of(pictures):
        seen = sensor.observe(frame)
        best, second = np.sort(seen.match)[[-1, -2]]
        assert best > second + 0.1


def test_exact_ima_keeps_all_that_it_makes_of_10000_panoramas() -> None:
    """A panorama's transforms take less than its share of the room."""
    count, kept = 12, []
    for config in (IMAConfig(memory_mb=ROOM_MB), IMAConfig(memory_mb=0.0)):
        row = Grower("ima", "nodes", (count,), partial(growing._looks, partial(IMA, config), panoramas))
        kept.append(measure_point(row, count).kept_mb)
    assert 0.2 < (kept[0] - kept[1]) / count < ROOM_MB / NODES[-1]


# --- the machine ----------------------------------------------------------------------------------------------------


def test_limits_are_the_best_of_several_tries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "LARGE_BYTES", 2**20)
    monkeypatch.setattr(machine, "SIDE", 64)
    seconds = iter([0.3, 0.1, *[0.3] * 5, *[0.2] * 7, *[0.4] * 7, *[0.8] * 7])
    monkeypatch.setattr(machine, "seconds_of", lambda call: next(seconds))
    told = machine.limits()
    assert told.copy_gb_s == pytest.approx(2.0 * 2**20 / 0.1 / 1e9)  # read and written
    assert told.read_gb_s == pytest.approx(2**20 / 0.2 / 1e9)
    assert told.matmul32_gflop_s == pytest.approx(2.0 * 64**3 / 0.4 / 1e9)
    assert told.matmul64_gflop_s == pytest.approx(2.0 * 64**3 / 0.8 / 1e9)


def test_the_least_time_is_the_longer_of_moving_and_reckoning() -> None:
    limits = Limits(copy_gb_s=10.0, read_gb_s=8.0, matmul32_gflop_s=50.0, matmul64_gflop_s=25.0)
    assert limits.seconds(read=8e9) == pytest.approx(1.0)
    assert limits.seconds(read=5e9, written=5e9) == pytest.approx(1.0)
    assert limits.seconds(flops32=50e9, flops64=50e9) == pytest.approx(3.0)
    assert limits.seconds(read=8e9, flops32=100e9) == pytest.approx(2.0)
