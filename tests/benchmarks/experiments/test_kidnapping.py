"""Started anywhere, and kidnapped (thesis 5.2.2)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from benchmarks.experiments.kidnapping import EXPERIMENT, SEEN_UNDER, _recovery, _summary, updates_until_right
from benchmarks.experiments.kidnappings import LOOKS, kidnapped, looks_until_right
from benchmarks.experiments.tracking import Tracked
from benchmarks.worlds.settings import WorldSettings


@pytest.mark.parametrize(
    ("matched", "right", "looks"),
    [
        ("110", "010", 2.0),
        ("0011", "0001", 2.0),
        ("0111", "1000", 1.0),
        ("1011", "0100", 2.0),  # right without a match: the next look is spent
        ("111", "000", np.inf),
        ("", "", np.inf),
    ],
)
def test_looks_by_hand(matched: str, right: str, looks: float) -> None:
    assert looks_until_right(*(np.array([c == "1" for c in text], dtype=bool) for text in (matched, right))) == looks


@given(st.lists(st.tuples(st.booleans(), st.booleans())))
def test_in_time_is_any_right_before_the_looks_are_spent(updates: list[tuple[bool, bool]]) -> None:
    """Written as it was counted first, by a running sum."""
    matched, right = np.array(updates, dtype=bool).reshape(-1, 2).T
    in_time = np.cumsum(matched) - matched < LOOKS
    assert (looks_until_right(matched, right) <= LOOKS) == right[in_time].any()


def test_updates_and_recovery_by_hand(by_hand: Callable[..., Tracked]) -> None:
    look = [(3, 0.7, False)]
    seen = by_hand(
        ("normal", 4, 4, look),
        ("supposed", 4, 0, []),
        ("normal", 3, 0, look),
        ("normal", 0, 0, look),
        ("supposed", 1, 0, []),
    )
    assert updates_until_right(seen) == 1.0
    matched = np.array([True, False, True, True, False])
    assert _recovery(seen, 1, matched) == (2.0, 1.0, 0.5)  # two updates covered, one look wrong, the next one right
    never, nor_then, share = _recovery(seen, 4, matched)
    assert (never, nor_then) == (np.inf, np.inf)
    assert np.isnan(share)


def test_summary_by_hand() -> None:
    summary = _summary([(1.0, 1.0, 1.0), (4.0, 7.0, 0.5), (np.inf, np.inf, np.nan), (3.0, 3.0, 0.6)])
    assert (summary["three"], summary["six"], summary["six updates"]) == (0.5, 0.75, 0.5)
    assert (summary["looks"], summary["then"]) == pytest.approx((8.0 / 3.0, 0.7))


def test_the_event_leaves_the_world_as_it_is() -> None:
    settings = kidnapped(WorldSettings(age=1.0), 16, 0.5)
    assert (settings.age, settings.kidnap_at, settings.kidnap_laps) == (1.0, 16, 0.5)


def test_draws() -> None:
    measured = [
        {column: {f"all looks {name}": [1.0, np.inf] for name in SEEN_UNDER} for column in (AS_PUBLISHED, IMPROVED)}
    ]
    figure = Figure()
    EXPERIMENT.draw(measured, figure)
    share = figure.axes[0].lines[0].get_ydata()
    assert list(np.asarray(share)[:3]) == [0.0, 0.5, 0.5]


@pytest.mark.slow
def test_the_claims_of_the_thesis_hold() -> None:
    """Three seeds, twelve kidnappings each: right within three looks in 85 % fresh, half of the old; six in 85 %."""
    measured = [EXPERIMENT.measure(seed) for seed in (10, 11, 12)]
    ours = [one[AS_PUBLISHED] for one in measured]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours[0])
    mean = {key: np.mean([one[key] for one in ours]) for key in ours[0] if not key.startswith("all")}
    assert mean["origin fresh"] == pytest.approx(0.125)
    assert mean["started fresh"] <= 2.0 and mean["started old"] <= 3.0
    assert mean["three fresh"] >= 0.85 and mean["three old"] >= 0.5
    assert min(mean["six fresh"], mean["six old"]) >= 0.85
