"""Times in the names of picture files: dates, clocks that count since 1970, and seconds with a fraction."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise

from topoloc.importing.time_units import EPOCH_S, TIME_UNITS, unit_by_size

NUMBER = re.compile(r"\d+(?:\.\d+)?")
DATE = re.compile(
    r"(?<!\d)(19[89]\d|20\d\d)[-_.]?(\d\d)[-_.]?(\d\d)[-_. T]?(\d\d)[-_.:h]?(\d\d)[-_.:m]?(\d\d)"
    r"(?:[.,](\d{1,6})|[-_]?(\d{6})|(\d{3}))?(?!\d)"
)
"""Year, month, day, hours, minutes, seconds; the fraction of a second stands in one of the last three groups."""
LATEST_S = 4102444800.0
"""No clock shows more than the year 2100 [s since 1970]."""

Told = Sequence[tuple[str, float]]
"""Names, and the times [s] that are read from them."""


@dataclass(frozen=True)
class NameTimes:
    """Times as the names of a folder tell them.

    Attributes:
        times: of each name [s]; None where it tells none.
        whole_seconds: the names know only the second, so that several may have the same.
    """

    times: Sequence[float | None]
    whole_seconds: bool = False


def name_times(stems: Sequence[str]) -> NameTimes | None:
    """The times that the names of a folder tell; None where no way of reading them fits more than half.

    The ways, the first that fits: a date with the time of day, which is taken for UTC; the last number that is a time
    since 1970, in the unit that its size tells; the last number with a fraction, as seconds. Numbers of pictures and of
    versions are none of these: the same moment in all names is no time of the pictures, and a fraction is one only
    where the times all differ and grow with the names.

    Args:
        stems: names of the files without their endings.
    """
    for read, fits, whole_seconds in WAYS:
        times = [read(stem) for stem in stems]
        told = [(stem, time) for stem, time in zip(stems, times, strict=True) if time is not None]
        if 2 * len(told) > len(stems) and fits(told):
            return NameTimes(times, whole_seconds)
    return None


def _date(stem: str) -> float | None:
    """The last date with a time of day, to the second [s since 1970]."""
    moments = [time for time, _ in map(_moment, DATE.finditer(stem)) if time is not None]
    return moments[-1] if moments else None


def _date_and_fraction(stem: str) -> float | None:
    """The same with its fraction, where it has one."""
    moments = [time + fraction for time, fraction in map(_moment, DATE.finditer(stem)) if time is not None]
    return moments[-1] if moments else None


def _moment(found: re.Match[str]) -> tuple[float | None, float]:
    """Seconds since 1970, None where there is no such date, and the fraction of a second."""
    *date, after_point, micros, millis = found.groups()
    year, month, day, hour, minute, second = map(int, date)
    try:
        moment = datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()
    except ValueError:
        return None, 0.0
    return moment, float(f"0.{after_point or micros or millis or 0}")


def _count(stem: str) -> float | None:
    """The last number that a clock could show that counts since 1970 [s]."""
    for word in reversed(NUMBER.findall(stem)):
        value = float(word)
        time = value * TIME_UNITS[unit_by_size(value)]
        if EPOCH_S <= time <= LATEST_S:
            return time
    return None


def _fraction(stem: str) -> float | None:
    """The last number with a fraction."""
    return next((float(word) for word in reversed(NUMBER.findall(stem)) if "." in word), None)


def _move(told: Told) -> bool:
    """Whether the times are not all of one second."""
    return len(told) == 1 or len({int(time) for _, time in told}) > 1


def _differ(told: Told) -> bool:
    """Whether the times are not all the same."""
    return len(told) == 1 or len({time for _, time in told}) > 1


def _grow(told: Told) -> bool:
    """Whether all differ, and grow with the other numbers in the names."""
    by_name = sorted(told, key=lambda one: ([n for n in map(float, NUMBER.findall(one[0])) if n != one[1]], one[1]))
    return all(before < time for (_, before), (_, time) in pairwise(by_name))


WAYS: Sequence[tuple[Callable[[str], float | None], Callable[[Told], bool], bool]] = (
    (_date_and_fraction, lambda told: _move(told) and _grow(told), False),
    (_date, _move, True),
    (_count, _differ, False),
    (_fraction, _grow, False),
)
"""How a time is read, whether those of a folder can be times, and whether they know only the second."""
