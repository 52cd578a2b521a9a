"""The dated report and the README's table say what the rows of a run say."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from benchmarks.publish import Published, publish, report_of
from benchmarks.publish.__main__ import main
from benchmarks.publish.headline import HEADLINE, HEADLINE_SCENARIOS
from benchmarks.publish.pages import BEGIN, END, ROOT
from benchmarks.report.comparisons import QUESTION
from benchmarks.results import ResultsFile, Row
from topoloc.errors import InputError

SENSORS = tuple(dict.fromkeys(sensor for sensor, _ in HEADLINE))
ESTIMATORS = tuple(dict.fromkeys(estimator for _, estimator in HEADLINE))
SEEDS = 6


def value(scenario: str, sensor: str, estimator: str, seed: int) -> float:
    """Node accuracy: PCA with particles is always .1 above IMA with the tracker, but where people stand about."""
    apart = 0.1 if (sensor, estimator) == QUESTION[1] else 0.0
    if scenario == "lab-people":
        apart *= (-1.0) ** seed
    return 0.5 + 0.02 * seed + apart


def rows_of(seeds: int = SEEDS) -> list[Row]:
    return [
        Row(
            scenario,
            sensor,
            estimator,
            seed,
            values={
                "node_accuracy": value(scenario, sensor, estimator, seed),
                "position_median_m": 0.25,
                "sensor_ms": 8.0,
                "estimator_ms": 1.0 + seed,
            },
        )
        for scenario in HEADLINE_SCENARIOS
        for sensor in SENSORS
        for estimator in ESTIMATORS
        for seed in range(seeds)
    ] + [Row("lab-fresh", "lame", "grid", 0, "failed", "a | bug")]


def run_folder(
    folder: Path, rows: list[Row], seeds: int = SEEDS, scenarios: Mapping[str, Mapping[str, Any]] | None = None
) -> Path:
    """A run's folder; ``scenarios`` adds to their tables."""
    tables = {name: {"description": f"What {name} is."} for name in HEADLINE_SCENARIOS}
    for name, table in (scenarios or {}).items():
        tables.setdefault(name, {}).update(table)
    names = {"scenarios": list(tables), "sensors": SENSORS, "estimators": ESTIMATORS}
    config = {
        "run": {"started": "2026-01-02 03:04:05", "rows": len(rows), "seeds": seeds, "updates": 60, **names},
        "versions": {"python": "3"},
        "machine": {"system": "Linux", "processor": "one", "cores": 2, "memory_gb": 8.0},
        "scenarios": tables,
        "sensors": {name: {} for name in SENSORS},
        "estimators": {name: {} for name in ESTIMATORS},
    }
    folder.mkdir(parents=True)
    (folder / "config.toml").write_text(tomli_w.dumps(config))
    with ResultsFile(folder / "results.csv", rows):
        pass
    return folder


def text_of(folder: Path) -> str:
    """The report of a run."""
    published = Published.of(folder)
    return report_of(published, published)


def line_of(text: str, *starts: str) -> list[str]:
    """The cells of the only line of a table that begins with these."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {' | '.join(starts)} |"))
    return [cell.strip() for cell in line.strip("| ").split(" | ")]


def test_both_are_written_from_the_rows(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run", rows_of())
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    report, _ = publish(folder, root=tmp_path)
    assert report == tmp_path / "docs" / "reports" / "2026-01-02.md"
    text = readme.read_text()
    assert text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    assert line_of(text, "`pca`", "`particle`")[2:] == ["0.65 ± 0.04", "0.55 ± 0.10", "0.65 ± 0.04", "0.25 ± 0.00 m"]
    assert line_of(text, "`ima`", "`grid`")[2:] == ["0.55 ± 0.04"] * 3 + ["0.25 ± 0.00 m"]


def test_the_report_calls_only_what_can_be_told(tmp_path: Path) -> None:
    text = text_of(run_folder(tmp_path / "run", rows_of()))
    second = "`pca` with `particle`"
    assert line_of(text, "`node_accuracy`", "lab-fresh")[4:] == ["+0.100 (+0.100 to +0.100)", second]
    assert line_of(text, "`node_accuracy`", "lab-people")[5] == "no difference told"
    assert "- failed: a | bug (`lame` on lab-fresh)" in text
    fresh = text[text.index("### lab-fresh") : text.index("### lab-people")]
    assert [cell.startswith("**") for cell in line_of(fresh, "`particle`")[1:]] == [name == "pca" for name in SENSORS]
    people = text[text.index("### lab-people") : text.index("### lab-kidnapped")]
    assert all(cell.startswith("**") for cell in line_of(people, "`particle`")[1:])
    assert line_of(text, "`ima`", "8.00", "8.00", "8.00")
    assert line_of(text, "`grid`", "3.50", "3.50", "3.50")
    assert "one, 2 cores, 8 GB, Linux" in text
    assert "All drives are **simulated**. 6 seeds from 0 on, 60 frames a drive. " in text
    costs = text[text.index("## What a step costs") : text.index("| sensor, `sensor_ms`")]
    assert "medians over all pairs and seeds that the sensor" in costs and "on one, 2 cores" in costs


def test_the_first_matrix_is_over_the_scenarios_that_most_ran_on(tmp_path: Path) -> None:
    """By hand: PCA with particles is .1 above the others in two of three scenarios, and level in the third."""
    rows = [row for row in rows_of() if row.key[:3] != ("lab-people", "ima", "grid")]
    rows += [Row("mine", "ima", "grid", seed, values={"node_accuracy": 0.0}) for seed in range(SEEDS)]
    folder = run_folder(tmp_path / "run", rows, scenarios={"mine": {"recorded": True}})
    text = text_of(folder)
    part = text[text.index("### All together") : text.index("### lab-fresh")]
    assert "Mean over lab-fresh, lab-people, lab-kidnapped, with equal weights. Left out, since one recorded" in part
    assert "tells no difference: mine. † lacks one of these: " in part
    particle = dict(zip(SENSORS, line_of(part, "`particle`")[1:], strict=True))
    assert particle["pca"].startswith("**62 (") and particle["ima"].startswith("55 (")
    grid = dict(zip(SENSORS, line_of(part, "`grid`")[1:], strict=True))
    assert grid["ima"].startswith("55 (") and grid["ima"].endswith(") †")
    assert not grid["pca"].endswith("†")


def test_the_answer_is_that_of_the_verdicts(tmp_path: Path) -> None:
    text = text_of(run_folder(tmp_path / "run", rows_of()))
    answer = text[text.index("In short, `ima` with `activity` beside `pca` with `particle`:") :]
    assert answer.split("\n\n")[1].splitlines() == [
        "- node accuracy: worse in lab-fresh, lab-kidnapped; no difference told in lab-people",
        "- median position error (m): no difference told in lab-fresh, lab-people, lab-kidnapped",
        "- recall at 99 % precision: no value in lab-fresh, lab-people, lab-kidnapped",
        "- calibration error: no value in lab-fresh, lab-people, lab-kidnapped",
    ]


def test_where_less_is_better_the_first_pair_may_win(tmp_path: Path) -> None:
    rows = [
        Row("lab-fresh", *pair, seed, values={"position_median_m": far + 0.01 * seed})
        for pair, far in zip(QUESTION, (0.1, 0.2), strict=True)
        for seed in range(SEEDS)
    ]
    text = text_of(run_folder(tmp_path / "run", rows))
    assert line_of(text, "`position_median_m`", "lab-fresh")[4:] == [
        "+0.100 (+0.100 to +0.100)",
        "`ima` with `activity`",
    ]
    assert "- median position error (m): better in lab-fresh\n" in text


def test_without_both_pairs_there_is_no_answer(tmp_path: Path) -> None:
    rows = [Row("lab-fresh", "ima", "activity", 0, values={"node_accuracy": 0.5})]
    text = text_of(run_folder(tmp_path / "run", rows))
    assert "They did not both run on any scenario." in text
    assert "### lab-people\n\nWhat lab-people is.\n\nNo run came to an end." in text


def test_of_a_recorded_drive_no_difference_is_told(tmp_path: Path) -> None:
    """It is said that it is recorded; its table has no interval and nothing in bold."""
    mine = [Row("mine", *row.key[1:], values=row.values) for row in rows_of() if row.scenario == "lab-fresh"]
    tables = {"mine": {"recorded": True, "frames": 211}, "lab-people": {"updates": 120}}
    text = text_of(run_folder(tmp_path / "run", [*rows_of(), *mine], scenarios=tables))
    assert "The drives of lab-fresh, lab-people, lab-kidnapped are **simulated**. 6 seeds from 0 on" in text
    assert "60 frames a drive (lab-people: 120)" in text
    assert "mine is one **recorded** drive; seeds there (6 seeds from 0 on) are the estimators' random numbers" in text
    part = text[text.index("### mine") : text.index("## IMA")]
    assert "One recorded drive" in part and line_of(part, "`grid`")[1:] == ["55"] * len(SENSORS) and "**" not in part
    assert line_of(text, "`node_accuracy`", "mine")[4:] == ["+0.100", "one drive: not told"]
    assert "; one drive: not told in mine\n" in text


def test_drives_that_are_all_recorded_are_not_called_simulated(tmp_path: Path) -> None:
    tables = {name: {"recorded": True} for name in HEADLINE_SCENARIOS}
    text = text_of(run_folder(tmp_path / "run", rows_of(), scenarios=tables))
    assert "simulated" not in text
    assert "lab-fresh, lab-people, lab-kidnapped are **recorded**, one drive each" in text
    part = text[text.index("### All together") : text.index("### lab-fresh")]
    assert "They are one recorded drive each" in part
    assert line_of(part, "`grid`")[1:] == ["55"] * len(SENSORS)


def test_few_seeds_tell_no_differences(tmp_path: Path) -> None:
    rows = [row for row in rows_of() if row.seed < 5]
    text = text_of(run_folder(tmp_path / "run", rows, seeds=5))
    assert line_of(text, "`node_accuracy`", "lab-fresh")[5] == "too few seeds"
    assert "Fewer than 6 seeds tell no differences" in text and "**" not in text[text.index("## Which") :]


def test_an_unfinished_run_or_a_page_without_place_is_refused(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run", rows_of())
    (tmp_path / "README.md").write_text("nothing\n")
    with pytest.raises(InputError, match="no place for the headline table"):
        publish(folder, root=tmp_path)
    lines = (folder / "results.csv").read_text().splitlines(keepends=True)
    (folder / "results.csv").write_text("".join(lines[:-1]))
    with pytest.raises(InputError, match=r"not finished: lacks 1 of \d+ rows; continue it: topoloc bench --resume"):
        publish(folder, root=tmp_path)
    assert not (tmp_path / "docs").exists()


def test_a_run_without_the_headlines_rows_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    rows = [row for row in rows_of() if row.key[:3] != ("lab-people", "ima", "kalman")]
    (tmp_path / "README.md").write_text(f"{BEGIN}\n{END}\n")
    with pytest.raises(InputError, match="has no row of ima/kalman on lab-people, which the README's table needs"):
        publish(run_folder(tmp_path / "run", rows), root=tmp_path)
    assert not (tmp_path / "docs").exists()


@pytest.mark.parametrize("lacking", ["started", "cores", "seeds"])
def test_settings_that_are_not_a_runs_are_refused(tmp_path: Path, lacking: str) -> None:
    path = run_folder(tmp_path / "run", rows_of()) / "config.toml"
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith(f"{lacking} ")))
    with pytest.raises(
        InputError, match=rf"config\.toml: \[\w+\] has no {lacking}; name the folder of a benchmark run"
    ):
        Published.of(path.parent)


def test_a_mistake_on_the_command_line_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = main([str(tmp_path / "nowhere")])
    out, errors = capsys.readouterr()
    assert (code, out) == (2, "")
    assert errors == f"publish: {tmp_path / 'nowhere'}: no such folder; name the folder of a benchmark run\n"


def test_the_readmes_table_is_that_of_the_last_report() -> None:
    """Means of the README, in %, stand in the report of the same run."""
    text = (ROOT / "README.md").read_text()
    table = text[text.index(BEGIN) : text.index(END)]
    reports = sorted((ROOT / "docs" / "reports").glob("*.md"))
    assert reports, "no report: write one with python -m benchmarks.publish RUN"
    report = reports[-1].read_text()
    for scenario, column in zip(HEADLINE_SCENARIOS, (2, 3, 4), strict=True):
        part = report[report.index(f"### {scenario}\n") :]
        heads = [cell.strip("` ") for cell in part[part.index("| ") :].split("\n", 1)[0].strip("| ").split(" | ")]
        for sensor, estimator in HEADLINE:
            told = line_of(table, f"`{sensor}`", f"`{estimator}`")[column]
            row = next(line for line in part.splitlines() if line.startswith(f"| `{estimator}` |"))
            cell = row.strip("|").split("|")[heads.index(sensor) + 1].strip("* ")
            found = re.match(r"\d+", cell)
            assert found is not None and abs(float(told.split()[0]) - float(found[0]) / 100.0) < 0.0101


def test_times_may_come_from_a_run_that_was_alone_on_its_machine(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run", rows_of())
    quiet = [replace(row, values={**row.values, "sensor_ms": 3.0, "node_accuracy": 0.0}) for row in rows_of()]
    text = report_of(Published.of(folder), Published.of(run_folder(tmp_path / "quiet", quiet)))
    assert line_of(text, "`ima`", "3.00", "3.00", "3.00")
    without = text_of(folder)
    assert text[: text.index("## What a step costs")] == without[: without.index("## What a step costs")]
