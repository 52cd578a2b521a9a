from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from filterpy import monte_carlo
from rich.console import Console
from threadpoolctl import threadpool_info, threadpool_limits

import benchmarks.speed as registry
from benchmarks.cli.speed import speed
from benchmarks.speed import case as timing
from benchmarks.speed import corridor, grid, machine
from benchmarks.speed import growers as growing
from benchmarks.speed.agreement import global_numbers_from, same_in_distribution, same_masses, same_numbers
from benchmarks.speed.case import Case, Pair, Result, measure
from benchmarks.speed.grid import Hall, grid_predict, kernel
from benchmarks.speed.growth import Grower, Growth, Point
from benchmarks.speed.least_work import Work
from benchmarks.speed.likelihood import log_likelihood, plain_log_likelihood
from benchmarks.speed.machine import Limits
from benchmarks.speed.own_functions import Function
from benchmarks.speed.particle_step import SEEN, particle_filter_step
from benchmarks.speed.profile import Part, Profiled
from benchmarks.speed.resampling import (
    filterpy_resampling,
    particles_resampling,
    same_counts,
    same_indices,
    some_weights,
)
from benchmarks.speed.screen import make_console, print_growths, print_profiles, print_results
from topoloc.cli import group, main, progress
from topoloc.errors import UnknownName, UserError
from topoloc.types import Evidence

KEYS = ["what", "size", "peer", "ours_ms", "peer_ms", "ratio", "agree"]


def nothing() -> None:
    pass


def a_case(what: str = "idling", group: str = "pastimes", packages: tuple[str, ...] = (), agree: bool = True) -> Case:
    return Case(group, what, "1 hour", "somebody", packages, lambda: Pair(nothing, nothing, lambda: agree))


LIMITS = Limits(copy_gb_s=10.0, read_gb_s=8.0, matmul32_gflop_s=50.0, matmul64_gflop_s=25.0)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "SHORTEST_S", 0.0)  # a call makes a sample
    monkeypatch.setattr(machine, "limits", lambda: LIMITS)
    monkeypatch.setattr(growing, "growers", lambda: (Grower("sleeper", "naps", (2, 4), lambda size: lambda: nothing),))


@pytest.fixture
def cases(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    return lambda *cases: monkeypatch.setattr(registry, "CASES", cases)


# --- what is run ----------------------------------------------------------------------------------------------------


def test_answers_are_compared_first_and_then_both_are_timed_by_turns() -> None:
    calls: list[str] = []

    def agree() -> bool:
        calls.append("agree")
        return True

    pair = Pair(lambda: calls.append("ours"), lambda: calls.append("peers"), agree)
    measure(replace(a_case(), prepare=lambda: pair), repeats=4)
    assert calls[0] == "agree"
    timed = calls[-8:]
    assert [set(timed[k : k + 2]) for k in (0, 2, 4, 6)] == [{"ours", "peers"}] * 4
    assert timed[:4] == ["ours", "peers", "peers", "ours"]


def test_libraries_have_one_thread() -> None:
    threads: set[int] = set()

    def look() -> None:
        threads.update(library["num_threads"] for library in threadpool_info())
        threads.add(cv2.getNumThreads())

    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    try:
        with threadpool_limits(2):
            look()
            assert 2 in threads
            threads.clear()
            measure(replace(a_case(), prepare=lambda: Pair(look, look, lambda: True)), repeats=1)
        assert threads == {1}
        assert cv2.getNumThreads() == 2
    finally:
        cv2.setNumThreads(before)


def test_ratio_is_the_peers_time_by_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    warm_up = [1.0]
    seconds = {"ours": iter([*warm_up, 2.0, 4.0, 4.0, 2.0, 4.0]), "peers": iter([*warm_up, 6.0, 8.0, 4.0, 8.0, 40.0])}
    pair = Pair(lambda: "ours", lambda: "peers", lambda: True)
    monkeypatch.setattr(timing, "seconds_of", lambda call, number=1: next(seconds[call()]))
    result = measure(replace(a_case(), prepare=lambda: pair), repeats=5)
    # ratios 3, 2, 1, 4, 10
    assert (result.ratio_low, result.ratio, result.ratio_high) == (2.0, 3.0, 4.0)
    assert (result.ours_ms, result.peer_ms) == (4000.0, 8000.0)
    assert result.samples == 5


@pytest.mark.parametrize(("seconds", "expected"), [(0.01, 21), (0.75, 10), (30.0, 5)])
def test_there_are_fewer_samples_where_the_work_is_long(
    monkeypatch: pytest.MonkeyPatch, seconds: float, expected: int
) -> None:
    monkeypatch.setattr(timing, "seconds_of", lambda call, number=1: seconds)
    assert measure(a_case(), repeats=21).samples == expected
    assert measure(a_case(), repeats=3).samples == 3


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Callable[[list[str]], int]:
    """The command line with this command alone, whatever else is installed."""
    monkeypatch.setattr(group, "names", lambda kind: ["speed"])
    monkeypatch.setattr(group, "load", lambda kind, name: speed)
    return main.run


def test_json_is_a_list_of_rows(
    cases: Callable[..., None], run: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    cases(filterpy_resampling("systematic", 200), grid_predict(Hall(8, 6)), a_case())
    assert run(["speed", "estimators", "--json", "--repeats", "3"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["what"] for row in rows] == ["resampling", "grid-predict"]
    for row in rows:
        assert list(row) == KEYS
        assert all(isinstance(row[name], float) and row[name] > 0.0 for name in ("ours_ms", "peer_ms", "ratio"))
        assert row["agree"] is True


def test_all_is_run_by_default_and_a_single_work_by_its_name(
    cases: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    cases(a_case("idling"), a_case("napping"), a_case("idling", "duties"))
    for what, expected in ((None, 3), ("idling", 2), ("pastimes", 2), ("napping", 1)):
        assert speed(what, repeats=1, as_json=True) == 0
        rows = json.loads(capsys.readouterr().out)
        assert len([row for row in rows if list(row) == KEYS]) == expected
        others = [row["what"] for row in rows if list(row) != KEYS]
        assert others == ([] if what else ["machine", "growth", "growth", "growth-exponent"])


def test_growth_is_told_and_drawn(
    cases: Callable[..., None],
    run: Callable[[list[str]], int],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    cases(a_case())
    picture = tmp_path / "growth.png"
    assert run(["speed", "growth", "--plot", str(picture)]) == 0
    out, err = capsys.readouterr()
    assert "sleeper, by naps" in out and "idling" not in out
    assert "1 rows of about" in err
    assert cv2.imread(str(picture)) is not None
    assert run(["speed", "growth", "--plot", str(picture)]) == 2  # it is there already
    assert "growth.png" in capsys.readouterr().err
    assert run(["speed", "growth", "--full", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert [row["what"] for row in json.loads(out)] == ["machine", "growth", "growth", "growth-exponent"]


def test_growths_options_are_refused_where_nothing_grows(cases: Callable[..., None], tmp_path: Path) -> None:
    cases(a_case())
    with pytest.raises(UserError, match="--plot is about growth"):
        speed("idling", plot=tmp_path / "growth.png")
    with pytest.raises(UserError, match="--full is about growth"):
        speed("idling", full=True)
    with pytest.raises(UserError, match=r"ends in \.png"):
        speed("growth", plot=tmp_path / "growth.jpg")


def test_the_machines_limits_are_told_with_each_table(
    cases: Callable[..., None], run: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    cases(a_case())
    assert run(["speed", "idling", "--repeats", "1"]) == 0
    assert "copies 10.0 GB/s" in capsys.readouterr().out
    assert run(["speed", "machine", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [LIMITS.row()]


def test_answers_that_differ_are_told_and_make_the_exit_code_1(
    cases: Callable[..., None], run: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    cases(a_case("idling"), a_case("napping", agree=False))
    assert run(["speed", "--repeats", "1"]) == 1
    idling, napping = capsys.readouterr().out.split("napping")
    assert " yes" in idling and " no" not in idling
    assert " no" in napping and " yes" not in napping
    assert run(["speed", "idling"]) == 0


def test_a_peer_that_is_not_installed_is_told(cases: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    lacking = a_case("napping", packages=("json", "no_such_package"))
    cases(a_case("idling"), lacking, lacking)
    assert speed(repeats=1, as_json=True) == 0
    out, err = capsys.readouterr()
    assert [row["what"] for row in json.loads(out)][:2] == ["idling", "machine"]
    assert err.startswith("no_such_package: not installed; make speed installs it; left out: 2 of 3\n")


def test_unknown_names_are_refused_with_those_that_exist(
    cases: Callable[..., None], run: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    cases(a_case("idling"), a_case("napping"))
    with pytest.raises(
        UnknownName, match="no comparison is called 'work'; choose from: pastimes, idling, napping, growth, "
    ):
        speed("work")
    assert run(["speed", "work"]) == 2
    assert "pastimes, idling, napping" in capsys.readouterr().err


def test_no_samples_are_refused() -> None:
    with pytest.raises(UserError, match="--repeats is 0"):
        speed(repeats=0)


@pytest.mark.parametrize("what", ["growth", "machine", "profile"])
def test_samples_are_refused_where_nothing_is_compared(what: str) -> None:
    with pytest.raises(UserError, match=f"--repeats is about comparisons, which 'topoloc speed {what}' leaves out"):
        speed(what, repeats=5)


def test_there_are_as_many_samples_as_are_asked_for(
    cases: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def watching(case: Case, repeats: int) -> Result:
        asked.append(repeats)
        return measure(case, 1)

    monkeypatch.setattr(timing, "measure", watching)
    cases(a_case())
    speed("idling")
    speed("idling", repeats=5)
    assert asked == [21, 5]


def test_nothing_to_compare_shows_no_bar(cases: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    def no_bar(items: Sequence[object], what: str) -> None:
        raise AssertionError(f"a bar {what!r} for {len(items)}")

    monkeypatch.setattr(progress, "track", no_bar)
    cases(a_case(packages=("no_such_package",)))
    assert speed("machine") == 0
    assert speed("idling") == 0


# --- on the screen --------------------------------------------------------------------------------------------------

WIDE = 123_456.0


def narrow() -> Console:
    return Console(width=80, file=io.StringIO(), force_terminal=True, color_system=None, highlight=False)


def written(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    out = console.file.getvalue()
    assert max(map(len, out.splitlines())) <= console.width
    assert "\N{HORIZONTAL ELLIPSIS}" not in out
    return out


def test_figures_are_whole_on_a_narrow_terminal() -> None:
    long = replace(a_case(), size="100 of 10,000 nodes, each with a panorama", peer="somebody.else.whose_name_is_long")
    console = narrow()
    print_results(console, [Result(long, WIDE, WIDE, 123.4, 1_234.0, 12_345.0, 21, agree=True)])
    out = written(console)
    for figure in ("123456 ", "123 (1234 to 12345)", " 21 ", " yes", "samples", "agree"):
        assert figure in out
    for word in ("panorama", "10,000"):  # on one line or another
        assert word in out


def test_figures_of_growth_and_profiles_are_whole_on_a_narrow_terminal() -> None:
    console = narrow()
    row = Grower("a sensor", "particles", (1_000_000,), lambda size: lambda: nothing)
    print_growths(console, [Growth(row, (Point(1_000_000, WIDE, WIDE, WIDE, 3, WIDE, WIDE, WIDE, WIDE, WIDE),))])
    function = Function(
        "sensors.a_module.AClassOfMany.a_function_with_a_long_name", "Does what takes long to tell." * 3
    )
    part = Part("look", WIDE, ((function, 1.0),), Work(8e11))
    print_profiles(console, [Profiled("a with b", (part,))], LIMITS)
    out = written(console)
    assert "1,000,000 " in out and "123456 (123456 to 123456)" in out
    assert "100000 (x 1.2)" in out and out.count(" 100 % ") == 2


@pytest.mark.parametrize(("columns", "width"), [(40, 80), (80, 80), (200, 200)])
def test_a_terminal_has_80_columns_at_least(monkeypatch: pytest.MonkeyPatch, columns: int, width: int) -> None:
    monkeypatch.setattr("sys.stdout", Terminal())
    monkeypatch.setenv("COLUMNS", str(columns))
    assert make_console().width == width


class Terminal(io.StringIO):
    """What is written to it is read by a person."""

    def isatty(self) -> bool:
        return True


# --- what counts as the same answer ---------------------------------------------------------------------------------


def test_peers_draw_the_numbers_that_we_draw_and_the_global_generator_is_left_as_it_was() -> None:
    before = np.random.mtrand.get_bit_generator()
    with global_numbers_from(3):
        drawn = monte_carlo.resampling.random(5)
    assert np.array_equal(drawn, same_numbers(3).random(5))
    assert np.random.mtrand.get_bit_generator() is before


def test_distributions_are_told_apart() -> None:
    def figures(mean: float, offset: int) -> Callable[[int], np.ndarray]:
        return lambda seed: np.random.default_rng(seed + offset).normal([0.0, mean], [1.0, 0.1])

    # the second mean differs by ten deviations; of equal ones chance tells apart a pair in 50 000
    assert same_in_distribution(figures(1.0, 0), figures(1.0, 0), runs=8)
    assert not same_in_distribution(figures(1.0, 0), figures(2.0, 0), runs=8)
    assert not same_in_distribution(figures(1.0, 0), lambda seed: np.array([0.0, np.nan]), runs=8)


def test_masses_are_told_apart() -> None:
    ours = np.array([0.5, 0.3, 0.2])
    assert same_masses(ours, ours + np.array([1e-3, -1e-3, 0.0]))
    assert not same_masses(ours, ours + np.array([3e-3, 0.0, -3e-3]))


@pytest.mark.parametrize("likelihood", [log_likelihood, plain_log_likelihood])
def test_the_peers_likelihood_is_ours(likelihood: Callable[[Evidence, np.ndarray], np.ndarray]) -> None:
    poses = np.random.default_rng(0).uniform([-1.0, -1.0, -9.0], [5.0, 3.0, 9.0], (500, 3))
    expected = SEEN[3].log_likelihood(poses[:, :2], poses[:, 2:])[:, 0]
    np.testing.assert_allclose(likelihood(SEEN[3], poses), expected, atol=1e-12)


# --- the estimators' comparisons agree, and would not if the peer were wrong -----------------------------------------


def agrees(case: Case) -> bool:
    return case.prepare().agree()


def test_particle_step_agrees() -> None:
    for package in ("particles", "numba"):
        pytest.importorskip(package)
    assert agrees(particle_filter_step(1000, log_likelihood, "particles"))


def test_particle_step_never_ends() -> None:
    for package in ("particles", "numba"):
        pytest.importorskip(package)
    pair = particle_filter_step(100, log_likelihood, "particles").prepare()
    for _ in range(2 * len(SEEN)):
        pair.ours()
        pair.peers()


def wider(evidence: Evidence, poses: np.ndarray) -> np.ndarray:
    return log_likelihood(replace(evidence, sigma=1.3 * evidence.sigma), poses)


def turned(evidence: Evidence, poses: np.ndarray) -> np.ndarray:
    return log_likelihood(replace(evidence, poses=evidence.poses + np.array([0.0, 0.0, 0.1])), poses)


@pytest.mark.parametrize("wrong", [wider, turned])
def test_particle_step_tells_a_wrong_peer(wrong: Callable[[Evidence, np.ndarray], np.ndarray]) -> None:
    for package in ("particles", "numba"):
        pytest.importorskip(package)
    assert not agrees(particle_filter_step(1000, wrong, "a wrong one"))


@pytest.mark.parametrize("name", ["systematic", "stratified", "multinomial"])
def test_resampling_agrees_with_filterpy(name: str) -> None:
    assert agrees(filterpy_resampling(name, 2000))


@pytest.mark.parametrize(("name", "same_algorithm"), [("systematic", True), ("residual", False)])
def test_resampling_agrees_with_particles(name: str, same_algorithm: bool) -> None:
    for package in ("particles", "numba"):
        pytest.importorskip(package)
    assert agrees(particles_resampling(name, 2000, same_algorithm))


def test_resampling_tells_a_wrong_peer() -> None:
    weights = some_weights(2000)
    assert not same_indices("systematic", monte_carlo.stratified_resample, weights)
    # filterpy's residual gives other counts than n w; the multinomial's counts stray farther from it
    assert not same_counts("residual", monte_carlo.residual_resample, weights)
    assert not same_counts("residual", monte_carlo.multinomial_resample, weights)
    assert same_counts("multinomial", monte_carlo.multinomial_resample, weights)


SMALL_HALLS = [Hall(14, 10), Hall(30, 20, resolution_m=0.1, deviation_m=0.15, deviation_deg=12.0)]


@pytest.mark.parametrize("hall", SMALL_HALLS)
def test_grid_predict_agrees(hall: Hall) -> None:
    assert agrees(grid_predict(hall))


@pytest.mark.parametrize("hall", SMALL_HALLS)
def test_grid_predict_tells_a_wrong_peer(hall: Hall, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid, "kernel", lambda variance: kernel(1.2 * variance))
    assert not agrees(grid_predict(hall))


def test_corridor_agrees() -> None:
    assert agrees(corridor.corridor_step(60))


def test_corridor_tells_a_wrong_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(corridor, "KERNEL", np.array([0.2, 0.6, 0.2]))
    assert not agrees(corridor.corridor_step(60))


def test_every_kernel_has_its_variance() -> None:
    for variance in (0.0, 0.16, 0.49, 0.5, 2.25):
        taps = kernel(variance)
        lags = np.arange(len(taps)) - len(taps) // 2
        assert taps.sum() == pytest.approx(1.0)
        # a Gaussian cut at four deviations lacks 0.1 % of its variance, and sampling at a deviation of 0.7 a little
        assert taps @ lags**2 == pytest.approx(variance, rel=0.01)


def test_every_comparison_is_in_the_list_once() -> None:
    rows = [(case.what, case.size, case.peer) for case in registry.CASES]
    assert len(set(rows)) == len(rows)
    assert {case.what for case in registry.CASES} >= {
        "ima",
        "ima-candidates",
        "kalman-step",
        "map-open",
        "nearest-histogram",
        "nearest-pca",
        "particle-step",
        "resampling",
        "grid-predict",
        "grid-update",
        "grid-1d",
    }
