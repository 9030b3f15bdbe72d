"""Outlines of the mesh for pictures, faces under water; units by magnitude."""

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.mesh.body import Body
from damjoint.model.fields import (
    BROKEN,
    CLOSED,
    SLIPPED,
    SOFTENING,
    along,
    distance,
    joint_states,
    nearest_rows,
)
from damjoint.model.loads import STAGED, Loading
from damjoint.pictures.outline import JointLine, section_outline, skin
from damjoint.pictures.scene import displaced_faces, fluid_above, fluids
from damjoint.studies.report_input import suitable_unit
from damjoint.units import FORCES, LENGTHS, STRESSES, unit, with_unit
from numpy.testing import assert_allclose


def body(points, **quads):
    """A body with these regions."""
    points = np.array([(*p, 0.0) for p in points])
    cells = [("quad", np.array(some)) for some in quads.values()]
    return Body(points, np.arange(len(points)), cells, np.arange(len(quads)), list(quads))


def joint_of(ends):
    """The only joint of a section, with these ends."""
    return [JointLine("dam", "foundation", *np.array(ends, float))]


@pytest.fixture
def lift():
    """A dam with a batter 1:4 and a slope 1:1 on a block of concrete on rock; the joint at y = 4
    from x = 1 to x = 8, the crest at y = 8 from 2 to 4.
    """
    bodies = {
        "dam": body([(1, 4), (8, 4), (4, 8), (2, 8)], dam=[(0, 1, 2, 3)]),
        "foundation": body(
            [(x, 0) for x in (-5, 0, 12, 20)]
            + [(x, -3) for x in (20, 12, 0, -5)]
            + [(1, 4), (8, 4)],
            foundation=[(0, 7, 6, 1), (1, 6, 5, 2), (2, 5, 4, 3)],
            lower=[(1, 8, 9, 2)],  # clockwise
        ),
    }
    still = {name: np.zeros_like(b.points) for name, b in bodies.items()}
    return bodies, still, np.array([(1.0, 4.0), (8.0, 4.0)])


def area(polygon):
    x, y = polygon.T
    return abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def test_outlines_of_a_lift_joint(lift):
    bodies, still, ends = lift
    section = section_outline(bodies, still, 1.0, joint_of(ends))
    assert_allclose(section.upstream, [(2, 8), (1, 4)])
    assert_allclose(section.downstream, [(8, 4), (4, 8)])
    assert_allclose(section.crest, [(4, 8), (2, 8)])
    assert_allclose(section.floor, [(1, 4), (0, 0), (-5, 0)])
    assert_allclose(section.bed, [(20, 0), (12, 0), (8, 4)])
    assert {name: len(*tables) for name, tables in section.foundation.faces.items()} == {
        "foundation": 3,
        "lower": 1,
    }
    assert_allclose(section.dam.centroid[1], 4 + 4 / 3 * (7 + 2 * 2) / (7 + 2))


def filled(section, still, level, tail=0.0, **settings):
    """Areas of the fluids of a section at its levels."""
    case = load("dam", settings, [30.0])
    faces, dry = displaced_faces(section), displaced_faces(still)
    now = Loading(level, tail, (1.0,) * len(STAGED))
    return {name: sum(map(area, quads)) for name, quads in fluids(case, faces, now, dry).items()}


@pytest.mark.parametrize(
    "level, held", [(0, 0), (2, 2 * (5 + 2 / 8)), (6, 6 * (5 + 6 / 8)), (9, 8 * (5 + 1) + 5 + 2)]
)
@pytest.mark.parametrize("on_crest", [0, 1])
def test_area_of_water_up_to_a_level(lift, level, held, on_crest):
    """Beside a batter 1:4 from the end of the rock; over the crest only if water loads it."""
    section = section_outline(*lift[:2], 1.0, joint_of(lift[2]))
    areas = filled(section, section, level, crest_water=on_crest, silt_height=1.0)
    assert areas["water"] == pytest.approx(held + 2 * on_crest * (level > 8))
    assert areas["silt"] == pytest.approx(5 + 1 / 8)


def test_water_follows_the_displaced_dam(lift):
    """Tailwater beside a slope 1:1, displaced by -0.05 m, ten times exaggerated; the ground reaches
    the displaced dam.
    """
    bodies, still, ends = lift
    moved = still | {"dam": still["dam"] - (0.05, 0, 0)}
    before, section = (section_outline(bodies, u, 10.0, joint_of(ends)) for u in (still, moved))
    areas = filled(section, before, 0.0, 6.0)
    assert areas["water"] == pytest.approx(4 * (8 + 2) + 2 * (20 - 8 + 0.5 + 1))
    assert_allclose(section.crest[:, 0], (3.5, 1.5))


def test_ground_that_the_exaggerated_displacement_lowers_stays_dry(lift):
    bodies, still, ends = lift
    sunk = {name: u - (0, 0.3, 0) for name, u in still.items()}
    before, section = (section_outline(bodies, u, 10.0, joint_of(ends)) for u in (still, sunk))
    assert filled(section, before, -1.0)["water"] == 0


def test_a_body_without_a_face_at_the_lowest_z_has_no_section(lift):
    bodies, still, ends = lift
    bodies["dam"].points[:2, 2] = 1.0
    assert section_outline(bodies, still, 1.0, joint_of(ends)) is None


def test_water_below_an_overhang():
    """It also fills the overhang, which the dam hides; none above a dry face."""
    edges = np.array(
        [((1.0, 2.0), (0.0, 1.0)), ((0.0, 1.0), (0.0, 0.0)), ((0.0, 0.0), (-2.0, 0.0))]
    )
    assert [area(quad) for quad in fluid_above(edges, 2.0)] == [0.5, 0.0, 4.0]
    assert [area(quad) for quad in fluid_above(edges, 0.0)] == [0.0, 0.0, 0.0]


def test_surface_of_a_solid():
    """Two tetrahedra that share a face."""
    points = np.vstack([np.zeros(3), np.eye(3), np.ones(3)])
    tets = [("tetra", np.array([(0, 1, 2, 3), (4, 1, 2, 3)]))]
    ((faces, owners),) = skin(Body(points, np.arange(5), tets, np.arange(2)))
    assert len(faces) == 6 and {1, 2, 3} not in map(set, faces.tolist())
    assert sorted(owners) == [0, 0, 0, 1, 1, 1]


def test_states_of_the_joint():
    """Closed, slipped, softening (slipped or not), broken; law = friction has no softening: values
    between 0 and 1 are means over z. The damage of endo stays below 1.
    """
    rows = {"damage": np.array([0, 0, 0.2, 0.2, 1]), "slip": np.array([0, 1e-3, 0, 1e-3, 1e-3])}
    expected = [CLOSED, SLIPPED, SOFTENING, SOFTENING, BROKEN]
    assert joint_states(rows, load("dam", {"law": "bond"}).law).tolist() == expected
    friction = [CLOSED, SLIPPED, CLOSED, SLIPPED, BROKEN]
    assert joint_states(rows, load("dam", {"law": "friction"}).law).tolist() == friction
    endo = rows | {"damage": np.array([0, 0, 0.7, 0.72, 0.73])}
    assert joint_states(endo, ENDO).tolist() == expected


#: Laws by name, with parameters for which tension breaks them.
ENDO = load("dam", {"law": "endo", "sigma_max": 2e5, "mu": 0.8, "adhesion": 1.9e5}).law
BREAKING = {n: load("dam", {"law": n, "sigma_max": 2e5}).law for n in ("rupture", "bond")}
BREAKING |= {"endo": ENDO, "friction": load("dam", {"law": "friction"}).law}


@pytest.mark.parametrize("name", BREAKING)
def test_a_broken_joint_has_one_meaning(name):
    """Opened far and closed again: broken in the colours exactly where the law says so, which does
    not heal but for friction; no cohesion is left, but friction keeps all of it.
    """
    law = BREAKING[name]
    far, closed = (np.array([[jump, 0.0, 0.0]]) for jump in (1e-2, -1e-6))
    before = law.initial(1)
    assert not law.is_broken(closed, before)[0] and law.cohesion_left(closed, before)[0] == 1
    after = law.update_internal_variables(far, before)
    heals = name == "friction"
    for jump, broken in ((far, True), (closed, not heals)):
        rows = {"damage": law.damage(jump, after), "slip": law.slip(after, 1)}
        assert law.is_broken(jump, after)[0] == broken == (joint_states(rows, law)[0] == BROKEN)
        assert not law.in_process_zone(jump, after)[0]
        assert law.cohesion_left(jump, after)[0] == pytest.approx(float(heals), abs=2e-3)


def test_endo_is_broken_where_linear_softening_would_end():
    """In tension at a plastic opening of 2 G_f/sigma_max, to the elastic part."""
    openings = np.linspace(0.9, 1.1, 201) * ENDO.delta_c
    jumps = np.column_stack([openings, *np.zeros((2, 201))])
    after = ENDO.update_internal_variables(jumps, ENDO.initial(201))
    first = np.argmax(ENDO.is_broken(jumps, after))
    assert after.plastic[first, 2] == pytest.approx(ENDO.delta_c, rel=2e-3)
    # strength^2 is as S^2/(-S'), S = (1 - alpha)^3/sqrt(alpha)
    alphas = np.append(np.linspace(1e-3, 0.9, 100_001), after.alpha[first])
    S = (1 - alphas) ** 3 / np.sqrt(alphas)
    squares = S**2 / (S * (3 / (1 - alphas) + 0.5 / alphas))
    left = np.sqrt(squares[-1] / squares.max())
    assert ENDO.cohesion_left(jumps, after)[first] == pytest.approx(left, rel=1e-6)


def test_rows_of_a_stepped_joint():
    """Two nodes at the same x and z; curves are drawn over the distance."""
    rows = {
        "x": np.array([0, 1, 1, 2.0]),
        "y": np.array([0, 0, 1, 1.0]),
        "z": np.zeros(4),
        "s": np.array([0, 1, 2, 3.0]),
        "p": np.array([3, 2, 1, 0.0]),
    }
    points = np.column_stack([rows[axis] for axis in "xyz"])[::-1]
    joint = Body(points, np.arange(4), [], np.arange(0))
    assert nearest_rows(joint.points, rows).tolist() == [3, 2, 1, 0]
    assert_allclose(along(rows)["p"], [3, 2, 1, 0])
    assert_allclose(distance({"x": rows["x"]}), rows["x"])  # flat: no separate column


def test_curves_of_a_joint_with_unordered_nodes():
    """A pressure linear in the distance stays linear; there are as many parts as nodes across."""
    s, z = np.random.default_rng(1).uniform(size=(2, 400))
    curves = along({"x": s, "z": z, "s": s, "p": 3 - s})
    assert len(curves["s"]) == 20
    assert_allclose(curves["p"], 3 - curves["s"], atol=0.025)


@pytest.mark.parametrize(
    "value, units, text",
    [
        (1.2683e7, FORCES, "12.68 MN/m"),
        (150e3, FORCES, "150 kN/m"),
        (4.2e-7, LENGTHS, "420 nm"),
        (0.0, LENGTHS, "0 mm"),
    ],
)
def test_units_by_magnitude(value, units, text):
    assert with_unit(value, units) == text
    assert unit([np.array([0, -value])], units)[0] == text.split()[1]


def test_a_zero_has_one_unit_in_results_and_parameters():
    zero = np.zeros(2)
    assert unit([zero], LENGTHS)[0] == "mm" and unit([zero], FORCES)[0] == "MN/m"
    assert unit([zero], STRESSES) == suitable_unit("Pa", zero) == ("MPa", 1e-6)
