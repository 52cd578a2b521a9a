"""IMA against the literal transcription of Code 2.1 and 2.2, to 1e-4 in value and in column, ties apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles.ima_literal import Literal, ima_literal
from oracles.shared_data import RING6_QUERIES, placed_panorama

from sensors.ima import IMAConfig
from sensors.images import clahe, grey, resize
from sensors.slot_matching import Matches, make_reference, match_slots
from topoloc.files import read_image
from topoloc.thesis import THESIS

FLAT = IMAConfig().flat_variance
TIE = 1e-4


def fast(new: np.ndarray, ref: np.ndarray, slots: int, circular: bool) -> Matches:
    width = new.shape[1] // slots
    reference = make_reference(ref[None].astype(float), width, FLAT, circular)
    return match_slots(new.astype(float), reference, slots, FLAT)


def agree(found: Matches, literal: Literal) -> None:
    first, second = sorted(literal.sums[1:])[-1:-3:-1]
    assume(literal.slot_lead >= TIE)
    assert found.value[0] == pytest.approx(literal.max, abs=1e-4)
    if first - second > TIE:
        assert found.column[0] + 1 == literal.col


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    slots=st.sampled_from([1, 2, 3, 4, 5]),
    columns=st.integers(10, 14),
    circle=st.integers(28, 40),
    circular=st.booleans(),
)
def test_random_images(seed: int, slots: int, columns: int, circle: int, circular: bool) -> None:
    rng = np.random.default_rng(seed)
    ref = rng.integers(0, 256, (5, circle))
    left = int(rng.integers(0, circle if circular else circle - columns + 1))
    new = ref[:, (left + np.arange(columns)) % circle] + rng.normal(0, 20, (5, columns))
    agree(fast(new, ref, slots, circular), ima_literal(new, ref, slots, FLAT, circular))


def test_random_images_seldom_tie() -> None:
    """The escape for ties above must not swallow the test."""
    ties = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        ref, new = rng.integers(0, 256, (5, 36)), rng.integers(0, 256, (5, 12))
        ties += ima_literal(new, ref, 4, FLAT).slot_lead < TIE
    assert ties <= 2


@pytest.mark.parametrize("circular", [True, False])
@pytest.mark.parametrize(
    "case", ["black on picture", "picture on black", "black on black", "flat patch in reference", "flat slot in image"]
)
def test_flat_and_black(case: str, circular: bool) -> None:
    rng = np.random.default_rng(7)
    ref, new = rng.integers(0, 256, (6, 48)).astype(float), rng.integers(0, 256, (6, 16)).astype(float)
    if case == "black on picture":
        new[:] = 0
    elif case == "picture on black":
        ref[:] = 0
    elif case == "black on black":
        new[:], ref[:] = 0, 0
    elif case == "flat patch in reference":
        ref[:, 10:30] = 90
        new = ref[:, 4:20].copy()
    else:
        new = ref[:, 20:36].copy()
        new[:, 4:8] = 200
    found, literal = fast(new, ref, 4, circular), ima_literal(new, ref, 4, FLAT, circular)
    assert found.value[0] == pytest.approx(literal.max, abs=1e-9)
    assert found.column[0] + 1 == literal.col


def test_columns_that_fill_no_slot_are_left_out() -> None:
    """15 slots of 4 in 72 columns: the 12 rightmost do not count (EQUATIONS.md, 1)."""
    rng = np.random.default_rng(3)
    ref = rng.integers(0, 256, (4, 90)).astype(float)
    new = ref[:, 10:82].copy()
    cut = new.copy()
    cut[:, 60:] = rng.integers(0, 256, (4, 12))
    first, second = fast(new, ref, 15, True), fast(cut, ref, 15, True)
    assert first.value[0] == second.value[0] == pytest.approx(1.0)
    assert first.column[0] == second.column[0] == 10


def test_wraps_around() -> None:
    rng = np.random.default_rng(4)
    ref = rng.integers(0, 256, (6, 60)).astype(float)
    found = fast(np.roll(ref, 5, axis=1)[:, :20], ref, 4, True)
    assert found.column[0] == 55
    assert found.value[0] == pytest.approx(1.0)


def test_a_plain_image_matches_itself_at_its_left_edge() -> None:
    """5.1.1 and 5.1.5 compare with a single image of reference, which is no circle."""
    rng = np.random.default_rng(5)
    image = rng.integers(0, 256, (6, 24)).astype(float)
    found = fast(image, image, 4, False)
    assert (found.column[0], found.value[0]) == (0, pytest.approx(1.0))
    shifted = fast(image[:, 4:20], image, 4, False)
    assert (shifted.column[0], shifted.value[0]) == (4, pytest.approx(1.0))


def test_many_references_at_once_equal_one_at_a_time() -> None:
    rng = np.random.default_rng(6)
    refs, new = rng.integers(0, 256, (5, 6, 40)).astype(float), rng.integers(0, 256, (6, 16)).astype(float)
    together = match_slots(new, make_reference(refs, 4, FLAT, True), 4, FLAT)
    for k, ref in enumerate(refs):
        alone = fast(new, ref, 4, True)
        assert together.value[k] == pytest.approx(alone.value[0], abs=1e-12)
        assert together.column[k] == alone.column[0]


def real_views() -> list[object]:
    """All 18 real queries; most of them only in the slow tests."""
    names = [f"{number:02d}.jpg" for number in range(18)]
    return [name if name in ("00.jpg", "07.jpg") else pytest.param(name, marks=pytest.mark.slow) for name in names]


@pytest.mark.skipif(not RING6_QUERIES.is_dir(), reason="the real photographs are not on this machine")
@pytest.mark.parametrize("name", real_views())
def test_real_images(name: str) -> None:
    """A real view on a real panorama at the thesis's size: 54 x 72 on 54 x 648, 8 slots."""
    panorama, _ = placed_panorama()
    ref = resize(clahe(grey(panorama), THESIS.clahe_clip_limit, THESIS.clahe_tiles, 40.0), 648, 54).astype(float)
    query = grey(read_image(RING6_QUERIES / name))
    new = resize(clahe(query, THESIS.clahe_clip_limit, THESIS.clahe_tiles), 72, 54).astype(float)
    found, literal = fast(new, ref, 8, True), ima_literal(new, ref, 8, FLAT)
    values = np.array(literal.sums[1:])
    assert found.value[0] == pytest.approx(literal.max, abs=1e-4)
    assert np.sort(values)[-1] - np.sort(values)[-2] > TIE
    assert found.column[0] + 1 == literal.col
