"""Pictures and animations of the drawing area; needs a window."""

from __future__ import annotations

import tempfile
from pathlib import Path

import gmsh
from PIL import Image

from .. import InputError
from .gallery import Gallery
from .scene import SolvedScene

#: Seconds for which an animation shows a level, a frame of an earthquake, and its last step.
LEVEL, FRAME, LAST = 0.6, 0.05, 2.0


def picture(folder: str) -> Path:
    """Write the drawing area into a folder as window.png. Raises InputError, OSError."""
    file = target(folder, "window.png")
    gmsh.graphics.draw()
    gmsh.write(str(file))
    return file


def animation(folder: str, gallery: Gallery, scene: SolvedScene) -> Path:
    """Write all steps of a scene into a folder as window.gif; shows the same step as before.

    Raises InputError, OSError.
    """
    file, before = target(folder, "window.gif"), gallery.step
    with tempfile.TemporaryDirectory(prefix="damjoint_") as scratch:
        frames = []
        for step in range(len(scene.times)):
            gallery.set_step(step)
            with Image.open(picture(scratch)) as frame:
                frames.append(frame.convert("RGB"))
    gallery.set_step(before)
    if not frames:
        raise InputError("nothing to export: no level was reached")
    each = LEVEL if scene.quake is None else FRAME
    milliseconds = [1000 * each] * (len(frames) - 1) + [1000 * LAST]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=milliseconds, loop=0)
    return file


def target(folder: str, name: str) -> Path:
    """A file in a folder, which is created. Raises InputError if there is no folder."""
    if not folder.strip():
        raise InputError("out: name a folder")
    Path(folder).mkdir(parents=True, exist_ok=True)
    return Path(folder) / name
