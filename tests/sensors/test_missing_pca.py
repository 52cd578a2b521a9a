"""Probabilistic PCA with missing pixels, beside closed forms, a dense likelihood and EM written out in loops."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import subspace_angles
from scipy.stats import multivariate_normal

from sensors.missing_pca import Method, MissingPCA, MissingPCAConfig, missing_pca
from topoloc.geometry import Floats

METHODS: tuple[Method, ...] = ("exact", "factorised")
SHARP = MissingPCAConfig(tolerance=1e-12, most_steps=3000)


def pictures(
    count: int, pixels: int, features: int, missing: float, noise: float = 0.5, seed: int = 0
) -> tuple[Floats, Floats]:
    """Pictures (count, pixels) by the model, NaN where missing, and its C (pixels, features)."""
    rng = np.random.default_rng(seed)
    loading = rng.normal(size=(pixels, features)) * np.linspace(3.0, 1.0, features)
    made = rng.normal(size=(count, features)) @ loading.T + rng.normal(size=pixels)
    made += noise * rng.normal(size=made.shape)
    made[rng.random(made.shape) < missing] = np.nan
    return made, loading


def angle_deg(found: MissingPCA, loading: Floats) -> float:
    return float(np.rad2deg(subspace_angles(found.components, loading).max()))


def dense(found: MissingPCA) -> Floats:
    """Covariance (D, D) of a picture by the model."""
    return np.asarray(found.components @ found.components.T + found.noise * np.eye(len(found.mean)))


@pytest.mark.parametrize("method", METHODS)
def test_of_complete_pictures_it_is_ppca(method: Method) -> None:
    """Tipping & Bishop's closed form: principal subspace, noise the mean of what is left, lengths less the noise."""
    data, _ = pictures(300, 12, 3, 0.0)
    found = missing_pca(data, 3, MissingPCAConfig(method, tolerance=1e-13, most_steps=3000))
    values, vectors = np.linalg.eigh(np.cov(data.T, bias=True))
    assert np.rad2deg(subspace_angles(found.components, vectors[:, -3:]).max()) < 1e-3
    assert found.noise == pytest.approx(values[:-3].mean(), rel=1e-6)
    np.testing.assert_allclose(found.lengths**2, values[:-4:-1] - found.noise, rtol=1e-6)
    np.testing.assert_allclose(found.mean, data.mean(axis=0), atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("missing", "most_deg"), [(0.0, 1.2), (0.3, 1.5), (0.6, 2.2), (0.8, 3.2)])
def test_the_subspace_is_found_in_spite_of_missing_pixels(method: Method, missing: float, most_deg: float) -> None:
    data, loading = pictures(1000, 192, 5, missing, seed=1)
    found = missing_pca(data, 5, MissingPCAConfig(method))
    assert angle_deg(found, loading) < most_deg
    assert np.sqrt(found.noise) == pytest.approx(0.5, rel=0.05)
    start = missing_pca(data, 5, MissingPCAConfig(method, most_steps=1))
    assert missing < 0.5 or angle_deg(start, loading) > angle_deg(found, loading)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_the_likelihood_never_falls(method: Method, seed: int) -> None:
    """Nor its lower bound; many features on few noisy pictures, where steps would go wrong first."""
    data, _ = pictures(40, 20, 6, 0.6, noise=2.0, seed=seed)
    config = MissingPCAConfig(method, least_seen=0.0, tolerance=0.0, most_steps=150)
    gains = np.diff(missing_pca(data, 6, config).likelihoods)
    assert len(gains) > 20
    assert gains[:-1].min() >= 0.0 and gains[-1] > -1e-9


@pytest.mark.parametrize("method", METHODS)
def test_it_does_not_fall_where_bright_pixels_are_missing(method: Method) -> None:
    """Then the means have far to go, and what x takes on of them must be handed over whole."""
    data, _ = pictures(100, 20, 3, 0.0, seed=12)
    data[data > np.quantile(data, 0.4)] = np.nan
    config = MissingPCAConfig(method, least_seen=0.0, tolerance=0.0, most_steps=60)
    found = missing_pca(data, 3, config)
    assert np.diff(found.likelihoods).min() > -1e-9
    seen = found.components[np.isfinite(found.mean)]
    assert len(seen) and np.abs(found.project(data)[0].mean(axis=0)).max() < 0.02


def test_the_likelihood_is_that_of_the_seen_pixels() -> None:
    """The likelihood before the second step is that of the model after the first one, by dense covariances."""
    data, _ = pictures(30, 8, 2, 0.5, seed=2)
    one, two = (
        missing_pca(data, 2, MissingPCAConfig(least_seen=0.0, tolerance=0.0, most_steps=steps)) for steps in (1, 2)
    )
    total = 0.0
    for picture in data:
        seen = np.isfinite(picture)
        if seen.any():
            law = multivariate_normal(one.mean[seen], dense(one)[np.ix_(seen, seen)])
            total += float(law.logpdf(picture[seen]))
    assert two.likelihoods[1] == pytest.approx(total / np.isfinite(data).sum(), rel=1e-9)


def test_the_factorised_bound_lies_below_the_likelihood() -> None:
    data, _ = pictures(200, 20, 3, 0.6, seed=3)
    exact, factorised = (missing_pca(data, 3, MissingPCAConfig(method)).likelihoods[-1] for method in METHODS)
    assert factorised < exact


def em_in_loops(data: Floats, features: int, steps: int) -> tuple[Floats, Floats, float]:
    """EQUATIONS.md, 2, exact EM, written out picture by picture and pixel by pixel: C, mu and s2."""
    rng = np.random.default_rng(0)
    count, pixels = data.shape
    c, mu, s2 = rng.normal(size=(pixels, features)), np.nanmean(data, axis=0), 1.0
    for _ in range(steps):
        x, v = [], []
        for y in data:
            o = np.isfinite(y)
            m = s2 * np.eye(features) + c[o].T @ c[o]
            x.append(np.linalg.solve(m, c[o].T @ (y[o] - mu[o])))
            v.append(s2 * np.linalg.inv(m))
        error = 0.0
        for d in range(pixels):
            left, right = np.zeros((features + 1, features + 1)), np.zeros(features + 1)
            seeing = [n for n in range(count) if np.isfinite(data[n, d])]
            for n in seeing:
                one = np.append(x[n], 1.0)
                left += np.outer(one, one)
                left[:features, :features] += v[n]
                right += data[n, d] * one
            row = np.linalg.solve(left, right)
            c[d], mu[d] = row[:features], row[features]
            error += sum((data[n, d] - c[d] @ x[n] - mu[d]) ** 2 + c[d] @ v[n] @ c[d] for n in seeing)
        s2 = float(error / np.isfinite(data).sum())
    return c, mu, s2


def test_em_in_loops_ends_at_the_same_model() -> None:
    data, _ = pictures(40, 6, 2, 0.3, noise=1.5, seed=4)
    c, mu, s2 = em_in_loops(data, 2, steps=400)
    found = missing_pca(data, 2, SHARP)
    assert found.noise == pytest.approx(s2, rel=1e-3)
    np.testing.assert_allclose(found.mean, mu, atol=5e-3)
    np.testing.assert_allclose(dense(found), c @ c.T + s2 * np.eye(6), atol=0.02)
    assert len(found.likelihoods) < 400


def test_projection_is_the_posterior_of_each_picture() -> None:
    """Of full pictures that of PPCA, (C'C + s2 I)^-1 C'(y - mu); of sparse ones the same of what is seen."""
    data, _ = pictures(100, 10, 3, 0.5, seed=5)
    found = missing_pca(data, 3)
    full, _ = pictures(4, 10, 3, 0.0, seed=6)
    c, s2 = found.components, found.noise
    means, covariances = found.project(np.concatenate([full, data[:4]]))
    by_hand = np.linalg.solve(c.T @ c + s2 * np.eye(3), c.T @ (full - found.mean).T).T
    np.testing.assert_allclose(means[:4], by_hand, atol=1e-10)
    for picture, mean, covariance in zip(data[:4], means[4:], covariances[4:], strict=True):
        o = np.isfinite(picture)
        m = c[o].T @ c[o] + s2 * np.eye(3)
        np.testing.assert_allclose(mean, np.linalg.solve(m, c[o].T @ (picture[o] - found.mean[o])), atol=1e-10)
        np.testing.assert_allclose(covariance, s2 * np.linalg.inv(m), atol=1e-10)


def test_an_empty_picture_has_the_prior() -> None:
    data, _ = pictures(100, 10, 3, 0.5, seed=7)
    data[3] = np.nan
    found = missing_pca(data, 3)
    means, covariances = found.project(data[3:4])
    np.testing.assert_array_equal(means, np.zeros((1, 3)))
    np.testing.assert_allclose(covariances, np.eye(3)[None], atol=1e-12)


def test_many_pictures_are_projected_as_each_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    data, _ = pictures(50, 10, 3, 0.5, seed=8)
    found = missing_pca(data, 3)
    alone = np.concatenate([found.project(one[None])[0] for one in data])
    monkeypatch.setattr("sensors.missing_pca.AT_ONCE", 70)
    np.testing.assert_allclose(found.project(data)[0], alone, atol=1e-12)
    assert found.project(data[:0])[0].shape == (0, 3)


def test_pixels_that_are_hardly_seen_are_left_out() -> None:
    data, _ = pictures(200, 12, 3, 0.3, seed=9)
    data[:, 4] = np.nan
    data[6:, 7] = np.nan
    found = missing_pca(data, 3)
    assert np.flatnonzero(np.isnan(found.mean)).tolist() == [4, 7]
    assert not found.components[[4, 7]].any()
    changed = data.copy()
    changed[:, [4, 7]] = 1e6
    np.testing.assert_array_equal(found.project(changed)[0], found.project(data)[0])


def test_columns_are_orthogonal_and_sorted() -> None:
    data, _ = pictures(200, 12, 3, 0.3, seed=10)
    found = missing_pca(data, 3)
    squares = found.components.T @ found.components
    np.testing.assert_allclose(squares, np.diag(found.lengths**2), atol=1e-9)
    assert (np.diff(found.lengths) < 0.0).all()


def test_pictures_without_noise_do_not_break_it() -> None:
    data, loading = pictures(200, 20, 3, 0.4, noise=0.0, seed=11)
    for method in METHODS:
        found = missing_pca(data, 3, MissingPCAConfig(method))
        assert np.isfinite(found.components).all() and found.noise > 0.0
        assert angle_deg(found, loading) < 1.0


def test_too_few_pixels_are_refused() -> None:
    data, _ = pictures(100, 10, 3, 0.5)
    with pytest.raises(ValueError, match="10 features need more pixels"):
        missing_pca(data, 10)
    with pytest.raises(ValueError, match="than the 0 that 4 pictures have"):
        missing_pca(data[:4], 3)


@pytest.mark.parametrize("wrong", [{"method": "quick"}, {"least_seen": 1.0}, {"tolerance": -1.0}, {"most_steps": 0}])
def test_settings_that_make_no_sense(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        MissingPCAConfig(**wrong)  # type: ignore[arg-type]
