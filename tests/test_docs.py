"""What README and docs show is run, and what they point to exists."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from topoloc import plugins
from topoloc.cli.localize import STEP_COLUMNS
from topoloc.cli.main import build_app
from topoloc.map_folder import EDGE_COLUMNS, NODE_COLUMNS, VIEW_COLUMNS
from topoloc.metrics import METRICS

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.DOTALL)


def test_python_of_the_readme_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = blocks(ROOT / "README.md", "python")
    exec(compile(code, "README.md", "exec"), {})
    (promised,) = re.findall(r"It prints `([^`]+)`", (ROOT / "README.md").read_text())
    assert capsys.readouterr().out.strip() == promised


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
    for name in plugins.names(plugins.SENSORS) + plugins.names(plugins.ESTIMATORS):
        assert f"`{name}`" in text


def test_formats_page_has_the_columns() -> None:
    text = (ROOT / "docs" / "formats.md").read_text()
    for columns in (NODE_COLUMNS, EDGE_COLUMNS, VIEW_COLUMNS, STEP_COLUMNS):
        assert f"`{','.join(columns)}`" in text


def test_metrics_page_defines_every_metric() -> None:
    text = (ROOT / "docs" / "metrics.md").read_text()
    for metric in METRICS:
        assert f"| `{metric.name}` | {metric.unit} | {metric.definition} | {metric.better} |" in text
