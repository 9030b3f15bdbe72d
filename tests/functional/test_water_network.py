"""Water in joints that meet: one network, whose heads follow from its ends on the surface."""

import itertools

import numpy as np
import pytest
from blocks import write_blocks
from damjoint import InputError
from damjoint.engines.condensed.solve import check
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.model.loads import Loading
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.model import Model
from damjoint.statics import gravity
from damjoint.statics.rigid_block import RigidBlock
from damjoint.statics.uplift import Uplift
from damjoint.studies.report_input import limits

WATER = 9810.0
#: A long block beside a short one: bases of 10 and 5 m, a contraction joint of 10 m above x = 10.
BLOCKS = {"left": (0, 0, 10, 10), "right": (10, 0, 15, 10)}
BASES = {"left base": (0, 0, 10, 0), "right base": (10, 0, 15, 0)}
CONTRACTION = {"contraction": (10, 10, 10, 0)}
LENGTHS = np.array([10.0, 5.0, 10.0])
SETTINGS = {"law": "friction", "adhesion": 1e30, "pena_tang": 0.0, "E": 2e10, "order": 1.0}


@pytest.fixture
def model(tmp_path):
    """model(uplift, **settings): the blocks as a Model, with a mesh of 1 m."""

    def build(uplift, levels=(5.0,), tails=(0.0,), joints=None, blocks=None, **settings):
        write_blocks(tmp_path / "own.msh", blocks or BLOCKS, joints or BASES | CONTRACTION)
        (tmp_path / "own.case").write_text('geometry = "own.msh";')
        settings = SETTINGS | {"uplift": uplift} | settings
        case = load(str(tmp_path / "own.case"), settings, levels, tails)
        check(case)
        return Model(case)

    return build


def pressures(model, level, tail=0.0, jump=None):
    """Pressure at the nodes of each joint over the weight of the water, and their places (x, y)."""
    equilibrium, start = model.equilibrium, model.start()
    jump = start.jump if jump is None else jump
    found = equilibrium.water_in_step(start.variables).pressures(jump, Loading(level, tail))
    places = [joint.space.locations[:, :2] for joint in equilibrium.interface.joints]
    return [own.nodes / WATER for own in found], places, found


def opened(model, sizes):
    """Unknowns for which each joint is open by some measure [m], with a wave along it."""
    equilibrium = model.equilibrium
    jump, width = np.zeros(len(model.start().jump)), model.case["dim"]
    for joint, size in zip(equilibrium.interface.joints, sizes, strict=True):
        normals = joint.surface.normals[0][: int(width)]
        x = joint.space.locations @ [1.0, 0.7, 0.3]
        wanted = (size * (1 + 0.5 * np.sin(x)))[:, None] * normals
        jump += np.linalg.lstsq(joint.unknowns.toarray(), wanted.ravel(), rcond=None)[0]
    return jump


@pytest.mark.parametrize("flip", [False, True])
def test_two_blocks_have_the_uplift_of_one(flip):
    """The example: one line from heel to toe, and the drained one alike."""
    mu = {"mu": (0.8, 0.8, 0.6)}
    case = load("monoliths", {"n_joint": 20.0, **mu}, [40.0], [3.0 if flip else 0.0])
    results = LoadStepper(case, interface_of(case)).run()
    first, last = 40.0, 3.0 if flip else 0.0
    middle = first + (last - first) * 14 / 34
    uplift = [WATER * (first + middle) / 2 * 14, WATER * (middle + last) / 2 * 20]
    assert [own.last["U"] for own in results.joints[:2]] == pytest.approx(uplift, rel=1e-12)
    if not flip:
        assert uplift == pytest.approx([4.363e6, 2.308e6], rel=3e-4)
    for own in results.joints[:2]:
        rows = own.at()
        assert rows["p"] == pytest.approx(WATER * (first + (last - first) * rows["x"] / 34))


@pytest.mark.heavy
@pytest.mark.parametrize("reference", ["linear", "reservoir"])
def test_drains_lower_the_head_of_the_whole_path(model, reference):
    """Linear between heel, drains and toe, across the joint where the blocks meet."""
    drains = {"drain_x": (4.0, 2.0, 2.0), "drain_effectiveness": (0.5, 0.4, 0.0)}
    settings = drains | {"drain_reference": reference}
    for modes, knots in (
        (("drained", "imposed"), [4.0]),
        (("imposed", "drained"), [12.0]),
        (("drained", "drained"), [4.0, 12.0]),
    ):
        heads, places, _ = pressures(model((*modes, "none"), **settings), 9.0)
        effect, at = {4.0: 0.5, 12.0: 0.4}, list[float]()
        for x in knots:
            undrained = 9 * (1 - x / 15) if reference == "linear" else 9.0
            if at:  # what the drains before leave
                undrained = at[0] * (15 - x) / (15 - knots[0])
            at.append((1 - effect[x]) * undrained)
        for own, place in zip(heads[:2], places[:2], strict=True):
            expected = np.interp(place[:, 0], [0, *knots, 15], [9, *at, 0])
            assert own == pytest.approx(expected, abs=1e-12)


@pytest.mark.heavy
@pytest.mark.parametrize("uplift", ["flow", "cracked"])
def test_closed_joints_in_series_have_the_imposed_pressure(model, uplift):
    heads, places, _ = pressures(model((uplift, uplift, "none")), 9.0, 3.0)
    for own, place in zip(heads[:2], places[:2], strict=True):
        assert own == pytest.approx(9 - 6 * place[:, 0] / 15, rel=1e-12)


@pytest.mark.heavy
@pytest.mark.parametrize("apertures", [(1e-4, 3e-4), (3e-4, 1e-4), (1e-3, 1e-8), (1e-8, 1e-3)])
def test_two_apertures_in_series(model, apertures):
    """Resistances L/w^3: the same flux in both, and the head between them."""
    built = model(("flow", "flow", "none"), aperture_min=(*apertures, 1e-4))
    heads, places, found = pressures(built, 9.0, 3.0)
    resistance = LENGTHS[:2] / np.array(apertures) ** 3
    middle = 9 - 6 * resistance[0] / resistance.sum()
    for own, place in zip(heads[:2], places[:2], strict=True):
        assert own == pytest.approx(np.interp(place[:, 0], [0, 10, 15], [9, middle, 3]), rel=1e-12)
    flux = 1000 * WATER * 6 / (12 * built.case["visc"] * resistance.sum())
    assert [own.leakage for own in found[:2]] == pytest.approx([flux, flux], rel=1e-12)
    assert np.concatenate([own.flux for own in found[:2]]) == pytest.approx(flux, rel=1e-12)


@pytest.mark.heavy
@pytest.mark.parametrize("modes", [("flow", "imposed"), ("imposed", "flow"), ("cracked", "flow")])
def test_imposed_beside_flow_conducts_as_if_closed(model, modes):
    """By its aperture_min, also where it is open; cracked likewise where there is no crack."""
    sizes = [0.0 if mode == "flow" else 1e-3 * (mode == "imposed") for mode in modes]
    built = model((*modes, "none"), aperture_min=(1e-4, 2e-4, 1e-4))
    heads, places, _ = pressures(built, 9.0, 3.0, opened(built, [*sizes, 0.0]))
    resistance = LENGTHS[:2] / np.array([1.0, 8.0])
    middle = 9 - 6 * resistance[0] / resistance.sum()
    for own, place in zip(heads[:2], places[:2], strict=True):
        assert own == pytest.approx(np.interp(place[:, 0], [0, 10, 15], [9, middle, 3]), rel=1e-12)


@pytest.mark.heavy
@pytest.mark.parametrize("mode", ["imposed", "flow"])
@pytest.mark.parametrize("apertures", [(1e-4, 2e-4, 3e-4), (1e-8, 1e-3, 1e-8), (1e-3, 1e-8, 1e-3)])
def test_three_joints_at_a_node(model, mode, apertures):
    """The fluxes balance: H = sum(H_k w_k^3/L_k) / sum(w_k^3/L_k); imposed with equal w."""
    level, tail = 12.0, 3.0
    built = model(mode, [level], [tail], aperture_min=apertures)
    heads, places, found = pressures(built, level, tail)
    conductance = np.array(apertures if mode == "flow" else (1, 1, 1)) ** 3 / LENGTHS
    ends = np.array([level, tail, level])
    middle = ends @ conductance / conductance.sum()
    for own, place in zip(heads[:2], places[:2], strict=True):
        line = np.interp(place[:, 0], [0, 10, 15], [level, middle, tail])
        assert own == pytest.approx(line, rel=1e-12)
    y = places[2][:, 1]
    assert heads[2] + y == pytest.approx(np.interp(y, [0, 10], [middle, level]), rel=1e-12)
    if mode == "flow":
        left, right, down = (own.leakage for own in found)
        assert left + down == pytest.approx(right, rel=1e-12)
        drop = conductance @ (ends - ends[1]) / conductance.sum()
        assert right == pytest.approx(
            1000 * WATER * conductance[1] * drop / (12 * built.case["visc"]), rel=1e-12
        )


@pytest.mark.parametrize("mode", ["imposed", "flow"])
@pytest.mark.parametrize("third", [True, False])
@pytest.mark.parametrize("level", [8.0, 12.0])
def test_joints_that_meet_in_3d(mode, third, level):
    """Two blocks 1 m thick, bases of 5 m, a vertical joint of 10 m with its heel on top, dry or
    under water: as in the plane, with two or three joints at a line.
    """
    uplift = (mode, mode, mode if third else "none")
    apertures = (1e-4, 2e-4, 3e-4)
    settings = {"dim": 3.0, "uplift": uplift, "aperture_min": apertures}
    built = Model(load("ssnp143", settings, [level], [3.0]))
    heads, _, found = pressures(built, level, 3.0)
    width = np.array(apertures if mode == "flow" else (1, 1, 1)) ** 3
    conductance = width / [5, 5, 10] * [1, 1, third and level > 10]
    middle = conductance @ [level, 3, level] / conductance.sum()
    top = level if level > 10 else middle
    for k, joint in enumerate(built.equilibrium.interface.joints[: 2 + third]):
        x, y, _ = joint.space.locations.T
        bases = np.interp(x, [-5, 0, 5], [level, middle, 3])
        expected = bases if k < 2 else np.interp(y, [0, 10], [middle, top])
        assert heads[k] == pytest.approx(np.maximum(expected - y, 0), abs=1e-9)
    if mode == "flow":
        into = 1000 * WATER * conductance * [level - middle, middle - 3, level - middle]
        flux = [own.leakage for own in found[: 2 + third]]
        expected = into[: 2 + third] / (12 * built.case["visc"])
        assert flux == pytest.approx(expected, rel=1e-9, abs=1e-9 * expected.max())


@pytest.mark.heavy
@pytest.mark.parametrize("level", [25.0, 45.0])
def test_the_bases_of_blocks_have_the_uplift_of_one_base(level):
    """Of the dam across a valley, in one piece and in blocks of 15 m; by the meshes to 2e-4."""
    total = {}
    for name in ("valley", "valley_blocks"):
        coarse = {"n_joint": 8.0, "h_dam": 10.0, "h_found": 40.0, "order": 1.0}
        built = Model(load(name, coarse, [level]))
        start = built.start()
        water = built.equilibrium.water_in_step(start.variables)
        found = water.pressures(start.jump, Loading(level, 0.0))
        total[name] = sum(
            water.wetted.points.weights @ own.water_points
            for water, own in zip(built.equilibrium.water, found, strict=True)
            if not water.joint.mesh.name.startswith("contraction")
        )
    assert total["valley_blocks"] == pytest.approx(total["valley"], rel=2e-4)


@pytest.mark.parametrize("mode", ["imposed", "flow"])
def test_no_water_enters_at_a_dry_end(model, mode):
    """The crest is dry above the head where the joints meet; none is in a dry network."""
    built = model(mode, [6.0])
    heads, places, found = pressures(built, 6.0)
    assert heads[0] == pytest.approx(6 * (1 - places[0][:, 0] / 15), abs=1e-12)
    assert heads[2] == pytest.approx(np.maximum(2 - places[2][:, 1], 0), abs=1e-12)
    if mode == "flow":
        assert abs(found[2].leakage) < 1e-12 * found[0].leakage
    for own in pressures(built, 0.0)[0]:
        assert not own.any()


@pytest.mark.parametrize("mode", ["imposed", "flow"])
def test_water_leaves_at_a_dry_end(model, mode):
    """At the head of its elevation: the toe of the contraction joint is at y = 10 on the crest."""
    joints = BASES | {"contraction": (10, 0, 10, 10)}
    built = model(mode, [20.0], joints=joints, joint_head_offset=20.0)
    heads, places, found = pressures(built, 20.0)
    middle = (40 / 10 + 0 / 5 + 10 / 10) / (1 / 10 + 1 / 5 + 1 / 10)
    assert heads[0] == pytest.approx(40 + (middle - 40) * places[0][:, 0] / 10, rel=1e-12)
    y = places[2][:, 1]
    assert heads[2] == pytest.approx((middle - 10) * (1 - y / 10) + 10 - y, abs=1e-11)
    if mode == "flow":
        left, right, out = (own.leakage for own in found)
        assert out > 0 and left == pytest.approx(right + out, rel=1e-12)


@pytest.mark.parametrize(
    "uplift, left, right",
    [
        (("imposed", "none", "none"), 7.0, 0.0),
        (("none", "imposed", "none"), 0.0, 2.0),
        (("waterstop", "imposed", "none"), None, 2.0),
    ],
)
def test_a_path_ends_at_a_joint_without_water(model, uplift, left, right):
    """And at a waterstop: the head is that of the end that the water reaches."""
    heads, places, _ = pressures(model(uplift, [7.0], [2.0], waterstop=4.0), 7.0, 2.0)
    if left is None:
        assert np.array_equal(heads[0] > 0, places[0][:, 0] <= 4)
    else:
        assert heads[0] == pytest.approx(left, abs=1e-12)
    assert heads[1] == pytest.approx(right, abs=1e-12)


@pytest.mark.heavy
@pytest.mark.parametrize("mode", ["imposed", "flow"])
def test_a_waterstop_behind_another_joint(model, mode):
    """The head before it is that where the joints meet: of the reservoir without another outlet."""
    built = model((mode, "waterstop", "none"), [9.0], [2.0], waterstop=2.0)
    heads, places, _ = pressures(built, 9.0, 2.0)
    assert heads[0] == pytest.approx(9.0)
    assert heads[1] == pytest.approx(9.0 * (places[1][:, 0] <= 12))
    *_, found = pressures(built, 9.0, 2.0)
    assert found[1].water_points == pytest.approx(9.0 * WATER)
    joints = BASES | {"contraction": (10, 0, 10, 10)}
    built = model((mode, mode, "waterstop"), [9.0], [3.0], joints=joints, waterstop=2.0)
    heads, places, _ = pressures(built, 9.0, 3.0)
    y = places[2][:, 1]
    assert heads[2] == pytest.approx((5.0 - y) * (y <= 2))
    assert heads[0] == pytest.approx(9 - 0.4 * places[0][:, 0])


@pytest.mark.parametrize("uplift", [("flow", "flow", "none"), ("flow",) * 3])
def test_derivative_of_the_pressure(model, uplift):
    """By finite differences, at random openings."""
    built = model(uplift, [12.0], aperture_min=(1e-4, 2e-4, 3e-4))
    variables, loading = built.start().variables, Loading(12.0, 1.0)
    (system,) = built.equilibrium.flowing
    jump = opened(built, [2e-3, 3e-3, 4e-3])
    solution = system.solve(jump, variables, loading)
    derivative = system.derivative(jump, variables, solution, None)
    way = np.random.default_rng(1).normal(size=len(jump)) * 1e-8
    above, below = (system.solve(jump + s * way, variables, loading).pressure for s in (1, -1))
    expected = derivative.pressure @ way[derivative.columns]
    assert np.abs(expected).max() > 1e-3
    assert (above - below) / 2 == pytest.approx(expected, rel=1e-4, abs=1e-6 * np.ptp(expected))


@pytest.mark.heavy
@pytest.mark.parametrize("opening", [1e-6, 1e-3])
def test_fluxes_balance_beside_open_joints(model, opening):
    """However much better one of them conducts, in each direction."""
    for sizes in ((opening, 0, 0), (0, opening, 0), (0, 0, opening), (opening, 0, opening)):
        built = model("flow", [12.0], aperture_min=1e-8)
        _, _, found = pressures(built, 12.0, 1.0, opened(built, sizes))
        left, right, down = (own.leakage for own in found)
        assert left + down == pytest.approx(right, rel=1e-9)
        assert right > 0


@pytest.mark.parametrize(
    "uplift, settings, words",
    [
        (("drained", "flow", "none"), {"drain_x": 2.0}, "uplift = drained, flow: must not be"),
        (
            ("flow", "flow", "none"),
            {"drains": 1.0, "drain_x": 2.0, "drain_effectiveness": (0.5, 0.6, 0.5)},
            "drain_effectiveness = 0.5, 0.6: must be the same in joints that meet (left base and",
        ),
        ("drained", {"drain_x": 2.0}, "uplift = drained: must be another one where"),
    ],
)
def test_settings_of_joints_that_meet(model, uplift, settings, words):
    with pytest.raises(InputError) as error:
        model(uplift, **settings)
    assert words in str(error.value)


@pytest.mark.parametrize(
    "uplift, settings",
    [
        (("imposed", "imposed", "none"), {}),
        (("imposed", "imposed", "imposed"), {}),
        (("drained", "drained", "none"), {"drain_x": (4.0, 2.0, 1.0)}),
        (("imposed", "drained", "none"), {"drain_x": 2.0, "drain_reference": "reservoir"}),
        (("imposed", "none", "none"), {}),
        (("none", "imposed", "imposed"), {}),
        (("waterstop", "imposed", "none"), {"waterstop": 3.0}),
    ],
)
def test_the_gravity_method_has_the_same_uplift(model, uplift, settings):
    """Of each joint, its moment about the toe, too; the contraction joint's crest is dry."""
    built = model(uplift, [9.0], [2.0], **settings)
    level, tail = 9.0, 2.0
    for number, own in enumerate(built.case.joints):
        body = RigidBlock(own)
        found = Uplift(own, body, level, tail, 0.0)
        water = built.equilibrium.water[number]
        points, joint = water.wetted.points, water.joint
        pressure = pressures(built, level, tail)[2][number].water_points
        toe = np.array([*body.toe, 0.0])
        arm = np.linalg.norm(points.positions - toe, axis=1)
        sizes = points.weights * pressure
        # the pressure of the water at rest ends between two nodes of the contraction joint
        kink = WATER * (1.0 if joint.mesh.name == "contraction" else 1e-9)
        assert found.force == pytest.approx(sizes.sum(), abs=kink)
        assert found.moment == pytest.approx(sizes @ arm, abs=10 * kink)


@pytest.mark.heavy
def test_the_gravity_method_of_a_crack_on_a_path(model):
    """A crack of 5 m at the inner heel conducts freely: of 15 m of the path 10 m are left."""
    built = model(("cracked", "cracked", "none"), [9.0], [0.0])
    first, second, _ = built.case.joints
    found = Uplift(second, RigidBlock(second), 9.0, 0.0, 2.5)
    middle = 9 * (1 - 10 / 12.5)
    assert found.p[0] == pytest.approx(WATER * middle)
    assert found.force == pytest.approx(WATER * (middle * 2.5 + middle * 2.5 / 2))
    found = Uplift(first, RigidBlock(first), 9.0, 0.0, 5.0)
    assert found.force == pytest.approx(WATER * (9 * 5 + (9 + 4.5) / 2 * 5))
    drained = model(("cracked",) * 2 + ("none",), drains=(1.0, 0.0, 0.0), drain_x=6.0)
    first, second, _ = drained.case.joints
    found = Uplift(first, RigidBlock(first), 9.0, 0.0, 3.0)
    at = 0.5 * 9 * 9 / 12
    assert found.force == pytest.approx(
        WATER * (9 * 3 + (9 + at) / 2 * 3 + (at + at * 5 / 9) / 2 * 4)
    )


@pytest.mark.heavy
def test_the_report_says_that_water_passes_between_joints(model):
    words = "Water passes between joints that meet"
    for uplift in ("imposed", ("none", "none", "imposed"), "none"):
        sentences = limits(model(uplift).case)
        assert any(words in sentence for sentence in sentences) == (uplift != "none")


@pytest.mark.heavy
def test_the_gravity_method_of_several_heels(model):
    """The water reaches the contraction joint's at 10 m; none if it leaves at several toes."""
    built = model("imposed", [12.0])
    for own, length, ends in zip(
        built.case.joints, LENGTHS, ([12, 6], [6, 0], [12, 6]), strict=True
    ):
        found = Uplift(own, RigidBlock(own), 12.0, 0.0, 0.0)
        bottom = 0.5 * 10**2 if length == 10 and own.section["heel_y"][0] else 0.0
        assert found.force == pytest.approx(WATER * (sum(ends) / 2 * length - bottom))
    with pytest.raises(InputError, match="uplift = imposed: has no gravity method where joints"):
        Uplift(own, RigidBlock(own), 12.0, 11.0, 0.0)
    own = model("imposed", [12.0], joints=BASES | {"contraction": (10, 0, 10, 10)}).case.joints[0]
    with pytest.raises(InputError, match="uplift = imposed: has no gravity method where joints"):
        Uplift(own, RigidBlock(own), 12.0, 0.0, 0.0)
    several = "water leaves at more than one toe, or at a heel"
    assert gravity.obstacle(own, {}, {"time": 1.0}) == several
    assert gravity.of_state(own, {}, {"time": 1.0}) is None


@pytest.mark.heavy
@pytest.mark.parametrize(
    "uplift, tail, settings",
    [
        ("imposed", 2.0, {}),
        ("drained", 1.0, {"drain_x": (2.0, 2.0), "drain_effectiveness": (0.6, 0.0)}),
        ("flow", 0.0, {"aperture_min": 1e-5}),
        ("cracked", 2.0, {}),
        ("cracked", 0.0, {"drains": (1.0, 0.0), "drain_x": 6.0}),
        ("flow", 0.0, {"drains": (0.0, 1.0), "drain_x": (2.0, 1.0)}),
    ],
)
def test_a_joint_in_two_parts_is_one_joint(tmp_path, uplift, tail, settings):
    """A block opens one joint, or two in series: the same water and jumps."""
    block, ends, found = {"block": (0, 0, 15, 24)}, (0, 10, 15), []
    for number in (1, 2):
        places = ends if number == 2 else (ends[0], ends[-1])
        joints = {f"part {x}": (x, 0, x1, 0) for x, x1 in itertools.pairwise(places)}
        write_blocks(tmp_path / "own.msh", block, joints | {"_line": (0, 0, 10, 0)})
        (tmp_path / "own.case").write_text('geometry = "own.msh";')
        own = {
            n: v if number == 2 or not isinstance(v, tuple) else v[0] for n, v in settings.items()
        }
        if number == 1 and own.get("drains") == 0:
            own |= {"drains": 1.0, "drain_x": ends[1] + settings["drain_x"][1]}
        law = {"law": "bond", "sigma_max": 1e4, "adhesion": 1e5, "G_f": 20.0, "order": 1.0}
        case = load(
            str(tmp_path / "own.case"),
            law | {"uplift": uplift, "E": 2e10, "tolerance": 1e-12} | own,
            [20.0, 23.5],
            [tail],
        )
        results = LoadStepper(case, interface_of(case)).run()
        assert not results.stopped
        rows = [joint.at() for joint in results.joints]
        table = {n: np.concatenate([own[n] for own in rows]) for n in ("x", "p", "delta_n")}
        order = np.unique(np.round(table["x"], 6), return_index=True)[1]
        found.append({n: values[order] for n, values in table.items()})
        found[-1]["U"] = sum(joint.last["U"] for joint in results.joints)
        found[-1]["flux"] = results.joints[-1].last["flux"]
    one, two = found
    assert one["delta_n"].max() > 1e-5
    for name, values in one.items():
        assert two[name] == pytest.approx(values, rel=1e-6, abs=1e-9 * np.abs(values).max())
