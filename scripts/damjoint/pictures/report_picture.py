"""Pictures of a report, inside its page."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from .drawing import runs_of

#: Resolution of the rasterised parts of a picture.
DPI = 160
#: Least value of a white pixel; least height of a band over its width, of the first with heading.
WHITE, LEAST_BAND, FIRST_BAND = 250, 0.1, 0.3


@dataclass(frozen=True)
class Picture:
    """A picture of the report."""

    #: CSS class of its size
    size: str
    caption: str
    #: data addresses of its parts, below each other
    addresses: list[str]


def embedded(figure: Figure) -> list[str]:
    """Encode a figure with all its legends as a data address: SVG with rasterised meshes."""
    file = io.BytesIO()
    whole: dict[str, Any] = {"bbox_inches": "tight", "pad_inches": 0.05}
    figure.savefig(file, format="svg", dpi=DPI, metadata={"Date": None}, **whole)
    return [f"data:image/svg+xml;base64,{base64.b64encode(file.getvalue()).decode()}"]


def bands(path: Path) -> list[str]:
    """A picture file as data addresses of bands, cut where it is white: pages end between them."""
    picture = Image.open(path).convert("RGB")
    inked = np.asarray(picture).min(axis=(1, 2)) < WHITE
    cuts, encoded = [0], list[str]()
    for ink, first, end in runs_of(inked):
        least = LEAST_BAND if len(cuts) > 1 else FIRST_BAND
        if not ink and first - cuts[-1] > least * picture.width:
            cuts.append((first + end) // 2)
    for top, bottom in pairwise([*cuts, picture.height]):
        file = io.BytesIO()
        picture.crop((0, top, picture.width, bottom)).save(file, "PNG")
        encoded.append(f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}")
    return encoded
