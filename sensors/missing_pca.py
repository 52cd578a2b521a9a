"""Probabilistic PCA of pictures with missing pixels, by EM (second seed, section 5; EQUATIONS.md, 2).

The model is y = C x + mu + e, x ~ N(0, I), e ~ N(0, s2 I); of each picture y only some pixels o are seen. The seed
leaves the algorithm to a reference; both forms here are textbook ones.

Exact: each picture has a posterior of its own, M = s2 I + C_o' C_o, x = M^-1 C_o' (y_o - mu_o), V = s2 M^-1, and each
pixel's row of C and its mean are the regression of its seen values on [x; 1] with E[xx'] = xx' + V. The log-likelihood
of what was seen never falls.

Factorised: missing pixels are random variables of their own, taken for independent of x. One S = (I + C'C / s2)^-1
serves all pictures, and missing pixels are filled with C x + mu. A quicker step, but a shorter one, since what was
filled in passes for seen; what never falls is a lower bound of the log-likelihood.

Plain EM creeps where the noise is small: only the prior of x tells how C and x share their scale, and mu and x their
mean. So both let the prior N(m, P) follow each step, and then put it back to N(0, I), mu taking C m and C the root of P
(parameter expansion, Liu, Rubin & Wu 1998): the same model, in tens of steps in place of hundreds.

Nothing loops over pictures or pixels: sums of outer products over what is seen are products of the mask with a matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np

from topoloc.geometry import Floats

Method = Literal["exact", "factorised"]
LEAST_NOISE = 1e-9
"""Least variance of the noise, as a share of the mean variance of a pixel: at 0 there is no likelihood."""
AT_ONCE = 2**22
"""Numbers that pictures may take which are projected together."""


@dataclass(frozen=True)
class MissingPCAConfig:
    """Settings of PCA with missing pixels.

    Attributes:
        method: ``exact``: a posterior of its own for each picture; ``factorised``: one for all, missing pixels filled
            in: a quicker step, several times as many of them, and a noise that is a little too large.
        least_seen: share of the pictures that must show a pixel; one that fewer show is left out.
        tolerance: EM ends once a step gains less log-likelihood than this for each value that was seen.
        most_steps: of EM, after which it ends in any case.
    """

    method: Method = "exact"
    least_seen: float = 0.05
    tolerance: float = 1e-4
    most_steps: int = 200

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise ValueError(f"method is {self.method!r}; use one of: {', '.join(get_args(Method))}")
        if not 0.0 <= self.least_seen < 1.0:
            raise ValueError(f"least_seen is {self.least_seen}; it must lie between 0 and 1")
        if not self.tolerance >= 0.0 or self.most_steps < 1:
            raise ValueError("tolerance must not be negative, and most_steps at least 1")


@dataclass(frozen=True)
class MissingPCA:
    """A basis that pictures with missing pixels are projected on.

    Attributes:
        components: (D, k) C: orthogonal columns, the longest first; 0 for pixels that were left out.
        mean: (D,) mu; NaN for those.
        noise: s2, variance of the noise.
        likelihoods: (steps,) log-likelihood for each value that was seen, before each step; factorised: its bound.
    """

    components: Floats
    mean: Floats
    noise: float
    likelihoods: Floats

    @property
    def lengths(self) -> Floats:
        """(k,) lengths of the columns of C: x times these is in units of the pixels."""
        return np.asarray(np.linalg.norm(self.components, axis=0))

    def project(self, pictures: Floats) -> tuple[Floats, Floats]:
        """Posterior of x.

        Args:
            pictures: (N, D), NaN where a pixel is missing.

        Returns:
            Means (N, k) and covariances (N, k, k). A picture without any pixel has those of the prior, 0 and I.
        """
        used = np.isfinite(self.mean)
        model = _Model(self.components[used], self.mean[used], self.noise)
        together = max(1, AT_ONCE // max(self.components.shape[1] ** 2, len(self.mean)))
        parts = [
            _posterior(_Seen.of(pictures[first : first + together, used]), model)
            for first in range(0, max(1, len(pictures)), together)
        ]
        return np.concatenate([part.mean for part in parts]), np.concatenate([part.covariance for part in parts])


def missing_pca(pictures: Floats, features: int, config: MissingPCAConfig | None = None) -> MissingPCA:
    """Fit the model. EM starts at PCA of the pictures filled with the pixels' means, so nothing is left to chance.

    Args:
        pictures: (N, D), NaN where a pixel is missing.
        features: k.
        config: settings.

    Raises:
        ValueError: too few pictures, or too few pixels that are seen often enough, for so many features.
    """
    config = config or MissingPCAConfig()
    used = np.isfinite(pictures).sum(axis=0) >= max(config.least_seen * len(pictures), features + 2)
    if used.sum() <= features:
        raise ValueError(
            f"{features} features need more pixels that are seen often enough than the {int(used.sum())} "
            f"that {len(pictures)} pictures have"
        )
    seen = _Seen.of(pictures[:, used])
    em: _EM = (_Exact if config.method == "exact" else _Factorised)(seen, _start(seen, features))
    likelihoods: list[float] = []
    while len(likelihoods) < config.most_steps:
        likelihoods.append(em.step() / seen.values_seen)
        if len(likelihoods) > 1 and likelihoods[-1] - likelihoods[-2] < config.tolerance:
            break
    components, mean = np.zeros((len(used), features)), np.full(len(used), np.nan)
    components[used], mean[used] = _straightened(em.model.loading), em.model.mean
    return MissingPCA(components, mean, em.model.noise, np.array(likelihoods))


class _Seen(NamedTuple):
    """Pictures (N, D), 0 where they are missing; the mask (N, D), 1 where they are seen; how many values are."""

    values: Floats
    mask: Floats
    values_seen: int

    @classmethod
    def of(cls, pictures: Floats) -> _Seen:
        known = np.isfinite(pictures)
        return cls(np.where(known, pictures, 0.0), known.astype(np.float64), int(known.sum()))

    def without(self, mean: Floats) -> Floats:
        """(N, D) what is seen less the mean (D,); 0 where nothing is."""
        return np.asarray(self.values - self.mask * mean)


class _Model(NamedTuple):
    """C (D, k), mu (D,) and s2."""

    loading: Floats
    mean: Floats
    noise: float


class _Posterior(NamedTuple):
    """Means (N, k) and covariances (N, k, k) of x, and the log-likelihood of all that was seen."""

    mean: Floats
    covariance: Floats
    log_likelihood: float


class _EM(Protocol):
    """Expectation and maximization."""

    model: _Model

    def step(self) -> float:
        """Improve the model; returns what the one before was worth."""


class _Exact:
    """EM with a posterior for each picture."""

    def __init__(self, seen: _Seen, start: _Model) -> None:
        self._seen, self.model = seen, start
        self._least = _least_noise(seen, start)

    def step(self) -> float:
        posterior, seen = _posterior(self._seen, self.model), self._seen
        count, features = posterior.mean.shape
        known = np.column_stack([posterior.mean, np.ones(count)])  # [x; 1]
        squared = known[:, :, None] * known[:, None, :]
        squared[:, :features, :features] += posterior.covariance
        sums = (seen.mask.T @ squared.reshape(count, -1)).reshape(-1, features + 1, features + 1)
        centred = seen.without(self.model.mean)  # so that the difference below does not lose digits
        products = centred.T @ known
        rows = np.linalg.solve(sums, products[:, :, None])[:, :, 0]
        left = np.sum(centred**2) - np.sum(rows * products)  # of (y - c x - mu)^2 + c V c', as rows solve the equations
        noise = max(float(left) / seen.values_seen, self._least)
        middle, root = _prior(squared.mean(axis=0))
        loading, mean = rows[:, :features], self.model.mean + rows[:, features]
        self.model = _Model(loading @ root, mean + loading @ middle, noise)
        return posterior.log_likelihood


class _Factorised:
    """EM with one covariance for all pictures and missing pixels filled in."""

    def __init__(self, seen: _Seen, start: _Model) -> None:
        self._seen, self.model = seen, start
        self._least = _least_noise(seen, start)
        self._latent: Floats = np.zeros(
            (len(seen.values), start.loading.shape[1])
        )  # missing pixels begin at their means

    def step(self) -> float:
        (loading, mean, noise), seen = self.model, self._seen
        count, pixels = seen.values.shape
        filled = seen.without(mean) + (1.0 - seen.mask) * (self._latent @ loading.T)
        gram = loading.T @ loading
        spread = np.linalg.inv(np.eye(len(gram)) + gram / noise)  # S
        latent = filled @ loading @ spread / noise
        wrong = _squares(filled - latent @ loading.T) + count * float(np.sum(gram * spread))
        bound = seen.values_seen * np.log(2.0 * np.pi * noise) + wrong / noise + _squares(latent)
        bound += count * (np.trace(spread) - len(spread) - np.linalg.slogdet(spread)[1])
        known = np.column_stack([latent, np.ones(count)])  # [x; 1]
        squares = known.T @ known
        squares[:-1, :-1] += count * spread
        rows = np.linalg.solve(squares, known.T @ filled)  # (k + 1, D): C', and by how much mu moves
        wrong = _squares(filled - known @ rows) + count * float(np.sum(rows[:-1] @ rows[:-1].T * spread))
        wrong += (count * pixels - seen.values_seen) * noise  # what was filled in is uncertain by the noise before
        middle, root = _prior(squares / count)
        self._latent = np.asarray(np.linalg.solve(root, (latent - middle).T).T)
        turned, moved = rows[:-1].T @ root, mean + rows[-1] + middle @ rows[:-1]
        self.model = _Model(turned, moved, max(wrong / (count * pixels), self._least))
        return float(-0.5 * bound)


def _prior(squares: Floats) -> tuple[Floats, Floats]:
    """Mean (k,) of x and root (k, k) of its covariance, from the means (k + 1, k + 1) of [x; 1][x; 1]'."""
    middle = squares[:-1, -1]
    return middle, np.asarray(np.linalg.cholesky(squares[:-1, :-1] - np.outer(middle, middle)))


def _posterior(seen: _Seen, model: _Model) -> _Posterior:
    """Of the latent features of each picture, by the model."""
    loading, noise = model.loading, model.noise
    count, features = len(seen.values), loading.shape[1]
    outer = (loading[:, :, None] * loading[:, None, :]).reshape(len(loading), -1)
    precision = (seen.mask @ outer).reshape(count, features, features) + noise * np.eye(features)  # M
    centred = seen.without(model.mean)
    towards = centred @ loading
    inverse = np.linalg.inv(precision)
    mean = np.einsum("nij,nj->ni", inverse, towards)
    # det(C_o C_o' + s2 I) = s2^(|o| - k) det M, and its inverse is (I - C_o M^-1 C_o') / s2
    log_determinants = (seen.values_seen - count * features) * np.log(noise) + np.linalg.slogdet(precision)[1].sum()
    quadratic = (_squares(centred) - float(np.sum(towards * mean))) / noise
    log_likelihood = -0.5 * (seen.values_seen * np.log(2.0 * np.pi) + log_determinants + quadratic)
    return _Posterior(mean, np.asarray(noise * inverse), float(log_likelihood))


def _start(seen: _Seen, features: int) -> _Model:
    """PCA of the pictures with missing pixels at their means."""
    mean = seen.values.sum(axis=0) / seen.mask.sum(axis=0)
    centred = seen.without(mean)
    values, vectors = np.linalg.eigh(centred.T @ centred / len(centred))
    values = np.maximum(values, LEAST_NOISE * max(float(values.mean()), np.finfo(float).tiny))
    rest = float(values[:-features].mean())
    return _Model(vectors[:, -features:] * np.sqrt(np.maximum(values[-features:] - rest, rest)), mean, rest)


def _least_noise(seen: _Seen, start: _Model) -> float:
    return max(LEAST_NOISE * _squares(seen.without(start.mean)) / seen.values_seen, np.finfo(float).tiny)


def _straightened(loading: Floats) -> Floats:
    """C (D, k) turned so that its columns are orthogonal, the longest first, the largest entry of each positive.

    A turn of x changes nothing: its prior is round.
    """
    axes, lengths, _ = np.linalg.svd(loading, full_matrices=False)
    signs = np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(len(lengths))])
    return np.asarray(axes * lengths * signs)


def _squares(values: Floats) -> float:
    return float(np.sum(values**2))
