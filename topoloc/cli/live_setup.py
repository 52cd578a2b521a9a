"""What ``topoloc run`` and ``topoloc ros`` share: a localizer that is ready for pictures, and how it is stopped."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from topoloc.live import LiveLocalizer
    from topoloc.rig_file import Rig
    from topoloc.topo_map import TopoMap


@dataclass(frozen=True)
class LiveChoice:
    """What a user chose.

    Attributes:
        sensor, estimator: names.
        seed: of the estimator's random numbers.
        settings: ``sensor.``, ``estimator.``, ``odometry.`` and ``live.KEY=VALUE`` words.
        state: file that keeps the belief, or None.
    """

    sensor: str
    estimator: str
    seed: int
    settings: Sequence[str]
    state: Path | None


def live_localizer(the_map: TopoMap, choice: LiveChoice, rig: Rig, kinds: frozenset[str]) -> LiveLocalizer:
    """A localizer for a running robot, going on from a saved belief where there is one.

    Args:
        the_map: the map.
        choice: sensor, estimator and settings.
        rig: the camera's lens and place on the robot.
        kinds: of pictures that will come.

    Raises:
        UserError: a name or a setting that nothing has, a sensor that needs other pictures, another map's belief.
    """
    from topoloc import plugins
    from topoloc.errors import UserError
    from topoloc.live import LiveConfig, LiveLocalizer
    from topoloc.live.saved_belief import load
    from topoloc.live.sources import mounted
    from topoloc.localizer import Localizer
    from topoloc.odometry import OdometryNoise
    from topoloc.settings import build, parse_words, refuse_unknown

    tables = parse_words(choice.settings)
    refuse_unknown(tables, {"sensor", "estimator", "odometry", "live"}, "--set")
    config = build(LiveConfig, tables.get("live", {}), "settings of live")
    noise = build(OdometryNoise, tables.get("odometry", {}), "settings of odometry")
    eye = plugins.make_sensor(choice.sensor, tables.get("sensor"))
    mind = plugins.make_estimator(choice.estimator, tables.get("estimator"))
    missing = ", ".join(sorted(eye.needs - kinds))
    if missing:
        raise UserError(f"{choice.sensor} needs {missing} pictures, which do not come from there; choose another one")
    state, seed = choice.state, choice.seed
    saved = None if state is None else load(state, the_map)
    localizer = Localizer(the_map, eye, mind, rng=seed, noise=noise)
    camera = rig.camera or the_map.camera
    return LiveLocalizer(localizer, mounted(rig), rig.lens, camera, config, saved, state_file=state, rng=seed)


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """What ends a service ends the run as Ctrl-C does, with belief and log written."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
