"""Poses from a CSV file with named columns and units: poses, wheels or speeds become a track in metres and radians."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats, wrap
from topoloc.importing.csv_table import Column, CsvTable, read_table
from topoloc.importing.time_units import NAME_THE_UNIT, TIME_UNITS, unclear_step, unit_by_size
from topoloc.recording import Track

EXAMPLE = "time_s,x_m,y_m,heading_deg"
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SPEEDS = {"m_s": 1.0, "cm_s": 1e-2, "mm_s": 1e-3}
ANGLES = {"rad": 1.0, "deg": np.pi / 180.0}
TURNS = {"rad_s": 1.0, "deg_s": np.pi / 180.0}


@dataclass(frozen=True)
class Quantity:
    """What a column can tell.

    Attributes:
        names: that say so, in small letters and without unit.
        units: factor to metres, radians and seconds, by unit; empty: a pure number.
        default: unit of a column that names none; None: it must name one.
    """

    names: tuple[str, ...]
    units: Mapping[str, float] = field(default_factory=dict)
    default: str | None = None


QUANTITIES = {
    "time": Quantity(("time", "t", "timestamp", "stamp", "%time", "__time"), TIME_UNITS),
    "x": Quantity(("x", "tx", "pos_x", "position_x", "position.x"), LENGTHS, "m"),
    "y": Quantity(("y", "ty", "pos_y", "position_y", "position.y"), LENGTHS, "m"),
    "heading": Quantity(("heading", "yaw", "theta"), ANGLES),
    "qx": Quantity(("qx", "orientation_x", "orientation.x")),
    "qy": Quantity(("qy", "orientation_y", "orientation.y")),
    "qz": Quantity(("qz", "orientation_z", "orientation.z")),
    "qw": Quantity(("qw", "orientation_w", "orientation.w")),
    "left": Quantity(("left", "left_wheel", "wheel_left"), {**LENGTHS, "ticks": np.nan}),
    "right": Quantity(("right", "right_wheel", "wheel_right"), {**LENGTHS, "ticks": np.nan}),
    "left_total": Quantity(("left_total", "total_left"), {**LENGTHS, "ticks": np.nan}),
    "right_total": Quantity(("right_total", "total_right"), {**LENGTHS, "ticks": np.nan}),
    "v": Quantity(("v", "speed", "linear_velocity"), SPEEDS, "m_s"),
    "omega": Quantity(("omega", "yaw_rate", "angular_velocity"), TURNS),
}
"""What is read; heading and turns are counter-clockwise from x. The factor of ticks is told by ``Wheels``."""


@dataclass(frozen=True)
class Wheels:
    """A robot with two driven wheels.

    Attributes:
        base_m: distance between them [m]; None where it is not told.
        ticks_per_metre: what their encoders count on a metre; None where it is not told.
    """

    base_m: float | None = None
    ticks_per_metre: float | None = None

    def __post_init__(self) -> None:
        for name, value in (("--wheel-base-m", self.base_m), ("--ticks-per-metre", self.ticks_per_metre)):
            if value is not None and not 0.0 < value < np.inf:
                raise UserError(f"{name} is {value:g}; it must be above 0")


@dataclass(frozen=True)
class CsvTrack(Track):
    """A track, and how it was read.

    Attributes:
        columns: names of the columns that were read, by quantity.
        ignored: names of the columns that nothing was read from.
        repeated: rows that were left out because the row before has the same time.
        clock: the unit of the times.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    repeated: int = 0
    clock: str = "s"


def read_poses_csv(path: Path | str, wheels: Wheels | None = None) -> CsvTrack:
    """Read a track from a CSV file whose columns are named, each with its unit: ``time_s,x_m,y_m,heading_deg``.

    The pose is told by x, y and heading; by x, y and a quaternion qx, qy, qz, qw; by what each wheel moved since the
    row before (``left_m,right_m`` or ``left_ticks,right_ticks``) or in all (``left_total_ticks``, ...); or by speeds
    (``v_m_s,omega_rad_s``), taken as changing evenly from row to row. The first of these that is there is read. A
    unit stands at the name's end or in brackets, ``x [mm]``. Without one, lengths are metres, speeds metres a second,
    and times seconds with a fraction, or what a clock that counts since 1970 shows; angles and wheels must have one.

    Args:
        path: the file; ``,`` ``;`` tab or blanks separate.
        wheels: of the robot, where the file tells of wheels.

    Returns:
        Times increase [s]; poses (N, 3) [m, m, rad], headings counter-clockwise. From wheels and speeds they begin at
        the origin.

    Raises:
        InputError: naming file, line, column and remedy.
    """
    table = read_table(Path(path), EXAMPLE)
    found = _found(table)
    if "time" not in found:
        raise InputError(table.path, "no column tells the time", f"name one time_s; such as {EXAMPLE}")
    times, clock = _times(table, found["time"])
    way = next((way for way in WAYS if set(way) <= set(found)), None)
    if way is None:
        raise InputError(table.path, *_lacking(found))
    poses = WAYS[way](_Reading(table, found, times, wheels or Wheels()))
    later = np.concatenate([[True], np.diff(times) > 0.0])
    read = {what: found[what].name for what in ("time", *way)}
    ignored = tuple(column.name for column in table.columns if column.name not in read.values())
    return CsvTrack(times[later], poses[later], read, ignored, int((~later).sum()), clock)


def _found(table: CsvTable) -> dict[str, Column]:
    """The column of each quantity that one is named for."""
    by_name = {name: what for what, quantity in QUANTITIES.items() for name in quantity.names}
    found: dict[str, Column] = {}
    for column in table.columns:
        what = by_name.get(column.quantity)
        if what is None:
            continue
        if what in found:
            both = f"{found[what].name!r} and {column.name!r}"
            raise InputError(table.path, f"{both} both tell the {what}", "rename or delete one of the two columns")
        found[what] = column
    return found


def _lacking(found: Mapping[str, Column]) -> tuple[str, str]:
    """What is wrong with a file that tells no pose, and what to do."""
    if {"x", "y"} <= set(found):
        return "no column tells the heading", "add heading_deg or heading_rad, or qx,qy,qz,qw"
    for one, other in (("left", "right"), ("left_total", "right_total"), ("v", "omega"), ("x", "y")):
        if one in found or other in found:
            there, lacks = (one, other) if one in found else (other, one)
            return f"has the column {found[there].name!r}, but none for {lacks}", f"add it; such as {EXAMPLE}"
    return "no columns tell a pose", f"name them {EXAMPLE}, or time_s,left_m,right_m, or time_s,v_m_s,omega_rad_s"


def _times(table: CsvTable, column: Column) -> tuple[Floats, str]:
    """Times (N,) [s], none before the one above, and the unit that they are counted in."""
    raw = table.numbers(column)
    unit = column.unit or unit_by_size(float(raw[0]))
    times = raw * _factor(table, column, "time", unit)
    steps = np.diff(times)
    back = np.flatnonzero(steps < 0.0)
    if back.size:
        row = int(back[0]) + 1
        problem = f"column {column.name!r}: {table.rows[row][column.index]} is before the line above"
        raise InputError(table.path, problem, "sort the lines by time", table.lines[row])
    if column.unit is None and (step := unclear_step(raw)) is not None:
        raise InputError(table.path, f"column {column.name!r} has no unit, and steps by {step:g}", NAME_THE_UNIT)
    return times, unit


def _factor(table: CsvTable, column: Column, what: str, unit: str | None) -> float:
    """What the column's numbers are multiplied with to be metres, radians or seconds."""
    quantity = QUANTITIES[what]
    if not quantity.units:
        return 1.0
    if unit is None:
        ways = " or ".join(f"{column.name}_{name}" for name in quantity.units)
        raise InputError(table.path, f"the column {column.name!r} names no unit", f"rename it {ways}")
    if unit not in quantity.units:
        known = ", ".join(quantity.units)
        raise InputError(table.path, f"the column {column.name!r} is in {unit!r}", f"write it in one of: {known}")
    return quantity.units[unit]


@dataclass(frozen=True)
class _Reading:
    """A table whose columns are known, on its way to poses (N, 3)."""

    table: CsvTable
    found: Mapping[str, Column]
    times: Floats
    wheels: Wheels

    def by_heading(self) -> Floats:
        x, y, heading = (self._numbers(what) for what in ("x", "y", "heading"))
        return np.column_stack([x, y, wrap(heading)])

    def by_quaternion(self) -> Floats:
        x, y, qx, qy, qz, qw = (self._numbers(what) for what in ("x", "y", "qx", "qy", "qz", "qw"))
        zero = np.flatnonzero(qx**2 + qy**2 + qz**2 + qw**2 == 0.0)
        if zero.size:
            line = self.table.lines[int(zero[0])]
            raise InputError(self.table.path, "the quaternion is zero", "write 0,0,0,1 for no turn", line)
        heading = np.arctan2(2.0 * (qw * qz + qx * qy), qw**2 + qx**2 - qy**2 - qz**2)
        return np.column_stack([x, y, wrap(heading)])

    def by_totals(self) -> Floats:
        return self._driven(np.diff(self._wheel("left_total")), np.diff(self._wheel("right_total")))

    def by_wheels(self) -> Floats:
        return self._driven(self._wheel("left")[1:], self._wheel("right")[1:])

    def by_speeds(self) -> Floats:
        v, omega, steps = self._numbers("v"), self._numbers("omega"), np.diff(self.times)
        return _arcs(0.5 * (v[1:] + v[:-1]) * steps, 0.5 * (omega[1:] + omega[:-1]) * steps)

    def _numbers(self, what: str) -> Floats:
        """(N,) a quantity in metres, radians, and per second."""
        column = self.found[what]
        unit = column.unit or QUANTITIES[what].default
        return self.table.numbers(column) * _factor(self.table, column, what, unit)

    def _wheel(self, what: str) -> Floats:
        """(N,) what a wheel moved [m]."""
        column = self.found[what]
        if column.unit != "ticks":
            return self._numbers(what)
        if self.wheels.ticks_per_metre is None:
            raise InputError(self.table.path, f"the column {column.name!r} counts ticks", "give --ticks-per-metre")
        return self.table.numbers(column) / self.wheels.ticks_per_metre

    def _driven(self, left: Floats, right: Floats) -> Floats:
        """Poses (N, 3), of what the two wheels moved in each step (N - 1,) [m]."""
        if self.wheels.base_m is None:
            remedy = "give --wheel-base-m, the distance between them in metres"
            raise InputError(self.table.path, "tells what wheels moved", remedy)
        return _arcs(0.5 * (left + right), (right - left) / self.wheels.base_m)


WAYS: Mapping[tuple[str, ...], Callable[[_Reading], Floats]] = {
    ("x", "y", "heading"): _Reading.by_heading,
    ("x", "y", "qx", "qy", "qz", "qw"): _Reading.by_quaternion,
    ("left_total", "right_total"): _Reading.by_totals,
    ("left", "right"): _Reading.by_wheels,
    ("v", "omega"): _Reading.by_speeds,
}
"""How a pose can be told, by the quantities that it takes; the first that a file has is read."""


def _arcs(lengths: Floats, turns: Floats) -> Floats:
    """Poses (N + 1, 3) from the origin on, along arcs of these lengths (N,) [m] that turn so far (N,) [rad]."""
    headings = np.concatenate([[0.0], np.cumsum(turns)])
    middle = headings[:-1] + 0.5 * turns
    chords = lengths * np.sinc(0.5 * turns / np.pi)
    steps = np.column_stack([chords * np.cos(middle), chords * np.sin(middle)])
    positions = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return np.column_stack([positions, wrap(headings)])
