"""The tutorial and the pages on a sensor and a scenario of one's own run as they stand, and print what they show."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from oracles.installed_page import install

from benchmarks.scenarios import make_scenario, scenario_names
from topoloc import plugins

DOCS = Path(__file__).parents[1] / "docs"
CELL = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```text\n(?P<shown>.*?)```\n)?", re.DOTALL)


class Cell(NamedTuple):
    """A piece of code of a page, and what the page says that it prints."""

    code: str
    shown: str
    line: int


def cells(page: str) -> list[Cell]:
    text = (DOCS / page).read_text()
    found = [(match, text[: match.start("code")].count("\n")) for match in CELL.finditer(text)]
    return [Cell(match["code"], match["shown"] or "", line) for match, line in found]


@pytest.mark.parametrize(("page", "least"), [("tutorial.md", 9), ("own_sensor.md", 3), ("own_scenario.md", 3)])
def test_page_prints_what_it_shows(
    page: str, least: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Cell by cell in one namespace, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {}
    found = cells(page)
    assert len(found) >= least
    assert any(cell.shown for cell in found)
    for cell in found:
        exec(compile("\n" * cell.line + cell.code, page, "exec"), namespace)
        assert capsys.readouterr().out == cell.shown, f"{page}, line {cell.line}"


def test_sensor_of_the_page_is_known_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(DOCS / "own_sensor.md", cells("own_sensor.md")[0].code, tmp_path, monkeypatch)
    assert "mosaic" in plugins.names(plugins.SENSORS)
    sensor: Any = plugins.make_sensor("mosaic", {"columns": "15"})
    assert sensor.config.columns == 15
    settings = {setting.name: setting for setting in plugins.settings_of(type(sensor))}
    assert settings["columns"].default == "12"
    assert settings["columns"].text.startswith("tiles side by side")
    assert settings["neighbours"].text  # inherited, and told all the same
    assert plugins.make_sensor("mosaic+histogram").needs == {"rgb"}


def test_scenario_of_the_page_is_known_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (code,) = (cell.code for cell in cells("own_scenario.md") if "LAB_CROWDED" in cell.code)
    install(DOCS / "own_scenario.md", code, tmp_path, monkeypatch)
    assert "lab-crowded" in scenario_names()
    scenario = make_scenario("lab-crowded", updates=5)
    assert scenario.description.startswith("People stand before the camera")
    assert (scenario.settings["people"], scenario.settings["bulbs"], scenario.settings["updates"]) == (0.6, 1.0, 5)
