"""What people look for first: help with examples, completion, version, exit codes, types, changelog, citation."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from cyclopts import App

from topoloc import __version__
from topoloc.cli.main import EXIT_DEFECT, EXIT_INTERRUPTED, EXIT_USER_ERROR, build_app, run

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
ROOMS = ("topoloc", "sensors", "estimators", "benchmarks")


def below(app: App, path: tuple[str, ...] = ()) -> Iterator[tuple[str, App]]:
    """Every command that does something, by the words that call it."""
    for name in app:
        if not name.startswith("-"):
            command, words = app[name], (*path, name)
            if command.default_command is not None:
                yield " ".join(words), command
            yield from below(command, words)


COMMANDS = dict(below(build_app()))


@pytest.fixture(scope="module")
def app() -> App:
    return build_app()


def test_every_installed_command_is_there() -> None:
    points = PROJECT["entry-points"]
    groups = {"import": "topoloc.importers", "map": "topoloc.map_commands"}
    expected = {name for name in points["topoloc.commands"] if name not in groups}
    expected |= {f"{group} {name}" for group, points_of in groups.items() for name in points[points_of]}
    groups_of_commands = {command.partition(" ")[0] for command in COMMANDS if " " in command}
    assert expected - set(COMMANDS) - groups_of_commands == set()


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example_that_parses(command: str, app: App) -> None:
    text = COMMANDS[command].default_command.__doc__ or ""
    _, found, examples = text.partition("Example:")
    assert found, "the help shows no example"
    lines = re.findall(r"``(topoloc [^`]*)``", " ".join(examples.split()))
    assert lines, "the example is not marked as code"
    assert any(line.startswith(f"topoloc {command}") for line in lines)
    for line in lines:
        app.parse_args(shlex.split(line)[1:], exit_on_error=False, print_error=False)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_tells_of_every_option(command: str) -> None:
    arguments = COMMANDS[command].assemble_argument_collection()
    told = COMMANDS[command].default_command.__doc__ or ""  # its Args: serve as well
    in_docstring = set(re.findall(r"^ +(\w+): \S", told, re.MULTILINE))
    silent = [one.name for one in arguments if not one.parameter.help and one.field_info.name not in in_docstring]
    assert silent == []


@pytest.mark.parametrize("command", [[], ["map"], ["import"]])
def test_a_group_shows_what_is_below_it(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*command, "--help"]) == 0
    shown = capsys.readouterr().out
    words = " ".join(command)
    assert all(f" {name.split()[-1]} " in shown for name in COMMANDS if name.rpartition(" ")[0] == words)


def test_versions_agree(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.strip() == __version__ == PROJECT["version"]


def test_module_is_the_command() -> None:
    called = subprocess.run(
        [sys.executable, "-m", "topoloc", "--version"], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert called.stdout.strip() == PROJECT["version"]


def test_exit_codes_are_documented() -> None:
    page = (ROOT / "docs" / "exit_codes.md").read_text()
    codes = [int(code) for code in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)]
    assert codes == [0, 1, EXIT_USER_ERROR, EXIT_DEFECT, EXIT_INTERRUPTED]
    assert run(["no-such-command"]) == EXIT_USER_ERROR


@pytest.fixture(scope="module")
def bash_script() -> str:
    return build_app().generate_completion(shell="bash")


def completed(script: str, *words: str, tmp_path: Path) -> list[str]:
    """What a real bash offers for the last of some words."""
    (tmp_path / "topoloc.bash").write_text(script)
    setting = f"COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}"
    code = f"source topoloc.bash; {setting}; _topoloc; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    return done.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes(bash_script: str, tmp_path: Path) -> None:
    assert completed(bash_script, "topoloc", "loc", tmp_path=tmp_path) == ["localize"]
    assert completed(bash_script, "topoloc", "map", "la", tmp_path=tmp_path) == ["layout"]
    assert completed(bash_script, "topoloc", "localize", "--est", tmp_path=tmp_path) == ["--estimator"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_printed_and_sound(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "localize" in script
    if shutil.which(shell) is not None:
        read = subprocess.run([shell, "-n"], input=script, capture_output=True, text=True, check=False)
        assert (read.returncode, read.stderr) == (0, "")


def test_completion_is_installed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / ".bashrc").write_text("alias ours=theirs\n")
    monkeypatch.setenv("HOME", str(tmp_path))
    for _ in range(2):
        assert run(["completion", "bash", "--install"]) == 0
    place = Path(capsys.readouterr().out.splitlines()[0].partition(": completion for bash")[0])
    assert place.is_relative_to(tmp_path)
    assert "_topoloc" in place.read_text()
    lines = (tmp_path / ".bashrc").read_text().splitlines()
    assert lines[0] == "alias ours=theirs"
    assert sum(str(place) in line for line in lines) == 1


def test_completion_of_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["completion", "tcsh"]) == EXIT_USER_ERROR
    assert "bash" in capsys.readouterr().err


def test_rooms_are_typed() -> None:
    for room in ROOMS:
        assert (ROOT / room / "py.typed").is_file()


def test_changelog_has_this_version() -> None:
    text = (ROOT / "CHANGELOG.md").read_text()
    heads = re.findall(r"^## \[([^\]]+)\](?: - (\d{4}-\d{2}-\d{2}|unreleased))?$", text, re.MULTILINE)
    assert heads[0][0] in (PROJECT["version"], "Unreleased")
    assert PROJECT["version"] in [version for version, _ in heads]
    assert set(re.findall(r"^### (.*)$", text, re.MULTILINE)) <= {
        "Added",
        "Changed",
        "Deprecated",
        "Removed",
        "Fixed",
        "Security",
    }


def test_citation_file_is_one() -> None:
    """What the Citation File Format 1.2.0 asks for; the whole schema is not at hand."""
    citation: dict[str, Any] = import_module("yaml").safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert citation["version"] == PROJECT["version"]
    assert len(citation["references"]) == 3, "the thesis and the two papers"
    for work in (citation, *citation["references"]):
        assert work["title"]
        assert all(set(author) <= {"name", "family-names", "given-names"} for author in work["authors"])
    for work in citation["references"]:
        assert work["type"] in ("article", "conference-paper", "generic", "thesis")
        assert work.get("year") is None or 1990 < work["year"] <= date.today().year
        assert work.get("doi") is None or re.fullmatch(r"10\.\d{4,9}/\S+", work["doi"])


def test_contributors_are_told_of_every_target_and_room() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    targets = re.findall(r"`make ([a-z-]+)`", text)
    made = (ROOT / "Makefile").read_text()
    assert {"test", "lint"} <= set(targets)
    assert all(re.search(rf"^{target}:", made, re.MULTILINE) for target in targets)
    assert all(f"`{room}/`" in text for room in ROOMS)
    links = re.findall(r"\]\(([^)#]+)\)", text)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []
