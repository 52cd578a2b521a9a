"""A package that a page of the docs describes, as pip would install it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest


def install(page: Path, code: str, folder: Path, monkeypatch: pytest.MonkeyPatch, module: str | None = None) -> None:
    """Put the package that a page's TOML describes on the path, with a piece of the page's code as its module.

    Args:
        page: with one block of TOML, a pyproject.
        code: of the module.
        folder: to install into.
        monkeypatch: takes the folder off the path again.
        module: its name; by default the project's.
    """
    (toml,) = re.findall(r"```toml\n(.*?)```", page.read_text(), re.DOTALL)
    project = tomllib.loads(toml)["project"]
    (folder / f"{module or project['name']}.py").write_text(code)
    installed = folder / f"{project['name']}-{project['version']}.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    groups = [(group, line) for group, lines in project["entry-points"].items() for line in lines.items()]
    points = "".join(f"[{group}]\n{name} = {target}\n" for group, (name, target) in groups)
    (installed / "entry_points.txt").write_text(points)
    monkeypatch.syspath_prepend(folder)
