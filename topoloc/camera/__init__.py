"""The camera of a recording: its field of view, its yaw on the robot and its lens, measured."""

from topoloc.camera.chessboard import ChessboardLens, lens_from_chessboards
from topoloc.camera.field_of_view import FieldOfView, estimate_field_of_view
from topoloc.camera.mount_yaw import MountYaw, estimate_mount_yaw

__all__ = [
    "ChessboardLens",
    "FieldOfView",
    "MountYaw",
    "estimate_field_of_view",
    "estimate_mount_yaw",
    "lens_from_chessboards",
]
