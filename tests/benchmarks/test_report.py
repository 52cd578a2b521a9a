"""The report's figures against cases worked out by hand, and what it says where something is missing."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from oracles import small_run
from oracles.small_run import ESTIMATORS, SCENARIOS, SENSORS, UNFED, row, rows, write_run
from oracles.spoil import Spoil, remove, rewrite, write

from benchmarks.report import replay_data, write_report
from benchmarks.report.answers import Answers
from benchmarks.report.comparisons import (
    A_BETTER,
    B_BETTER,
    MOST_COMPARISONS,
    NONE_TOLD,
    TOO_FEW,
    compare,
    offered,
    verdict,
)
from benchmarks.report.error_curves import median_errors
from benchmarks.report.headline import BEST, ELSEWHERE, LEVEL, OPEN, WORSE, Cell, Headline, headline_of
from benchmarks.report.markup import asset, json_script, number
from benchmarks.report.reliability import Reliability
from benchmarks.report.run_read import RunRead
from benchmarks.results import Row
from benchmarks.spread import Difference, Interval, paired
from topoloc.metrics import METRICS

HOSTILE = "</script><script>alert('x & \"y\"')</script>"


class Page(HTMLParser):
    """What a browser would make of the page: its text, the tags, and whatever it would load."""

    VOID = frozenset({"meta", "br", "wbr", "img", "input", "circle", "path", "rect"})

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

    @property
    def text(self) -> str:
        return " ".join("".join(self.texts).split())


def page_of(folder: Path) -> Page:
    return Page(write_report(folder).read_text())


def embedded(folder: Path, role: str) -> list[object]:
    """What the page's script reads under this role."""
    pattern = rf'<script type="application/json" data-role="{role}">(.*?)</script>'
    return [json.loads(found) for found in re.findall(pattern, (folder / "report.html").read_text())]


@pytest.fixture(scope="module")
def eight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with eight seeds, and its report; nobody changes it."""
    folder = write_run(tmp_path_factory.mktemp("runs") / "eight", seeds=8)
    write_report(folder)
    return folder


def test_the_page_holds_what_the_run_found(tmp_path: Path) -> None:
    page = page_of(write_run(tmp_path / "run"))
    assert page.open == []
    for expected in (
        "16 runs: 14 ok, 2 unavailable. Started 2030-01-01 12:00:00.",
        "With 2 seeds no difference can be called one yet: that takes at least 6. Run topoloc bench --seeds 10",
        "Simulated (toy): ",
        "Somebody's folder (carried): one drive.",
        "A toy. (simulated)",
        "Carried away. (somebody's folder: one drive, seeds are the estimator's alone)",
        "0 of 2, unavailable",
        f"unavailable: {UNFED}: mix(a,b)/grid",
        "topoloc bench --scenarios toy --sensors ima --estimators activity --seeds 2 --updates 6 "
        "--set sensors.ima.slots=4Copy",
        "topoloc bench --scenarios carried --sensors 'mix(a,b)' --estimators grid --seeds 2 --updates 6 "
        "--set estimators.grid.headings=12",
        "topoloc explain run --scenario toy --sensor 'mix(a,b)' --estimator grid --seed 0 --step 12",
    ):
        assert expected in page.text
    assert all(metric.definition in page.text for metric in METRICS)


def test_the_tables_hold_means_and_intervals_of_the_rows(tmp_path: Path) -> None:
    text = write_report(write_run(tmp_path / "run")).read_text()
    toy = text[text.index("<h3>toy</h3>") : text.index("<h3>carried</h3>")]
    carried = text[text.index("<h3>carried</h3>") : text.index("Can the stated")]
    line = toy[toy.index("ima/<wbr>activity") : toy.index("ima/<wbr>grid")]
    # node accuracy 0.90 and 0.91, position error 0.2 and 0.3 m, NEES 3 and 4
    assert '<td data-value="0.905">0.91 <span class="mark">★</span><small>[0.90, 0.91]</small></td>' in line
    assert '<td data-value="0.25">0.25<small>[0.20, 0.30]</small></td>' in line
    assert '<td data-value="3.5">3.50<small>[3.00, 4.00]</small></td>' in line
    assert '<td data-value="1234.5">1234<small>[1234, 1234]</small></td>' in line
    assert "recovery" not in toy  # nobody has a value there
    assert '<td data-value="2">2.00' in carried
    assert '<td data-value="" class="none">\N{EN DASH}</td>' in carried[carried.index("ima/<wbr>grid") :]


def test_the_headline_is_the_mean_over_scenarios_with_equal_weights() -> None:
    headline = headline_of(rows(8))
    best = headline.cells["ima", "activity"]
    noise = 0.01 * np.mean([seed % 3 for seed in range(8)])
    assert best.mean == pytest.approx((0.9 + 0.7) / 2 + noise)
    assert best.interval is not None
    assert best.interval.low < best.mean < best.interval.high
    assert headline.best == ("ima", "activity")
    assert (headline.compared, headline.seeds) == (frozenset(SCENARIOS), 8)
    assert headline.cells["ima", "grid"].verdict == WORSE
    assert headline.cells["mix(a,b)", "activity"].verdict == WORSE  # by 0.02 in most seeds, never more
    assert headline.cells["mix(a,b)", "grid"].verdict == ELSEWHERE
    assert headline.cells["mix(a,b)", "grid"].scenarios == 1


def test_pairs_that_only_scatter_are_not_told_apart_from_the_best() -> None:
    noise = [0.1, -0.1, 0.05, -0.05, 0.1, -0.12]
    pairs = {("ima", "grid"): 0.8 + np.zeros(6), ("pca", "grid"): 0.8 + np.array(noise), ("pca", "voting"): np.ones(6)}
    table = [
        Row("toy", *pair, seed, values={"node_accuracy": v}) for pair, vs in pairs.items() for seed, v in enumerate(vs)
    ]
    without = headline_of([one for one in table if one.estimator == "grid"])
    assert {pair: cell.verdict for pair, cell in without.cells.items()} == {
        ("ima", "grid"): BEST,
        ("pca", "grid"): LEVEL,
    }
    assert headline_of(table).cells["ima", "grid"].verdict == WORSE
    few = headline_of([one for one in table if one.seed < 5])
    assert {cell.verdict for cell in few.cells.values()} == {BEST, OPEN}


def test_a_seed_that_a_scenario_lacks_is_no_seed_of_the_headline() -> None:
    table = [one for one in rows(3) if (one.scenario, one.seed) != ("carried", 2)]
    cell = headline_of(table).cells["ima", "activity"]
    assert cell.mean == pytest.approx((0.9 + 0.7 + 0.91 + 0.71) / 4)


def test_the_headline_of_nothing_is_empty() -> None:
    assert headline_of([]) == Headline({}, None, frozenset(), 0)
    assert headline_of([row("carried", "mix(a,b)", "grid", 0)]).cells == {}


def test_the_headline_marks_cells_by_more_than_colour(eight: Path) -> None:
    page = page_of(eight)
    assert "Highest: ima/activity with 0.81" in page.text
    assert "Not told apart from it: 0 other pairs; worse: 2." in page.text
    for mark in ("0.81 ★", "0.41 ▽", "0.89 †", "1 of 2 scenarios", "★ highest mean"):
        assert mark in page.text


def test_any_two_pairs_are_compared_as_spread_does_it(eight: Path) -> None:
    run = RunRead.of(eight)
    pairs = offered(headline_of(run.rows), run)
    entries = iter(compare(run, pairs))
    assert len(pairs) == 4
    for i, first in enumerate(pairs):
        for second in pairs[i + 1 :]:
            expected = {m: paired(run.rows, m, first, second) for m in ("node_accuracy", "position_median_m")}
            for scenario in SCENARIOS:
                for metric, found in expected.items():
                    entry, difference = next(entries), found[scenario]
                    assert entry is not None
                    assert entry[3:] == [difference.pairs, verdict(difference, metric)]
                    assert entry[0] == (None if difference.mean is None else round(1000 * difference.mean))
    assert next(entries, None) is None


def test_a_verdict_knows_which_way_is_better() -> None:
    up = Difference(0.1, Interval(0.05, 0.2), 6)
    assert verdict(up, "node_accuracy") == B_BETTER
    assert verdict(up, "position_median_m") == A_BETTER
    assert verdict(Difference(0.1, Interval(-0.05, 0.2), 6), "node_accuracy") == NONE_TOLD
    assert verdict(Difference(0.1, Interval(0.05, 0.2), 5), "node_accuracy") == TOO_FEW
    assert verdict(Difference(None, None, 0), "node_accuracy") == TOO_FEW


def test_of_too_many_pairs_the_best_are_offered(eight: Path) -> None:
    cells = {(f"s{i}", "grid"): Cell(i / 200, None, 1, OPEN) for i in range(200)}
    pairs = offered(Headline(cells, None, frozenset({"toy"}), 1), RunRead.of(eight))
    count = len(pairs)
    assert count * (count - 1) // 2 * len(SCENARIOS) <= MOST_COMPARISONS < (count + 1) * count // 2 * len(SCENARIOS)
    assert pairs[0] == ("s199", "grid")


def test_reliability_counts_updates_that_name_a_node(eight: Path) -> None:
    answers = RunRead.of(eight).answers["toy", "ima", "grid"]
    curve = Reliability.of(answers)
    assert curve.count.tolist() == [0, 0, 0, 0, 0, 8, 0, 0, 0, 24]
    assert curve.stated[[5, 9]] == pytest.approx([0.55, 0.95])
    assert curve.right[[5, 9]] == pytest.approx([1.0, 2 / 3])
    assert curve.error == pytest.approx((0.45 + 3 * 0.95 - 2) / 4)
    label = "stated 0.55, right 1.00 (16 updates); stated 0.95, right 0.67 (48 updates)"  # two scenarios
    assert f"Reliability of ima/grid: {label}." in (eight / "report.html").read_text()


def test_reliability_of_no_update_is_empty() -> None:
    curve = Reliability.of([Answers(np.ones(3), np.zeros(0), np.zeros(0, dtype=bool))])
    assert curve.error is None
    assert not curve.count.any()


def test_the_error_at_a_frame_is_the_median_over_seeds(eight: Path) -> None:
    answers = RunRead.of(eight).answers["toy", "ima", "activity"]
    three = [answers[seed] for seed in (0, 1, 7)]  # 0.2, 0.3 and 0.9 m
    assert median_errors(three) == pytest.approx([0.3] * 6)
    longer = Answers(np.array([1.0, 3.0]), np.zeros(0), np.zeros(0, dtype=bool))
    shorter = Answers(np.array([2.0]), np.zeros(0), np.zeros(0, dtype=bool))
    assert median_errors([longer, shorter]).tolist() == [1.5, 3.0]
    text = (eight / "report.html").read_text()
    assert "Position error over time of ima on toy; median over all frames: activity 0.55 m, grid 0.85 m." in text
    assert text.count("carried elsewhere") == len(SENSORS)  # one chart of each sensor where it happens


def test_the_replay_keeps_what_compact_py_says(eight: Path) -> None:
    toy, carried = embedded(eight, "replay-data")
    assert isinstance(toy, dict)
    assert isinstance(carried, dict)
    assert toy["truth"][2] == [100, 0, 0]
    assert carried["kidnapped"] == [small_run.KIDNAPPED_AT]
    assert toy["frames"] == [toy["frames"][0]] * 5 + [-1]
    assert toy["looks"][0][0] == [
        0,
        [[1, 800, 150, 100, 0, 5], [0, 400, -125, 0, 0, None]],
        [[1, 800, 500, [2000, 9800], [900, 100], [1, 0]]],
        "",
    ]
    account = [
        0,
        [[0, None, None, 1000, 0]],
        [[1, 5, 800, 750, 0], [0, 5, 500, 250, 1]],
        0,
        [[50], [25]],
        [[4], [None]],
    ]
    assert toy["answers"][0][0][0] == [0, 20, 0, 10, 0, 950, 0, 1, [0, 0, 1000], account]
    assert toy["answers"][0][0][2][8:] == [[], 0]  # gated: those of the frame before hold
    assert toy["answers"][1][1][4][4:6] == [-1, 200]
    assert carried["answers"][1][1] == f"unavailable: {UNFED}"


def test_the_plan_is_not_drawn_through_a_kidnapping(eight: Path) -> None:
    plans = re.findall(r'<path class="way" d="([^"]*)"', (eight / "report.html").read_text())
    assert [plan.count("M") for plan in plans] == [1, 2]


def test_pictures_and_answers_have_a_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_run(tmp_path / "run")
    monkeypatch.setattr(replay_data, "ANSWERS_BYTES", 1200)
    monkeypatch.setattr(replay_data, "PICTURES_BYTES", 6000)
    page = page_of(folder)
    assert "To keep the page small, only one of" in page.text
    toy = embedded(folder, "replay-data")[0]
    assert isinstance(toy, dict)
    assert -1 in toy["frames"][:5]
    assert toy["frames"][0] >= 0
    kept = [[isinstance(one, list) for one in line] for line in toy["answers"]]
    assert kept == [[True, False], [False, False]]  # the pair with the highest mean
    assert "left out, or the page would be too large" in toy["answers"][1][1]
    assert [bool(one) for one in toy["looks"]] == [True, False]


def test_the_page_needs_nothing_from_outside(eight: Path) -> None:
    text = (eight / "report.html").read_text()
    page = Page(text)
    assert all(link.startswith("#") for link in page.links)
    assert not {"link", "iframe", "object", "embed", "base", "form"} & set(page.tags)
    assert not re.search(r"https?://|@import|eval\(|new Function|innerHTML|document\.write", text)
    assert "Content-Security-Policy" in text


def test_a_picture_that_would_be_loaded_from_elsewhere_is_left_out(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    path = folder / "replay/toy/drive.json"
    path.write_text(re.sub(r'"data:image/[^"]*"', '"https://example.org/track.png"', path.read_text()))
    text = write_report(folder).read_text()
    assert "example.org" not in text


def test_hostile_names_are_escaped(tmp_path: Path) -> None:
    hostile = [Row(HOSTILE, HOSTILE, HOSTILE, 0, "failed", HOSTILE), Row(HOSTILE, "ima", HOSTILE, 0)]
    folder = write_run(tmp_path / "run", written=[*rows(2), *hostile])
    clean = page_of(write_run(tmp_path / "clean"))
    page = page_of(folder)
    assert page.tags.count("script") == clean.tags.count("script")
    assert page.open == []
    assert HOSTILE in page.text
    assert "<" not in json_script("x", {HOSTILE: HOSTILE}).removeprefix("<script").removesuffix("</script>")


def test_hostile_nodes_are_escaped(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    path = folder / "replay/toy/drive.json"
    path.write_text(path.read_text().replace('"PLACE 1"', json.dumps(HOSTILE)))
    page = page_of(folder)
    assert HOSTILE in page.text
    assert page.open == []


def test_an_unfinished_run_says_so(tmp_path: Path) -> None:
    page = page_of(write_run(tmp_path / "run", written=rows(2)[:1]))
    assert "1 run: 1 ok; unfinished: 15 of 16 are still to run" in page.text
    assert page.open == []


def test_a_run_without_a_row_has_a_report(tmp_path: Path) -> None:
    page = page_of(write_run(tmp_path / "run", written=[]))
    assert "0 runs: 0 ok; unfinished: 16 of 16" in page.text
    assert "No run has come to an end, so there is nothing to compare yet." in page.text
    assert page.open == []


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (remove("replay"), "No replay: replay/toy/drive.json: no such file"),
        (write("replay/toy/drive.json", "{"), "No replay: replay/toy/drive.json: is not valid JSON"),
        (write("replay/toy/drive.json", "[1]"), "No replay: replay/toy/drive.json: does not hold a drive"),
        (rewrite("replay/toy/drive.json", '"edges":[[0,1]', '"edges":[[0,9]'), "drive.json: does not hold a drive"),
        (rewrite("replay/toy/drive.json", '"x":0.0', '"x":NaN'), "drive.json: does not hold a drive"),
        (remove("replay/toy/answers/ima/grid.json"), "replay/toy/answers/ima/grid.json: no such file"),
        (write("replay/toy/answers/ima/grid.json", '[{"kind":"new"}]'), "ima/grid.json: does not hold answers"),
        (write("replay/toy/looks/ima.json", "null"), "16 runs: 14 ok"),
        (remove("steps"), "steps/toy/ima/activity-0.csv: no such file"),
        (write("steps/toy/ima/grid-1.csv", "timestamp,x\n"), "grid-1.csv: does not have the columns of a steps.csv"),
    ],
)
def test_what_is_missing_or_broken_is_said(tmp_path: Path, spoil: Spoil, said: str) -> None:
    folder = write_run(tmp_path / "run")
    spoil(folder)
    page = page_of(folder)
    assert said in page.text
    assert page.open == []


def test_numbers_are_as_long_as_they_tell() -> None:
    values = (0.0, -0.001, 0.905, -1.5, 12.34, 123.4, None, float("nan"), float("inf"))
    assert [number(value) for value in values] == [
        "0.00", "0.00", "0.91", "\N{MINUS SIGN}1.50", "12.3", "123", "\N{EN DASH}", "\N{EN DASH}", "\N{EN DASH}",
    ]  # fmt: skip


def test_text_has_contrast_enough() -> None:
    """WCAG 2.1, 1.4.3: 4.5 to 1, in the light and in the dark, on both grounds."""
    themes = re.findall(r":root \{(.*?)\}", asset("style.css"), re.DOTALL)
    assert len(themes) == 2
    for theme in themes:
        colours = dict(re.findall(r"--(\w+): (#\w+)", theme))
        for ground in ("paper", "panel"):
            for text in ("ink", "soft", "blue", "red", "green", "purple", "orange"):
                least = 4.5 if text in ("ink", "soft", "blue", "red") else 3.0  # the others draw lines and discs
                assert contrast(colours[text], colours[ground]) >= least, (text, ground)


def contrast(first: str, second: str) -> float:
    light, dark = sorted(map(luminance, (first, second)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(colour: str) -> float:
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    levels = np.array([int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)])
    linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_every_run_is_in_the_page(eight: Path) -> None:
    page = page_of(eight)
    for sensor in SENSORS:
        for estimator in ESTIMATORS:
            assert f"{sensor}/{estimator}" in page.text
