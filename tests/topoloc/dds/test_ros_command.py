"""``topoloc ros``: what it refuses before it starts, and what it says while it runs."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from topoloc.cli.main import run
from topoloc.dds.board import ERASE, Board
from topoloc.live import LiveCounts, LiveReport
from topoloc.testing import toy_map
from topoloc.types import Estimate, Status, WeightedPoses

IMAGE = ("--image-topic", "/camera/image/compressed")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "--image-topic"),
        (["--image-topic", "camera image"], "'camera image' is no ROS 2 topic name; "),
        ([*IMAGE, "--domain", "233"], "233"),
        ([*IMAGE, "--set", "live.patience=1"], "'patience'"),
        ([*IMAGE, "--set", "live.camera_silent_s=-1"], "settings of live: camera_silent_s is -1"),
        ([*IMAGE, "--camera-toml", "no.toml"], "no.toml: no such file"),
        ([*IMAGE, "--sensor", "fourier"], "fourier needs omni pictures"),
        ([*IMAGE, "--state", "map.toml"], "map.toml: is no belief that topoloc saved"),
    ],
    ids=["no topic", "no name", "no domain", "no setting", "no value", "no camera", "blind sensor", "no belief"],
)
def test_mistakes(
    options: Sequence[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    toy_map().save(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert run(["ros", ".", *options]) == 2
    out, err = capsys.readouterr()
    assert says in err and err.count("\n") == 1 and out == ""


def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.delitem(sys.modules, "topoloc.dds.node", raising=False)
    monkeypatch.setitem(sys.modules, "cyclonedds.builtin", None)
    assert run(["ros", str(tmp_path), *IMAGE]) == 2
    assert capsys.readouterr().err == "topoloc: topoloc ros needs cyclonedds; type: pip install 'topoloc[dds]'\n"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def report(status: Status = Status.LOCALIZED, node: int | None = 0) -> LiveReport:
    estimate = Estimate(np.zeros(3), np.eye(3), node, 0.9, status)
    name = None if node is None else toy_map().nodes[node].id
    belief = WeightedPoses.uniform(np.zeros((1, 3)))
    return LiveReport(1.0, estimate, status, "", belief, np.zeros(3), name, LiveCounts(used=1), 0.0)


def test_lines_elsewhere_than_on_a_terminal() -> None:
    """One a second, and at every change of place or status."""
    now, out = [0.0], io.StringIO()
    board = Board(toy_map(), out, lambda: now[0])
    for time, one in ((0.0, report()), (0.5, report()), (0.6, report(node=1)), (0.7, report(Status.LOST, 1))):
        now[0] = time
        board.tell(one)
    now[0] = 1.7
    board.tell(report(Status.LOST, 1))
    board.notice(["no image yet"])
    board.notice(["no image yet", "no odometry yet"])
    board.notice([])
    board.notice(["no image yet"])
    board.close()
    lines = out.getvalue().splitlines()
    assert [("0-0" in line, "LOST" in line) for line in lines[:4]] == [
        (True, False),
        (False, False),
        (False, True),
        (False, True),
    ]
    assert lines[4:] == ["no image yet", "no odometry yet", "no image yet"]


def test_a_line_on_a_terminal_is_rewritten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    out = Terminal()
    board = Board(toy_map(), out, lambda: 0.0)
    board.tell(report())
    board.tell(report(node=1))
    board.notice(["no odometry yet"])
    board.close()
    _, first, second, notice, last = out.getvalue().split(ERASE)
    assert (len(first), len(second)) == (29, 29) and "\n" not in first + second
    assert notice == "no odometry yet\n"
    assert len(last) > 30 and last.startswith(second) and last.endswith("\n")
