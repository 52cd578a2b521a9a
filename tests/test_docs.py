"""What README and docs show is run, and what they point to exists."""

from __future__ import annotations

import re
import shlex
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from oracles.installed_page import install

from topoloc import plugins
from topoloc.cli.main import build_app
from topoloc.map_folder import EDGE_COLUMNS, NODE_COLUMNS, VIEW_COLUMNS
from topoloc.metrics import METRICS
from topoloc.settings import parse_words
from topoloc.steps import STEP_COLUMNS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.DOTALL)


@pytest.mark.parametrize("name", ["README.md", "docs/estimators.md", "docs/omni.md"])
def test_python_of_a_page_prints_what_it_says(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = blocks(ROOT / name, "python")
    exec(compile(code, name, "exec"), {})
    (promised,) = re.findall(r"It prints `([^`]+)`", (ROOT / name).read_text())
    assert capsys.readouterr().out.strip() == promised


def test_estimator_of_the_docs_keeps_the_contract() -> None:
    namespace: dict[str, Any] = {}
    code = blocks(ROOT / "docs" / "estimator.md", "python")
    assert "check_estimator(NodeTracker)" in code[-1]
    for part in code:
        exec(compile(part, "estimator.md", "exec"), namespace)


def test_estimator_of_the_docs_is_known_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As pip would install what the page's pyproject says, beside a file with the page's class."""
    page = ROOT / "docs" / "estimator.md"
    install(page, blocks(page, "python")[0], tmp_path, monkeypatch, "nodetracker")
    assert "nodes" in plugins.names(plugins.ESTIMATORS)
    estimator: Any = plugins.make_estimator("nodes", {"renewal": "0.2"})
    assert estimator.config.renewal == 0.2
    (setting,) = plugins.settings_of(type(estimator))
    assert (setting.name, setting.default) == ("renewal", "0.1")
    assert setting.text.startswith("probability")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_parse(page: Path) -> None:
    """Each command line in the docs names an existing command and options it takes."""
    app = build_app()
    for block in blocks(page, "sh"):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] == "topoloc":
                app.parse_args(words[1:], exit_on_error=False, print_error=False)
            elif words:
                assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert target.startswith("https://") or (page.parent / target).exists(), target


def test_every_sensor_and_estimator_is_introduced() -> None:
    text = (ROOT / "README.md").read_text()
    ours = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    for name in [*ours[plugins.SENSORS], *ours[plugins.ESTIMATORS]]:
        assert f"`{name}`" in text


def test_formats_page_has_the_columns() -> None:
    text = (ROOT / "docs" / "formats.md").read_text()
    for columns in (NODE_COLUMNS, EDGE_COLUMNS, VIEW_COLUMNS, STEP_COLUMNS):
        assert f"`{','.join(columns)}`" in text


def test_metrics_page_defines_every_metric() -> None:
    text = (ROOT / "docs" / "metrics.md").read_text()
    for metric in METRICS:
        assert f"| `{metric.name}` | {metric.unit} | {metric.definition} | {metric.better} |" in text


def test_every_world_is_introduced_and_what_is_set_of_it_exists() -> None:
    page = ROOT / "docs" / "worlds.md"
    text = page.read_text()
    for name in plugins.names(plugins.WORLDS):
        assert f"`{name}`" in text
        assert f"pictures/world_{name}.jpg" in text
    for line in "".join(blocks(page, "sh")).splitlines():
        words = shlex.split(line, comments=True)
        if words[:2] == ["topoloc", "simulate"]:
            chosen = [value for option, value in pairwise(words) if option == "--set"]
            plugins.make(plugins.WORLDS, words[2], parse_words(chosen))


def test_every_setting_that_the_page_of_worlds_names_exists() -> None:
    table = (ROOT / "docs" / "worlds.md").read_text().partition("| setting |")[2].partition("\n\n")[0]
    known = {setting.name for setting in plugins.settings_of(plugins.load(plugins.WORLDS, "lab"))}
    named = [name for row in table.splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]
    assert len(named) > 15
    for name in named:
        assert name in known or (name.endswith(".*") and any(one.startswith(name[:-1]) for one in known)), name
