"""Our steps beside other people's libraries doing the same, in one run and on one thread: ``topoloc speed``."""

from __future__ import annotations

from benchmarks.speed.case import Case
from benchmarks.speed.corridor import corridor_step
from benchmarks.speed.grid import Hall, grid_predict, grid_update
from benchmarks.speed.image_matching import ima_match, opencv_correlation, skimage_correlation
from benchmarks.speed.large_maps import CASES as LARGE_MAPS
from benchmarks.speed.likelihood import log_likelihood, plain_log_likelihood
from benchmarks.speed.particle_step import particle_filter_step
from benchmarks.speed.resampling import filterpy_resampling, particles_resampling
from benchmarks.speed.stone_soup_step import stone_soup_gaussian, stone_soup_particles
from benchmarks.speed.view_sensors import CASES as NEAREST_VIEWS

PARTICLES = (1_000, 10_000, 100_000)

PANORAMAS = (8, 100, 1_000)

CASES: tuple[Case, ...] = (
    *(ima_match(count, "cv2.matchTemplate", opencv_correlation) for count in PANORAMAS),
    *(ima_match(count, "skimage", skimage_correlation, ("skimage",)) for count in PANORAMAS[:2]),
    *LARGE_MAPS,
    *NEAREST_VIEWS,
    *(particle_filter_step(count, log_likelihood, "particles") for count in PARTICLES),
    *(particle_filter_step(count, plain_log_likelihood, "particles, plain") for count in PARTICLES),
    *(stone_soup_particles(count, log_likelihood, "Stone Soup") for count in PARTICLES),
    *(stone_soup_particles(count, plain_log_likelihood, "Stone Soup, plain") for count in PARTICLES),
    *(filterpy_resampling(name, 100_000) for name in ("systematic", "stratified", "multinomial")),
    particles_resampling("systematic", 100_000, same_algorithm=True),
    particles_resampling("residual", 100_000, same_algorithm=False),
    grid_predict(Hall(40, 40)),
    grid_predict(Hall(400, 200)),
    grid_predict(Hall(200, 200, resolution_m=0.1, deviation_m=0.15)),
    grid_update(Hall(40, 40)),
    grid_update(Hall(400, 200)),
    corridor_step(10_000),
    stone_soup_gaussian(),
)
"""Every comparison. One more is one more entry here."""
