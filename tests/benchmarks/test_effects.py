"""The errors of the simulated sensor: each has the size that its setting says, and none is there unasked."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from benchmarks.worlds.effects import MID_GREY, MOST_GAIN, SensorEffects, sense, streak_kernel
from topoloc.types import Image

NONE = SensorEffects.none()
SIZES = [(24, 32), (56, 256), (288, 384), (31, 47), (288, 3456)]


def flat(grey: int, rows: int = 288, columns: int = 384) -> Image:
    return np.full((rows, columns, 3), grey, dtype=np.uint8)


def pattern(rows: int = 288, columns: int = 384) -> Image:
    """Coloured patches of 8 pixels."""
    patches = np.random.default_rng(1).integers(0, 256, (rows // 8 + 1, columns // 8 + 1, 3), dtype=np.uint8)
    return np.kron(patches, np.ones((8, 8, 1), dtype=np.uint8))[:rows, :columns]


def generator() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("size", SIZES)
def test_without_effects_the_picture_stays_as_it_is(size: tuple[int, int]) -> None:
    assert set(asdict(NONE).values()) == {0}
    image = pattern(*size)
    before = image.copy()
    assert (sense(image, NONE, generator()) == before).all()
    sense(image, SensorEffects(), generator())
    assert (image == before).all()


@pytest.mark.parametrize("size", SIZES)
def test_a_picture_of_any_size_keeps_it_and_the_same_seed_gives_the_same_bytes(size: tuple[int, int]) -> None:
    image = pattern(*size)
    once, again = (sense(image, SensorEffects(), generator()) for _ in range(2))
    assert once.shape == image.shape
    assert once.dtype == np.uint8
    assert (once == again).all()
    assert (once != sense(image, SensorEffects(), np.random.default_rng(8))).any()


def test_every_effect_alone_changes_the_picture_and_takes_the_same_draws() -> None:
    image, defaults = pattern(), asdict(SensorEffects())
    after = []
    for name, value in defaults.items():
        rng = generator()
        changed = replace(NONE, **{name: value})
        assert (sense(image, changed, rng) != image).any(), name
        after.append(rng.random())
    assert len(set(after)) == 1


def test_noise_and_exposure_have_the_size_that_their_settings_say() -> None:
    grey, rng = flat(120), generator()
    noisy = sense(grey, replace(NONE, noise_grey=5.0), rng).astype(float)
    assert noisy.std() == pytest.approx(5.0, rel=0.05)
    assert noisy.mean() == pytest.approx(120.0, abs=0.05)
    means = [sense(grey, replace(NONE, exposure_sd=0.1), rng).mean() / 120.0 for _ in range(200)]
    assert np.std(np.log(means)) == pytest.approx(0.1, rel=0.2)


def test_the_corners_lose_the_light_that_the_vignette_says() -> None:
    dark = sense(flat(120), replace(NONE, vignette=0.3), generator())
    assert dark[0, 0, 0] == pytest.approx(0.7 * 120.0, abs=1.0)
    assert dark[144, 192, 0] == pytest.approx(120.0, abs=1.0)


@pytest.mark.parametrize("blur_px", [0.7, 1.5])
def test_the_lens_blurs_both_ways_by_its_standard_deviation(blur_px: float) -> None:
    image = flat(0)
    image[144, 192] = 255
    blurred = sense(image, replace(NONE, blur_px=blur_px), generator())[..., 0].astype(float)
    for axis, middle in ((0, 192), (1, 144)):
        share = blurred.sum(axis=axis) / blurred.sum()
        spread = np.sqrt(share @ (np.arange(len(share)) - middle) ** 2)
        assert spread == pytest.approx(blur_px, rel=0.15)


@pytest.mark.parametrize("length", [0.0, 0.3, 1.0, 2.5, 7.0, 12.4])
def test_a_streak_is_as_long_as_it_says_and_keeps_light_and_place(length: float) -> None:
    weights = streak_kernel(length)
    offset = np.arange(len(weights)) - len(weights) // 2
    assert weights.sum() == pytest.approx(1.0)
    assert weights == pytest.approx(weights[::-1])
    assert (weights >= 0.0).all()
    covered = np.linspace(-length / 2.0, length / 2.0, 20001)
    between = np.abs(covered) % 1.0  # reading between pixels spreads by a little
    assert weights @ offset**2 == pytest.approx(np.mean(covered**2 + between * (1.0 - between)), abs=3e-3)


def test_motion_blurs_sideways_only_by_a_length_of_its_own_in_every_frame() -> None:
    image = flat(0)
    image[:, 192:] = 200
    moving, rng = replace(NONE, motion_blur_px=6.0), generator()
    lengths = []
    for _ in range(200):
        blurred = sense(image, moving, rng)
        assert (blurred == blurred[:1]).all()
        step = np.diff(blurred[0, :, 0].astype(float)) / 200.0
        place = np.arange(len(step)) - step @ np.arange(len(step))
        lengths.append(np.sqrt(12.0 * (step @ place**2)))
    assert np.mean(lengths) == pytest.approx(6.0, rel=0.1)
    assert max(lengths) < 12.5
    assert min(lengths) < 1.5


def test_a_camera_that_stands_has_no_motion_blur_and_takes_the_same_draws() -> None:
    moving, standing = generator(), generator()
    image, effects = pattern(), replace(NONE, motion_blur_px=5.0)
    assert (sense(image, effects, standing, still=True) == image).all()
    assert (sense(image, effects, moving) != image).any()
    assert moving.random() == standing.random()


def test_bright_places_spill_over_their_surroundings_and_dim_ones_do_not() -> None:
    window = flat(60)
    window[100:180, 40:120] = 255
    glaring = replace(NONE, glare=0.1)
    veiled = sense(window, glaring, generator()).astype(int)
    assert veiled[140, 135, 0] >= 64
    row = veiled[140, 125:, 0]
    assert (np.diff(row) <= 0).all()
    assert row[-1] == 60
    lamp_off = np.minimum(window, 200).astype(np.uint8)
    assert (sense(lamp_off, glaring, generator()) == lamp_off).all()


@pytest.mark.parametrize("grey", [40, 80, 118, 200])
def test_automatic_exposure_brings_the_mean_to_mid_grey_by_its_share(grey: int) -> None:
    assert sense(flat(grey), replace(NONE, auto_exposure=1.0), generator()).mean() == pytest.approx(MID_GREY, abs=0.5)
    half = sense(flat(grey), replace(NONE, auto_exposure=0.5), generator()).mean()
    assert half == pytest.approx(np.sqrt(grey * MID_GREY), abs=0.5)


def test_automatic_exposure_has_a_limit_so_that_a_covered_camera_stays_dark() -> None:
    exposing = replace(NONE, auto_exposure=1.0)
    assert sense(flat(6), exposing, generator()).mean() == pytest.approx(6.0 * MOST_GAIN)
    assert (sense(flat(0), exposing, generator()) == 0).all()


def test_noise_grows_with_the_gain_of_automatic_exposure_but_not_below_one() -> None:
    for grey, gain in ((59, 2.0), (118, 1.0), (200, 1.0)):
        noisy = sense(flat(grey), replace(NONE, auto_exposure=1.0, noise_grey=4.0), generator()).astype(float)
        assert noisy.std() == pytest.approx(4.0 * gain, rel=0.05)


def test_the_colour_of_the_light_tints_the_picture_and_is_metered() -> None:
    tinted = sense(flat(100), NONE, generator(), tint=(1.2, 1.0, 0.5))
    assert tinted[0, 0].tolist() == [120, 100, 50]
    exposed = sense(flat(100), replace(NONE, auto_exposure=1.0), generator(), tint=(1.2, 1.0, 0.5))
    assert exposed.mean() == pytest.approx(MID_GREY, abs=0.5)


def test_compression_keeps_the_colours_in_their_order_and_loses_more_at_lower_quality() -> None:
    red = np.full((48, 64, 3), (200, 40, 10), dtype=np.uint8)
    assert np.abs(sense(red, replace(NONE, jpeg_quality=90), generator()).astype(int) - red).max() <= 4
    image = pattern().astype(int)
    lost = [
        np.abs(sense(pattern(), replace(NONE, jpeg_quality=quality), generator()) - image).mean()
        for quality in (100, 80, 20, 1)
    ]
    assert lost == sorted(lost)
    assert lost[0] > 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("exposure_sd", -0.1),
        ("noise_grey", -1.0),
        ("blur_px", float("nan")),
        ("motion_blur_px", float("inf")),
        ("vignette", 1.1),
        ("glare", -0.1),
        ("auto_exposure", 2.0),
        ("jpeg_quality", 101),
        ("jpeg_quality", -1),
    ],
)
def test_a_setting_out_of_range_is_named_in_one_line(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"^{name} is {value}; it must [^\n]*$"):
        replace(NONE, **{name: value})  # type: ignore[arg-type]


def test_every_setting_is_described_in_one_line_with_its_name() -> None:
    described = [line.strip().split(":")[0] for line in str(SensorEffects.__doc__).split("Attributes:")[1].splitlines()]
    assert [name for name in described if name] == list(asdict(SensorEffects()))
