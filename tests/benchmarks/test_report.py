from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
import tomli_w

from benchmarks.report import report_html, write_report
from benchmarks.results import COLUMNS, ResultsFile, Row, Summary, Track, summarize, write_track

HOSTILE = "<script>alert('x & \"y\"')</script>"
CONFIG = {
    "run": {"command": "topoloc bench --seeds 2", "started": "2030-01-01 12:00:00", "rows": 4},
    "scenarios": {"toy": {"description": "A toy."}},
}
TRACK = Track(
    scenario="toy",
    sensor="ima",
    estimator="grid",
    seed=0,
    nodes=[(0.0, 0.0), (1.0, 0.0)],
    edges=[(0, 1)],
    ids=["door", "desk"],
    truth=[(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)],
    dead_reckoning=[(0.0, 0.0), (0.5, 0.1), (99.0, 0.2)],
    updates=[0, 2],
    estimates=[(0.3, 0.0), (1.0, 0.1)],
    right=[True, False],
    kidnapped_at=[],
)


def row(seed: int, accuracy: float | None, estimator: str = "grid", status: str = "ok", reason: str = "") -> Row:
    values = {"node_accuracy": accuracy, "position_median_m": 0.25, "steps": 60.0} if status == "ok" else {}
    return Row("toy", "ima", estimator, seed, status, reason, values)


ROWS = [row(0, 0.9), row(1, 0.7), row(0, None, "particle", "failed", "ValueError: a bug"), row(1, 0.5, "particle")]


class Page(HTMLParser):
    """What a browser would make of the page: its text, the tags, and whatever it would load."""

    VOID = frozenset({"meta", "br", "circle", "polyline", "path"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.texts: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "xlink:href", "srcset")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_the_page_holds_the_rows_the_plan_and_the_command() -> None:
    page = Page(report_html(ROWS, {"toy": TRACK}, CONFIG))
    text = "".join(page.texts)
    assert page.open == []
    for expected in ("0.80 ± 0.14", "0.25 ± 0.00 m", "ValueError: a bug", "A toy.", "topoloc bench --seeds 2"):
        assert expected in text
    assert all(column in page.texts for column in COLUMNS)
    assert "ima with grid, seed 0, names the right node in 1 of 2 updates, in the median 0.20 m off" in text
    assert "The worlds are simulated" in text
    assert "4 runs: 3 ok, 1 failed" in text
    assert page.tags.count("svg") == 1


def test_the_page_needs_nothing_from_outside() -> None:
    text = report_html(ROWS, {"toy": TRACK}, CONFIG)
    page = Page(text)
    assert page.links == []
    assert not {"link", "img", "iframe", "object", "embed"} & set(page.tags)
    assert not re.search(r"https?://|url\(|@import", text)


def test_hostile_names_are_escaped() -> None:
    hostile = Row(HOSTILE, HOSTILE, HOSTILE, 0, "failed", HOSTILE)
    track = Track(**{**vars(TRACK), "scenario": HOSTILE, "sensor": HOSTILE, "ids": [HOSTILE, HOSTILE]})
    config = {"run": {"command": HOSTILE, "started": HOSTILE}, "scenarios": {HOSTILE: {"description": HOSTILE}}}
    page = Page(report_html([hostile], {HOSTILE: track}, config))
    assert page.tags.count("script") == 1  # our own
    assert page.open == []
    assert page.texts.count(HOSTILE) >= 8


def test_an_unfinished_run_says_so() -> None:
    text = report_html(ROWS[:1], {}, CONFIG)
    assert "unfinished: 3 of 4 are still to run" in text
    assert "No run has come to an end" in text
    assert "unfinished" in report_html([], {}, CONFIG)


def test_dead_reckoning_that_strays_does_not_shrink_the_plan() -> None:
    text = report_html(ROWS, {"toy": TRACK}, CONFIG)
    box = re.search(r'viewBox="0 0 (\d+) (\d+)"', text)
    assert box and int(box[1]) < 500


def test_the_truth_is_not_drawn_through_a_kidnapping() -> None:
    track = Track(**{**vars(TRACK), "truth": [(0.0, 0.0), (0.1, 0.0), (0.9, 0.0), (1.0, 0.0)], "kidnapped_at": [2]})
    lines = re.findall(r'<polyline class="truth" points="([^"]*)"', report_html(ROWS, {"toy": track}, CONFIG))
    assert [len(line.split()) for line in lines] == [2, 2]


def test_a_report_is_made_from_a_folder_alone(tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text(tomli_w.dumps(CONFIG))
    with ResultsFile(tmp_path / "results.csv", ROWS):
        pass
    write_track(tmp_path, TRACK)
    ours = report_html(sorted(ROWS, key=lambda row: row.key), {"toy": TRACK}, CONFIG)
    assert Page(write_report(tmp_path).read_text()).texts == Page(ours).texts


def test_a_summary_is_mean_and_spread_over_the_seeds_that_ran() -> None:
    summaries = summarize(ROWS, "node_accuracy")
    assert summaries["toy", "ima", "grid"].mean == pytest.approx(0.8)
    assert summaries["toy", "ima", "grid"].text() == "0.80 ± 0.14"  # sample standard deviation of 0.9 and 0.7: 0.1414
    assert summaries["toy", "ima", "particle"] == Summary((0.5,), "ok", "ValueError: a bug")
    assert summaries["toy", "ima", "particle"].text() == "0.50"
    assert summarize([row(0, None, status="unavailable")], "nees")["toy", "ima", "grid"].text() == "unavailable"
    assert summarize([row(0, 1.0)], "nees")["toy", "ima", "grid"].text() == "-"
