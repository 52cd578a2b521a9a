"""Springs and dampers: forces against the formula written out, and what physics asks of them."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc.geometry import Floats
from topoloc.mapping import LAWS, Springs, stiffness_of

seeds = st.integers(0, 2**32 - 1)


def random_springs(rng: np.random.Generator, count: int, step_share: float = 0.5) -> Springs:
    lengths, stiff = (np.triu(rng.uniform(0.2, 2.0, (count, count)), 1) for _ in range(2))
    return Springs.of(lengths + lengths.T, stiff + stiff.T, 1.0, step_share)


def forces_written_out(springs: Springs, r: Floats, v: Floats) -> Floats:
    """EQUATIONS: F_ij = -[k_ij (|l_ij| - d_ij) + b (v_i - v_j).e_ij] e_ij."""
    total = np.zeros_like(r)
    for i in range(len(r)):
        for j in range(len(r)):
            if i != j:
                way = r[i] - r[j]
                e = way / np.linalg.norm(way)
                stretch = np.linalg.norm(way) - springs.lengths[i, j]
                total[i] -= (springs.stiffness[i, j] * stretch + springs.damping * (v[i] - v[j]) @ e) * e
    return total


@given(seeds, st.integers(2, 9))
def test_forces_are_those_of_the_formula(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    springs, (r, v) = random_springs(rng, count), rng.normal(size=(2, count, 2))
    np.testing.assert_allclose(springs.forces(r, v), forces_written_out(springs, r, v), rtol=1e-8, atol=1e-8)


@given(seeds, st.integers(2, 9))
def test_action_is_reaction(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    springs, (r, v) = random_springs(rng, count), rng.normal(size=(2, count, 2))
    force = springs.forces(r, v)
    scale = 1.0 + np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-9 * scale
    assert abs(float((r[:, 0] * force[:, 1] - r[:, 1] * force[:, 0]).sum())) < 1e-9 * scale


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(2, 12))
def test_energy_falls(seed: int, count: int) -> None:
    """At every one of small steps, and from beginning to end of the longest that the settings allow."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-1.0, 1.0, (count, 2))
    small = random_springs(np.random.default_rng(seed), count, step_share=0.005)
    energy = [small.energy(start, np.zeros_like(start)), *(small.energy(*at) for at in islice(small.moves(start), 60))]
    assert (np.diff(energy) <= 1e-6 * energy[0]).all()
    springs = random_springs(np.random.default_rng(seed), count)
    *_, last = islice(springs.moves(start), 300)
    assert springs.energy(*last) <= springs.energy(start, np.zeros_like(start))


def test_energy_of_two_masses_by_hand() -> None:
    springs = Springs(np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([[0.0, 3.0], [3.0, 0.0]]), 0.1, 0.1)
    r, v = np.array([[0.0, 0.0], [1.5, 0.0]]), np.array([[0.0, 2.0], [1.0, 0.0]])
    assert springs.energy(r, v) == pytest.approx(0.5 * 3.0 * 0.5**2 + 0.5 * (4.0 + 1.0))


def test_two_masses_come_to_rest_at_the_natural_length() -> None:
    springs = Springs.of(np.array([[0.0, 0.7], [0.7, 0.0]]), 1.0 - np.eye(2), 1.0, 0.5)
    *_, (r, v) = islice(springs.moves(np.array([[0.0, 0.0], [3.0, 1.0]])), 200)
    assert np.linalg.norm(r[1] - r[0]) == pytest.approx(0.7, abs=1e-6)
    assert np.abs(v).max() < 1e-6
    np.testing.assert_allclose(r.mean(axis=0), [1.5, 0.5], atol=1e-12)  # nothing from outside moves them


def test_masses_on_one_spot_and_masses_without_springs_stay_finite() -> None:
    springs = Springs.of(1.0 - np.eye(3), 1.0 - np.eye(3), 1.0, 0.5)
    r = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    force = springs.forces(r, np.zeros_like(r))
    assert np.isfinite(force).all()
    np.testing.assert_allclose(force, 0.0, atol=1e-12)
    loose = Springs.of(1.0 - np.eye(3), np.zeros((3, 3)), 1.0, 0.5)
    *_, (after, _) = islice(loose.moves(r), 5)
    np.testing.assert_array_equal(after, r)


BY_HAND = {
    "constant": [1.0, 1.0, 1.0],
    "inverse": [2.0, 1.0, 0.4],
    "inverse-square": [4.0, 1.0, 0.16],
    "linear": [0.75, 0.5, 0.0],
    "exponential": [np.exp(-0.25), np.exp(-0.5), np.exp(-1.25)],
}


@pytest.mark.parametrize("law", LAWS)
def test_laws_by_hand(law: str) -> None:
    """Lengths 1, 2, 5 in units of 2, reach 2 units."""
    lengths = np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 5.0], [2.0, 5.0, 0.0]])
    stiff = stiffness_of(law, lengths, 2.0, 2.0)
    np.testing.assert_allclose(stiff[np.triu_indices(3, 1)], BY_HAND[law])
    np.testing.assert_array_equal(stiff, stiff.T)
    assert (np.diag(stiff) == 0.0).all()


@pytest.mark.parametrize("law", LAWS)
def test_laws_do_not_depend_on_the_scale_of_the_descriptor(law: str) -> None:
    lengths = np.random.default_rng(0).uniform(0.5, 3.0, (6, 6))
    np.testing.assert_allclose(stiffness_of(law, 1e3 * lengths, 2e3, 1.5), stiffness_of(law, lengths, 2.0, 1.5))


def test_images_that_look_the_same_have_no_endless_stiffness() -> None:
    assert np.isfinite(stiffness_of("inverse-square", np.zeros((2, 2)), 1.0, 1.0)).all()
