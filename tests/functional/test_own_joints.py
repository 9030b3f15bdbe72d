"""Geometries of one's own with several joints: a second joint that is strong, joints that meet."""

import numpy as np
import pytest
from blocks import write_blocks
from damjoint import InputError
from damjoint.engines.condensed.solve import check
from damjoint.engines.getdp import solve as getdp
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.mesh.mesh import mesh_of
from damjoint.model.fields import Solution
from damjoint.pictures.run_picture import PER_JOINT, picture
from damjoint.post.summary import joints_note, joints_table
from damjoint.solver.load_stepper import LoadStepper
from damjoint.statics.notes import notes
from damjoint.statics.verdict import verdict

WATER = 9810.0
#: Weight of a block of 10 m by 10 m [N/m].
WEIGHT = 100 * 2400 * 9.81
#: A tower of two blocks on a joint; two blocks side by side.
TOWER = {"low": (0, 0, 10, 5), "high": (0, 5, 10, 12)}
BLOCKS = {"left": (0, 0, 10, 10), "right": (10, 0, 20, 10)}
BASES = {"left base": (0, 0, 10, 0), "right base": (10, 0, 20, 0)}
CONTRACTION = {"contraction": (10, 0, 10, 10)}
SETTINGS = {"uplift": "none", "E": 2e10, "order": 1.0}
FRICTION = {"law": "friction", "adhesion": 0.0, "pena_tang": 0.0}


@pytest.fixture
def solved(tmp_path):
    """solved(blocks, joints, levels, **settings): the results of blocks on rock."""

    def run(blocks, joints, levels, fine=None, **settings):
        write_blocks(tmp_path / "own.msh", blocks, joints, fine=fine)
        (tmp_path / "own.case").write_text('geometry = "own.msh";')
        tails = levels if settings.pop("both_sides", False) else None
        case = load(str(tmp_path / "own.case"), SETTINGS | settings, levels, tails)
        check(case)
        return LoadStepper(case, interface_of(case)).run()

    return run


@pytest.mark.heavy
def test_a_strong_second_joint_tends_to_the_run_without_it(solved):
    """On the same mesh, with an error of first order in its compliance."""
    law = {"sigma_max": 1e4, "law": "bond", "adhesion": 5e4}
    base, lift = {"base": (0, 0, 10, 0)}, (0, 5, 10, 5)
    glued = {"a": TOWER["low"], "a/b": TOWER["high"]}
    one = solved(glued, base | {"_lift": lift}, [8, 10], **law).at()
    assert one["sigma_n"].min() < -1e5
    errors = []
    for stiffness in (1e13, 1e14, 1e15):
        strong = {"law": ("bond", "friction"), "adhesion": (5e4, 1e30)}
        strong |= {"K_N": (1e11, stiffness), "K_T": (5e10, stiffness)}
        results = solved(TOWER, base | {"lift": lift}, [8, 10], **(law | strong))
        assert results.case.joint_names == ("base", "lift")
        own = results.joints[0].at()
        errors.append(
            max(np.abs(own[n] - one[n]).max() / np.abs(one[n]).max() for n in ("sigma_n", "tau_1"))
        )
    assert errors[1] < 1e-6
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx(10, rel=0.01)


def test_an_open_contraction_joint_parts_two_dams(solved):
    """Each block has its own weight, and the left one all of the thrust."""
    soft = {"K_N": (1e11, 1e11, 1.0), "K_T": (5e10, 5e10, 1.0)}
    strong = FRICTION | {"adhesion": 1e30}
    result = solved(BLOCKS, BASES | CONTRACTION, [5], **strong, **soft)
    left, right, between = result.joints
    thrust = WATER * 5**2 / 2
    assert (left.last["N"], left.last["T"]) == pytest.approx((WEIGHT, thrust), rel=1e-6)
    assert right.last["N"] == pytest.approx(WEIGHT, rel=1e-6)
    assert abs(right.last["T"]) < 1e-6 * thrust and abs(between.last["N"]) < 1e-6 * thrust
    factors = [row[1] for row in joints_table(result, result.last["time"]).rows]
    assert [factor.startswith("(") for factor in factors] == [False, False, True]
    assert joints_note(result.case).startswith("(SSF): between bodies that other joints hold")


@pytest.mark.heavy
def test_a_stiff_contraction_joint_glues_two_blocks(solved):
    stiff = {"K_N": (1e11, 1e11, 1e16), "K_T": (5e10, 5e10, 1e16), "adhesion": 1e30}
    two = solved(BLOCKS, BASES | CONTRACTION, [5], **(FRICTION | stiff))
    glued = {"left": BLOCKS["left"], "left/right": BLOCKS["right"]}
    joints = BASES | {"_contraction": CONTRACTION["contraction"]}
    one = solved(glued, joints, [5], **(FRICTION | {"adhesion": 1e30}))
    assert two.last["crest_ux"] == pytest.approx(one.last["crest_ux"], rel=1e-6)
    for own, other in zip(two.joints, one.joints, strict=False):
        assert np.allclose(own.at()["sigma_n"], other.at()["sigma_n"], rtol=0, atol=1)


@pytest.mark.heavy
def test_blocks_of_different_friction_share_the_thrust(solved):
    """A smooth contraction joint transmits thrust only: both slide where it is mu_1 W + mu_2 W; the
    water stands above the crest, on which it does not press here.
    """
    smooth = FRICTION | {"mu": (0.3, 0.2, 1e-6)}
    results = solved(BLOCKS, BASES | CONTRACTION, [20], **smooth)
    level = (0.5 * WEIGHT / WATER + 50) / 10  # thrust of the water on 10 m of height
    assert results.last["level"] == pytest.approx(level, rel=1e-4)
    assert verdict(results) == "sliding on left base and right base"
    thrust = results.last["T"] + results.joints[1].last["T"]
    assert thrust == pytest.approx(0.5 * WEIGHT, rel=1e-4)


@pytest.mark.heavy
def test_slip_of_an_inclined_crack_inside_a_body(solved):
    """Under 100 MPa along x, at 20 degrees to it, with a friction of 30 degrees: 4 (1 - nu^2) tau b
    sqrt(1 - (x/b)^2) / E, with tau the shear stress less the friction, b half of the length.
    """
    angle, stress = np.radians(20), 1e8
    along = np.array([np.cos(angle), np.sin(angle)])
    ends = (*(12 - along), *(12 + along))
    joints = {"base": (0, 0, 24, 0), "crack": ends}
    soft = {"K_N": (1e4, 1e13), "K_T": (1e4, 1e13), "adhesion": (1e30, 0.0)}
    body = {"rho_dam": 0.0, "E": 25e9, "nu": 0.25, "face_load": "uniform", "order": 2.0}
    friction = {"law": "friction", "mu": np.tan(np.pi / 6), "pena_tang": 0.0}
    level = stress / WATER
    results = solved(
        {"body": (0, 0, 24, 24)},
        joints,
        [level],
        {"crack": 0.1},
        both_sides=True,
        **(soft | body | friction),
    )
    assert not results.stopped
    rows = results.joints[1].at()
    normal = stress * np.sin(angle) ** 2
    tau = stress * np.sin(angle) * np.cos(angle) - normal * np.tan(np.pi / 6)
    middle = np.abs(rows["s"] - 1) < 0.3
    assert -rows["sigma_n"][middle] == pytest.approx(normal, rel=0.02)
    slip = 4 * (1 - 0.25**2) * tau / 25e9 * np.sqrt(1 - (rows["s"][middle] - 1) ** 2)
    assert slip.max() == pytest.approx(3.8078e-3, rel=1e-3)
    assert np.abs(rows["delta_t1"][middle]) == pytest.approx(slip, rel=0.02)
    tips = np.abs(rows["s"] - 1) > 1 - 1e-9
    assert np.all(rows["delta_t1"][tips] == 0) and tips.sum() == 2
    with pytest.raises(InputError, match="joint crack must lie between two bodies"):
        getdp.check(results.case)


@pytest.mark.heavy
@pytest.mark.parametrize("dim", [2, 3])
def test_monoliths_are_in_equilibrium(dim):
    """The bases carry the thrust and the weight less the uplift."""
    solid = {"n_joint": 6.0, "h_dam": 12.0, "h_found": 40.0} if dim == 3 else {"n_joint": 20.0}
    case = load("monoliths", solid | {"dim": float(dim)}, [40.0])
    results = LoadStepper(case, interface_of(case)).run()
    *bases, contraction = results.joints
    share = 1 / len(bases) if dim == 3 else 1.0  # per metre of both monoliths
    area, thrust = (34 + 5) / 2 * 45, WATER * 40**2 / 2
    weight = 2400 * 9.81 * area
    total = {n: share * sum(own.last[n] for own in bases) for n in "NTU"}
    assert total["N"] + total["U"] == pytest.approx(weight, rel=1e-9)
    assert total["T"] == pytest.approx(thrust, rel=1e-4)  # elements that the waterline cuts
    assert contraction.last["U"] == 0
    if dim == 2:  # the downstream block holds what its contraction joint presses
        assert bases[1].last["T"] == pytest.approx(contraction.last["N"], rel=1e-6)


@pytest.mark.heavy
def test_water_enters_no_joint_at_the_downstream_face():
    """Above its end there, 31 m, too: the joint is wet up to the head of the base."""
    low, high = (
        LoadStepper(case, interface_of(case)).run().joints
        for case in (
            load("monoliths", {"n_joint": 20.0, "uplift": "imposed"}, [level])
            for level in (31.0, 31.1)
        )
    )
    for before, after in zip(low, high, strict=True):
        assert after.last["U"] == pytest.approx(before.last["U"], rel=0.01)
    head = 31.1 * 20 / 34  # where the joints meet
    assert high[2].last["U"] == pytest.approx(WATER * head**2 / 2, rel=0.01)


def test_an_end_beside_the_water_that_it_has_is_noted(tmp_path):
    """A heel on the crest, where no reservoir stands; a toe on the upstream face."""
    blocks = {"one": (0.0, 0.0, 10.0, 20.0), "two": (10.0, 0.0, 22.0, 20.0)}
    bases = {"left": (0, 0, 10, 0), "right": (10, 0, 22, 0)}
    (tmp_path / "own.case").write_text('geometry = "own.msh"; levels() = {22};')
    for ends, expected in (
        ((10, 0, 10, 20), []),
        ((10, 20, 10, 0), ["heel of joint between: at y = 20 m it lies on no face that the reser"]),
    ):
        write_blocks(tmp_path / "own.msh", blocks, bases | {"between": ends}, size=4.0)
        for uplift in ("imposed", "none"):
            settings = {"uplift": uplift, "crest_water": 0.0}
            noted = notes(load(str(tmp_path / "own.case"), settings))
            found = [note[: len(expected[0])] for note in noted if "heel" in note or "toe" in note]
            assert found == (expected if uplift == "imposed" else [])


@pytest.mark.heavy
def test_lateral_forces_of_each_monolith_balance():
    """Without a load along z: what its base carries is what its contraction joint presses."""
    case = load("monoliths", {"dim": 3.0, "n_joint": 10.0, "h_dam": 10.0, "h_found": 30.0}, [45.0])
    interface = interface_of(case)
    results = LoadStepper(case, interface).run()
    total = dict.fromkeys(("dam", "dam 2", "foundation"), 0.0)
    for own, joint, of_joint in zip(
        results.joints, interface.joints, results.case.of_joints, strict=True
    ):
        force = own.last["T_z"] * joint.width
        total[of_joint.upper] += force
        total[of_joint.lower] -= force
    contraction = results.joints[results.case.joint_names.index("contraction")].last
    assert contraction["N"] > 1e4 and contraction["N"] == pytest.approx(abs(contraction["T_z"]))
    assert list(total.values()) == pytest.approx([0, 0, 0], abs=1e-6 * contraction["N"])


@pytest.mark.heavy
def test_each_block_of_a_dam_across_a_valley_is_in_equilibrium():
    """Weight and reservoir by the mesh; base and contraction joints by contact and water. In the
    latter the water's resultant is rho g b H^2/2.
    """
    coarse = {"n_joint": 4.0, "h_dam": 16.0, "h_found": 50.0}
    case = load("valley_blocks", coarse, [45.0])
    stepper = LoadStepper(case, interface_of(case))
    results = stepper.run()
    assert not results.stopped and verdict(results) == "stands"
    equilibrium, state, mesh = stepper.model.equilibrium, stepper.state, mesh_of(case)
    total = {name: np.zeros(3) for name in mesh.solids}
    for name, body in mesh.solids.items():
        (_, table), *_ = body.cells
        corners = body.points[table]
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
        total[name] += [0, -2400 * 9.81 * volume, 0]
    weight = -total["dam"][1]
    for face in mesh.faces.values():
        if face.side == "up":
            (_, table), *_ = face.surface.cells
            a, b, c = (face.surface.points[table[:, i]] for i in range(3))
            depth = 45 - ((a + b + c) / 3)[:, 1]
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
            total[face.body] -= (WATER * depth * area) @ face.surface.normals
    parts = zip(equilibrium.interface.joints, equilibrium.laws.laws, equilibrium.water, strict=True)
    for k, (joint, law, water) in enumerate(parts):
        jump = joint.jumps(joint.at_points, state.jump)
        traction, _ = law.traction_and_tangent(jump, state.variables.joints[k])
        frames = joint.frames[joint.points.elements]
        force = -joint.points.weights @ np.einsum("qk,qkc->qc", traction, frames)
        wet = water.wetted.points
        pressure = wet.weights * state.pressures[k].water_points
        force += pressure @ joint.surface.normals[wet.elements]
        total[joint.mesh.upper] += force
        total[joint.mesh.lower] -= force
        if joint.mesh.name.startswith("contraction"):
            height = 45 - joint.surface.points[:, 1].min()
            assert pressure.sum() == pytest.approx(WATER * 1.5 * height**2 / 2, rel=1e-9)
    assert len(total) == 9
    for name in set(total) - {"foundation"}:
        assert np.abs(total[name]).max() < 1e-6 * weight
    # without fields a row of curves for each joint, not fifteen in the height of one
    figure = picture(Solution(results, {}, {}), ())
    assert figure.get_figheight() > len(results.joints) * PER_JOINT


@pytest.mark.heavy
@pytest.mark.parametrize("order", [1.0, 2.0])
@pytest.mark.parametrize("waterstop", [0.0, 0.7, 3.0])
def test_water_in_a_contraction_joint_up_to_its_waterstop(waterstop, order):
    """rho g b H^2/2 on either face, also where the waterstop cuts elements; each monolith carries
    it, less the contact with the other one, to its base.
    """
    solid = {"n_joint": 6.0, "h_dam": 12.0, "h_found": 40.0, "dim": 3.0, "order": order}
    water = {"uplift": ("imposed", "imposed", "waterstop"), "waterstop": waterstop}
    case = load("monoliths", solid | water, [45.0])
    stepper = LoadStepper(case, interface_of(case))
    results = stepper.run()
    own, rows = results.joints[-1].last, results.joints[-1].at()
    pressure = WATER * waterstop * 45**2 / 2
    assert own["U"] * 45 == pytest.approx(pressure, rel=1e-9)
    beyond = rows["x"] > waterstop
    assert not rows["p"][beyond].any()
    if waterstop:
        assert rows["p"][~beyond] == pytest.approx(WATER * (45 - rows["y"][~beyond]), rel=1e-9)
    equilibrium, state = stepper.model.equilibrium, stepper.state
    across = []
    for k, joint in enumerate(equilibrium.interface.joints[:2]):
        jump = joint.jumps(joint.at_points, state.jump)
        traction, _ = equilibrium.laws.laws[k].traction_and_tangent(jump, state.variables.joints[k])
        frames = joint.frames[joint.points.elements]
        across.append(joint.points.weights @ np.einsum("qk,qk->q", traction, frames[:, :, 2]))
    pushed = pressure + 45 * own["N"]
    assert np.array(across) == pytest.approx([-pushed, pushed], rel=1e-6, abs=1e-6 * own["U"] + 1)


@pytest.mark.parametrize(
    "joints, settings, words",
    [
        (CONTRACTION, {}, "also meet beside the joint"),
        (BASES | CONTRACTION | {"free": (0, 8, 0, 2)}, {}, "joint free: must lie between two"),
        (BASES | CONTRACTION | {"edge": (0, 5, 5, 5)}, {}, "inside a body it must not touch"),
        (
            BASES | CONTRACTION,
            {"mu": (0.5, 0.6)},
            "mu = 0.5,0.6: must be one value, or one for each joint of the geometry (3: ",
        ),
        (BASES | CONTRACTION, {"lift_heights": (5.0,)}, "lift_heights: must not be set"),
        (
            BASES | CONTRACTION,
            {"uplift": ("none", "none", "waterstop"), "waterstop": 10.5},
            "waterstop = 10.5: must be < the joint's length (10 m)",
        ),
    ],
)
def test_bad_geometries_of_several_joints(solved, joints, settings, words):
    with pytest.raises(InputError) as error:
        solved(BLOCKS, joints, [5], **settings)
    assert words in str(error.value)
