"""Behaviours over a robot (thesis 4.2): ``VideoScan`` makes panoramas, ``Localize`` knows where it is."""

from topoloc.behaviours.engine import Behaviour, Engine
from topoloc.behaviours.localize import Localize, Position
from topoloc.behaviours.robot import MobileRobot, Watcher
from topoloc.behaviours.video_scan import ScannedCircle, ScanSettings, VideoScan, add_node, save_node

__all__ = [
    "Behaviour",
    "Engine",
    "Localize",
    "MobileRobot",
    "Position",
    "ScanSettings",
    "ScannedCircle",
    "VideoScan",
    "Watcher",
    "add_node",
    "save_node",
]
