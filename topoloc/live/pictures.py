"""Pictures as they arrive -> pictures of a frame: decoded and straightened only once they are looked at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from topoloc.errors import UnreadableImage, UserError
from topoloc.files import as_rgb, decode_image
from topoloc.lens import Lens
from topoloc.live.mailbox import ImageData
from topoloc.recording import LazyImages
from topoloc.topo_map import Camera
from topoloc.types import Image, Pixels


class Straightener:
    """Makes the images of a frame.

    Args:
        lens: how pictures are bent; None: not at all.
        camera: the pinhole camera that they are of, once they are straightened.
        expected: the map's camera, whose aspect ratio they must have.
    """

    def __init__(self, lens: Lens | None, camera: Camera, expected: Camera) -> None:
        self._lens, self._camera, self._expected = lens, camera, expected
        self._one_was_fine = False

    def images(self, time: float, data: ImageData) -> Mapping[str, Pixels]:
        """By kind, as ``topoloc.types.Frame`` has them; they are read when they are asked for.

        Reading raises ``UnreadableImage`` for a picture that does not decode, and ``UserError`` for one that the lens
        or the map's camera does not suit, if none before did.
        """
        return data if isinstance(data, Mapping) else LazyImages({"rgb": lambda: self._straight(time, data)})

    def _straight(self, time: float, data: bytes | Image) -> Image:
        name = Path(f"the picture at {time:.3f} s")
        image = as_rgb(decode_image(data, name, "send JPEG or PNG")) if isinstance(data, bytes) else data
        if image.dtype != np.uint8 or image.ndim not in (2, 3) or not image.size:
            raise UnreadableImage(name, f"is {image.dtype} {image.shape}", "hand in uint8 (rows, cols[, 3])")
        rows, columns = image.shape[:2]
        try:
            straight = image if self._lens is None else self._lens.straighten(image, self._camera)
        except ValueError as error:
            raise self._misfit(name, f"{error}", "correct width, height and [lens] in camera.toml") from None
        if not self._expected.fits(straight):
            wanted = f"the map's camera has {self._expected.width}x{self._expected.height}, another aspect ratio"
            raise self._misfit(
                name, f"is {columns}x{rows}, but {wanted}", "set the camera to that, or make a map with it"
            )
        self._one_was_fine = True
        return straight

    def _misfit(self, name: Path, problem: str, remedy: str) -> UserError:
        """The first picture's size is a user's mistake; later, a robot that runs must not stop for it."""
        return (
            UnreadableImage(name, problem, remedy) if self._one_was_fine else UserError(f"{name} {problem}; {remedy}")
        )
