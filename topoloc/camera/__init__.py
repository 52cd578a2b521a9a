"""The camera of a recording: its field of view, its yaw on the robot and its lens, measured."""
