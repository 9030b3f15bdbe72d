"""Quadrangles, prisms and hexahedra of order 2: as accurate as triangles, in both engines."""

import numpy as np
import pytest
from closed_forms import differences
from damjoint import data
from damjoint.engines import engine_of
from damjoint.input.resolve import load
from damjoint.statics.hints import hints
from numpy.testing import assert_allclose

#: A dam on a foundation of three blocks in rows and columns; regular: quadrangles but in the last
#: block, else triangles (their halves).
BLOCKS = """
Include "PARAMETERS";
x() = {0, 5, 1.5, 0, -5, -5, 0, 5, 10, 10};
y() = {0, 0, 10, 10, 0, -5, -5, -5, -5, 0};
For i In {1 : 10}
  Point(i) = {x(i - 1), y(i - 1), 0};
EndFor
from() = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 1, 1, 2};
to() = {2, 3, 4, 1, 6, 7, 8, 9, 10, 2, 5, 7, 8};
For i In {1 : 13}
  Line(i) = {from(i - 1), to(i - 1)};
EndFor
Curve Loop(1) = {1, 2, 3, 4};
Curve Loop(2) = {-1, 12, 7, -13};
Curve Loop(3) = {11, 5, 6, -12};
Curve Loop(4) = {13, 8, 9, 10};
For i In {1 : 4}
  Plane Surface(i) = {i};
EndFor
Transfinite Curve {1 : 13} = n_joint + 1;
Transfinite Curve {2, 4} = 2 * n_joint + 1;
Transfinite Surface {1 : 4};
If(!StrCmp(mesh_pattern, "regular"))
  Recombine Surface {1 : 3};
EndIf
Physical Surface("dam") = {1};
Physical Surface("foundation") = {2 : 4};
Physical Curve("joint") = {1};
Physical Curve("upstream") = {4};
Physical Curve("fixed") = {5 : 9};
Physical Point("heel") = {1};
Physical Point("toe") = {2};
Physical Point("crest") = {4};
"""
STRONG = {"order": 2, "sigma_max": 1e12}


@pytest.fixture
def blocks(tmp_path, monkeypatch):
    """The case file of BLOCKS."""
    monkeypatch.setenv("DAMJOINT_RUN_GEO", "1")
    parameters = str(data("pro") / "parameters.pro")
    (tmp_path / "blocks.geo").write_text(BLOCKS.replace("PARAMETERS", parameters))
    path = tmp_path / "blocks.case"
    common = data("cases") / "ssnp142.case"
    own = 'geometry = "blocks.geo";\nlevels() = {9};\ntimes() = {1};\n'
    path.write_text(f'Include "{common}";\n{own}')
    return str(path)


@pytest.mark.heavy
def test_quadrangles_are_as_accurate_as_triangles(blocks, solve):
    """Opening of the heel, displacement of the crest, stress at the toe: closer to those of a fine
    mesh than with triangles of as many unknowns.
    """

    def found(pattern, n):
        (result,) = solve(blocks, mesh_pattern=pattern, n_joint=n, uplift="none", **STRONG)
        rows, crest = result.at(), result.last["crest_ux"]
        return np.array([rows["delta_n"][0], crest, rows["sigma_n"][-1]]), result.info["unknowns"]

    fine, _ = found("regular", 16)
    (quads, number), (halves, same) = found("regular", 4), found("free", 4)
    assert number == same
    assert np.all(np.abs(quads - fine) < 0.7 * np.abs(halves - fine))


@pytest.mark.heavy
def test_both_engines_agree_on_quadrangles_beside_triangles(blocks):
    """Rows of the joint; displacement and stress of both bodies, element by element. The waterline
    cuts no element.
    """
    settings = {"mesh_pattern": "regular", "n_joint": 5, "uplift": "imposed", "nu": 0.2, "order": 2}
    case, nothing = load(blocks, settings), lambda number, time: None
    (one,), (other,) = (engine_of(case, n)(case, nothing, True) for n in ("getdp", "auto"))
    assert max(differences(one.result, other.result)) < 1e-6
    assert len({shape for shape, _ in one.mesh().bodies["foundation"].cells}) == 2
    for a, b in zip(one.fields().values(), other.fields().values(), strict=True):
        for field in ("displacement", "stress"):
            for body, values in getattr(a, field).items():
                size = np.abs(values).max()
                assert_allclose(getattr(b, field)[body], values, rtol=0, atol=1e-6 * size)


@pytest.mark.heavy
@pytest.mark.parametrize("pattern, flat", [("layers", "free"), ("regular", "regular")])
def test_3d_contains_the_plane_solution(solve, pattern, flat):
    """A layer of prisms or hexahedra as thick as the joint is long, fixed along z."""
    size = {"n_joint": 10, "h_dam": 2, "h_found": 3, "uplift": "imposed", "nu": 0.25, "order": 2}
    (two,) = solve("a", "6,9", mesh_pattern=flat, **size)
    (three,) = solve("a", "6,9", **size, dim=3, mesh_pattern=pattern, thickness=5, hold_z=1)
    assert max(differences(two, three)) < 1e-8
    assert_allclose(three.history["crest_ux"], two.history["crest_ux"], rtol=1e-8)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "law, uplift", [("rupture", "flow"), ("bond", "flow"), ("friction", "cracked")]
)
def test_a_slice_needs_as_many_iterations_as_2d(solve, law, uplift):
    """In each step, on the same mesh extruded along z; the joint opens or slips."""
    scene = {"law": law, "uplift": uplift, "sigma_max": 1e4, "adhesion": 5e4, "mu": 0.8}
    scene |= {"E_dam": 2e10, "E_found": 3e10, "K_N": 1e11, "n_joint": 20, "h_dam": 8, "h_found": 30}
    (two,) = solve("dam", "30,40,45", **scene)
    layer = {"dim": 3, "mesh_pattern": "layers", "n_layers": 1, "thickness": 2, "hold_z": 1}
    (three,) = solve("dam", "30,40,45", **scene, **layer)
    assert three.history["iterations"].tolist() == two.history["iterations"].tolist()
    assert two.history["iterations"][-1] > 3
    assert max(differences(two, three)) < 1e-8
    assert [any("plane strain" in hint for hint in hints(r)) for r in (two, three)] == [False, True]
