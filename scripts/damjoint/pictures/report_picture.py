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
#: Least value of a white pixel.
WHITE = 250
#: Over the width of a picture: height of what is a panel, not text, and of the white that is wider
#: than between a panel and its text.
PANEL, WIDE = 0.06, 0.015


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
    """A picture file as data addresses of bands, cut in the white between two panels: pages end
    between them.

    The cut is in the widest white if that is WIDE, else above the text of the lower panel.
    """
    picture = Image.open(path).convert("RGB")
    inked = np.asarray(picture).min(axis=(1, 2)) < WHITE
    cuts, encoded, gaps, panels = [0], list[str](), list[tuple[int, int]](), 0
    for ink, first, end in runs_of(inked):
        if not ink:
            gaps.append((first, end))
        elif end - first > PANEL * picture.width:
            if panels and gaps:
                widest = max(gaps, key=lambda gap: gap[1] - gap[0])
                wide = widest[1] - widest[0] > WIDE * picture.width
                cuts.append(sum(widest if wide else gaps[0]) // 2)
            gaps, panels = [], panels + 1
    for top, bottom in pairwise([*cuts, picture.height]):
        file = io.BytesIO()
        picture.crop((0, top, picture.width, bottom)).save(file, "PNG")
        encoded.append(f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}")
    return encoded
