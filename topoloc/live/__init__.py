"""Localization of a robot that runs: from a camera, a video or a recording as if it were one, in real time."""

from topoloc.live.engine import LiveConfig, LiveCounts, LiveLocalizer, LiveReport
from topoloc.live.saved_belief import SavedBelief

__all__ = ["LiveConfig", "LiveCounts", "LiveLocalizer", "LiveReport", "SavedBelief"]
