"""Poses from CSV: any units and order of columns give the same track, and each mistake is named with its place."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats, wrap
from topoloc.importing.odometry_csv import Wheels, read_poses_csv
from topoloc.importing.time_units import unit_by_size

TIMES = np.array([100.0, 100.5, 101.0, 102.0])
POSES = np.array([[0.0, 0.0, 0.0], [0.5, 0.25, 1.0], [1.0, -2.0, 3.0], [1.5, 0.125, -3.0]])
TIME_NAMES = {"time_s": 1.0, "t [ms]": 1e3, "timestamp_us": 1e6, "Time (ns)": 1e9, "timestamp": 1.0, "stamp_sec": 1.0}
LENGTH_NAMES = {"{}_m": 1.0, "{} [mm]": 1e3, "{}_cm": 1e2, "{}": 1.0, "pos_{}": 1.0, "{} (metres)": 1.0}
HEADING_NAMES = {"heading_rad": 1.0, "yaw_deg": 180.0 / np.pi, "Theta [°]": 180.0 / np.pi, "theta_radians": 1.0}


def written(
    path: Path, columns: Mapping[str, Sequence[float] | Floats], order: Sequence[int] = (), mark: str = ","
) -> Path:
    names = list(columns)
    names = [names[i] for i in order] if order else names
    rows = zip(*(columns[name] for name in names), strict=True)
    lines = [mark.join(names), *(mark.join(f"{value:.12g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def quaternion(headings: Floats) -> dict[str, Floats]:
    zero = np.zeros_like(headings)
    return {"qx": zero, "qy": zero, "qz": np.sin(headings / 2), "qw": np.cos(headings / 2)}


@given(
    time=st.sampled_from(sorted(TIME_NAMES)),
    x=st.sampled_from(sorted(LENGTH_NAMES)),
    y=st.sampled_from(sorted(LENGTH_NAMES)),
    heading=st.sampled_from([*sorted(HEADING_NAMES), "quaternion"]),
    shuffle=st.randoms(use_true_random=False),
    mark=st.sampled_from([",", ";", "\t", ", "]),
    bom=st.booleans(),
)
def test_any_units_and_order_give_the_same_track(
    tmp_path_factory: pytest.TempPathFactory,
    time: str,
    x: str,
    y: str,
    heading: str,
    shuffle: Random,
    mark: str,
    bom: bool,
) -> None:
    path = tmp_path_factory.mktemp("csv") / "drive.csv"
    turned = quaternion(POSES[:, 2]) if heading == "quaternion" else {heading: POSES[:, 2] * HEADING_NAMES[heading]}
    columns: dict[str, Sequence[float] | Floats] = {
        time: TIMES * TIME_NAMES[time],
        x.format("x"): POSES[:, 0] * LENGTH_NAMES[x],
        y.format("y"): POSES[:, 1] * LENGTH_NAMES[y],
        "battery [V]": [12.0] * len(TIMES),
        **turned,
    }
    order = list(range(len(columns)))
    shuffle.shuffle(order)
    written(path, columns, order, mark)
    if bom:
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    track = read_poses_csv(path)
    np.testing.assert_allclose(track.times, TIMES)
    np.testing.assert_allclose(track.poses[:, :2], POSES[:, :2], atol=1e-9)
    np.testing.assert_allclose(wrap(track.poses[:, 2] - POSES[:, 2]), 0.0, atol=1e-9)
    assert (track.ignored, track.repeated) == (("battery [V]",), 0)


def circle(rows: int) -> tuple[Floats, Floats]:
    """Times, and poses every so often on a circle of 2 m that is driven at 0.5 m/s counter-clockwise."""
    times = np.linspace(0.0, 8.0, rows)
    turned = 0.25 * times
    return times, np.column_stack([2.0 * np.sin(turned), 2.0 * (1.0 - np.cos(turned)), turned])


@pytest.mark.parametrize("way", ["metres", "ticks", "totals", "speeds"])
def test_wheels_and_speeds_are_driven_along_arcs(way: str, tmp_path: Path) -> None:
    times, poses = circle(9)
    steps = np.diff(times, prepend=times[0])
    left, right = 0.5 * steps * (1.0 - 0.25 / 2.0), 0.5 * steps * (1.0 + 0.25 / 2.0)  # base 0.5 m, radius 2 m
    columns: dict[str, dict[str, Floats]] = {
        "metres": {"left_m": left, "right_mm": 1e3 * right},
        "ticks": {"right_ticks": 800.0 * right, "left_ticks": 800.0 * left},
        "totals": {"left_total_ticks": 70.0 + 800.0 * left.cumsum(), "right_total_ticks": 800.0 * right.cumsum()},
        "speeds": {"v_m_s": np.full(9, 0.5), "omega [deg/s]": np.full(9, np.rad2deg(0.25))},
    }
    path = written(tmp_path / "drive.csv", {"time_s": times, **columns[way]})
    track = read_poses_csv(path, Wheels(base_m=0.5, ticks_per_metre=800.0))
    np.testing.assert_allclose(track.poses, poses, atol=1e-9)


def test_the_first_row_has_no_step_before_it(tmp_path: Path) -> None:
    path = written(tmp_path / "drive.csv", {"time_s": [1, 2], "left_m": [9, 1], "right_m": [9, 1]})
    np.testing.assert_allclose(read_poses_csv(path, Wheels(0.4)).poses, [[0, 0, 0], [1, 0, 0]])


def test_poses_go_before_speeds(tmp_path: Path) -> None:
    columns = {
        "time_s": [1, 2],
        "v_m_s": [5, 5],
        "omega_rad_s": [0, 0],
        "x_m": [3, 4],
        "y_m": [0, 0],
        "yaw_deg": [0, 90],
    }
    track = read_poses_csv(written(tmp_path / "drive.csv", columns))
    np.testing.assert_allclose(track.poses, np.array([[3.0, 0.0, 0.0], [4.0, 0.0, np.pi / 2]]))
    assert track.ignored == ("v_m_s", "omega_rad_s")
    assert track.columns == {"time": "time_s", "x": "x_m", "y": "y_m", "heading": "yaw_deg"}


def test_what_rostopic_writes_is_read(tmp_path: Path) -> None:
    """``rostopic echo -p``: nanoseconds without a unit, names with dots, and much else."""
    path = tmp_path / "odom.csv"
    pose = "field.pose.pose."
    names = ["%time", "field.header.seq", *(f"{pose}position.{k}" for k in "xyz")]
    names += [f"{pose}orientation.{k}" for k in "xyzw"] + ["field.twist.twist.linear.x"]
    rows = ["1500000000500000000,1,1,2,0,0,0,0,1,0.3", "1500000001500000000,2,2,2,0,0,0,1,0,0.3"]
    path.write_text("\n".join([",".join(names), *rows]))
    track = read_poses_csv(path)
    np.testing.assert_allclose(track.times, [1500000000.5, 1500000001.5], atol=1e-6)
    np.testing.assert_allclose(np.abs(track.poses), np.array([[1.0, 2.0, 0.0], [2.0, 2.0, np.pi]]), atol=1e-9)
    assert track.clock == "ns"


def test_a_tum_trajectory_is_read(tmp_path: Path) -> None:
    path = tmp_path / "groundtruth.txt"
    path.write_text("# ground truth\n# timestamp tx ty tz qx qy qz qw\n1.0 2 3 0 0 0 0 1\n1.5 2 4 0 0 0 0 2\n")
    np.testing.assert_allclose(read_poses_csv(path).poses, [[2, 3, 0], [2, 4, 0]])


def test_comments_quotes_blank_lines_and_empty_last_cells_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(
        '# of Monday\n\ntime_s,x_m,y_m,"heading, mine",heading_deg\n0,1,2,"a, b",90,\n\n# then\n1,1,3,,90\n'
    )
    track = read_poses_csv(path)
    np.testing.assert_allclose(track.poses, [[1, 2, np.pi / 2], [1, 3, np.pi / 2]])
    assert track.ignored == ("heading, mine",)


def test_rows_of_the_same_time_are_left_out_but_what_they_drove_counts(tmp_path: Path) -> None:
    columns = {"time_s": [1, 2, 2, 3], "left_m": [0, 1, 1, 1], "right_m": [0, 1, 1, 1]}
    track = read_poses_csv(written(tmp_path / "drive.csv", columns), Wheels(0.4))
    assert track.repeated == 1
    np.testing.assert_allclose(track.times, [1, 2, 3])
    np.testing.assert_allclose(track.poses[:, 0], [0, 1, 3])


@pytest.mark.parametrize(
    ("value", "unit"), [(12.5, "s"), (1.7e9, "s"), (1.7e12, "ms"), (1.7e15, "us"), (1.7e18, "ns"), (-1.7e12, "ms")]
)
def test_a_clock_since_1970_shows_its_unit(value: float, unit: str) -> None:
    assert unit_by_size(value) == unit


GOOD = "time_s,x_m,y_m,heading_deg\n0,1,2,90\n1,2,2,90\n"
BAD = {
    "bare theta": (GOOD.replace("heading_deg", "theta"), r"'theta' names no unit; rename it theta_rad or theta_deg$"),
    "bare omega": ("t,v,omega\n0,1,2\n", r"'omega' names no unit; rename it omega_rad_s or omega_deg_s$"),
    "feet": (GOOD.replace("x_m", "x [ft]"), r"'x \[ft\]' is in 'ft'; write it in one of: m, cm, mm$"),
    "time in metres": (GOOD.replace("time_s", "t_m"), r"'t_m' is in 'm'; write it in one of: s, ms, us, ns$"),
    "decimal comma": (
        GOOD.replace(",", ";").replace("1;2;90", "1,5;2;90"),
        r"line 2: column 'x_m': '1,5' .*write 1\.5",
    ),
    "decimal comma between commas": (GOOD.replace("0,1,", "0,1,5,"), r"line 2: 5 cells for 4 columns; .*point"),
    "a letter": (GOOD.replace("1,2,2", "1,two,2"), r"line 3: column 'x_m': 'two' is not a finite number; "),
    "nan": (GOOD.replace("1,2,2", "1,nan,2"), r"line 3: column 'x_m': 'nan' is not a finite number; "),
    "an empty cell": (GOOD.replace("1,2,2", "1,,2"), r"line 3: no 'x_m'; "),
    "a short row": (GOOD.replace("1,2,2,90", "1,2"), r"line 3: 2 cells for 4 columns; "),
    "back in time": (GOOD + "0.5,2,2,90\n", r"line 4: column 'time_s': 0\.5 is before the line above; sort"),
    "unlabelled milliseconds": ("t,x,y,yaw_deg\n0,1,2,90\n50,2,2,90\n", r"'t' has no unit, and steps by 50; .*t.*_ms"),
    "unlabelled milliseconds at 500 Hz": (
        "t,x,y,yaw_deg\n0,1,2,90\n2,2,2,90\n",
        r"'t' has no unit, and steps by 2; .*_ms",
    ),
    "twice the same": (GOOD.replace("y_m", "x_mm"), r"'x_m' and 'x_mm' both tell the x; "),
    "no time": (GOOD.replace("time_s", "row"), r"no column tells the time; "),
    "no heading": (GOOD.replace("heading_deg", "battery"), r"no column tells the heading; add heading_deg"),
    "no right wheel": ("t,left_m\n0,1\n", r"has the column 'left_m', but none for right; "),
    "nothing known": ("a,b\n0,1\n", r"no column tells the time; "),
    "no pose": ("t,b\n0,1\n", r"no columns tell a pose; "),
    "no names": ("0,1,2,90\n1,2,2,90\n", r"line 1: names no columns; .*time_s,x_m,y_m,heading_deg"),
    "no rows": ("time_s,x_m,y_m,heading_deg\n", r"holds no rows; "),
    "empty": ("", r"holds no rows; "),
    "zero quaternion": ("t,x,y,qx,qy,qz,qw\n0,1,2,0,0,0,0\n", r"line 2: the quaternion is zero; "),
    "wheels without a base": ("time_s,left_m,right_m\n0,1,1\n1,1,1\n", r"tells what wheels moved; give --wheel-base-m"),
    "ticks without a scale": (
        "t,left_ticks,right_ticks\n0,1,1\n",
        r"'left_ticks' counts ticks; give --ticks-per-metre",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_is_named_with_its_place(case: str, tmp_path: Path) -> None:
    text, expected = BAD[case]
    (tmp_path / "drive.csv").write_text(text)
    with pytest.raises(InputError, match=r"drive\.csv") as caught:
        read_poses_csv(tmp_path / "drive.csv")
    assert re.search(expected, str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_good_file_is_good(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text(GOOD)
    assert len(read_poses_csv(tmp_path / "drive.csv").times) == 2


def test_a_table_in_utf_16_is_named(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text(GOOD, encoding="utf-16")
    with pytest.raises(InputError, match=r"drive\.csv: is not a text file in UTF-8; export"):
        read_poses_csv(tmp_path / "drive.csv")


@pytest.mark.parametrize(
    ("times", "clock"),
    [(["0", "0.5", "1"], "s"), (["1700000000", "1700000001"], "s"), (["1700000000000", "1700000000002"], "ms")],
)
def test_a_clock_that_is_clear_needs_no_unit(times: list[str], clock: str, tmp_path: Path) -> None:
    rows = "".join(f"{time},1,2,90\n" for time in times)
    (tmp_path / "drive.csv").write_text(f"time,x_m,y_m,heading_deg\n{rows}")
    assert read_poses_csv(tmp_path / "drive.csv").clock == clock


@pytest.mark.parametrize("wheels", [{"base_m": 0.0}, {"ticks_per_metre": -1.0}, {"base_m": float("nan")}])
def test_impossible_wheels(wheels: dict[str, float]) -> None:
    with pytest.raises(UserError, match=r"--(wheel-base-m|ticks-per-metre) is .*; it must be above 0"):
        Wheels(**wheels)
