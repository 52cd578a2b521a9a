"""Which room loads which library and which other room, seen in a fresh interpreter."""

from __future__ import annotations

import subprocess
import sys

import pytest

PICTURES_AND_TABLES = {"cv2", "sklearn", "matplotlib", "rich", "cyclopts", "joblib", "filterpy", "pandas", "PIL"}


def loaded_by(statement: str) -> set[str]:
    """Top-level packages in ``sys.modules`` after a statement."""
    code = f"import sys\n{statement}\nprint(*sorted({{name.partition('.')[0] for name in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize(
    ("statement", "forbidden"),
    [
        ("import topoloc", PICTURES_AND_TABLES | {"estimators", "sensors", "benchmarks"}),
        ("import topoloc.testing, topoloc.metrics, topoloc.plan, topoloc.checks, topoloc.map_folder",
         PICTURES_AND_TABLES | {"estimators", "sensors", "benchmarks"}),
        ("import estimators", PICTURES_AND_TABLES | {"sensors", "benchmarks"}),
        ("import sensors", {"estimators", "benchmarks", "matplotlib", "rich", "cyclopts"}),
    ],
    ids=["topoloc", "the hall's corners", "estimators", "sensors"],
)  # fmt: skip
def test_a_room_does_not_load(statement: str, forbidden: set[str]) -> None:
    loaded = loaded_by(statement)
    assert "numpy" in loaded, "or this test sees nothing"
    assert not loaded & forbidden
