"""Sensor models: image -> evidence. One file, one sensor."""

from sensors.descriptor import Descriptor
from sensors.disparity import Disparity
from sensors.fourier import FourierSignature
from sensors.fusion import Mix, Product
from sensors.histogram import ColorHistogram
from sensors.ima import IMA
from sensors.local import LocalFeatures
from sensors.pca import PCAMap
from sensors.robust_ima import RobustIMA

__all__ = [
    "IMA",
    "ColorHistogram",
    "Descriptor",
    "Disparity",
    "FourierSignature",
    "LocalFeatures",
    "Mix",
    "PCAMap",
    "Product",
    "RobustIMA",
]
