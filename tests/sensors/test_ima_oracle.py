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
from sensors.slot_correlation import BLOCK, FEW, make_reference
from sensors.slot_matching import Matches, match_frames, match_slots, sums_of_winners
from topoloc.files import read_image
from topoloc.thesis import THESIS

FLAT = IMAConfig().flat_variance
TIE = 1e-4
SINGLE = 1e-6
"""What single precision leaves of agreement."""
WAYS = st.sampled_from([0, FEW])


def fast(new: np.ndarray, ref: np.ndarray, slots: int, circular: bool, beside: int = 0) -> Matches:
    """What the last of several references gives; the others are noise. ``FEW`` beside it: Fourier transforms do it."""
    noise = np.random.default_rng(1).integers(0, 256, (beside, *ref.shape))
    refs = np.concatenate([noise, ref[None]]).astype(float)
    found = match_slots(new, make_reference(refs, new.shape[1] // slots, FLAT, circular), slots, FLAT)
    return Matches(found.value[-1:], found.column[-1:], found.columns[-1:], found.advance[-1:])


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
    beside=WAYS,
)
def test_random_images(seed: int, slots: int, columns: int, circle: int, circular: bool, beside: int) -> None:
    rng = np.random.default_rng(seed)
    ref = rng.integers(0, 256, (5, circle))
    left = int(rng.integers(0, circle if circular else circle - columns + 1))
    new = ref[:, (left + np.arange(columns)) % circle] + rng.normal(0, 20, (5, columns))
    agree(fast(new, ref, slots, circular, beside), ima_literal(new, ref, slots, FLAT, circular))


def test_random_images_seldom_tie() -> None:
    """The escape for ties above must not swallow the test."""
    ties = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        ref, new = rng.integers(0, 256, (5, 36)), rng.integers(0, 256, (5, 12))
        ties += ima_literal(new, ref, 4, FLAT).slot_lead < TIE
    assert ties <= 2


@pytest.mark.parametrize("circular", [True, False])
@pytest.mark.parametrize("beside", [0, FEW])
@pytest.mark.parametrize(
    "case", ["black on picture", "picture on black", "black on black", "flat patch in reference", "flat slot in image"]
)
def test_flat_and_black(case: str, beside: int, circular: bool) -> None:
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
    found, literal = fast(new, ref, 4, circular, beside), ima_literal(new, ref, 4, FLAT, circular)
    assert found.value[0] == pytest.approx(literal.max, abs=SINGLE)
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


@pytest.mark.parametrize("columns", [40, 46])
@pytest.mark.parametrize("kept_mb", [0.0, 0.02, 1.0])
def test_many_references_at_once_equal_one_at_a_time(columns: int, kept_mb: float) -> None:
    """More than a block of them, on a circle whose length is a product of small primes and one that is not.

    Memory for none, one or all of the blocks makes no difference, and what is kept serves again.
    """
    rng = np.random.default_rng(6)
    refs, new = rng.integers(0, 256, (2 * BLOCK + 3, 6, columns)), rng.integers(0, 256, (6, 16))
    reference = make_reference(refs, 4, FLAT, True, kept_mb)
    first, together = (match_slots(new, reference, 4, FLAT) for _ in range(2))
    np.testing.assert_array_equal(together.value, first.value)
    for k, ref in enumerate(refs):
        alone = fast(new, ref, 4, True)
        assert together.value[k] == pytest.approx(alone.value[0], abs=SINGLE)
        assert together.column[k] == alone.column[0]


def test_memory_is_kept_to() -> None:
    refs = np.random.default_rng(6).integers(0, 256, (3 * BLOCK, 6, 40))
    block = 21 * BLOCK * 12 * 4  # frequencies, references, real and imaginary parts of rows, bytes
    for blocks in (0, 1, 2, 3):
        reference = make_reference(refs, 4, FLAT, True, kept_mb=(blocks + 0.5) * block / 1e6)
        match_slots(refs[0, :, :16], reference, 4, FLAT)
        assert reference.kept_bytes == blocks * block


def test_several_frames_at_once_equal_one_at_a_time() -> None:
    rng = np.random.default_rng(8)
    refs, frames = rng.integers(0, 256, (9, 6, 40)), rng.integers(0, 256, (3, 6, 16))
    reference = make_reference(refs, 4, FLAT, True)
    for frame, together in zip(frames, match_frames(list(frames), reference, 4, FLAT, sums_of_winners), strict=True):
        alone = match_slots(frame, reference, 4, FLAT)
        np.testing.assert_allclose(together.value, alone.value, atol=SINGLE)
        np.testing.assert_array_equal(together.column, alone.column)


@pytest.mark.parametrize("beside", [0, FEW])
def test_of_equal_slots_the_first_wins(beside: int) -> None:
    """Two slots of a frame that are the same add once, at the place of the first: ">" in Code 2.1."""
    rng = np.random.default_rng(9)
    patch, ref = rng.integers(0, 256, (6, 4)), np.full((6, 40), 90)
    ref[:, 20:24] = patch
    new = np.concatenate([patch, patch], axis=1)
    found, literal = fast(new, ref, 2, True, beside), ima_literal(new.astype(float), ref.astype(float), 2, FLAT, True)
    assert found.column[0] + 1 == literal.col == 21
    assert found.value[0] == pytest.approx(literal.max, abs=SINGLE)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), low=st.integers(0, 250), beside=WAYS)
def test_what_is_hardly_not_flat(seed: int, low: int, beside: int) -> None:
    """Two grey levels that differ by one, beside a bright wall: what single precision bears worst."""
    rng = np.random.default_rng(seed)
    ref = np.concatenate([low + rng.integers(0, 2, (20, 40)), rng.integers(0, 256, (20, 40))], axis=1)
    new = ref[:, 4:28] + rng.integers(0, 2, (20, 24))
    agree(fast(new, ref, 3, True, beside), ima_literal(new.astype(float), ref.astype(float), 3, FLAT, True))


def real_views() -> list[object]:
    """All 18 real queries; most of them only in the slow tests."""
    names = [f"{number:02d}.jpg" for number in range(18)]
    return [name if name in ("00.jpg", "07.jpg") else pytest.param(name, marks=pytest.mark.slow) for name in names]


@pytest.mark.skipif(not RING6_QUERIES.is_dir(), reason="the real photographs are not on this machine")
@pytest.mark.parametrize("beside", [0, FEW])
@pytest.mark.parametrize("name", real_views())
def test_real_images(name: str, beside: int) -> None:
    """A real view on a real panorama at the thesis's size: 54 x 72 on 54 x 648, 8 slots."""
    panorama, _ = placed_panorama()
    ref = resize(clahe(grey(panorama), THESIS.clahe_clip_limit, THESIS.clahe_tiles, 40.0), 648, 54).astype(float)
    query = grey(read_image(RING6_QUERIES / name))
    new = resize(clahe(query, THESIS.clahe_clip_limit, THESIS.clahe_tiles), 72, 54).astype(float)
    found, literal = fast(new, ref, 8, True, beside), ima_literal(new, ref, 8, FLAT)
    values = np.array(literal.sums[1:])
    assert found.value[0] == pytest.approx(literal.max, abs=1e-4)
    assert np.sort(values)[-1] - np.sort(values)[-2] > TIE
    assert found.column[0] + 1 == literal.col
