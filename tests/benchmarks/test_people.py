"""People before the camera: how many, how big, how long they stay, what they cover."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.worlds import LabWorld, WorldSettings, lab_scene, render_frame
from benchmarks.worlds.lab import CORRIDOR, DOOR_Y, furniture
from benchmarks.worlds.moment import CHAIRS, Moment, as_they_stand
from benchmarks.worlds.people import clear_distance, crowd, person, present
from topoloc.geometry import compose
from topoloc.topo_map import Camera

CAMERA = Camera()
HALF_VIEW = float(np.deg2rad(20.0))


@pytest.mark.parametrize("share", [0.0, 0.1, 0.35, 0.9, 1.0])
def test_people_are_there_in_the_share_of_frames_asked_for_and_stay_a_while(share: float) -> None:
    there = present(share, 20000, np.random.default_rng(1))
    assert there.mean() == pytest.approx(share, abs=0.02 if 0.0 < share < 1.0 else 0.0)
    changes = (there[1:] != there[:-1]).mean()
    assert changes <= 0.75 * 2.0 * share * (1.0 - share)  # independent frames would change that often


def test_a_person_is_175_cm_tall_and_45_cm_wide() -> None:
    faces = person(1, np.array([2.0, 1.0]), 0.3, 0)
    assert faces.heights.max() == pytest.approx(1.75)
    across = np.linalg.norm(faces.ends[:, :2] - (2.0, 1.0), axis=1).max()
    assert 2.0 * across == pytest.approx(0.45)


def test_someone_is_before_the_camera_in_every_frame_or_in_none_and_covers_some_views_whole() -> None:
    still = {"updates": 40, "shake_px": 0.0, "turning_shake_px": 0.0, "grille_shake_px": 0.0}
    world = LabWorld(WorldSettings(people=1.0, **still))  # type: ignore[arg-type]
    scene, cameras = lab_scene(3), compose(world.drive(3)[1], world.mount)
    covered = []
    for camera, passers in zip(
        cameras, crowd(1.0, cameras, scene, HALF_VIEW, 3, np.random.default_rng(1)), strict=True
    ):
        assert 1 <= len(passers) <= 2
        seen = scene
        for faces in passers:
            seen = seen.with_faces(faces)
        changed = render_frame(seen, camera, CAMERA) != render_frame(scene, camera, CAMERA)
        covered.append(changed.any(axis=(0, 2)).mean())
    assert min(covered) > 0.04
    assert np.mean(covered) > 0.25
    empty = crowd(0.0, cameras, scene, HALF_VIEW, 3, np.random.default_rng(1))
    assert not any(empty)


def test_stays_come_in_all_manners_over_many_frames() -> None:
    scene, camera = lab_scene(3), np.array([0.0, 0.0, 1.0])
    stays = [crowd(1.0, camera[None], scene, HALF_VIEW, 3, np.random.default_rng(seed))[0] for seed in range(200)]
    near = [np.linalg.norm(passers[0].ends[:, :2].mean(axis=0) - camera[:2]) for passers in stays]
    assert 0.04 < np.mean(np.array(near) < 0.6) < 0.25  # the whole view
    assert max(near) <= 2.55
    assert 0.1 < np.mean([len(passers) == 2 for passers in stays]) < 0.3


def test_a_crowd_changes_even_where_it_never_leaves() -> None:
    """Manners hold per stay: over 300 frames some passers cover the whole view, and most do not."""
    scene, camera = lab_scene(3), np.array([0.0, 0.0, 1.0])
    frames = crowd(1.0, np.tile(camera, (300, 1)), scene, HALF_VIEW, 3, np.random.default_rng(0))
    near = np.array([np.linalg.norm(passers[0].ends[:, :2].mean(axis=0) - camera[:2]) for passers in frames])
    assert 0.02 < (near < 0.6).mean() < 0.3
    assert np.unique(near.round(1)).size > 8


@pytest.mark.parametrize("moment", [Moment(age=0.5), Moment(seated=0.4), Moment(age=1.0, seated=1.0)])
def test_everyone_who_sits_has_a_chair_of_his_own(moment: Moment) -> None:
    for seed in range(20):
        things = furniture(np.random.default_rng(seed))
        later = as_they_stand(things, moment, np.random.default_rng(seed))
        chairs = sum(thing.kind in CHAIRS for thing in things)
        assert sum(thing.kind in CHAIRS for thing in later) == chairs == 7


def test_nobody_stands_inside_furniture() -> None:
    scene = lab_scene(5)
    rng = np.random.default_rng(0)
    for heading in np.linspace(-3.0, 3.0, 30):
        camera = np.array([1.0, 1.0, heading])
        (passer, *_) = crowd(1.0, camera[None], scene, HALF_VIEW, 5, rng)[0]
        middle = passer.ends[:, :2].mean(axis=0)
        ahead = middle - camera[:2]
        free = clear_distance(scene.faces, camera[:2], float(np.arctan2(ahead[1], ahead[0])))
        assert np.hypot(*ahead) < free


def test_the_clear_distance_is_that_to_the_first_wall() -> None:
    scene = lab_scene(1)
    assert clear_distance(scene.faces, np.array([-1.0, -1.0]), -np.pi / 2.0) == pytest.approx(1.3)  # the panel
    along = np.array([CORRIDOR[0] + 5.0, DOOR_Y - 0.7])
    assert clear_distance(scene.faces, along, np.pi) == pytest.approx(5.0)  # the corridor's end
