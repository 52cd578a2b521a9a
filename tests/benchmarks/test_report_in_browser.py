"""The report in headless Chromium: used as a reader would use it, in a wide window and on a phone."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import escape, unescape
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from oracles.small_run import FRAMES, SCENARIOS, write_run

from benchmarks.report import write_report
from benchmarks.results import read_results
from benchmarks.spread import paired

PROBE = Path(__file__).with_name("report_probe.js")
COLLECT = """<script>
window.problems = [];
window.addEventListener("error", event => problems.push(String(event.message)));
window.addEventListener("unhandledrejection", event => problems.push(String(event.reason)));
document.addEventListener("securitypolicyviolation", event => problems.push("blocked: " + event.blockedURI));
for (const kind of ["error", "warn"]) console[kind] = (...words) => problems.push(words.join(" "));
</script>"""
PHONE_PX, DESK_PX = 360, 1280
MEASURE = """<script>
window.addEventListener("load", () => setTimeout(() => {
  const page = document.querySelector("iframe").contentDocument, wide = page.documentElement.clientWidth;
  for (const one of page.querySelectorAll("details")) one.open = true;
  const out = [...page.querySelectorAll("body *")].filter(one => one.getBoundingClientRect().right > wide + 0.5
    && !one.closest(".wide, pre, .unseen, svg, option"));
  const pre = document.createElement("pre");
  pre.id = "outcome";
  pre.textContent = JSON.stringify({wide, scroll: page.documentElement.scrollWidth,
    out: out.map(one => one.outerHTML.slice(0, 200)), status: page.querySelector("[data-role=status]").textContent,
    verdicts: [...page.querySelectorAll(".verdict")].map(one => one.getBoundingClientRect().right),
    tables: [...page.querySelectorAll(".sortable")].map(one => one.parentElement.scrollWidth
      - one.parentElement.clientWidth)});
  document.body.append(pre);
}, 500));
</script>"""
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --hide-scrollbars --window-size=1200,900 --virtual-time-budget=60000"
)


def chromium() -> str:
    """The browser; without one the test is left out, and says so."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    pytest.skip("left out: no Chromium on PATH; install the package chromium")


def outcome_of(page: Path, profile: Path) -> Any:
    """What a page wrote into its <pre id="outcome">."""
    command = [chromium(), *FLAGS.split(), f"--user-data-dir={profile}", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    found = re.search(r'<pre id="outcome">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, done.stderr[-2000:]
    return json.loads(unescape(found[1]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with eight seeds and its report."""
    chromium()
    path = write_run(tmp_path_factory.mktemp("runs") / "run", seeds=8)
    write_report(path)
    return path


@pytest.fixture(scope="module")
def used(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What the probe found."""
    text = (folder / "report.html").read_text()
    page = folder / "probed.html"
    page.write_text(
        text.replace("<style>", f"{COLLECT}<style>", 1).replace(
            "</body>", f"<script>{PROBE.read_text()}</script></body>"
        )
    )
    return outcome_of(page, tmp_path_factory.mktemp("profile"))


def test_nothing_goes_wrong(used: Any) -> None:
    assert used["problems"] == []


def test_each_table_sorts_up_and_down(used: Any) -> None:
    assert len(used["sorting"]) == len(SCENARIOS)
    for table in used["sorting"]:
        assert len(table) > 5
        for column in table:
            assert column["focused"]
            assert column["sorted"] == 1
            (up, rising), (down, falling) = column["orders"]
            assert (up, down) == ("ascending", "descending")
            assert sorted(rising) == sorted(falling)
            for cells, turn in ((rising, 1), (falling, -1)):
                known = [cell for cell in cells if cell != ""]
                assert cells == known + [""] * (len(cells) - len(known))
                values = [float(cell) if re.fullmatch(r"[-\d.]+", cell) else cell for cell in known]
                assert all(turn * (a > b) - turn * (a < b) <= 0 for a, b in pairwise(values))
    recovery = next(column for column in used["sorting"][1] if column["name"].startswith("updates to recover"))
    assert "" in recovery["orders"][0][1]


def test_the_two_pairs_tool_says_what_python_says(used: Any, folder: Path) -> None:
    rows = read_results(folder / "results.csv")
    seen = set()
    for a, b, left_out, lines in used["comparisons"]:
        without = ["carried"] if "mix(a,b)/grid" in (a, b) and a != b else []
        assert left_out == (f"Without results of both, and left out: {without[0]}." if without else "")
        assert [line[0] for line in lines] == [name for name in SCENARIOS if name not in without] or a == b
        for scenario, *cells in lines:
            if not cells:
                assert scenario == "choose two different pairs"
                assert a == b
                continue
            first, second = tuple(a.split("/")), tuple(b.split("/"))
            for metric, (text, words) in {"node_accuracy": cells[:2], "position_median_m": cells[2:]}.items():
                found = paired(rows, metric, first, second)[scenario]
                assert found.mean is not None
                assert found.interval is not None
                mean, low, high = map(float, re.findall(r"-?\d+\.\d+", text.replace("\N{MINUS SIGN}", "-")))
                assert [mean, low, high] == pytest.approx(
                    [found.mean, found.interval.low, found.interval.high], abs=6e-3
                )
                better_b = (found.mean > 0) == (metric == "node_accuracy")
                side = f"{'B' if better_b else 'A'} is better"
                called = side if found.called else "no difference told"
                assert words == ("one drive: not told" if scenario == "carried" else called)
                seen.add(words)
    assert seen == {"A is better", "B is better", "no difference told", "one drive: not told"}


def test_the_replay_moves_by_buttons_keys_slider_and_itself(used: Any) -> None:
    last = FRAMES - 1
    assert len(used["replays"]) == len(SCENARIOS)
    for found in used["replays"]:
        said = "Frame 0 of 5: named node 1 PLACE 1 (right) with probability 0.95, LOCALIZED; 0.20 m and 10° off."
        assert found["start"] == [0, said, "data:image/"]
        assert found["buttons"] == [1, 2, 1, last, last, 0, 0]
        assert found["keys"] == [1, 2, 1, last, 0]
        assert found["slider"] == [4, "4"]
        assert found["playing"] == ["Pause", "off"]
        assert 1 <= found["moved"] <= 3
        assert found["paused"] == [0, "Play", "polite"]
        assert found["ended"] == [last, "Play"]
        assert found["without"] == [True, True]  # the last frame has no picture, and that is said


def test_keys_work_wherever_the_focus_is_in_the_player(used: Any) -> None:
    last = FRAMES - 1
    for found in (one["anywhere"] for one in used["replays"]):
        assert found["jumps"] == [[True, last, True, 0]] * 7
        assert found["space"] == [[True, "Pause", True, "Play", 0]] * 7
        assert found["letGo"]  # or a browser would press the button, too
        assert found["slider"] == [[True, 1], [True, 2], [True, 1]]
        assert found["left"] == [False, False, False, 1]  # a select and a box that scrolls keep theirs


def test_nodes_are_right_adjacent_or_wrong(used: Any) -> None:
    for found in used["replays"]:
        assert found["words"] == [
            "named node 1 PLACE 1 (adjacent) with probability 0.95, LOCALIZED",
            "named node 1 PLACE 1 with probability 0.50, LOCALIZED",
            "named node 2 PLACE 2 (right) with probability 0.55, LOCALIZED",
            "named no node (wrong) with probability 0.20, LOCALIZED",
            "named node 1 PLACE 1 (right) with probability 0.95, LOCALIZED",
        ]
        marks = dict(found["marks"])
        assert list(marks) == ["right", "adjacent", "wrong"]
        assert [marks[name].count("M") for name in marks] == [3, 1, 1]
        assert marks["adjacent"].endswith("z")  # a diamond is closed


def test_selects_change_the_picture(used: Any) -> None:
    for found in used["replays"]:
        assert found["estimator"] == [True, 4, ""]
        assert found["back"]
        assert "2 PLACE 2 ◀ wins5°0.800.750.50 m, 4°" in found["account"]
        assert "1 PLACE 1 (virtual)5°0.500.250.25 m, \N{EN DASH}" in found["account"]
        lefts = [left for left, _, _ in found["slots"]]
        assert lefts == ["20%", "98%", "-2%"]  # the second slot goes round
        assert [kind for _, kind, _ in found["slots"]] == ["slot counted", "slot", "slot"]
        assert found["sensor"][0] == 0
        assert found["sensor"][1].endswith("--sensor 'mix(a,b)' --estimator activity --seed 0 --step 4")
    reliability, errors = used["choosers"]
    assert reliability == [["0"], ["1"]]
    assert errors == [["0 0"], ["1 0"], ["1 1"]]


def test_the_legend_brings_a_line_forward(used: Any) -> None:
    assert used["legend"] == [[], ["0"], [], ["0"], [], [["0"], "true"], [[], "false"]]


def test_a_command_is_copied_or_selected(used: Any) -> None:
    copied, told, told_refused, selected, after = used["copying"]
    assert (told, told_refused, after) == ("Copied", "Selected", "Copy")
    assert copied == selected
    assert copied.startswith("topoloc bench --scenarios toy carried --sensors ima 'mix(a,b)'")


def test_controls_and_pictures_have_names_and_headings_are_in_order(used: Any) -> None:
    assert used["nameless"] == []
    assert used["namelessAfter"] == []
    assert used["headings"][0] == 1
    assert all(deeper <= level + 1 for level, deeper in pairwise(used["headings"]))


def measured(folder: Path, width: int, place: Path) -> Any:
    """What sticks out of a window of this width."""
    text = (folder / "report.html").read_text()
    frame = f'<iframe style="width: {width}px; height: 800px; border: 0" srcdoc="{escape(text)}"></iframe>'
    page = place / "framed.html"
    page.write_text(f"<!DOCTYPE html><body>{frame}{MEASURE}</body>")
    return outcome_of(page, place / "profile")


def test_a_desk_shows_all_columns(folder: Path, tmp_path: Path) -> None:
    found = measured(folder, DESK_PX, tmp_path)
    assert found["wide"] == DESK_PX
    assert found["tables"] == [0] * len(SCENARIOS)


def test_a_phone_shows_it_without_scrolling_sideways(folder: Path, tmp_path: Path) -> None:
    found = measured(folder, PHONE_PX, tmp_path)
    assert found["wide"] == PHONE_PX
    assert len(found["verdicts"]) == 4
    assert max(found["verdicts"]) <= PHONE_PX
    assert found["scroll"] == PHONE_PX
    assert found["out"] == []
    assert found["status"].startswith("Frame 0 of 5")
