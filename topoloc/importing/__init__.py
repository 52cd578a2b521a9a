"""Bringing others' recordings into ours: bags, videos, folders of pictures, public data sets."""

from topoloc.importing.recording_sink import Imported, RecordingSink

__all__ = ["Imported", "RecordingSink"]
