"""Pictures of the RobotCar's stereo camera: colours from the mosaic, and the set's own table against distortion.

The mosaic is GBRG (robotcar-dataset-sdk, ``image.py``). A table ``<camera>_distortion_lut.bin`` holds, as doubles, the
columns and then the rows of the recorded picture for each pixel of the straight one (``camera_model.py``).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from topoloc.errors import InputError, UnreadableImage
from topoloc.files import reason
from topoloc.importing.public.sequence import Encoded
from topoloc.lens import Lens
from topoloc.rig_file import Rig
from topoloc.topo_map import Camera
from topoloc.types import Image

Table = NDArray[np.float32]
"""(2, rows, columns), as OpenCV takes it: columns, then rows of the recorded picture [pixels]."""
StereoCamera = Literal["centre", "left", "right"]
MODELS = {"centre": "stereo_narrow_left", "left": "stereo_wide_left", "right": "stereo_wide_right"}
"""Names of the cameras' models."""
SIZE = (1280, 960)
"""Columns and rows."""
FOCAL_PX, CX_PX, CY_PX = 983.044006, 643.646973, 493.378998
"""Of the straight picture, all three; published with the set, seen in loaders of others."""


@dataclass(frozen=True)
class PictureMaker:
    """Makes a picture of a recording of a file.

    Attributes:
        width: columns to make pictures narrower to.
        table: (2, rows, columns) of the recorded picture for each pixel of the straight one, or None: as it is.
    """

    width: int
    table: Table | None = None

    def __call__(self, path: Path) -> Encoded:
        """The picture in colours, straight, narrow. Raises ``UnreadableImage``."""
        import cv2

        image = in_colours(path)
        if self.table is not None:
            if image.shape[:2] != self.table.shape[1:]:
                raise UnreadableImage(path, "is not of the size of its camera's table", "take away --models")
            columns, rows = self.table
            image = np.asarray(cv2.remap(image, columns, rows, cv2.INTER_LINEAR), dtype=np.uint8)
        rows_, columns_ = image.shape[:2]
        if self.width < columns_:
            size = (self.width, round(rows_ * self.width / columns_))
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        return Encoded(image, ".jpg")


def in_colours(path: Path) -> Image:
    """A picture, RGB: of a single channel it is a mosaic, others have their colours. Raises ``UnreadableImage``."""
    import cv2

    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise UnreadableImage(path, f"cannot be read ({reason(error)})", "unpack it again") from None
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    if image is None or image.dtype != np.uint8:
        raise UnreadableImage(path, "does not decode as an image of 8 bits", "unpack it again")
    how = cv2.COLOR_BayerGBRG2RGB if image.ndim == 2 else cv2.COLOR_BGR2RGB
    return np.asarray(cv2.cvtColor(image[..., :3] if image.ndim == 3 else image, how), dtype=np.uint8)


def read_lut(folder: Path, camera: StereoCamera) -> Table:
    """The table (2, rows, columns) of a camera: columns, then rows [pixels].

    Raises:
        InputError: no such file, or of another size.
    """
    path = folder / f"{MODELS[camera]}_distortion_lut.bin"
    if not path.exists():
        raise InputError(path, "no such file", "name the folder models of robotcar-dataset-sdk")
    values = np.fromfile(path, dtype=np.float64)
    if values.size != 2 * SIZE[0] * SIZE[1]:
        raise InputError(path, f"holds {values.size} numbers, not 2 x {SIZE[0]} x {SIZE[1]}", "download it again")
    return values.reshape(2, SIZE[1], SIZE[0]).astype(np.float32)


def rig_of(width: int) -> Rig:
    """The camera of pictures that are so wide: its axis does not go through the middle, which a lens tells."""
    columns = min(width, SIZE[0])
    scale = columns / SIZE[0]
    focal = FOCAL_PX * scale
    lens = Lens("pinhole", focal, focal, (CX_PX + 0.5) * scale - 0.5, (CY_PX + 0.5) * scale - 0.5)
    return Rig(Camera(lens.hfov_deg(columns), columns, round(SIZE[1] * scale)), lens=lens)
