from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from contextlib import suppress
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from benchmarks.choice import Choice, choose, left_out, read_choice, sensors_for, suite_of
from benchmarks.cli.bench import bench
from benchmarks.cli.simulate import simulate
from benchmarks.config import config_of
from benchmarks.results import COSTS, VALUES, Row, read_results
from benchmarks.scenarios import DEFAULT, make_scenario
from benchmarks.screen import print_problems
from sensors import ColorHistogram
from topoloc import plugins
from topoloc.cli.main import run
from topoloc.errors import UnknownName, UserError

SMALL: dict[str, Any] = {"scenarios": ["lab-fresh"], "sensors": ["histogram"], "estimators": ["best-match", "grid"]}


def test_the_command_writes_its_three_files_and_goes_on_where_it_stopped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    bench(**SMALL, seeds=1, updates=3, jobs=1, out=folder)
    rows = read_results(folder / "results.csv")
    config = tomllib.loads((folder / "config.toml").read_text())
    assert [(row.estimator, row.status) for row in rows] == [("best-match", "ok"), ("grid", "ok")]
    assert config["run"]["command"] == (
        "topoloc bench --scenarios lab-fresh --sensors histogram --estimators best-match grid --seeds 1 --updates 3"
    )
    assert config["scenarios"]["lab-fresh"]["updates"] == 3
    out = capsys.readouterr().out
    assert "lab-fresh (simulated)" in out
    assert all(str(folder / name) in out for name in ("results.csv", "config.toml", "report.html"))

    text = (folder / "results.csv").read_text()
    (folder / "results.csv").write_text(text[:-20])
    bench(resume=folder, jobs=1)
    again = read_results(folder / "results.csv")
    assert [row.key for row in again] == [row.key for row in rows]
    assert [row.values["node_accuracy"] for row in again] == [row.values["node_accuracy"] for row in rows]


def test_the_command_that_is_written_down_is_quoted() -> None:
    choice = Choice(("a b",), ("x",), ("y",), 1, 2)
    assert choice.command == "topoloc bench --scenarios 'a b' --sensors x --estimators y --seeds 1 --updates 2"


@pytest.mark.parametrize("what", ["scenarios", "sensors", "estimators"])
def test_unknown_names_are_refused_before_anything_is_written(what: str, tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match=f"no {what[:-1]} is called 'nonsense'; choose from: "):
        bench(**{**SMALL, what: ["nonsense"]}, out=tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("what", ["seeds", "updates", "jobs"])
def test_numbers_below_one_are_refused(what: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=f"--{what} is 0"):
        bench(**{**SMALL, what: 0}, out=tmp_path / "run")


def test_a_folder_that_holds_something_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(UserError, match="--resume"):
        bench(**SMALL, out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_resume_takes_no_other_settings_and_wants_a_run(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="leave out all others"):
        bench(resume=tmp_path, seeds=5)
    with pytest.raises(UserError, match=r"config\.toml: no such file"):
        bench(resume=tmp_path)


def test_a_run_with_other_settings_is_not_continued(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    bench(**SMALL, seeds=1, updates=3, jobs=1, out=folder)
    config = folder / "config.toml"
    text = config.read_text()
    for old, new in (("updates = 3\n", "updates = 3\n"), ("recovery = 0.02", "recovery = 0.5")):
        config.write_text(text.replace(old, new))
        if old == new:
            bench(resume=folder, jobs=1)
        else:
            with pytest.raises(UserError, match=r"config.toml.*\[estimators\].*start a new run"):
                bench(resume=folder, jobs=1)


def test_sensors_that_no_scenario_can_feed_are_named_and_left_out() -> None:
    chosen = sensors_for([make_scenario(name) for name in DEFAULT])
    assert chosen[0] == "ima"
    assert not {"disparity", "fourier"} & set(chosen)
    assert left_out(choose(None, None, None, 1, 1)) == "disparity (rgb, right images), fourier (omni images)"
    assert "disparity" in sensors_for([make_scenario("office-stereo")])
    assert sensors_for([make_scenario("hall-omni")]) == ("fourier",)


def test_what_is_left_out_is_told_once_the_run_begins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small: dict[str, Any] = {
        "scenarios": ["hall-omni"],
        "estimators": ["best-match"],
        "updates": 2,
        "seeds": 1,
        "jobs": 1,
    }
    with pytest.raises(UserError, match="no setting"):
        bench(**small, settings=["nonsense"], out=tmp_path / "run")
    assert capsys.readouterr().err == ""
    bench(**small, out=tmp_path / "run")
    assert "left out, since no scenario here has what they need: descriptor (rgb images)" in capsys.readouterr().err


def test_what_gives_no_result_at_all_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"no run gave a result.*omni images"):
        bench(sensors=["fourier"], estimators=["grid"], seeds=1, updates=3, jobs=1, out=tmp_path / "run")
    assert (tmp_path / "run" / "results.csv").exists()


def test_a_scenario_of_full_circles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench(scenarios=["hall-omni"], estimators=["grid"], seeds=1, updates=3, jobs=1, out=tmp_path / "run")
    assert [row.status for row in read_results(tmp_path / "run" / "results.csv")] == ["ok"]
    assert "hall-omni (simulated)" in capsys.readouterr().out


def test_settings_are_used_and_written_down(tmp_path: Path) -> None:
    words = ["sensors.histogram.sigma_m=0.7", "estimators.grid.recovery=0.1", "scenarios.lab-fresh.people=0.2"]
    folder = tmp_path / "run"
    bench(**SMALL, seeds=1, updates=3, jobs=1, settings=words, out=folder)
    config = tomllib.loads((folder / "config.toml").read_text())
    assert config["sensors"]["histogram"]["sigma_m"] == 0.7
    assert config["estimators"]["grid"]["recovery"] == 0.1
    assert config["scenarios"]["lab-fresh"]["people"] == 0.2
    assert config["run"]["command"].endswith("--set " + " ".join(words))
    sensor = suite_of(read_choice(folder)).sensors["histogram"]()
    assert isinstance(sensor, ColorHistogram) and sensor.config.sigma_m == 0.7
    bench(resume=folder, jobs=1)


def test_settings_are_written_down_as_what_they_stand_for(tmp_path: Path) -> None:
    words = ["sensors.ima.slots=4.0", "estimators.particle.particles=5e2", "sensors.mix(ima,histogram).weights=2,1"]
    sensors = ("ima", "mix(ima,histogram)")
    choice = Choice(("lab-fresh",), sensors, ("particle",), 1, 3, settings=tuple(words))
    config = config_of(choice, suite_of(choice))
    assert (config["sensors"]["ima"]["slots"], config["estimators"]["particle"]["particles"]) == (4, 500)
    assert config["sensors"]["mix(ima,histogram)"]["weights"] == [2.0, 1.0]


@pytest.mark.parametrize(
    ("word", "problem"),
    [
        ("sensors.ima.slots=4", "nothing is called 'ima' here"),
        ("sensors.histogram.slots=4", "nothing is called 'slots'"),
        ("estimators.grid.recovery=much", "'much'; write a number"),
        ("histogram.sigma_m=1", "nothing is called 'histogram' here"),
        ("scenarios.lab-fresh.updates=9", "updates"),
    ],
)
def test_settings_that_nothing_has_are_refused(word: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=problem):
        bench(**SMALL, settings=[word], out=tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_seeds_may_begin_later(tmp_path: Path) -> None:
    bench(**SMALL, seeds=1, first_seed=7, updates=3, jobs=1, out=tmp_path / "late")
    bench(**SMALL, seeds=2, first_seed=6, updates=3, jobs=1, out=tmp_path / "both")
    late, both = (read_results(tmp_path / name / "results.csv") for name in ("late", "both"))
    assert [row.seed for row in late] == [7, 7]
    told = [name for name in VALUES if name not in COSTS]
    for one, other in zip(late, [row for row in both if row.seed == 7], strict=True):
        assert [one.values[name] for name in told] == [other.values[name] for name in told]


def test_quick_and_full_contradict_each_other(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="contradict"):
        bench(quick=True, full=True, out=tmp_path / "run")


def test_json_is_all_that_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench(**SMALL, seeds=1, updates=3, jobs=1, out=tmp_path / "run", as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert (told["folder"], told["unfinished"]) == (str(tmp_path / "run"), 0)
    rows = read_results(tmp_path / "run" / "results.csv")
    assert [{name: one[name] for name in VALUES} for one in told["rows"]] == [dict(row.values) for row in rows]
    assert [one["estimator"] for one in told["rows"]] == ["best-match", "grid"]


def test_a_folder_is_a_scenario_found_again_from_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    simulate("lab", output=Path("mine"), seed=3, settings=("updates=4",))
    small = {**SMALL, "scenarios": ["mine", "lab-fresh"], "seeds": 2, "updates": 3, "jobs": 1}
    bench(**small, out=tmp_path / "run")
    rows = read_results(tmp_path / "run" / "results.csv")
    assert {(row.scenario, row.values["steps"]) for row in rows} == {("mine", 4.0), ("lab-fresh", 3.0)}
    text = (tmp_path / "run" / "results.csv").read_text()
    (tmp_path / "run" / "results.csv").write_text("\n".join(text.splitlines()[:3]) + "\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    bench(resume=tmp_path / "run", jobs=1)
    assert [row.key for row in read_results(tmp_path / "run" / "results.csv")] == [row.key for row in rows]
    listed = tmp_path / "mine" / "recording" / "rgb.txt"
    listed.write_text(listed.read_text() + "# other data\n")
    with pytest.raises(UserError, match=r"\[scenarios\] has other settings"):
        bench(resume=tmp_path / "run", jobs=1)


def test_two_scenarios_of_one_name_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    simulate("lab", output=Path("mine"), seed=3, settings=("updates=2",))
    shutil.copytree("mine", "other/mine")
    shutil.copytree("mine", "twins")
    for names in (["mine", "other/mine"], ["./twins"]):
        with pytest.raises(UserError, match=r"two scenarios are called '(mine|twins)'; give the folder another name"):
            bench(**{**SMALL, "scenarios": names}, out=tmp_path / "run")


def test_processes_here_and_a_cluster_are_not_both_used(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="give one of them"):
        bench(**SMALL, jobs=2, cluster="local", out=tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["scenarios", "sensors", "estimators", "settings"])
def test_an_option_with_nothing_after_it_does_not_mean_all(option: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="has nothing after it"):
        bench(**{**SMALL, option: []}, out=tmp_path / "run")


def test_numbers_that_are_not_whole_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for option in ("--seeds", "--updates", "--jobs", "--first-seed"):
        assert run(["bench", option, "1.5", "--out", str(tmp_path / "run")]) == 2
        assert f"{option} is '1.5'; write a whole number" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_cluster_that_does_not_answer_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--cluster nonsense: no dask scheduler answers there"):
        bench(**SMALL, cluster="nonsense", out=tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_settings_of_a_recorded_drive_and_its_length_are_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    simulate("lab", output=Path("mine"), seed=3, settings=("updates=2",))
    with pytest.raises(UserError, match="which is recorded: nothing is called 'people' here"):
        bench(**{**SMALL, "scenarios": ["mine"]}, settings=["scenarios.mine.people=0.5"], out=tmp_path / "run")


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('estimators = ["best-match"]\n', "", r"\[run\] has no estimators"),
        ("seeds = 1\n", "seeds = -2\n", "seeds is -2"),
        ("seeds = 1\n", 'seeds = "many"\n', "write a number"),
    ],
)
def test_a_config_that_somebody_spoilt_is_refused(old: str, new: str, problem: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    text = '[run]\nscenarios = ["lab-fresh"]\nsensors = ["ima"]\nestimators = ["best-match"]\nseeds = 1\nupdates = 3\n'
    assert old in text
    (folder / "config.toml").write_text(text.replace(old, new))
    with pytest.raises(UserError, match=problem):
        bench(resume=folder, jobs=1)


def test_failures_are_told_before_what_could_not_be_fed(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [
        Row("s", "ima", "grid", 0, "unavailable", "no pictures"),
        Row("s", "ima", "grid", 1),
        Row("s", "pca", "grid", 0, "failed", "a bug"),
        Row("s", "pca", "grid", 1, "failed", "another"),
    ]
    print_problems(rows)
    assert capsys.readouterr().out.splitlines() == [
        "2 of 4 runs failed, the first pca with grid on s, seed 0: a bug",
        "1 of 4 runs unavailable, the first ima with grid on s, seed 0: no pictures",
    ]


def test_a_sensor_whose_needs_are_a_property_may_be_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = make_scenario("lab-fresh")
    point = EntryPoint("dynamic", "benchmarks.looks:SharedLooks", plugins.SENSORS)  # what it needs, an instance knows
    monkeypatch.setattr(plugins, "entry_points", lambda group: [point])
    assert sensors_for([scenario]) == ("dynamic",)


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_progress_is_shown_on_a_terminal_and_nowhere_else(tmp_path: Path) -> None:
    words = ["--scenarios", "lab-fresh", "--sensors", "histogram", "--estimators", "best-match", "--updates", "3"]
    command = [sys.executable, "-m", "topoloc", "bench", *words, "--seeds", "2", "--jobs", "1"]
    silent = subprocess.run([*command, "--out", str(tmp_path / "a")], capture_output=True, text=True, check=True)
    assert silent.stderr == ""
    import pty

    ours, theirs = pty.openpty()
    shown = subprocess.Popen([*command, "--out", str(tmp_path / "b")], stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    told = b""
    with suppress(OSError):  # what Linux says at the end of a terminal
        while chunk := os.read(ours, 4096):
            told += chunk
    os.close(ours)
    out, _ = shown.communicate()
    assert shown.returncode == 0
    assert b"runs" in told and b"1/2" in told and re.search(rb"\d:\d\d:\d\d", told)  # how many, and the time left
    assert b"1/2" not in out
