"""The dated report and the README's table say what the rows of a run say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import tomli_w

from benchmarks.publish import BEGIN, END, HEADLINE, HEADLINE_SCENARIOS, ROOT, Published, publish, report_of
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


def run_folder(folder: Path, rows: list[Row]) -> Path:
    config = {
        "run": {"command": "topoloc bench", "started": "2026-01-02 03:04:05", "rows": len(rows), "seeds": SEEDS}
        | {"updates": 60},
        "versions": {"python": "3"},
        "machine": {"system": "Linux", "processor": "one", "cores": 2, "memory_gb": 8.0},
        "scenarios": {name: {"description": f"What {name} is."} for name in HEADLINE_SCENARIOS},
        "sensors": {name: {} for name in SENSORS},
        "estimators": {name: {} for name in ESTIMATORS},
    }
    folder.mkdir(parents=True)
    (folder / "config.toml").write_text(tomli_w.dumps(config))
    with ResultsFile(folder / "results.csv") as results:
        for row in rows:
            results.append(row)
    return folder


def line_of(text: str, *starts: str) -> list[str]:
    """The cells of the only line of a table that begins with these."""
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {' | '.join(starts)} |"))
    return [cell.strip() for cell in line.strip("| ").split(" | ")]


def test_both_are_written_from_the_rows(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run", rows_of())
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    report, _ = publish(folder, tmp_path)
    assert report == tmp_path / "docs" / "reports" / "2026-01-02.md"
    text = readme.read_text()
    assert text.startswith("before\n") and text.endswith("after\n") and "old" not in text
    assert line_of(text, "`pca`", "`particle`")[2:] == ["0.65 ± 0.04", "0.55 ± 0.10", "0.65 ± 0.04", "0.25 ± 0.00 m"]
    assert line_of(text, "`ima`", "`grid`")[2:] == ["0.55 ± 0.04"] * 3 + ["0.25 ± 0.00 m"]


def test_the_report_calls_only_what_can_be_told(tmp_path: Path) -> None:
    text = report_of(Published.of(run_folder(tmp_path / "run", rows_of())))
    second = "`pca` with `particle`"
    assert line_of(text, "`node_accuracy`", "lab-fresh")[4:] == ["+0.100 (+0.100 to +0.100)", second]
    assert line_of(text, "`node_accuracy`", "lab-people")[5] == "no difference told"
    assert line_of(text, "`estimator_ms`", "lab-fresh")[5] == "no difference told"  # both alike
    assert "- failed: a | bug (`lame` on lab-fresh)" in text
    fresh = text[text.index("### lab-fresh") : text.index("### lab-people")]
    assert [cell.startswith("**") for cell in line_of(fresh, "`particle`")[1:]] == [name == "pca" for name in SENSORS]
    people = text[text.index("### lab-people") : text.index("### lab-kidnapped")]
    assert all(cell.startswith("**") for cell in line_of(people, "`particle`")[1:])
    assert line_of(text, "`ima`", "8.00", "8.00", "8.00")
    assert line_of(text, "`grid`", "3.50", "3.50", "3.50")
    assert "one, 2 cores, 8 GB, Linux" in text


def test_few_seeds_tell_no_differences(tmp_path: Path) -> None:
    rows = [row for row in rows_of() if row.seed < 5]
    folder = run_folder(tmp_path / "run", rows)
    config = (folder / "config.toml").read_text().replace(f"seeds = {SEEDS}", "seeds = 5")
    (folder / "config.toml").write_text(config)
    text = report_of(Published.of(folder))
    assert line_of(text, "`node_accuracy`", "lab-fresh")[5] == "too few seeds"
    assert "Fewer than 6 seeds tell no differences" in text and "**" not in text[text.index("## Which") :]


def test_an_unfinished_run_or_a_page_without_place_is_refused(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run", rows_of())
    (tmp_path / "README.md").write_text("nothing\n")
    with pytest.raises(InputError, match="no place for the headline table"):
        publish(folder, tmp_path)
    lines = (folder / "results.csv").read_text().splitlines(keepends=True)
    (folder / "results.csv").write_text("".join(lines[:-1]))
    with pytest.raises(InputError, match=r"not finished.*--resume"):
        publish(folder, tmp_path)
    assert not (tmp_path / "docs").exists()


def test_the_readmes_table_is_that_of_the_last_report() -> None:
    """Means of the README, in %, stand in the report of the same run."""
    text = (ROOT / "README.md").read_text()
    table = text[text.index(BEGIN) : text.index(END)]
    report = sorted((ROOT / "docs" / "reports").glob("*.md"))[-1].read_text()
    for scenario, column in zip(HEADLINE_SCENARIOS, (2, 3, 4), strict=True):
        part = report[report.index(f"### {scenario}\n") :]
        heads = [cell.strip("` ") for cell in part[part.index("| ") :].split("\n", 1)[0].strip("| ").split(" | ")]
        for sensor, estimator in HEADLINE:
            told = line_of(table, f"`{sensor}`", f"`{estimator}`")[column]
            row = next(line for line in part.splitlines() if line.startswith(f"| `{estimator}` |"))
            cell = row.strip("|").split("|")[heads.index(sensor) + 1].strip("* ")
            found = re.match(r"\d+", cell)
            assert found is not None and abs(float(told.split()[0]) - float(found[0]) / 100.0) < 0.0101
