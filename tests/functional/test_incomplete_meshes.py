"""Meshes of the user with a defect: each is refused, or a note names it."""

from dataclasses import replace

import numpy as np
import pytest
from blocks import write_blocks
from damjoint import InputError
from damjoint.input.resolve import load
from damjoint.mesh.mesh import Mesh, mesh_of
from damjoint.statics.notes import notes, understood
from own_mesh import OwnMesh

COARSE = {"n_joint": 12.0, "h_dam": 12.0, "h_found": 50.0}
#: A case that slides at 44 m on the complete mesh.
CASE = 'geometry = "own.msh"; default_law = "friction"; default_adhesion = 0; default_mu = 0.6;'
LEVELS = "levels() = {30, 44};"


@pytest.fixture(scope="module")
def plane():
    """The mesh of stepped.case."""
    return OwnMesh.of(load("stepped", COARSE))


@pytest.fixture(scope="module")
def solid():
    """A dam in 3D, three elements thick."""
    space = {"dim": 3.0, "mesh_pattern": "split", "thickness": 30.0, "n_layers": 3.0}
    return OwnMesh.of(load("dam", COARSE | space | {"n_joint": 6.0}))


@pytest.fixture
def written(tmp_path):
    """written(mesh, more): the path of a case with a mesh."""

    def write(mesh, more=LEVELS):
        mesh.write(tmp_path / "own.msh")
        (tmp_path / "own.case").write_text(CASE + more)
        return str(tmp_path / "own.case")

    return write


def elements(mesh, name):
    """The elements of a region, rows of points, in the order of height."""
    rows = np.concatenate([table for _, table in mesh.regions[name][1]])
    return rows[np.argsort(mesh.points[rows].mean(axis=1)[:, 1], kind="stable")]


def with_elements(mesh, name, rows):
    """The mesh with other elements of a region."""
    dimension, ((kind, _), *_) = mesh.regions[name]
    return replace(mesh, regions=mesh.regions | {name: (dimension, [(kind, rows)])})


def without(name, chosen=None):
    """A defect: a region is missing, or some of its elements in the order of their height."""

    def defect(mesh):
        if chosen is None:
            return replace(mesh, regions={n: r for n, r in mesh.regions.items() if n != name})
        return with_elements(mesh, name, np.delete(elements(mesh, name), chosen, axis=0))

    return defect


def doubled(name, chosen=slice(None)):
    """A defect: elements of a region are there twice."""
    return lambda mesh: with_elements(
        mesh, name, np.concatenate([elements(mesh, name), elements(mesh, name)[chosen]])
    )


def end_at(name, *place):
    """A defect: heel or toe is the node nearest to a place."""
    far = lambda mesh: np.linalg.norm(mesh.points - place, axis=1)
    return lambda mesh: with_elements(mesh, name, np.array([[np.argmin(far(mesh))]]))


def scaled(factor):
    """A defect: the mesh is in another unit."""
    return lambda mesh: replace(mesh, points=factor * mesh.points)


def moved(*by):
    """A defect: the mesh is moved."""
    return lambda mesh: mesh.moved(by)


def turned(axes, signs=(1, 1, 1)):
    """A defect: other axes point downstream, up and along the dam."""
    return lambda mesh: replace(mesh, points=(mesh.points * signs)[:, axes])


def renamed(mesh, names):
    """The mesh with other names of regions."""
    return replace(mesh, regions={names.get(n, n): r for n, r in mesh.regions.items()})


def without_faces(mesh):
    """The mesh without faces that water loads."""
    faces = "upstream", "downstream", "crest surface", "reservoir floor", "tailwater bed"
    return replace(mesh, regions={n: r for n, r in mesh.regions.items() if n not in faces})


def flattened(mesh):
    """A defect: a node of an element lies on its opposite side."""
    points, (a, b, c) = mesh.points.copy(), elements(mesh, "foundation")[0]
    points[c] = (points[a] + points[b]) / 2
    return replace(mesh, points=points)


def folded(mesh):
    """A defect: a node inside the dam lies beyond its neighbours."""
    inner = [n for n in elements(mesh, "dam").ravel() if 12 < mesh.points[n, 1] < 25]
    skin = {n for name in ("upstream", "downstream") for n in elements(mesh, name).ravel()}
    node = next(n for n in inner if n not in skin)
    points = mesh.points.copy()
    points[node, 1] += 15
    return replace(mesh, points=points)


def with_island(mesh):
    """A defect: an element of the dam without connection to it."""
    points = np.vstack([mesh.points, [[200, 100, 0], [201, 100, 0], [200, 101, 0]]])
    dam = np.vstack([elements(mesh, "dam"), len(mesh.points) + np.arange(3)])
    return with_elements(replace(mesh, points=points), "dam", dam)


def with_line_inside(mesh):
    """A defect: a side inside the dam is an element of a face."""
    outer = np.concatenate([elements(mesh, name) for name in FACES])
    triangle = next(t for t in elements(mesh, "dam") if not np.isin(t, outer).any())
    return with_elements(mesh, "upstream", np.vstack([elements(mesh, "upstream"), triangle[:2]]))


def in_two_faces(mesh):
    """A defect: an element of the upstream face is in the crest surface, too."""
    rows = np.vstack([elements(mesh, "crest surface"), elements(mesh, "upstream")[-1:]])
    return with_elements(mesh, "crest surface", rows)


FACES = "upstream", "downstream", "crest surface", "joint"
OVERLAP = "its elements overlap at"
#: Defects that are refused, and the message.
REFUSED = {
    "joint element": (without("joint", [4]), "dam and foundation also meet beside the joint, at"),
    "end of the joint": (without("joint", [0]), "also meet beside the joint"),
    "heel": (without("heel"), "no region heel"),
    "crest": (without("crest"), "no region crest"),
    "fixed": (without("fixed"), "no region fixed"),
    "half of upstream": (without("upstream", slice(None, None, 2)), "upstream: has a hole"),
    "one of upstream": (without("upstream", [2]), "upstream: has a hole; 1 element is in"),
    "lowest of upstream": (without("upstream", [0]), "upstream: has a hole"),
    "highest of upstream": (without("upstream", [-1]), "crest surface and upstream: has a hole"),
    "one of downstream": (without("downstream", [2]), "downstream: has a hole"),
    "lowest of downstream": (without("downstream", [0]), "downstream: has a hole"),
    "dam's element at the joint": (without("dam", [0]), "joint: its elements must be sides"),
    "doubled dam": (doubled("dam"), "dam: "),
    "one doubled": (doubled("dam", [7]), "dam: 1 element occurs twice"),
    "doubled rock": (doubled("foundation"), "elements occur twice"),
    "doubled joint": (doubled("joint"), "joint: 16 elements occur twice"),
    "doubled upstream": (doubled("upstream"), "elements occur twice"),
    "in two faces": (in_two_faces, "upstream and crest surface: 1 element occurs twice"),
    "folded": (folded, OVERLAP),
    "island": (with_island, "dam: its part at 200.333, 100.333, 0 is connected to no joint"),
    "line inside": (with_line_inside, "upstream: must be on the surface of its body"),
    "toe inside the joint": (end_at("toe", 24, 4, 0), "toe of joint: must be its end; 24, 4, 0"),
    "heel inside the joint": (end_at("heel", 12, 0, 0), "heel of joint: must be its end"),
    "toe off the joint": (end_at("toe", 5, 45, 0), "5, 45, 0 lies not on it"),
    "toe at the heel": (end_at("toe", 0, 0, 0), "heel and toe must be two ends"),
    "toe and heel": (
        lambda mesh: end_at("heel", 34, 4, 0)(end_at("toe", 0, 0, 0)(mesh)),
        "x must point downstream",
    ),
    "two toes": (doubled("toe"), "toe"),
    "crest in the air": (
        lambda mesh: end_at("crest", 0, 99, 0)(
            replace(mesh, points=np.vstack([mesh.points, [0, 99, 0]]))
        ),
        "crest: must be on a body",
    ),
    "mm": (scaled(1e3), "the dam is 45000 m high: must be at most 1000 m"),
    "z up": (turned((0, 2, 1)), "its z must be the same everywhere with dim = 2 (y points up)"),
    "y down": (turned((0, 1, 2), (1, -1, 1)), "x must point downstream, y up"),
    "y down, without faces": (
        lambda mesh: turned((0, 1, 2), (1, -1, 1))(without_faces(mesh)),
        "the rock lies above the dam: y must point up",
    ),
    "names of the faces": (
        lambda mesh: renamed(mesh, {"upstream": "downstream", "downstream": "upstream"}),
        "stream: looks along",
    ),
    "nan": (scaled(np.nan), "it has coordinates that are not finite"),
    "flat": (flattened, "an element has no size, at"),
    "far away": (moved(1e9, 0, 0), "it lies 1e+09 m from the origin"),
    "below the water": (moved(0, -1e6, 0), "levels = 30: must be at most -999910 m, twice the dam"),
    "below the water 2": (moved(0, -90, 0), "levels = 30: must be at most 0 m"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_mesh_with_a_defect_is_refused(plane, written, name):
    defect, message = REFUSED[name]
    if name == "two toes":  # a point that is there twice is one; another one beside it is not
        defect = lambda mesh: with_elements(
            mesh, "toe", np.vstack([elements(mesh, "toe"), elements(mesh, "heel")])
        )
        message = "toe of joint: must be one point, not 2"
    with pytest.raises(InputError) as error:
        mesh_of(load(written(defect(plane))))
    assert message in str(error.value) and "\n" not in str(error.value)


def with_slit(mesh):
    """A defect: two triangles of the dam, inside it, meet in nodes of their own."""
    dam = elements(mesh, "dam")
    outer = np.concatenate([elements(mesh, name) for name in FACES])
    inner = dam[~np.isin(dam, outer).any(axis=1)]
    node = next(n for n in inner.ravel() if not np.isin(dam[(dam == n).any(axis=1)], outer).any())
    around = np.flatnonzero((dam == node).any(axis=1))
    one = dam[around[0]]
    other = next(i for i in around[1:] if np.isin(dam[i], one).sum() == 2)
    cut = dam.copy()
    for i in (around[0], other):
        cut[i][cut[i] == node] = len(mesh.points)
    points = np.vstack([mesh.points, mesh.points[node]])
    return with_elements(replace(mesh, points=points), "dam", cut)


#: Defects that a note names, since they may be intended.
NOTED = {
    "upstream": (without("upstream"), LEVELS, "no face upstream: no pressure of the reservoir"),
    "lower half of upstream": (
        lambda mesh: with_elements(
            replace(mesh, regions={n: r for n, r in mesh.regions.items() if n != "crest surface"}),
            "upstream",
            elements(mesh, "upstream")[:2],
        ),
        LEVELS,
        "of the dam's surface below the highest level point upstream and are in no face",
    ),
    "downstream": (
        without("downstream"),
        LEVELS + "tail_levels() = {7};",
        "no face downstream: no pressure of the tailwater",
    ),
    "crest surface": (
        without("crest surface"),
        "levels() = {46};",
        "no face crest surface: no pressure on the crest",
    ),
    "moved up": (
        moved(0, 1e6, 0),
        LEVELS,
        "the highest level, 44 m, does not reach the dam's face upstream, which begins at y = ",
    ),
    "no levels": (
        lambda mesh: mesh,
        "",
        "no levels are set: 30, 40, 45 m are those of the default",
    ),
    "km": (scaled(1e-3), "levels() = {0.044};", "the dam is 0.045 m high"),
    "hole in the dam": (without("dam", [40]), LEVELS, "the mesh has a cavity at"),
    "dam is fixed": (
        lambda mesh: with_elements(
            without("crest surface")(mesh),
            "fixed",
            np.vstack([elements(mesh, "fixed"), elements(mesh, "crest surface")]),
        ),
        LEVELS,
        "fixed holds 5 m of the dam's own surface",
    ),
    "slit": (with_slit, LEVELS, "two nodes lie at "),
    "crest at the toe": (
        lambda mesh: with_elements(mesh, "crest", elements(mesh, "toe")),
        LEVELS,
        "crest lies at y = 4 m, the dam reaches 45 m",
    ),
    "hole in fixed": (without("fixed", [3]), LEVELS, "fixed: has a gap"),
    "section": (
        lambda mesh: mesh,
        LEVELS + "default_dam_height = 60;",
        "dam_height has no effect; the geometry is a mesh, own.msh",
    ),
    "floor": (
        lambda mesh: mesh,
        LEVELS + "default_floor_water = 1;",
        "floor_water = 1 has no effect: no face",
    ),
    "silt": (
        moved(0, 20, 0),
        "levels() = {44}; default_silt_height = 10;",
        "silt_height = 10 m reaches no face upstream",
    ),
}


@pytest.mark.parametrize("name", NOTED)
def test_what_a_mesh_lacks_is_noted(plane, written, name):
    defect, more, message = NOTED[name]
    found = notes(load(written(defect(plane), more)))
    assert [note for note in found if message in note], found
    assert len(found) == 1 + (name == "slit"), found  # which is a cavity, too


def test_a_complete_mesh_is_understood(plane, written):
    """Height, base, weight, and what is under water."""
    case = load(written(plane, LEVELS + "tail_levels() = {24.5};"))
    assert notes(case) == []
    slope = np.hypot(29, 41)
    assert understood(case) == (
        "dam 45 m high, from y = 0 to 45 m; joint 38 m from heel to toe; weight 20.519 MN/m; "
        f"under water: upstream 44 of 45 m, downstream {slope / 2:.4g} of {slope:.4g} m, "
        "crest surface 0 of 5 m"
    )


@pytest.mark.parametrize("by", [(0.0, 0.0), (1e6, 0.0), (-300.0, 560.0)])
def test_a_complete_mesh_may_be_elsewhere(plane, written, by):
    """At elevations above the sea, too."""
    case = load(written(plane.moved((*by, 0)), ""), {}, [30 + by[1], 44 + by[1]])
    assert notes(case) == [] and mesh_of(case).user_geometry.height == pytest.approx(45)


@pytest.mark.heavy
def test_the_critical_level_of_a_complete_mesh(plane, written, command):
    """The search has no highest level. The heel is at 560 m above the sea."""
    path = written(plane.moved((0, 560, 0)), "default_pena_tang = 0; default_order = 1;")
    code, out, err = command("critical", path, "--levels", "590,600")
    assert code == 0 and "own: geometry: dam 45 m high, from y = 560 to 605 m" in err
    assert "overturning" in out and 605 < float(out.split()[3]) < 650


SPACE = "default_dim = 3; levels() = {40};"


def lacking(name, *place):
    """A defect: the element of a region that is nearest to a place is missing."""

    def defect(mesh):
        middles = mesh.points[elements(mesh, name)].mean(axis=1)
        return without(name, [np.argmin(np.linalg.norm(middles - place, axis=1))])(mesh)

    return defect


def with_toe_inside(mesh):
    """A defect: an edge inside the joint is a part of the toe."""
    rows = elements(mesh, "joint")
    inner = (5 < mesh.points[rows, 0]) & (mesh.points[rows, 0] < 30)
    edge = next(row[:2] for row, mask in zip(rows, inner, strict=True) if mask.all())
    return with_elements(mesh, "toe", np.vstack([elements(mesh, "toe"), edge]))


def without_corner(mesh):
    """A defect: an element of the dam at the joint is missing."""
    on_base = np.abs(mesh.points[elements(mesh, "dam"), 1]) < 1e-9
    return without("dam", [np.argmax(on_base.sum(axis=1) == 3)])(mesh)


#: Defects in 3D that are refused.
REFUSED_IN_3D = {
    "joint element": (lacking("joint", 17, 0, 15), "dam and foundation also meet beside the joint"),
    "upstream": (lacking("upstream", 0, 20, 15), "upstream: has a hole; 1 element "),
    "upstream at the heel": (lacking("upstream", 0, 1, 15), "upstream: has a hole; 1 element "),
    "gap of the heel": (lacking("heel", 0, 0, 15), "heel of joint: has a gap at 0, 0, 15"),
    "gap of the toe": (lacking("toe", 34, 0, 15), "toe of joint: has a gap at 34, 0, 15"),
    "toe inside": (with_toe_inside, "toe of joint: must be its end"),
    "dam at the joint": (without_corner, "joint: its elements must be sides of those of dam"),
    "doubled dam": (doubled("dam"), "elements occur twice"),
    "doubled joint": (doubled("joint"), "joint: 36 elements occur twice"),
    "mm": (scaled(1e3), "the dam is 45000 m high"),
    "z up": (
        lambda mesh: turned((0, 2, 1), (1, 1, -1))(without_faces(mesh)),
        "the joint on the rock faces along z: y must point up",
    ),
}


@pytest.mark.parametrize("name", REFUSED_IN_3D)
def test_a_mesh_in_3d_with_a_defect_is_refused(solid, written, name):
    defect, message = REFUSED_IN_3D[name]
    with pytest.raises(InputError) as error:
        mesh_of(load(written(defect(solid), SPACE)))
    assert message in str(error.value)


@pytest.mark.heavy
def test_what_a_mesh_in_3d_lacks_is_noted(solid, written):
    assert notes(load(written(solid, SPACE))) == []
    (found,) = notes(load(written(without("upstream")(solid), SPACE)))
    assert "no face upstream" in found
    (found,) = notes(load(written(lacking("upstream", 0, 20, 0)(solid), SPACE)))
    assert "m2 of the dam's surface below the highest level point upstream" in found
    assert 0 < float(found.split()[0]) < 200
    slope = 30 * np.hypot(29, 45)
    under = f"upstream 1200 of 1350 m2, downstream 0 of {slope:.4g} m2, crest surface 0 of 150 m2"
    assert f"weight 619.8 MN; under water: {under}" in understood(load(written(solid, SPACE)))


def test_a_support_or_load_without_a_region_is_refused(solid, plane, written):
    """It would not act."""
    mesh = replace(solid, regions={n: r for n, r in solid.regions.items() if n != "z faces"})
    with pytest.raises(InputError, match=r"hold_z = 1: must be 0, or geometry = .* region z faces"):
        mesh_of(load(written(mesh, SPACE + "default_hold_z = 1;")))
    for name, region in (("ice_force", "ice"), ("anchor_force", "anchor"), ("force_x", "force")):
        with pytest.raises(InputError, match=rf"{name} = 1000: must be 0, .* region {region}"):
            mesh_of(load(written(plane, LEVELS), {name: 1e3}))


#: A crack inside a block, and what may be wrong with it.
BLOCK = {"body": (0.0, 0.0, 10.0, 10.0)}
BASE, CRACK = {"base": (0, 0, 10, 0)}, {"crack": (3, 5, 7, 5)}


@pytest.mark.heavy
def test_a_crack_with_a_gap_is_refused(tmp_path):
    path = write_blocks(tmp_path / "own.msh", BLOCK, BASE | CRACK)
    (tmp_path / "own.case").write_text('geometry = "own.msh"; levels() = {5};')
    case = load(str(tmp_path / "own.case"))
    assert Mesh(case).joints[1].name == "crack" and notes(case) == []
    lines = path.read_text().splitlines()
    start = lines.index("$Elements")
    group = next(line.split()[1] for line in lines if line.endswith('"joint crack"'))
    of_crack = [i for i in range(start, len(lines)) if is_line(lines[i], group)]
    assert len(of_crack) == 4
    del lines[of_crack[1]]
    lines[start + 1] = str(int(lines[start + 1]) - 1)
    path.write_text("\n".join([*lines, ""]))
    with pytest.raises(InputError, match="joint crack: must be a chain of elements from heel to"):
        Mesh(load(str(tmp_path / "own.case")))


def is_line(text, group):
    """Whether a line of a file in format MSH 2.2 is a line element of a group."""
    words = text.split()
    return len(words) == 7 and words[1] == "1" and words[3] == group


def test_a_point_of_two_groups_is_one_element(tmp_path):
    """Format MSH 2.2 has it twice, once for each group: a force on it would be twice as large."""
    path = write_blocks(tmp_path / "own.msh", BLOCK, BASE)
    (tmp_path / "own.case").write_text('geometry = "own.msh"; levels() = {5};')
    lines = path.read_text().splitlines()
    name = next(line for line in lines if line.endswith('"crest"'))
    group = name.split()[1]
    start = lines.index("$Elements")
    point = next(w for line in lines[start:] if (w := line.split())[1:4] == ["15", "2", group])
    lines[start + 1] = str(int(lines[start + 1]) + 1)
    lines.insert(start + 2, " ".join(["1000000", "15", "2", "99", *point[4:]]))
    first = lines.index("$PhysicalNames") + 1
    lines[first : first + 1] = [str(int(lines[first]) + 1), '0 99 "force"']
    path.write_text("\n".join([*lines, ""]))
    mesh = mesh_of(load(str(tmp_path / "own.case"), {"force_x": 1e3}))
    assert [len(mesh.bodies[name].element_tags) for name in ("crest", "force")] == [1, 1]
