"""Meshes and drawings of other programs, by the recipes of reference/usage.md."""

import re
import subprocess
import sys

import gmsh
import numpy as np
import pytest
from damjoint import InputError, data
from damjoint.input.parameters import empty_gmsh
from damjoint.input.resolve import load
from damjoint.mesh.mesh import Mesh

PAGE = data("reference") / "usage.md"
#: The gmsh command of the installed package
GMSH = "import sys, gmsh; gmsh.initialize(['gmsh', *sys.argv[1:]], run=True); gmsh.finalize()"
#: The corners of a section [m]
SECTION = [(0, 0), (34, 0), (5, 45), (0, 45)]
#: Sizes of the mesh of geo/stepped.geo
COARSE = "n_joint = 20;\nh_dam = 8;\nh_found = 30;\n"


def recipe(language):
    """The block of code of a language in the page's section."""
    section = PAGE.read_text().split("## Meshes and drawings of other programs\n")[1]
    return re.search(rf"```{language}\n(.*?)```", section, re.DOTALL)[1]


@pytest.fixture
def drawn(tmp_path):
    """The mesh of geo/stepped.geo as dam.med and dam.inp, and as the package meshes it."""
    empty_gmsh()
    gmsh.parser.clear()
    (tmp_path / "own.geo").write_text(f'{COARSE}Include "{data("geo")}/stepped.geo";\n')
    gmsh.open(str(tmp_path / "own.geo"))
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.SaveGroupsOfElements", 1)
    gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", -1)  # of dimension 0
    for name in ("dam.med", "dam.inp", "expected.msh"):
        gmsh.write(str(tmp_path / name))
    return tmp_path


def mesh_in(folder, name="dam.msh"):
    """A mesh file as the package reads it."""
    path = folder / "own.case"
    path.write_text(f'geometry = "{name}";\nlevels() = {{30}};\n')
    return Mesh(load(str(path)))


def assert_same(mesh, expected):
    """Compare sizes of bodies, joints and faces."""
    assert mesh.counts == expected.counts
    assert mesh.faces.keys() == expected.faces.keys() and mesh.faces
    for ours, theirs in zip(mesh.joints, expected.joints, strict=True):
        assert ours.ends == theirs.ends
    for name, body in expected.solids.items():
        middles = [np.sort(solid.middles(), axis=0) for solid in (mesh.solids[name], body)]
        assert middles[0] == pytest.approx(middles[1], abs=1e-6)


@pytest.mark.heavy
def test_a_med_file_keeps_its_groups(drawn):
    if "Med" not in gmsh.option.getString("General.BuildOptions").split():
        pytest.skip("this Gmsh is built without MED")
    command = [sys.executable, "-c", GMSH, "dam.med", "-save", "-o", "dam.msh"]
    subprocess.run(command, cwd=drawn, check=True, capture_output=True)
    assert_same(mesh_in(drawn), mesh_in(drawn, "expected.msh"))


def test_an_abaqus_file_by_meshio(drawn, monkeypatch):
    """In plane strain, as the bodies of a dam are in Abaqus."""
    monkeypatch.chdir(drawn)
    deck = (drawn / "dam.inp").read_text()
    assert "CPS3" in deck
    (drawn / "dam.inp").write_text(deck.replace("CPS3", "CPE3"))
    exec(recipe("python"), {})
    assert_same(mesh_in(drawn), mesh_in(drawn, "expected.msh"))


@pytest.mark.parametrize("allowed", ["0", "1"])
def test_an_abaqus_file_itself_is_refused(drawn, monkeypatch, allowed):
    """With the way to convert it, in a section that the page has."""
    monkeypatch.setenv("DAMJOINT_RUN_GEO", allowed)
    with pytest.raises(InputError, match="must be converted to a") as error:
        mesh_in(drawn, "dam.inp")
    heading = str(error.value).split('"')[1]
    assert f"## {heading}\n" in PAGE.read_text()


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_drawing_in_step_format(tmp_path, monkeypatch, unit):
    """In millimetres, as CAD programs write it; of another size a line says what is missing."""
    empty_gmsh()
    corners = [gmsh.model.occ.addPoint(unit * x, unit * y, 0) for x, y in SECTION]
    lines = [
        gmsh.model.occ.addLine(corner, following)
        for corner, following in zip(corners, corners[1:] + corners[:1], strict=True)
    ]
    gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop(lines)])
    gmsh.model.occ.synchronize()
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    gmsh.write(str(tmp_path / "dam.step"))
    (tmp_path / "dam.geo").write_text(recipe("gmsh"))
    monkeypatch.setenv("DAMJOINT_RUN_GEO", "1")
    if unit == 1:
        with pytest.raises(InputError, match="no edge or corner where joint, face, toe and crest"):
            mesh_in(tmp_path, "dam.geo")
        return
    mesh = mesh_in(tmp_path, "dam.geo")
    (joint,) = mesh.joints
    assert joint.ends["joint_length"][0] == pytest.approx(34)
    assert mesh.solids["dam"].points.max(axis=0) == pytest.approx([34, 45, 0])
