"""The tables of own data: their arithmetic by hand, each measurement on a tiny world, and where they are written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from benchmarks.own_data import check, maps, panoramas_built, video
from benchmarks.own_data.__main__ import main
from benchmarks.own_data.driving import scan_poses
from benchmarks.own_data.own_table import Figures, OwnTable, each, how_many, mean, span
from benchmarks.own_data.page import DOCS, around, markers
from benchmarks.own_data.tables import TABLES
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from benchmarks.worlds.world import Place
from topoloc.geometry import wrap
from topoloc.topo_map import Camera


class Tiny(LabWorld):
    """Two places, and pictures of a sixteenth of the pixels."""

    camera = Camera(40.0, 96, 72)

    @property
    def places(self) -> Sequence[Place]:
        return LAB_PLACES[:2]

    @property
    def tour(self) -> Sequence[int]:
        return range(2)


def made_up(seed: int) -> Iterator[Figures]:
    yield {"share": 0.5 + 0.1 * seed, "gained": -2.0 + 5.0 * seed, "told": float(seed), "nodes": 8.0 + seed}
    yield {"share": 0.25, "nodes": 8.0}


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> OwnTable:
    """A table that takes no time, in the place of the first one."""
    one = OwnTable(
        "maps",
        "page.md",
        "Simulated.",
        (0, 1),
        ("map",),
        (("one",), ("other",)),
        {"share": mean(2, " m"), "gained": span, "told": how_many, "nodes": each},
        made_up,
    )
    monkeypatch.setitem(TABLES, "maps", one)
    return one


def page_of(folder: Path, one: OwnTable) -> Path:
    begin, end = markers(one.name)
    page = folder / one.page
    page.write_text(f"# Title\n\nbefore\n\n{begin}| old |\n{end}\nafter {begin.strip()[:4]}\n")
    return page


def test_cells_are_mean_and_spread_over_seeds(table: OwnTable) -> None:
    assert table.measured((0, 1)).splitlines() == [
        "Simulated. Seeds 0, 1; mean ± standard deviation over them.",
        "",
        "| map | share | gained | told | nodes |",
        "| --- | --- | --- | --- | --- |",
        "| one | 0.55 ± 0.07 m | -2 to +3 | 1 of 2 | 8, 9 |",
        "| other | 0.25 ± 0.00 m | - | - | 8 |",
    ]
    assert table.measured((3,)).splitlines()[0] == "Simulated. Seed 3."
    assert "| one | 0.80 m | +13 | 1 of 1 | 11 |" in table.measured((3,))


def test_a_row_too_few_is_no_table(table: OwnTable) -> None:
    with pytest.raises(ValueError, match="shorter"):
        table.text((0,), [[{"share": 1.0}]])


def test_only_what_lies_between_the_markers_is_replaced(
    table: OwnTable, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = page_of(tmp_path, table)
    before = page.read_text()
    assert main(["maps", "--seeds", "0"], tmp_path) == 0
    assert page.read_text() == before
    assert main(["maps", "--write"], tmp_path) == 0
    assert page.read_text() == before.replace("| old |\n", table.measured((0, 1)))
    assert main(["maps", "--write"], tmp_path) == 0
    assert page.read_text() == before.replace("| old |\n", table.measured((0, 1)))
    assert capsys.readouterr().out.count("| one | 0.55 ± 0.07 m |") == 2


@pytest.mark.parametrize("marker", [0, 1])
def test_a_page_without_a_place_is_refused_before_anything_is_measured(
    marker: int, table: OwnTable, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = page_of(tmp_path, table)
    page.write_text(page.read_text().replace(markers("maps")[marker], ""))
    text = page.read_text()
    assert main(["maps", "--write"], tmp_path) == 2
    out, errors = capsys.readouterr()
    assert (out, page.read_text()) == ("", text)
    assert errors.startswith(f"own_data: {page}: has no place for the table maps; put <!-- written by")


@pytest.mark.parametrize(
    ("words", "told"), [(["map"], "there is no table 'map'; choose from: maps, "), (["--seeds", "-1"], "negative")]
)
def test_mistakes_are_one_line(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    out, errors = capsys.readouterr()
    assert out == "" and told in errors and errors.count("\n") == 1


@pytest.mark.parametrize("name", list(TABLES))
def test_the_pages_show_the_tables(name: str) -> None:
    """Each with all of its rows and columns, and the seeds of the report."""
    one = TABLES[name]
    before, after = around(one)
    page = (DOCS / one.page).read_text(encoding="utf-8")
    shown = page[len(before) : len(page) - len(after)]
    assert " ".join(shown.split()).startswith(f"{one.about} Seeds {', '.join(map(str, one.seeds))};")
    lines = [line.strip("| ").split(" | ") for line in shown.splitlines() if line.startswith("|")]
    assert [cell.strip() for cell in lines[0]] == [*one.heads, *one.columns]
    assert len(lines) == 2 + len(one.rows)


def test_a_scan_passes_the_nodes_and_turns_on_each() -> None:
    places = LabWorld().positions
    poses = scan_poses(places)
    assert len(poses) == 158
    assert np.abs(wrap(np.diff(poses[:, 2]))).max() <= np.deg2rad(30.0) + 1e-9
    assert np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).max() <= 0.2 + 1e-9
    assert poses[-1, :2] == pytest.approx(places[0])
    for place in places:
        here = poses[np.linalg.norm(poses[:, :2] - place, axis=1) < 1e-9]
        assert len(np.unique(np.round(np.rad2deg(here[:, 2])) % 360.0)) == 12


def columns_of(rows: list[Figures]) -> list[set[str]]:
    return [set(row) for row in rows]


@pytest.mark.slow
def test_maps_on_a_tiny_world(monkeypatch: pytest.MonkeyPatch) -> None:
    """The drift is told of maps of odometry only, and `ima` is left out where there are no panoramas."""
    monkeypatch.setattr(maps, "SENSORS", ("ima", "local"))
    rows = list(maps.measure(0, Tiny))
    assert len(rows) == len(maps.MAPS.rows)
    panoramas, drift = {"`ima`"}, {"frames off, median", "at most"}
    everything = set(maps.MAPS.columns) - {"`pca`"}
    expected = [
        everything - drift,
        everything - drift,
        everything,
        everything - drift - panoramas,
        everything - panoramas,
    ]
    assert columns_of(rows) == expected
    assert rows[1]["nodes"] == 2
    assert 0.0 < rows[2]["frames off, median"] < rows[2]["at most"] < 1.0
    assert rows[1]["position, `local`"] < 0.5


def test_built_panoramas_on_a_tiny_world(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(panoramas_built, "FRAMES_A_NODE", 6)
    monkeypatch.setattr(panoramas_built, "PLACED", panoramas_built.PLACED[::3])
    rows = list(panoramas_built.measure(0, Tiny))
    assert columns_of(rows) == [set(panoramas_built.PANORAMAS_BUILT.columns)] * 3
    for row in rows:
        assert 0.0 < row["error, on the axis"] < 5.0
        assert 0.5 < row["match, on the axis"] < 1.0


def test_a_drive_through_a_video_on_a_tiny_world() -> None:
    pictures, through = video.measure(0, Tiny)
    assert set(through) == set(video.VIDEO.columns)
    assert set(through) - set(pictures) == {"`ima`, more right", "`pca`, more right"}
    assert through["size"] < 0.5 * pictures["size"]
    assert abs(through["`ima`"] - pictures["`ima`"]) < 0.3


@pytest.mark.slow
def test_narrow_frames_fit_a_narrow_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the laboratory as it is: small pictures have too few keypoints."""
    monkeypatch.setattr(check, "SHARES", (1.0, 0.5))
    whole, half = check.measure(1000)
    assert whole["told of"] == 0.0 and half["told of"] == 1.0
    assert whole["fits best"] == pytest.approx(40.0, abs=3.0)
    assert half["fits best"] == pytest.approx(check.seen_deg(0.5, Camera(40.0)), abs=3.0)


def test_the_middle_of_a_picture_enlarged() -> None:
    picture = np.zeros((8, 8), dtype=np.uint8)
    picture[2:6, 2:6] = 200
    assert (check.enlarged(picture, 0.5) == 200).all()
    assert (check.enlarged(picture, 1.0) == picture).all()
    assert check.seen_deg(1.0, Camera(40.0)) == pytest.approx(40.0)
