"""``topoloc compare``: what it tells of two runs or two pairs, what it warns of, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from cyclopts import App

from benchmarks.cli.compare import MOST_WARNINGS
from benchmarks.cli.compare import compare as command
from benchmarks.compare import Line, compare_pairs, compare_runs, notes, pair_of, read_run, warnings
from benchmarks.results import ResultsFile, Row
from topoloc.cli import main
from topoloc.errors import InputError, UnknownName, UserError

IMA, PCA = ("ima", "activity"), ("pca", "particle")
FUSED = ("mix(ima,pca)", "grid")
SIX = [0.5, 0.6, 0.5, 0.6, 0.5, 0.6]
MORE = [value + step for value, step in zip(SIX, [0.1, 0.2] * 3, strict=True)]
METRIC = "node_accuracy"
CONFIG: dict[str, Any] = {
    "run": {"updates": 60},
    "versions": {"topoloc": "0.1.0", "numpy": "2.4"},
    "machine": {"cores": 2},
    "scenarios": {"lab": {"description": "A laboratory.", "people": 0.0}, "hall": {"description": "A hall."}},
    "sensors": {"ima": {"slots": 8, "scale": {"slope": 5.0}}, "pca": {"components": 15}},
    "estimators": {"activity": {}, "particle": {"particles": 1000}},
}

Values = Mapping[tuple[str, tuple[str, str]], Sequence[float | None]]
MakeRun = Callable[..., Path]


def changed(**tables: Mapping[str, Any]) -> dict[str, Any]:
    """The config with some tables in another state: one level deep."""
    return {name: {**table, **tables.get(name, {})} for name, table in CONFIG.items()}


@pytest.fixture
def make_run(tmp_path: Path) -> MakeRun:
    """Writes a run's folder: values by scenario and pair, a seed each from 0 on; further rows as they are."""

    def make(
        name: str, values: Values, config: Mapping[str, Any] = CONFIG, metric: str = METRIC, rows: Sequence[Row] = ()
    ) -> Path:
        folder = tmp_path / name
        made = [
            Row(scenario, *pair, seed, values={metric: value})
            for (scenario, pair), seeds in values.items()
            for seed, value in enumerate(seeds)
        ]
        with ResultsFile(folder / "results.csv", [*made, *rows]):
            pass
        (folder / "config.toml").write_text(tomli_w.dumps(dict(config)))
        return folder

    return make


def line_of(a: Path, b: Path, metric: str = METRIC) -> Line:
    (line,) = compare_runs(read_run(a), read_run(b), metric)
    return line


def told(a: Path, b: Path, metrics: Sequence[str] = (METRIC,)) -> list[str]:
    return warnings(read_run(a), read_run(b), metrics)


@pytest.fixture
def topoloc(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """The command as a user types it: exit code, output, errors."""
    app = App(name="topoloc")
    app.command(command, name="compare")
    monkeypatch.setattr(main, "build_app", lambda: app)

    def typed(*words: object) -> tuple[int, str, str]:
        code = main.run(["compare", *map(str, words)])
        return code, *capsys.readouterr()

    return typed


# --- what it tells --------------------------------------------------------------------------------------------------


def test_a_difference_by_hand(make_run: MakeRun) -> None:
    line = line_of(make_run("a", {("lab", IMA): SIX}), make_run("b", {("lab", IMA): MORE}))
    assert (line.scenario, line.a, line.b) == ("lab", IMA, IMA)
    assert (line.mean_a, line.mean_b, line.difference.mean) == pytest.approx((0.55, 0.7, 0.15))
    assert line.difference.interval is not None
    # All resampled differences are 0.1 in 1 of 64 cases, which is more than the tail: the interval ends there.
    assert (line.difference.interval.low, line.difference.interval.high) == pytest.approx((0.1, 0.2))
    assert (line.difference.pairs, line.verdict) == (6, "better")


@pytest.mark.parametrize(
    ("metric", "values", "verdict"),
    [
        ("node_accuracy", MORE, "better"),
        ("position_median_m", MORE, "worse"),
        ("sensor_ms", MORE, "worse"),
        ("steps", MORE, "higher"),
        ("steps", [0.0] * 6, "lower"),
        ("node_accuracy", SIX, "no difference told"),
        ("node_accuracy", [0.4, 0.7] * 3, "no difference told"),
        ("node_accuracy", [1.0] * 5, "too few seeds"),
        ("node_accuracy", [*[1.0] * 5, None], "too few seeds"),
        ("node_accuracy", [None] * 6, "no value"),
        ("nees", MORE, "better"),
        ("nees", [6.0 - value for value in SIX], "no difference told"),
        ("nees", [9.0] * 6, "worse"),
    ],
)
def test_the_word(metric: str, values: Sequence[float | None], verdict: str, make_run: MakeRun) -> None:
    a = make_run("a", {("lab", IMA): SIX}, metric=metric)
    b = make_run("b", {("lab", IMA): values}, metric=metric)
    assert line_of(a, b, metric).verdict == verdict


def test_means_are_over_the_same_seeds_and_what_is_left_out_is_counted(make_run: MakeRun) -> None:
    a = make_run("a", {("lab", IMA): [0.5, 0.7, 0.9, None]})
    b = make_run("b", {("lab", IMA): [0.5, 0.5, None]})
    line = line_of(a, b)
    assert (line.mean_a, line.mean_b) == pytest.approx((0.6, 0.5))
    assert (line.difference.pairs, line.difference.left_out) == (2, 1)


def test_seeds_apart_give_means_alone(make_run: MakeRun) -> None:
    b = make_run("b", {}, rows=[Row("lab", *IMA, 7, values={METRIC: 0.9})])
    line = line_of(make_run("a", {("lab", IMA): SIX}), b)
    assert (line.mean_a, line.mean_b) == pytest.approx((0.55, 0.9))
    assert (line.difference.mean, line.difference.pairs, line.verdict) == (None, 0, "too few seeds")


def test_drives_of_other_settings_are_not_paired(make_run: MakeRun) -> None:
    values = {("lab", IMA): SIX, ("hall", IMA): SIX}
    a = make_run("a", values)
    b = make_run(
        "b", dict.fromkeys(values, MORE), changed(scenarios={"lab": {"description": "Another word.", "people": 0.3}})
    )
    verdicts = {line.scenario: line for line in compare_runs(read_run(a), read_run(b), METRIC)}
    assert verdicts["hall"].verdict == "better"
    lab = verdicts["lab"]
    assert (lab.verdict, lab.difference.interval, lab.difference.pairs) == ("other drives", None, 0)
    assert (lab.mean_a, lab.mean_b) == pytest.approx((0.55, 0.7))
    assert told(a, b) == ["scenarios.lab.people: 0.0 against 0.3"]


def test_words_for_people_make_no_other_drives(make_run: MakeRun) -> None:
    values = {("lab", IMA): SIX}
    other = make_run("b", values, changed(scenarios={"lab": {"description": "Said better.", "people": 0.0}}))
    a = make_run("a", values)
    assert (line_of(a, other).verdict, told(a, other)) == ("no difference told", [])


def test_two_pairs_of_one_run(make_run: MakeRun) -> None:
    run = read_run(make_run("a", {("lab", IMA): SIX, ("lab", PCA): MORE, ("hall", PCA): MORE, ("lab", FUSED): SIX}))
    (line,) = compare_pairs(run, run, METRIC, (IMA, PCA))
    assert (line.scenario, line.a, line.b, line.verdict) == ("lab", IMA, PCA, "better")
    assert [one.verdict for one in compare_pairs(run, run, METRIC, (PCA, FUSED))] == ["worse"]


def test_two_pairs_of_two_runs(make_run: MakeRun) -> None:
    a, b = (read_run(make_run(name, {("lab", IMA): SIX, ("lab", PCA): MORE})) for name in "ab")
    (line,) = compare_pairs(a, b, METRIC, (PCA, IMA))
    assert (line.mean_a, line.mean_b) == pytest.approx((0.7, 0.55))


@pytest.mark.parametrize(
    ("word", "pair"),
    [
        ("ima/activity", IMA),
        ("ima + pca/grid", ("ima+pca", "grid")),
        ("mix(ima, pca) / grid", FUSED),
    ],
)
def test_how_a_pair_is_typed(word: str, pair: tuple[str, str]) -> None:
    assert pair_of(word) == pair


def test_a_recording_may_have_moved_but_not_changed(make_run: MakeRun) -> None:
    folders = [
        make_run(name, {("own", IMA): SIX}, changed(scenarios={"own": {"folder": name, "digest": digest}}))
        for name, digest in (("here", "12"), ("there", "12"), ("changed", "34"))
    ]
    assert line_of(folders[0], folders[1]).verdict == "no difference told"
    assert told(folders[0], folders[1]) == []
    assert line_of(folders[0], folders[2]).verdict == "other drives"


# --- what it warns of -----------------------------------------------------------------------------------------------


def test_unlike_settings_are_named_with_both_values(make_run: MakeRun) -> None:
    values = {("lab", IMA): SIX}
    other = changed(
        run={"updates": 20},
        sensors={"ima": {"slots": 4, "scale": {"slope": 2.0}, "zoom": 1.1}, "pca": {"components": 9}},
        versions={"numpy": "2.3"},
        machine={"cores": 8},
    )
    a, b = make_run("a", values), make_run("b", values, other)
    expected = [
        "run.updates: 60 against 20",
        "sensors.ima.slots: 8 against 4",
        "sensors.ima.scale.slope: 5.0 against 2.0",
        "sensors.ima.zoom: nothing against 1.1",
        "sensors.pca.components: 15 against 9",
        "versions.numpy: 2.4 against 2.3",
    ]
    assert told(a, b) == expected
    assert told(a, b, [METRIC, "estimator_ms"]) == [*expected, "machine.cores: 2 against 8"]
    assert told(a, a, ["peak_mb"]) == []


def test_of_pairs_only_their_own_settings_count(make_run: MakeRun) -> None:
    values = {("lab", IMA): SIX, ("lab", PCA): MORE}
    other = changed(sensors={"ima": {"slots": 4}, "pca": {"components": 9}}, estimators={"particle": {"particles": 9}})
    a, b = read_run(make_run("a", values)), read_run(make_run("b", values, other))
    assert warnings(a, a, [METRIC], (IMA, PCA)) == []
    assert warnings(a, b, [METRIC], (IMA, PCA)) == []
    assert warnings(a, b, [METRIC], (PCA, PCA)) == [
        "sensors.pca.components: 15 against 9",
        "estimators.particle.particles: 1000 against 9",
    ]


def test_what_only_one_has_is_told(make_run: MakeRun) -> None:
    a = make_run("a", {("lab", IMA): SIX[:2]})
    b = make_run("b", {("lab", IMA): SIX[:4], ("hall", PCA): SIX[:1]})
    assert told(a, b) == [
        "only B has the scenario hall",
        "only B has the sensor pca",
        "only B has the estimator particle",
        "only B has the seeds 2, 3",
    ]


def test_an_unfinished_run_and_what_failed_are_told(make_run: MakeRun) -> None:
    values = {("lab", IMA): SIX[:2]}
    bad = [Row("lab", *IMA, seed, "failed", "ValueError: a bug") for seed in range(2, 7)]
    blind = Row("lab", *PCA, 0, "unavailable", "needs right images")
    a = make_run("a", values, changed(run={"rows": 10}), rows=[*bad, blind])
    assert told(a, a)[:3] == [
        f"A is unfinished: 2 rows are missing; go on with topoloc bench --resume {a}",
        f"B is unfinished: 2 rows are missing; go on with topoloc bench --resume {a}",
        "A: 5 of 8 runs failed (ValueError: a bug): ima/activity on lab, seed 2; ima/activity on lab, seed 3; "
        "ima/activity on lab, seed 4; and 2 more",
    ]
    assert told(a, a)[3] == "A: 1 of 8 runs unavailable (needs right images): pca/particle on lab, seed 0"
    assert line_of(a, make_run("b", {("lab", IMA): SIX})).difference.left_out == 4


def test_of_one_recorded_drive_no_difference_is_told(make_run: MakeRun) -> None:
    """A deterministic estimator has the same value in every seed: of that, any interval has no width."""
    values = {("lab", IMA): [0.5] * 6, ("hall", IMA): [0.5] * 6}
    recorded = changed(scenarios={"hall": {"recorded": True}})
    a = read_run(make_run("a", values, recorded))
    b = read_run(make_run("b", dict.fromkeys(values, [0.75] * 6), recorded))
    lines = {line.scenario: line for line in compare_runs(a, b, METRIC)}
    assert lines["lab"].verdict == "better"
    hall = lines["hall"]
    assert (hall.mean_a, hall.mean_b, hall.difference.mean, hall.difference.pairs) == (0.5, 0.75, 0.25, 6)
    assert (hall.difference.interval, hall.verdict) == (None, "one drive: not told")
    (note,) = notes(a, b, lines.values())
    assert note.startswith("hall is one recorded drive: ")


# --- what it refuses ------------------------------------------------------------------------------------------------


def test_a_folder_that_is_no_run(tmp_path: Path, make_run: MakeRun) -> None:
    with pytest.raises(InputError, match="nothing: no such folder; name the folder of a benchmark run"):
        read_run(tmp_path / "nothing")
    (tmp_path / "bare").mkdir()
    with pytest.raises(InputError, match=r"bare/results\.csv: no such file"):
        read_run(tmp_path / "bare")
    with pytest.raises(InputError, match=r"empty/results\.csv: holds no rows yet; run it with topoloc bench --resume"):
        read_run(make_run("empty", {}))
    folder = make_run("a", {("lab", IMA): SIX})
    (folder / "config.toml").unlink()
    with pytest.raises(InputError, match=r"config\.toml: no such file"):
        read_run(folder)


def test_a_config_of_another_shape_tells_nothing(make_run: MakeRun) -> None:
    a = make_run("a", {("lab", IMA): SIX}, {"run": 3, "sensors": {"ima": 4}, "scenarios": []})
    assert read_run(a).missing == 0
    assert told(a, a) == []
    assert line_of(a, a).verdict == "no difference told"


def test_runs_with_nothing_in_common(make_run: MakeRun) -> None:
    a, b = (read_run(make_run(name, {(name, IMA): SIX, (name, PCA): SIX})) for name in ("lab", "hall"))
    with pytest.raises(UserError, match="share no scenario with the same sensor and estimator; compare pairs"):
        compare_runs(a, b, METRIC)
    with pytest.raises(UserError, match="ima/activity and pca/particle share no scenario in"):
        compare_pairs(a, b, METRIC, (IMA, PCA))


def test_names_that_nothing_has(make_run: MakeRun) -> None:
    run = read_run(make_run("a", {("lab", IMA): SIX, ("lab", PCA): SIX}))
    with pytest.raises(UnknownName, match="no metric is called 'speed'; choose from: steps, node_accuracy"):
        compare_runs(run, run, "speed")
    with pytest.raises(UnknownName, match=r"no sensor in .*a is called 'eyes'; choose from: ima, pca"):
        compare_pairs(run, run, METRIC, (IMA, ("eyes", "particle")))
    with pytest.raises(UnknownName, match=r"no estimator in .*a is called 'mind'; choose from: activity, particle"):
        compare_pairs(run, run, METRIC, (("ima", "mind"), PCA))
    with pytest.raises(InputError, match="has no row of ima/particle yet; finish it: topoloc bench --resume"):
        compare_pairs(run, run, METRIC, (("ima", "particle"), PCA))


@pytest.mark.parametrize("word", ["ima", "ima/", "/grid", ""])
def test_a_word_that_is_no_pair(word: str) -> None:
    with pytest.raises(UserError, match="is no pair; write SENSOR/ESTIMATOR"):
        pair_of(word)


# --- as a user types it ---------------------------------------------------------------------------------------------


def test_the_tables(make_run: MakeRun, topoloc: Callable[..., tuple[int, str, str]]) -> None:
    a, b = make_run("a", {("lab", IMA): SIX}), make_run("b", {("lab", IMA): MORE, ("hall", IMA): SIX})
    code, out, errors = topoloc(a, b)
    assert code == 0
    assert errors == "warning: only B has the scenario hall\n"
    assert out.startswith(f"A: {a}\nB: {b}\nnode_accuracy, lab (higher is better)")
    assert "position_median_m, lab (lower is better)" in out
    row = next(line.split() for line in out.splitlines() if line.startswith(" ima"))
    assert row[:5] == ["ima", "activity", "0.550", "0.700", "0.150"]
    assert row[-2:] == ["6", "better"]


def test_the_table_of_two_pairs(make_run: MakeRun, topoloc: Callable[..., tuple[int, str, str]]) -> None:
    run = make_run("a", {("lab", IMA): SIX, ("lab", FUSED): [*MORE[:5], None]})
    code, out, _ = topoloc(run, "--pairs", "ima/activity", "mix(ima, pca)/grid", "--metric", METRIC, METRIC)
    assert code == 0
    assert out.startswith(f"A: ima/activity in {run}\nB: mix(ima,pca)/grid in {run}\n")
    (row,) = [line for line in out.splitlines() if line.startswith(" lab")]
    assert row.rstrip().endswith("5 (1 left out)  too few seeds")


def test_the_list_for_machines(make_run: MakeRun, topoloc: Callable[..., tuple[int, str, str]]) -> None:
    run = make_run("a", {("lab", IMA): [0.5], ("lab", PCA): [0.75]})
    code, out, _ = topoloc(run, run, "--metric", METRIC, "nees", "--json")
    assert code == 0
    assert len(json.loads(out)) == 4
    code, out, _ = topoloc(run, "--pairs", "ima/activity", "pca/particle", "--metric", METRIC, "--json")
    assert json.loads(out) == [
        {
            "metric": METRIC,
            "scenario": "lab",
            "a": "ima/activity",
            "b": "pca/particle",
            "mean_a": 0.5,
            "mean_b": 0.75,
            "difference": 0.25,
            "low": None,
            "high": None,
            "pairs": 1,
            "left_out": 0,
            "verdict": "too few seeds",
        }
    ]


def test_one_recorded_drive_is_shown_without_an_interval(
    make_run: MakeRun, topoloc: Callable[..., tuple[int, str, str]]
) -> None:
    recorded = changed(scenarios={"hall": {"recorded": True}})
    run = make_run("a", {("hall", IMA): [0.5] * 6, ("hall", PCA): [0.75] * 6}, recorded)
    words = [run, "--pairs", "ima/activity", "pca/particle", "--metric", METRIC]
    code, out, errors = topoloc(*words)
    assert (code, errors.count("hall is one recorded drive")) == (0, 1)
    (row,) = [line.split() for line in out.splitlines() if line.startswith(" hall")]
    assert row == ["hall", "0.500", "0.750", "0.250", "6", "one", "drive:", "not", "told"]
    (line,) = json.loads(topoloc(*words, "--json")[1])
    assert (line["low"], line["high"], line["verdict"]) == (None, None, "one drive: not told")


def test_many_warnings_are_cut_short(make_run: MakeRun, topoloc: Callable[..., tuple[int, str, str]]) -> None:
    values = {("lab", IMA): SIX}
    sides = [changed(sensors={"ima": {f"key{k}": k + side for k in range(MOST_WARNINGS + 7)}}) for side in (0, 1)]
    a, b = (make_run(name, values, config) for name, config in zip("ab", sides, strict=True))
    lines = topoloc(a, b)[2].splitlines()
    assert len(lines) == MOST_WARNINGS + 1
    assert (lines[0], lines[-1]) == ("warning: sensors.ima.key0: 0 against 1", "warning: and 7 more")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["a"], "one run needs --pairs ima/activity pca/particle, say; or name a second run"),
        (["a", "a", "--metric", "speed"], "no metric is called 'speed'; choose from: "),
        (["a", "a", "--pairs", "ima", "pca/particle"], "'ima' is no pair; write SENSOR/ESTIMATOR"),
        (["a", "nowhere"], "nowhere: no such folder; name the folder of a benchmark run"),
        ([], "topoloc: "),
    ],
)
def test_mistakes_are_one_line(
    words: Sequence[str],
    says: str,
    make_run: MakeRun,
    topoloc: Callable[..., tuple[int, str, str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(make_run("a", {("lab", IMA): SIX}).parent)
    code, out, errors = topoloc(*words)
    assert (code, out, errors.count("\n")) == (2, "", 1)
    assert says in errors
