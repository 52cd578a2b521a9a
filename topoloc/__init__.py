"""topoloc: tells a robot with one cheap camera and wheel odometry where it is on a topological map."""

from topoloc.errors import InputError, UserError
from topoloc.estimate import EstimateRule, estimate_from
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import Localizer, Step
from topoloc.odometry import MotionGate, OdometryNoise
from topoloc.recording import Recording
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Estimate, Evidence, Frame, Motion, Status, WeightedPoses

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "Estimate",
    "EstimateRule",
    "Estimator",
    "Evidence",
    "Frame",
    "InputError",
    "Localizer",
    "Motion",
    "MotionGate",
    "Node",
    "OdometryNoise",
    "Recording",
    "Sensor",
    "Status",
    "Step",
    "TopoMap",
    "UserError",
    "View",
    "WeightedPoses",
    "estimate_from",
]
