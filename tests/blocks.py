"""Meshes of blocks on rock with several joints, as geometries of one's own."""

from __future__ import annotations

from pathlib import Path

from damjoint.input.parameters import empty_gmsh

#: Corners (x0, y0, x1, y1) of the rock [m].
ROCK = -20.0, -20.0, 40.0, 0.0


def write_blocks(
    path: Path,
    blocks: dict[str, tuple[float, float, float, float]],
    joints: dict[str, tuple[float, float, float, float]],
    size: float = 1.0,
    fine: dict[str, float] | None = None,
    crest: float | None = None,
) -> Path:
    """Write the mesh of rectangular blocks on rock.

    blocks: corners by name; blocks of one name are glued. joints: ends (heel, toe) by name. Faces:
    the left side of the leftmost block is upstream, the right side of the last one, if it stands on
    the rock, downstream. A joint whose name begins with _ is a line of the mesh, but glued. size:
    of the elements [m]; fine: of those at joints, by name; crest: its x, by default the leftmost.
    """
    gmsh = empty_gmsh()
    gmsh.model.add("blocks")
    occ = gmsh.model.occ
    rectangle = lambda x0, y0, x1, y1: (2, occ.addRectangle(x0, y0, 0, x1 - x0, y1 - y0))
    shapes = {name: rectangle(*corners) for name, corners in {"rock": ROCK, **blocks}.items()}
    lines = {}
    for name, (x0, y0, x1, y1) in joints.items():
        ends = occ.addPoint(x0, y0, 0), occ.addPoint(x1, y1, 0)
        lines[name] = (1, occ.addLine(*ends))
    parts = [*shapes.values(), *lines.values()]
    _, pieces = occ.fragment(parts, [])
    occ.synchronize()
    pieces_of = dict(zip([*shapes, *lines], pieces, strict=True))

    def group(dimension: int, tags: list[int], name: str) -> None:
        gmsh.model.setPhysicalName(
            dimension, gmsh.model.addPhysicalGroup(dimension, sorted(set(tags))), name
        )

    def inside(dimension: int, x0: float, y0: float, x1: float, y1: float) -> list[int]:
        eps = 1e-6
        box = x0 - eps, y0 - eps, -eps, x1 + eps, y1 + eps, eps
        return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*box, dimension)]

    group(2, [tag for _, tag in pieces_of["rock"]], "foundation")
    by_name: dict[str, list[int]] = {}
    for name in blocks:
        tags = [tag for _, tag in pieces_of[name]]
        by_name.setdefault(f"dam {name.split('/')[0]}", []).extend(tags)
    for name, tags in by_name.items():
        group(2, tags, name)
    for name, (x0, y0, x1, y1) in joints.items():
        if name.startswith("_"):
            continue
        group(1, [tag for _, tag in pieces_of[name]], f"joint {name}")
        group(0, inside(0, x0, y0, x0, y0), f"heel {name}")
        group(0, inside(0, x1, y1, x1, y1), f"toe {name}")
    left, right, bottom = (
        inside(1, ROCK[0], ROCK[1], ROCK[0], ROCK[3]),
        inside(1, ROCK[2], ROCK[1], ROCK[2], ROCK[3]),
        inside(1, ROCK[0], ROCK[1], ROCK[2], ROCK[1]),
    )
    group(1, [*left, *right, *bottom], "fixed")
    x = min(corners[0] for corners in blocks.values())
    top = max(corners[3] for corners in blocks.values())
    group(1, inside(1, x, 0, x, top), "upstream")
    crest = x if crest is None else crest
    group(0, inside(0, crest, top, crest, top), "crest")
    *_, (_, bottom_of_last, right_of_last, top_of_last) = blocks.values()
    if bottom_of_last == 0:
        group(1, inside(1, right_of_last, 0, right_of_last, top_of_last), "downstream")
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    for name, own in (fine or {}).items():
        x0, y0, x1, y1 = joints[name]
        for x_end, y_end in ((x0, y0), (x1, y1)):
            gmsh.model.mesh.setSize([(0, p) for p in inside(0, x_end, y_end, x_end, y_end)], own)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.write(str(path))
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e22)
    return path
