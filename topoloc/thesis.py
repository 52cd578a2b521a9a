"""The settings that the thesis used (sections 4.1.1, 5.1.2 and 5.2), once, for sensors, estimators and experiments."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ThesisSettings:
    """The parameters of the thesis under its own names (4.1.1), with the values of 5.2.

    Attributes:
        scale_columns: columns of a scaled grey image; rows keep the aspect (54 for 384x288; the thesis says 58).
        slots: slots of IMA for place recognition.
        panorama_slots: slots of IMA for panorama reconstruction (5.1.3 calls 15 the safer number).
        zoom: digital zoom rho_in; 1 switches it off.
        match_threshold: eps_M; a destination's match must exceed it.
        head_threshold: eps_phi; the winner's match must exceed it for the heading to be corrected.
        clahe: filter grey full-size pictures with CLAHE (2.2.2).
        clahe_clip_limit: OpenCV's clip limit; not given in the thesis: chosen among 0.5, 1, 2 and 4, first on
            seeds 0 to 3 of the laboratory, then on its seeds 1000 to 1002 and on the 18 real headings.
        clahe_tiles: tiles along each side of a frame; not given in the thesis.
        min_rotation_deg: rotation that opens the motion gate, degrees.
        min_translation_m: translation that opens the motion gate, metres.
        panorama_step_deg: nominal step between the snapshots of a panorama, degrees (5.1.2).
    """

    scale_columns: int = 72
    slots: int = 8
    panorama_slots: int = 15
    zoom: float = 1.1
    match_threshold: float = 0.5
    head_threshold: float = 0.6
    clahe: bool = True
    clahe_clip_limit: float = 1.0
    clahe_tiles: int = 8
    min_rotation_deg: float = 10.0
    min_translation_m: float = 0.3
    panorama_step_deg: float = 30.0


THESIS = ThesisSettings()
"""The defaults everywhere."""
