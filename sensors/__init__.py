"""Sensor models: image -> evidence. One file, one sensor."""

from sensors.histogram import ColorHistogram
from sensors.ima import IMA

__all__ = ["IMA", "ColorHistogram"]
