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

from benchmarks.report import comparisons, replay_data, write_report
from benchmarks.report.answers import Answers
from benchmarks.report.comparisons import CODES, MOST_COMPARISONS, QUESTION, compare, offered
from benchmarks.report.error_curves import median_errors
from benchmarks.report.headline import BEST, LEVEL, OPEN, PARTLY, WORSE, Headline, headline_of, largest_block
from benchmarks.report.markup import asset, json_script, number
from benchmarks.report.reliability import Reliability
from benchmarks.report.replay_data import in_turn
from benchmarks.report.replay_files import near_nodes
from benchmarks.report.run_read import RunRead
from benchmarks.results import Row
from benchmarks.spread import Pair, Verdict, paired, verdict
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
        "With 2 seeds no difference can be called one yet: that takes at least 6.",
        "To tell pairs apart:topoloc bench --scenarios toy carried --sensors ima 'mix(a,b)' --estimators activity grid "
        "--seeds 10 --updates 6 --set sensors.ima.slots=4 estimators.grid.headings=12Copy",
        "Simulated (toy): ",
        "Somebody's folder (carried): one drive.",
        "A toy. (simulated)",
        "Carried away. (somebody's folder: one drive, seeds are the estimator's alone)",
        f"unavailable: {UNFED}: mix(a,b)/grid",
        "topoloc bench --scenarios toy --sensors ima --estimators activity --seeds 2 --updates 6 "
        "--set sensors.ima.slots=4Copy",
        "topoloc bench --scenarios carried --sensors 'mix(a,b)' --estimators grid --seeds 2 --updates 6 "
        "--set estimators.grid.headings=12",
        f"topoloc explain {tmp_path.resolve()}/run --scenario toy --sensor 'mix(a,b)' --estimator grid --seed 0 "
        "--step 12",
    ):
        assert expected in page.text
    assert all(metric.definition in page.text for metric in METRICS)


def test_the_tables_hold_means_and_intervals_of_the_rows(tmp_path: Path) -> None:
    text = write_report(write_run(tmp_path / "run")).read_text()
    toy = text[text.index("<h3>toy</h3>") : text.index("<h3>carried</h3>")]
    carried = text[text.index("<h3>carried</h3>") : text.index("Can the stated")]
    line = toy[toy.index("ima/<wbr>activity") : toy.index("ima/<wbr>grid")]
    # node accuracy 0.90 and 0.91, position error 0.2 and 0.3 m, NEES 3 and 4
    assert '<td data-value="0.905">0.91 <span class="mark">★</span><small>0.90\N{EN DASH}0.91</small></td>' in line
    assert '<td data-value="0.25">0.25<small>0.20\N{EN DASH}0.30</small></td>' in line
    assert '<td data-value="3.5">3.50<small>3.00\N{EN DASH}4.00</small></td>' in line
    assert '<td data-value="1234.5">1234<small>1234\N{EN DASH}1234</small></td>' in line
    assert "to recover" not in toy  # nobody has a value there
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
    assert headline.cells["ima", "grid"].standing == WORSE
    assert headline.cells["mix(a,b)", "activity"].standing == WORSE  # by 0.02 in most seeds, never more
    assert headline.cells["mix(a,b)", "grid"].standing == PARTLY
    assert headline.cells["mix(a,b)", "grid"].scenarios == 1


def test_pairs_that_only_scatter_are_not_told_apart_from_the_best() -> None:
    noise = [0.1, -0.1, 0.05, -0.05, 0.1, -0.12]
    pairs = {("ima", "grid"): 0.8 + np.zeros(6), ("pca", "grid"): 0.8 + np.array(noise), ("pca", "voting"): np.ones(6)}
    table = [
        Row("toy", *pair, seed, values={"node_accuracy": v}) for pair, vs in pairs.items() for seed, v in enumerate(vs)
    ]
    without = headline_of([one for one in table if one.estimator == "grid"])
    assert {pair: cell.standing for pair, cell in without.cells.items()} == {
        ("ima", "grid"): BEST,
        ("pca", "grid"): LEVEL,
    }
    assert headline_of(table).cells["ima", "grid"].standing == WORSE
    few = headline_of([one for one in table if one.seed < 5])
    assert {cell.standing for cell in few.cells.values()} == {BEST, OPEN}


def test_a_seed_that_a_scenario_lacks_is_no_seed_of_the_headline() -> None:
    table = [one for one in rows(3) if (one.scenario, one.seed) != ("carried", 2)]
    cell = headline_of(table).cells["ima", "activity"]
    assert cell.mean == pytest.approx((0.9 + 0.7 + 0.91 + 0.71) / 4)


def test_the_headline_of_nothing_is_empty() -> None:
    assert headline_of([]) == Headline({}, None, frozenset(), 0)
    assert headline_of([row("carried", "mix(a,b)", "grid", 0)]).cells == {}


def test_the_headline_marks_cells_by_more_than_colour(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", seeds=8, recorded=())
    page = page_of(folder)
    assert "Highest: ima/activity with 0.81" in page.text
    assert "Not told apart from it: 0 other pairs; worse: 2." in page.text
    assert "mean over all 2 scenarios and 8 seeds [95 % interval over seeds]" in page.text
    for mark in ("0.81 ★", "0.41 ▽", "0.89 †", "★ highest mean", "† lacks one of these scenarios"):
        assert mark in page.text
    assert re.search(
        r'<td class="partly"><b>0.89</b>.{,90}<small>1 scenario</small>', (folder / "report.html").read_text()
    )


def table_of(where: dict[Pair, dict[str, float]], seeds: int = 8) -> list[Row]:
    """Rows of pairs with these node accuracies on these scenarios, the same in each seed."""
    return [
        Row(scenario, *pair, seed, values={"node_accuracy": value})
        for pair, own in where.items()
        for scenario, value in own.items()
        for seed in range(seeds)
    ]


UNEVEN: dict[Pair, dict[str, float]] = {
    ("ima", "activity"): {"toy": 0.9, "carried": 0.7},
    ("ima", "grid"): {"toy": 0.8, "carried": 0.6},
    ("pca", "grid"): {"toy": 0.6, "carried": 0.4, "hall": 1.0},
    ("pca", "activity"): {"toy": 0.5, "carried": 0.3, "hall": 1.0},
    ("fourier", "grid"): {"hall": 0.95},
}
"""Four pairs ran on two scenarios, two of them on three, and a sensor on another one alone."""


def test_pairs_are_compared_over_the_largest_block() -> None:
    headline = headline_of(table_of(UNEVEN))
    assert headline.compared == {"toy", "carried"}  # 4 x 2, against 2 x 3 and 3 x 1
    assert headline.best == ("ima", "activity")
    assert headline.cells["pca", "grid"].mean == pytest.approx(0.5)  # without the hall
    standings = {pair: cell.standing for pair, cell in headline.cells.items()}
    assert standings == dict.fromkeys(UNEVEN, WORSE) | {("ima", "activity"): BEST, ("fourier", "grid"): PARTLY}
    assert headline.cells["fourier", "grid"].mean == pytest.approx(0.95)
    assert headline.ranked[-1] == ("fourier", "grid")


def test_of_blocks_of_one_size_the_one_of_more_scenarios_counts() -> None:
    one, two = frozenset("a"), frozenset("ab")
    assert largest_block([one, one, one, two]) == one  # 4 x 1, against 1 x 2
    assert largest_block([one, one, two, two]) == two  # 4 x 1, against 2 x 2


def test_the_page_names_the_compared_scenarios_and_sets_other_sensors_apart(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", seeds=8, written=table_of(UNEVEN), recorded=())
    page = page_of(folder)
    assert "Node accuracy, mean over 2 scenarios (toy, carried) and 8 seeds" in page.text
    assert "It is the share of updates whose named node is at most 0.25 m farther" in page.text
    text = (folder / "report.html").read_text()
    apart = text[text.index('<tbody class="apart">') :]
    apart = apart[: apart.index("</tbody>")]
    assert re.findall(r'<th scope="row">(.*?)</th>', apart) == ["fourier"]
    assert "--share" not in apart


def test_a_recorded_drive_is_no_part_of_the_headline(eight: Path) -> None:
    headline = headline_of(rows(8), ["carried"])
    assert headline.compared == {"toy"}
    assert headline.cells["mix(a,b)", "grid"].standing == WORSE  # it ran on all that counts
    assert "Recorded drives tell no difference and are left out: carried." in page_of(eight).text


def test_of_recorded_drives_alone_there_are_means_without_verdicts(tmp_path: Path) -> None:
    headline = headline_of(rows(8), SCENARIOS)
    assert headline.one_drive
    assert {cell.standing for cell in headline.cells.values()} == {BEST, OPEN, PARTLY}
    folder = write_run(tmp_path / "run", seeds=8, recorded=SCENARIOS)
    page = page_of(folder)
    assert "Each scenario is one recorded drive, and seeds are the estimator's random numbers alone" in page.text
    assert "▽" not in page.text
    assert "≈" not in page.text
    few = page_of(write_run(tmp_path / "few", recorded=SCENARIOS))
    assert "To tell pairs apart" not in few.text  # more seeds would not help


def test_a_recorded_scenario_has_a_highest_mean_and_no_other_mark(eight: Path) -> None:
    text = (eight / "report.html").read_text()
    toy, carried = (text[text.index(f"<h3>{name}</h3>") :].split("</section>")[0] for name in SCENARIOS)
    assert (toy.count("★"), toy.count("▽")) == (1, 3)
    assert (carried.count("★"), carried.count("▽"), carried.count("≈")) == (1, 0, 0)


def test_any_two_pairs_are_compared_as_spread_does_it(eight: Path) -> None:
    run = RunRead.of(eight)
    pairs = offered(run, headline_of(run.rows))
    entries = iter(compare(run, pairs))
    assert len(pairs) == 4
    seen = set()
    for i, first in enumerate(pairs):
        for second in pairs[i + 1 :]:
            expected = {m: paired(run.rows, m, first, second) for m in ("node_accuracy", "position_median_m")}
            for scenario in SCENARIOS:
                for metric, found in expected.items():
                    entry, difference = next(entries), found[scenario]
                    assert entry is not None
                    expected_verdict = verdict(difference, metric, one_drive=scenario == "carried")
                    assert entry[3:] == [difference.pairs, CODES.index(expected_verdict)]
                    seen.add(expected_verdict)
                    assert entry[0] == (None if difference.mean is None else round(1000 * difference.mean))
    assert next(entries, None) is None
    assert seen == {Verdict.BETTER, Verdict.WORSE, Verdict.NOT_TOLD, Verdict.ONE_DRIVE, Verdict.NO_VALUE}


def test_of_too_many_pairs_the_question_the_best_of_each_sensor_and_high_means_are_offered(tmp_path: Path) -> None:
    many = {("ima", f"e{i}"): {"toy": 0.5 + i / 1000} for i in range(200)}
    low = {("fourier", "grid"): {"toy": 0.1}, ("fourier", "voting"): {"toy": 0.05}}
    question = {pair: {"toy": 0.01} for pair in QUESTION}
    run = RunRead.of(write_run(tmp_path / "run", written=table_of(many | low | question, 1)))
    pairs = offered(run, headline_of(run.rows))
    assert len(pairs) * (len(pairs) - 1) // 2 <= MOST_COMPARISONS < (len(pairs) + 1) * len(pairs) // 2
    assert {*QUESTION, ("fourier", "grid"), ("ima", "e199")} <= set(pairs)
    assert not {("fourier", "voting"), ("ima", "e0")} & set(pairs)
    means = {pair: own["toy"] for pair, own in many.items()}
    assert {pair for pair in pairs if pair in means} == set(sorted(means, key=means.__getitem__)[-(len(pairs) - 3) :])


def test_pairs_that_must_be_offered_are_so_however_many(eight: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparisons, "MOST_COMPARISONS", 0)
    run = RunRead.of(eight)
    assert offered(run, headline_of(run.rows)) == [("ima", "activity"), ("mix(a,b)", "activity")]


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
    assert toy["codes"][3] == ["right", "adjacent", "wrong"]
    assert toy["answers"][0][0][0] == [0, 20, 0, 10, 0, 950, 0, 0, [0, 0, 1000], account]
    assert [answer[7] for answer in toy["answers"][0][0]] == [0, 1, -1, 0, 2, 0]
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
    assert kept == [[True, False], [False, False]]
    assert "left out, or the page would be too large; ima/activity and pca/particle come first" in toy["answers"][1][1]
    assert [bool(one) for one in toy["looks"]] == [True, False]
    carried = embedded(folder, "replay-data")[1]
    assert isinstance(carried, dict)
    assert isinstance(carried["answers"][0][0], list)  # each scenario has a share of its own


def test_the_replay_keeps_the_question_then_the_sensors_in_turn(tmp_path: Path) -> None:
    toy = {
        ("ima", "activity"): 0.1, ("pca", "particle"): 0.2, ("ima", "grid"): 0.9, ("ima", "voting"): 0.8,
        ("local", "grid"): 0.5, ("local", "voting"): 0.4, ("pca", "grid"): 0.7,
    }  # fmt: skip
    written = table_of({pair: {"toy": value} for pair, value in toy.items()}, 2)
    written += table_of({("local", "grid"): {"carried": 1.0}}, 2)  # what is good elsewhere does not count
    run = RunRead.of(write_run(tmp_path / "run", written=written))
    assert in_turn(run, "toy") == [
        *QUESTION,
        ("ima", "grid"), ("pca", "grid"), ("local", "grid"),
        ("ima", "voting"), ("local", "voting"),
    ]  # fmt: skip
    assert in_turn(run, "carried") == [("local", "grid")]


def test_near_nodes_are_within_a_metre_or_an_edge_of_the_true_one() -> None:
    places = np.array([[0.0, 0.0], [0.707, 0.708], [1.01, 0.0], [3.0, 0.0], [9.0, 0.0]])  # 0 to 1: 1.0005 m, rounded
    near = near_nodes(places, [(0, 3), (3, 4)], np.array([[0.1, 0.0], [8.0, 0.0]]))
    assert near == [{0, 1, 3}, {3, 4}]


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
    assert f"To go on with it:topoloc bench --resume {tmp_path.resolve()}/runCopy" in page.text
    assert "To tell pairs apart" not in page.text
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


def test_one_seed_has_no_intervals_and_none_are_spoken_of(tmp_path: Path) -> None:
    page = page_of(write_run(tmp_path / "run", seeds=1))
    assert "and 1 seed; 1 is best" in page.text
    assert "Values of the one seed." in page.text
    assert "95 %" not in page.text


def test_a_failed_pair_is_told_apart_from_an_unavailable_one(tmp_path: Path) -> None:
    written = [
        Row(one.scenario, one.sensor, one.estimator, one.seed, "failed", "it crashed")
        if one.key[:3] == ("carried", "ima", "grid") or one.key == ("toy", "ima", "grid", 1)
        else one
        for one in rows(2)
    ]
    text = write_report(write_run(tmp_path / "run", written=written)).read_text()
    toy, carried = (text[text.index(f"<h3>{name}</h3>") :].split("</section>")[0] for name in SCENARIOS)
    first_cells = dict(re.findall(r'<th scope="row">([^<]*<wbr>\w*)</th>(<td.*?</td>)', carried))
    assert first_cells["ima/<wbr>grid"] == '<td data-value="" class="failed">failed</td>'
    assert first_cells["mix(a,b)/<wbr>grid"] == '<td data-value="" class="none">unavailable</td>'
    assert '<td data-value="0" class="failed">' not in carried  # said once, at the head of the row
    assert '<td data-value="1" class="failed">1 of 2, failed</td>' in toy


def test_columns_have_the_labels_and_units_of_the_metrics(eight: Path) -> None:
    text = (eight / "report.html").read_text()
    heads = re.findall(r"<button[^>]*>(.*?)</button></th>", text[text.index("<h3>toy</h3>") :].split("</thead>")[0])
    told = [re.sub(r"<[^>]*>", "", head.replace("<span", " <span")).split(",")[0].split() for head in heads]
    assert [" ".join(words) for words in told] == [
        "sensor/estimator", "node accuracy ↑", "wrong ↓", "median position error m ↓", "median heading error deg ↓",
        "updates to first fix ↓", "recall at 99 % precision ↑", "lost ↓", "calibration error ↓", "NEES →3",
        "sensor ms ↓", "estimator ms ↓", "runs completed",
    ]  # fmt: skip


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
