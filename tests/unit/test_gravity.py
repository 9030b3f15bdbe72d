"""The gravity method against closed forms, published tables, and quadrature of each load."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import (
    BASE,
    CENTROID,
    WEIGHT,
    integral,
    resultants,
    slide_level,
    slide_level_of_45_m_dam,
)
from damjoint.input.resolve import load
from damjoint.statics import gravity
from damjoint.statics.rigid_block import RigidBlock
from damjoint.statics.uplift import Uplift
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import brentq

WATER = 1000 * 9.81
#: A dam with batter, neck and a lift joint that falls towards the toe.
WHOLE = {
    "batter": 4.0,
    "batter_height": 20.0,
    "neck_height": 6.0,
    "joint_height": 8.0,
    "joint_slope": -5.0,
}
SECTIONS = {
    "plain": {},
    "batter": {"batter": 4.0, "batter_height": 20.0},
    "neck": {"neck_height": 6.0},
    "sloping neck": {"neck_height": 6.0, "neck_batter": 2.0},
    "polygon": {"downstream_face": (30.0, 12.0, 12.0, 30.0, 7.0, 40.0)},
    "lift": {"joint_height": 8.0, "batter": 4.0},
    "rising": {"joint_slope": 7.0},
    "whole": WHOLE,
}


def large(settings, tail="3"):
    """The 45 m dam with water to its crest."""
    return load("dam", settings, "45", tail)


# -- published tables


@pytest.mark.parametrize(
    "level, normal, shear, moment",
    [(40, 13517, 7804, 202.4), (43, 13017, 9025, 165.7), (45, 12683, 9888, 139.2)],
)
def test_table_of_the_45_m_dam(level, normal, shear, moment):
    found = gravity.at(load("dam", {}, str(level), "3"), 1)
    assert found.N / 1e3 == pytest.approx(normal, abs=0.5)
    assert found.T / 1e3 == pytest.approx(shear, abs=0.5)
    assert found.M / 1e6 == pytest.approx(moment, abs=0.05)


def test_weight_and_centroid_of_koyna():
    """Two trapezoids with a vertical upstream face: below the neck and the neck itself."""
    empty = gravity.at(load("koyna", {"uplift": "none"}, "0"), 1)
    parts = [(66.5, 70.2, 19.25), (36.5, 19.25, 14.8)]  # height, width at foot and top
    areas = [h * (a + b) / 2 for h, a, b in parts]
    moments = [h * (a * a + a * b + b * b) / 6 for h, a, b in parts]  # about the upstream face
    weight = 2643 * 9.81 * sum(areas)
    assert empty.N == pytest.approx(weight, rel=1e-12)
    assert empty.M == pytest.approx(weight * (70.2 - sum(moments) / sum(areas)), rel=1e-12)


def test_a_neck_in_line_with_the_slope_is_none():
    """The same resultants as without a neck, on the base and on a lift joint within the neck."""
    lift = {"joint_height": 40.0, "joint_slope": 3.0}
    for joint in ({}, lift):
        straight, necked = (
            gravity.at(load("dam", {**joint, **neck}, "45", "3"), 1)
            for neck in ({}, {"neck_height": 9.0, "neck_batter": 29 / 45 * 9})
        )
        for name in ("N", "T", "M", "U"):
            assert getattr(necked, name) == pytest.approx(getattr(straight, name), rel=1e-12)


#: Koyna's section with a third corner of the downstream face, on the neck: widens upwards there.
POLYGON = ((70.2, 0.0), (45.0, 30.0), (19.25, 66.5), (12.0, 90.0), (14.8, 103.0))


def test_weight_and_centroid_of_a_polygonal_downstream_face():
    """A trapezoid between each two corners, above the base and above a lift joint."""
    face = tuple(v for corner in POLYGON[1:-1] for v in corner)
    settings = {"uplift": "none", "downstream_face": face}
    for above, corners in ((0.0, POLYGON), (40.0, ((45 - 25.75 / 3.65, 40.0), *POLYGON[2:]))):
        empty = gravity.at(load("koyna", settings | {"joint_height": above}, "0"), 1)
        area = moment = 0.0  # about the upstream face
        for (a, low), (b, high) in itertools.pairwise(corners):
            area += (high - low) * (a + b) / 2
            moment += (high - low) * (a * a + a * b + b * b) / 6
        weight = 2643 * 9.81 * area
        assert empty.N == pytest.approx(weight, rel=1e-12)
        assert empty.M == pytest.approx(weight * (corners[0][0] - moment / area), rel=1e-12)


def test_a_polygon_of_one_corner_is_a_neck():
    """The same resultants as by neck_height and neck_batter, on the base and on lift joints."""
    neck = {"neck_height": 36.5, "neck_batter": 4.45, "downstream_face": ()}
    for lift in ({}, {"joint_height": 50.0, "joint_slope": 4.0}, {"joint_height": 80.0}):
        one, other = (gravity.at(load("koyna", s | lift, "95", "75"), 1) for s in ({}, neck))
        for name in ("N", "T", "M", "U"):
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-12)


def test_crack_of_the_45_m_dam():
    """Without tension: from three times the distance of the resultant to the toe under linear
    uplift; from a cubic equation with full head in the crack (12185 kN, 128.3 MN m, 2.42 m).
    """
    found = gravity.at(large({"sigma_max": 0.0}), 1)
    assert found.crack_length == pytest.approx(1.08, abs=0.005)
    assert found.crack_length == pytest.approx(34 - 3 * found.M / found.N, rel=1e-9)
    dry = gravity.at(large({"sigma_max": 0.0, "uplift": "none"}), 1)
    # N B = 3 M with B uncracked: the uplift there, 42 w B/2 below full head, acts at B/3, too
    left = 3 * (dry.M - WATER * 45 * 34**2 / 2) / (dry.N - WATER * 45 * 34)
    for uplift in ("cracked", "flow"):
        wet = gravity.at(large({"sigma_max": 0.0, "uplift": uplift}), 1)
        assert wet.crack_length == pytest.approx(34 - left, rel=1e-9)
        assert wet.crack_length == pytest.approx(2.42, abs=0.01)
        assert wet.N / 1e3 == pytest.approx(12185, abs=1)
        assert wet.M / 1e6 == pytest.approx(128.3, abs=0.05)
        assert wet.sigma_n_eff_heel == 0 and wet.tip_stress == pytest.approx(0, abs=1)
        # all of N on the uncracked joint: a triangle
        assert wet.sigma_n_eff_toe == pytest.approx(-2 * wet.N / left, rel=1e-9)


def test_sliding_of_the_45_m_dam():
    assert gravity.at(large({"mu": 1.0, "adhesion": 2e5}), 1).SSF == pytest.approx(1.97, abs=5e-3)
    for mu in (0.6, 0.7):
        case = large({"mu": mu, "adhesion": 0.0})
        slides = brentq(lambda h, case=case: gravity.at(case, 1, h).SSF - 1, 30, 45)
        assert slides == pytest.approx(slide_level_of_45_m_dam(mu), abs=5e-4)


@pytest.mark.parametrize(
    "uplift, decompression, overturning", [("none", 8.98764, 11.462), ("imposed", 8.064, 10.017)]
)
def test_levels_of_ssnp142(uplift, decompression, overturning):
    """The thrust of a level above the crest is that of heavier water at the crest."""
    strong = load("a", {"uplift": uplift, "sigma_max": 1e9}, "10")
    found = brentq(lambda h: gravity.at(strong, 1, h).tip_stress, 5, 10)
    assert found == pytest.approx(decompression, abs=5e-4)
    case = load("a", {"uplift": uplift, "sigma_max": 0.0, "crest_water": 0.0}, "10")
    if uplift == "none":
        heavy = {"rho_water": 1000 * (overturning / 10) ** 3}
        case = load("a", heavy | {"uplift": "none", "sigma_max": 0.0}, "10")
        assert gravity.at(case, 1).M == pytest.approx(0, abs=2e-3 * WEIGHT)
        assert gravity.at(case, 1, 10.01).crack_length == 5
    else:
        assert gravity.at(case, 1, overturning - 1e-3).crack_length < 5
        turned = gravity.at(case, 1, overturning + 1e-3)
        assert turned.crack_length == 5 and not turned.stands


def test_sliding_levels_of_ssnp142():
    for uplift in ("none", "imposed"):
        case = load("c", {"uplift": uplift}, "9")
        found = brentq(lambda h, case=case: gravity.at(case, 1, h).SSF - 1, 5, 9)
        assert found == pytest.approx(slide_level(0.35, 1000, uplift == "imposed"), rel=1e-9)


def test_resultants_of_ssnp142():
    case = load("c", {}, "9", "4")
    for uplift in ("none", "imposed"):
        case.values["uplift"] = uplift
        found = gravity.at(case, 1)
        expected = resultants(9, 4, uplift == "imposed")
        assert_allclose((found.N, found.T, found.M), expected, rtol=1e-12)
    assert found.resultant.fy == pytest.approx(-WEIGHT + found.loads[2].fy)
    assert found.loads[0].moment == pytest.approx(WEIGHT * (BASE - CENTROID))


# -- loads by quadrature over the faces


def side_of(case, side):
    """Straight parts of the upper body's faces, as pairs of points in pro/section.pro's order."""
    found = case.section
    code = {"UP": 0, "DOWN": 1, "TOP": 2}[side]
    columns = zip(
        *(found[f"seg_{n}"] for n in ("side", "body", "x0", "y0", "x1", "y1")), strict=True
    )
    return [(np.array(c[2:4]), np.array(c[4:6])) for c in columns if c[0] == code and c[1] == 0]


def by_quadrature(case, side, pressure, horizontal_only=False):
    """Fx, Fy and moment about the toe of pressure(y, x component of the normal) on a side."""
    toe = np.array([case.section["toe_x"][0], case.section["toe_y"][0]])
    total = np.zeros(3)
    for a, b in side_of(case, side):
        along = b - a
        inward = np.array([-along[1], along[0]])
        share = abs(along[1]) / np.hypot(*along)

        def part(r, i, a=a, along=along, inward=inward, share=share):
            place = a + r * along
            force = pressure(place[1], share) * inward * (1, not horizontal_only)
            arm = place - toe
            return (*force, arm[0] * force[1] - arm[1] * force[0])[i]

        kinks = [
            (level - a[1]) / along[1] for level in (45.0, 30.0, 12.0, 10.0, 8.0) if along[1] != 0
        ]
        kinks = [k for k in kinks if 0 < k < 1] or None
        total += [quad(part, 0, 1, (i,), points=kinks, epsabs=1e-6, limit=200)[0] for i in range(3)]
    return total


def load_of(case, name, level=None):
    found = {row.name: row for row in gravity.at(case, 1, level).loads}[name]
    return found.fx, found.fy, found.moment


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("level, tail", [(30, 12), (45, 10), (48.5, 0)])
def test_water_on_faces(section, level, tail):
    case = load("dam", SECTIONS[section], "40", str(tail))
    hydrostatic = lambda surface: lambda y, _: WATER * max(surface - y, 0)
    names = {"reservoir": ("UP", level), "water on the crest": ("TOP", level)}
    for name, (side, surface) in (names | {"tailwater": ("DOWN", tail)}).items():
        expected = by_quadrature(case, side, hydrostatic(surface))
        if any(abs(expected) > 1e-6):
            assert_allclose(load_of(case, name, level), expected, rtol=1e-8, atol=1e-2)
        else:
            assert name not in {row.name for row in gravity.at(case, 1, level).loads}


@pytest.mark.parametrize("section", SECTIONS)
def test_silt_and_westergaard(section):
    case = load(
        "dam", SECTIONS[section] | {"silt_height": 12.0, "k_h": 0.1, "k_v": -0.05}, "30", "0"
    )
    silt = by_quadrature(case, "UP", lambda y, _: 900 * 9.81 * 0.5 * max(12 - y, 0), True)
    assert_allclose(load_of(case, "silt"), silt, rtol=1e-8, atol=1e-2)
    size = 7 / 8 * 0.1 * WATER
    added = by_quadrature(
        case, "UP", lambda y, share: size * share * math.sqrt(30 * max(30 - y, 0))
    )
    assert_allclose(load_of(case, "added water pressure"), added, rtol=1e-7, atol=1e-2)
    weight, quake = load_of(case, "weight"), load_of(case, "earthquake")
    assert quake[0] == pytest.approx(-0.1 * weight[1])
    assert quake[1] == pytest.approx(0.05 * weight[1])


@pytest.mark.parametrize("section", ["batter", "whole"])
def test_weight_of_silt(section):
    """Horizontal pressure times K_0, and the full vertical pressure on the batter."""
    settings = SECTIONS[section] | {"silt_height": 12.0, "silt_K0": 0.4, "silt_weight": 1.0}
    case = load("dam", settings, "30", "0")
    pressure = lambda y, _: 900 * 9.81 * max(12 - y, 0)
    normal, horizontal = (by_quadrature(case, "UP", pressure, part) for part in (False, True))
    found = load_of(case, "silt")
    assert found[1] < 0
    assert_allclose(found, normal + (0.4 - 1) * horizontal, rtol=1e-8, atol=1e-2)


@pytest.mark.parametrize(
    "section, angle",
    [
        ({}, 0),
        ({"batter": 4.0, "batter_height": 20.0}, 0),  # vertical over more than half
        ({"batter": 4.0, "batter_height": 30.0}, math.atan(4 / 38)),  # level above the batter
        ({"batter": 8.0, "batter_height": 45.0}, math.atan(8 / 45)),
        ({"batter": 8.0, "batter_height": 45.0, "joint_height": 8.0}, math.atan(8 / 45)),
        ({"batter": 20.0, "dam_base": 60.0}, math.atan(20 / 45)),
    ],
)
def test_zangar(section, angle):
    """Formula and C_m of Zangar (1952), normal to the face; 0.726 C_m k_h w H^2 on a vertical one
    [USBR, Design of Small Dams].
    """
    case = load("dam", section | {"k_h": 0.1, "added_mass": 2.0}, "38", "0")
    angles, coefficients = np.arange(0, 91, 10), [0.735, 0.67, 0.62, 0.55, 0.48, 0.4, 0.31]
    share = np.interp(math.degrees(angle), angles[:7], coefficients)

    def pressure(y, _):
        r = max(38 - y, 0) / 38
        return share / 2 * 0.1 * WATER * 38 * (r * (2 - r) + math.sqrt(r * (2 - r)))

    expected = by_quadrature(case, "UP", pressure)
    assert_allclose(load_of(case, "added water pressure"), expected, rtol=1e-7, atol=1)
    if not section:
        assert expected[0] == pytest.approx(0.726 * 0.735 * 0.1 * WATER * 38**2, rel=1e-3)


@pytest.mark.parametrize("section", SECTIONS)
def test_weight_by_slices(section):
    """Area and first moments of the upper body by integration of its width."""
    case = load("dam", SECTIONS[section])
    body = RigidBlock(case)
    (x0, y0), bottom = body.toe, min(body.toe[1], body.heel[1])

    def ends(y):
        """Intersections of the outline with the horizontal at y."""
        corners = body.outline + body.toe
        cuts = [
            a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
            if min(a[1], b[1]) <= y < max(a[1], b[1])
        ]
        return min(cuts), max(cuts)

    breaks = sorted({*(body.outline[:, 1] + y0), 45.0})
    sums = np.zeros(3)
    for low, high in itertools.pairwise(breaks):
        if high - low < 1e-9:
            continue
        moments = (
            lambda y: ends(y)[1] - ends(y)[0],
            lambda y: (ends(y)[1] ** 2 - ends(y)[0] ** 2) / 2 - x0 * (ends(y)[1] - ends(y)[0]),
            lambda y: (y - y0) * (ends(y)[1] - ends(y)[0]),
        )
        sums += [quad(m, low, high)[0] for m in moments]
    assert bottom == pytest.approx(breaks[0])
    area, x, y = body.area_and_centroid
    assert_allclose((area, area * x, area * y), sums, rtol=1e-9)


def test_line_forces():
    """Ice and a force on the faces, an inclined anchor: by hand for the dam without batter."""
    leaning = {"anchor_force": 2e6, "anchor_angle": 30.0}
    other = {"force_x": -3e4, "force_y": 5e4, "force_face": "downstream", "force_at": 9.0}
    settings = {"ice_force": 1e5, "ice_level": 30.0} | leaning | other
    case = large(settings)
    assert_allclose(load_of(case, "ice"), (1e5, 0, -1e5 * 30))
    pull = -2e6 * np.array([0.5, math.sqrt(0.75)])
    assert_allclose(load_of(case, "anchor"), (*pull, -31.5 * pull[1] - 45 * pull[0]))
    x = -9 * 29 / 45  # of the downstream face, from the toe
    assert_allclose(load_of(case, "force"), (-3e4, 5e4, x * 5e4 + 9 * 3e4))
    lifted = large(settings | {"joint_height": 31.0})
    assert {row.name for row in gravity.at(lifted, 1).loads}.isdisjoint({"ice", "force"})


def test_loads_increase_linearly_up_to_their_time():
    settings = {"silt_height": 10.0, "silt_t": 2.0, "ice_force": 1e5, "k_h": 0.1}
    case = load("dam", settings, "45,45,45")
    moments = lambda time: {row.name: row.moment for row in gravity.at(case, time).loads}
    assert "silt" not in moments(1) and "ice" not in moments(2)
    assert moments(1.25)["silt"] == pytest.approx(0.25 * moments(2)["silt"])
    assert moments(3)["silt"] == moments(2)["silt"]
    for name in ("ice", "earthquake", "added water pressure"):
        assert moments(2.5)[name] == pytest.approx(0.5 * moments(3)[name])


def test_uniform_pressure():
    """Modeling K: on the whole face; the level at which the dry dam overturns."""
    case = load("k")
    assert_allclose(load_of(case, "reservoir", 5.02), (WATER * 50.2, 0, -WATER * 251))
    assert gravity.at(case, 1, 49_247 / WATER).M == pytest.approx(0, abs=1e-4 * WEIGHT)


def test_inclined_joint():
    """Weight of a block on a joint that rises towards the toe: W cos, -W sin, and its moment."""
    case = load("dam", {"joint_slope": 10.0, "uplift": "none"}, "45", "0")
    found, lean = gravity.at(case, 1, 0.0), math.radians(10)
    weight = -found.loads[0].fy
    assert found.T == pytest.approx(-weight * math.sin(lean))
    assert found.N == pytest.approx(weight * math.cos(lean))
    assert found.M == pytest.approx(found.loads[0].moment)
    table = gravity.at(large({"joint_slope": -10.0}), 1).table()
    assert table["load"][-1] == "sum"
    for column in ("Fx", "Fy", "moment"):
        assert sum(table[column][:-1]) == pytest.approx(table[column][-1])


# -- uplift


def test_drains_that_reduce_the_head_of_the_reservoir():
    """USBR: a third of the difference remains at the drains."""
    settings = {"uplift": "drained", "drain_reference": "reservoir", "drain_effectiveness": 2 / 3}
    uplift = gravity.at(large(settings | {"drain_x": 5.0}), 1).uplift
    assert_allclose(uplift.s, [0, 0, 5, 34])
    assert_allclose(uplift.p / WATER, [45, 45, 3 + 42 / 3, 3])


# -- uplift in an earthquake

QUAKE = {"k_h": 0.1, "sigma_max": 0.0, "law": "bond"}


@pytest.mark.parametrize("uplift", ["cracked", "flow"])
def test_uplift_unchanged_by_an_earthquake(uplift):
    """That of the crack before it: of 2.42 m at 45 m."""
    settings = QUAKE | {"uplift": uplift, "quake_uplift": "unchanged"}
    before = gravity.at(large(settings | {"k_h": 0.0}), 1)
    assert before.crack_length == pytest.approx(2.42, abs=0.01)
    found = gravity.at(large(settings), 1)
    assert found.U == before.U and found.crack_length > before.crack_length
    assert found.tip_stress == pytest.approx(0, abs=1)
    crack = gravity.at(large(settings | {"quake_uplift": "crack"}), 1)
    assert crack.U > found.U and crack.crack_length > found.crack_length


@pytest.mark.parametrize("uplift", ["imposed", "drained", "cracked"])
def test_no_uplift_in_the_crack_that_an_earthquake_opens(uplift):
    """By quadrature of the pressure beside the crack, and without tension at its tip."""
    settings = QUAKE | {"uplift": uplift, "drain_x": 8.0}
    before = gravity.at(large(settings | {"k_h": 0.0}), 1)
    found = gravity.at(large(settings | {"quake_uplift": "zero"}), 1)
    a0, a = before.crack_length, found.crack_length
    assert found.uplift.p[0] == (before.uplift.p[0] if a0 else 0)
    pressure = lambda s: float(np.interp(s, before.uplift.s, before.uplift.p))
    parts = [(0, a0), (a, 34)]
    integrals = [
        sum(quad(lambda s, k=k: pressure(s) * (34 - s) ** k, *p, points=[8.0])[0] for p in parts)
        for k in (0, 1)
    ]
    assert (found.U, found.uplift.moment) == pytest.approx(integrals, rel=1e-7)
    # the resultant acts at a third of the uncracked length
    assert found.M == pytest.approx(found.N * (34 - a) / 3, rel=1e-9) and a > a0
    assert a < gravity.at(large(settings), 1).crack_length


def test_heads_are_measured_from_the_joint():
    """On a lift joint at 8 m: none from a tailwater at 3 m; on a slope from each end."""
    found = gravity.at(large({"joint_height": 8.0}), 1).uplift
    assert_allclose(found.p, np.array([37, 37, 0]) * WATER)
    length = RigidBlock(large({"joint_height": 8.0})).length
    assert found.force == pytest.approx(WATER * 37 * length / 2)
    assert found.moment == pytest.approx(WATER * 37 * length**2 / 3)
    case = large({"joint_slope": -5.0})
    found = gravity.at(case, 1).uplift
    assert found.p[-1] == pytest.approx(WATER * (3 + 34 * math.tan(math.radians(5))))


DRAINS = {"waterstop": 1.5, "drain_x": 4.0, "drain_effectiveness": 0.5, "drain_level": 6.0}


@pytest.mark.parametrize(
    "mode, crack, places, heads",
    [
        ("drained", 0.0, (0, 0, 4, 34), (45, 45, 6 + 0.5 * (45 - 42 * 4 / 34 - 6), 3)),
        ("drained", 2.0, (0, 0, 4, 34), (45, 45, 6 + 0.5 * (45 - 42 * 4 / 34 - 6), 3)),
        ("cracked", 2.0, (0, 2, 4, 34), (45, 45, 6 + 0.5 * (42 * 30 / 32 + 3 - 6), 3)),
        ("cracked", 5.0, (0, 5, 34), (45, 45, 3)),
        ("flow", 2.0, (0, 2, 34), (45, 45, 3)),
        ("imposed", 2.0, (0, 0, 34), (45, 45, 3)),
        ("waterstop", 2.0, (0, 0, 1.5, 1.5, 34), (45, 45, 45, 0, 0)),
        ("none", 2.0, (0, 0, 34), (0, 0, 0)),
    ],
)
def test_uplift_rules(mode, crack, places, heads):
    case = large(DRAINS | {"uplift": mode, "drains": 1.0})
    found = Uplift(case, RigidBlock(case), 45, 3, crack)
    assert_allclose(found.s, places)
    assert_allclose(found.p, np.array(heads) * WATER)
    pressure = lambda s: np.interp(s, found.s, found.p)
    kinks = [1.5, 2, 4, 5]
    assert found.force == pytest.approx(quad(pressure, 0, 34, points=kinks)[0])
    moment = quad(lambda s: pressure(s) * (34 - s), 0, 34, points=kinks)[0]
    assert found.moment == pytest.approx(moment)


@pytest.mark.parametrize("slope", [-8.0, 12.0])
@pytest.mark.parametrize("mode", ["cracked", "flow"])
def test_head_in_an_inclined_crack(mode, slope):
    """The reservoir's, at each height; beyond the tip linear to the toe's."""
    case = large({"uplift": mode, "joint_slope": slope})
    body = RigidBlock(case)
    found = Uplift(case, body, 45, 3, 9.0)
    assert_allclose(found.s, [0, 9, body.length])
    heights = 9 * math.sin(math.radians(slope)), 34 * math.tan(math.radians(slope))
    heads = [45, 45 - heights[0], max(3 - heights[1], 0)]
    assert_allclose(found.p, np.array(heads) * WATER)


#: A lift joint from 5 m at the heel to about 5.4 m or 4.6 m at the toe; level, tailwater.
DRY_ENDS = [
    (4.0, 5.3, 0.0),
    (4.0, 5.3, 5.35),
    (4.0, 5.6, 0.0),
    (4.0, 4.0, 3.0),
    (-4.0, 4.9, 4.8),
    (-4.0, 4.9, 4.4),
    (-4.0, 4.5, 5.2),
    (-4.0, 5.2, 0.0),
]


@pytest.mark.parametrize("slope, level, tail", DRY_ENDS)
@pytest.mark.parametrize("mode", ["imposed", "drained", "cracked", "flow"])
def test_uplift_between_dry_ends(mode, slope, level, tail):
    """imposed, drained without effect: linear between the pressures at heel and toe, zero where
    these are dry. cracked, flow: the head lies between those of the water that touches the joint
    and the exits below it; no water rises above these.
    """
    settings = {"joint_height": 5.0, "joint_slope": slope, "uplift": mode}
    case = large(settings | {"drain_effectiveness": 0.0})
    body = RigidBlock(case)
    (_, heel), (_, toe), length = body.heel, body.toe, body.length
    wet = [w for w, y in ((level, heel), (tail, toe)) if w > y]
    if mode in ("imposed", "drained") or not wet:
        p = [max(level - heel, 0), max(tail - toe, 0)]
        exact = lambda s: p[0] + (p[1] - p[0]) * s / length
    else:
        heads = [w if w > y else min(y, *wet) for w, y in ((level, heel), (tail, toe))]
        head = lambda s: heads[0] + (heads[1] - heads[0]) * s / length
        exact = lambda s: max(head(s) - heel - (toe - heel) * s / length, 0)
    found = Uplift(case, body, level, tail, 0.0)
    s = np.linspace(0, length, 50)
    assert_allclose(np.interp(s, found.s, found.p) / WATER, [exact(x) for x in s], atol=1e-9)


def test_drains_have_no_effect_if_the_crack_passes_them():
    """Drains that stop the crack leave it shorter; weak ones near the heel are passed."""
    settings = DRAINS | {"uplift": "cracked", "sigma_max": 0.0, "rho_dam": 2150.0}
    without = gravity.at(large(settings), 1)
    stopped = gravity.at(large(settings | {"drains": 1.0, "drain_x": 10.0}), 1)
    weak = {"drains": 1.0, "drain_x": 1.0, "drain_effectiveness": 0.05}
    passed = gravity.at(large(settings | weak), 1)
    assert 0 < stopped.crack_length < 10 < without.crack_length < 34
    assert len(stopped.uplift.s) == 4 and len(passed.uplift.s) == 3
    assert passed.crack_length == pytest.approx(without.crack_length, rel=1e-9)


def test_two_cracks_in_equilibrium():
    """Drains stop a crack of 2.09 m; a crack of 12.4 m past them is in equilibrium, too: N B = 3 M,
    B uncracked, with full head in the crack and the drained diagram beyond it.
    """
    drains = {"uplift": "cracked", "drains": 1.0, "drain_x": 6.0}
    settings = drains | {"dam_base": 30.0, "law": "bond", "sigma_max": 0.0, "adhesion": 0.0}
    found = gravity.at(load("dam", settings | {"mu": 1.2}, "44", "3"), 1)
    (longer,) = found.further
    dry = gravity.at(load("dam", settings | {"mu": 1.2, "uplift": "none"}, "44", "3"), 1)
    effectiveness = found.case["drain_effectiveness"]

    def forces(crack):
        x = np.array([0, crack, max(6.0, crack), 30])
        head = np.interp(x, [crack, 30], [44, 3])
        head[2] -= effectiveness * (head[2] - 3) * (crack < 6)
        p = WATER * head
        return dry.N - integral(x, p), dry.M - integral(x, p, 30 - x)

    def excess(crack):
        normal, moment = forces(crack)
        return normal * (30 - crack) - 3 * moment

    for method, crack in ((found, brentq(excess, 0, 5.9)), (longer, brentq(excess, 6.1, 25))):
        assert method.crack_length == pytest.approx(crack, rel=1e-9)
        assert method.SSF == pytest.approx(1.2 * forces(crack)[0] / dry.T, rel=1e-9)
    assert longer.tip_stress == pytest.approx(0, abs=1) and not longer.further
    (note,) = found.notes
    assert f"if it grows further, crack {longer.crack_length:.3g} m past the drains (6 m)" in note
    better = settings | {"drain_x": 4.0, "drain_effectiveness": 1.0}
    stopped = gravity.at(load("dam", better, "46.8", "3"), 1)
    (through,) = stopped.further
    assert stopped.stands and stopped.crack_length < 4
    assert not through.stands and through.crack_length == 30
    without = gravity.at(load("dam", settings | {"mu": 1.2, "drains": 0.0}, "44", "3"), 1)
    assert longer.crack_length == pytest.approx(without.crack_length, rel=1e-9)


@pytest.mark.parametrize(
    "seed",
    [seed if seed % 9 == 0 else pytest.param(seed, marks=pytest.mark.heavy) for seed in range(60)],
)
def test_all_crack_lengths_in_equilibrium_are_found(seed):
    """Against a scan of the tension at the tip."""
    dice = np.random.default_rng(seed)
    settings = {
        "dam_base": dice.uniform(26, 36),
        "law": ("bond", "friction")[seed % 2],
        "sigma_max": 0.0,
        "adhesion": (0.0, 5e4)[seed // 2 % 2],
        "G_t": 1e5,
        "uplift": "cracked",
        "drains": 1.0,
        "drain_x": dice.uniform(0.5, 20),
        "drain_effectiveness": dice.uniform(0, 1),
        "drain_level": dice.uniform(0, 25),
        "joint_slope": 0.0 if seed < 40 else seed - 49.5,
    }
    case = load("dam", settings, str(dice.uniform(38, 52)), str(dice.uniform(0, 15)))
    first = gravity.at(case, 1)
    at_tip = case.law.open_tension

    def too_much(crack):
        uplift = Uplift(case, first.body, first.level, first.tail_level, crack)
        state = replace(first, crack_length=crack, uplift=uplift, further=())
        return state.tip_stress > at_tip

    if not too_much(0.0):
        assert first.crack_length == 0 and not first.further
        return
    step = first.body.length / 4000
    scan = np.arange(first.body.length, 0, -step)[::-1][:-1]
    cracked = np.array([too_much(a) for a in scan])
    ends = scan[1:][cracked[:-1] & ~cracked[1:]]
    found = [one.crack_length for one in (first, *first.further) if one.stands]
    assert len(found) == len(ends) and np.all(np.abs(np.array(found) - ends) <= step)


# -- strength and factors


def test_tensile_strength():
    """No crack below it; beyond it none is left at the tip with law = rupture, else c/mu."""
    settings = {"uplift": "none", "rho_water": 1600.0}
    free = gravity.at(large(settings | {"sigma_max": 0.0}), 1)
    tension = gravity.at(large(settings | {"sigma_max": 1e9, "G_f": 1e9}), 1)
    assert tension.crack_length == 0 and tension.sigma_n_eff_heel == tension.tip_stress > 0
    strength = tension.tip_stress
    weaker = {"sigma_max": 0.99 * strength}
    assert gravity.at(large(settings | {"sigma_max": 1.01 * strength}), 1).crack_length == 0
    assert gravity.at(large(settings | weaker), 1).crack_length == pytest.approx(free.crack_length)
    friction = gravity.at(
        large(settings | {"law": "friction", "mu": 1.0, "adhesion": strength / 2}), 1
    )
    assert friction.tip_stress == pytest.approx(strength / 2, rel=1e-6)
    assert 0 < friction.crack_length < free.crack_length


def test_factors_and_position():
    found = gravity.at(large({"mu": 0.8, "adhesion": 1e5, "sigma_max": 0.0}), 1)
    holds = 0.8 * found.N + 1e5 * (34 - found.crack_length)
    assert found.SSF == pytest.approx(holds / found.T)
    # weight and tailwater (its thrust upstream and downwards) against reservoir and uplift
    rows = {row.name: row for row in found.loads}
    holding = rows["weight"].moment + rows["tailwater"].moment
    assert found.OSF == pytest.approx(holding / (found.uplift.moment - rows["reservoir"].moment))
    assert found.eccentricity == pytest.approx(34 / 2 - found.M / found.N)
    words = [gravity.position(x, 12) for x in (4.01, 8.1, 9.1, 3.1, 11.9, 12.1, -0.1)]
    third, half, base, outside = "middle third", "middle half", "within base", "outside"
    assert words == [third, half, base, half, base, outside, outside]
    dry = gravity.at(large({"uplift": "none"}, tail="0"), 1, 0.0)
    assert dry.SSF == dry.OSF == math.inf and dry.stands
