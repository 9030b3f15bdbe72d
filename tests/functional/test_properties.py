"""Properties of random dams (hypothesis, with a fixed seed): results do not depend on units,
numbering or position of the mesh, nor on the steps.
"""

import re
from dataclasses import replace
from functools import partial

import damjoint as dj
import numpy as np
import pytest
from damjoint import InputError, runner
from damjoint.input.parameters import AUTOMATIC, declared
from damjoint.input.resolve import load
from damjoint.laws import COLUMNS
from damjoint.mesh.mesh import Mesh
from damjoint.model.results import (
    FILM,
    FLUX,
    HISTORY,
    IN_TIME,
    JOINT,
    OF_POINT,
    QUAKE,
    THICKNESS,
)
from damjoint.studies import sensitivity
from damjoint.studies.critical import Search
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from own_mesh import OwnMesh, Shuffled
from variants import further

#: Without the search for a simpler failing example, which would take minutes.
few = settings(max_examples=8, deadline=None, derandomize=True, phases=[Phase.generate])

#: A coarse mesh of the default dam.
COARSE = {"n_joint": 4.0, "order": 1.0, "h_dam": 15.0, "h_found": 60.0}
#: One with batter and neck.
SECTION = {"n_joint": 10.0, "h_dam": 15.0, "h_found": 60.0, "batter": 3.0, "neck_height": 5.0}
#: Joints that crack, soften and slip below the requested levels, and still stand.
LAWS = {
    "rupture": {"sigma_max": 1e4, "G_f": 10.0},
    "friction": {"adhesion": 1e4, "mu": 0.9},
    "bond": {"sigma_max": 1e5, "G_f": 100.0, "adhesion": 2e5},
}
joints = st.builds(
    lambda law, uplift, order: {"law": law, "uplift": uplift, "order": order} | LAWS[law],
    st.sampled_from(list(LAWS)),
    st.sampled_from(["none", "imposed", "drained", "cracked", "flow"]),
    st.sampled_from([1.0, 2.0]),
)
levels = st.floats(28, 44)

#: Columns that are compared with the largest value of their group, and those of counts.
GROUPS = [
    ("delta_n", "delta_t1", "delta_t2", "slip", "lambda"),
    ("sigma_n", "tau_1", "tau_2", "p", "sigma_n_eff"),
    ("p_max", "p_min"),
]
COUNTS = "iterations", "cuts", "residual"


def differences(one, other):
    """Largest difference of each column of two tables, relative to the maximum of its group."""
    group = {name: group for group in GROUPS for name in group}
    size = {n: max(np.abs(one[g]).max() for g in group.get(n, [n]) if g in one) for n in one}
    return {n: np.abs(one[n] - other[n]).max() / max(size[n], 1e-300) for n in one}


def same(one, other, changed=None, within=1e-6):
    """Whether two results agree; changed: conversion of a column of the first to the second."""
    for a, b in ((one.joint, other.joint), (one.history, other.history)):
        wanted = {n: (changed or {}).get(n, lambda v: v)(v) for n, v in a.items()}
        off = {n: d for n, d in differences(wanted, b).items() if n not in COUNTS and d > within}
        assert not off


@pytest.fixture(scope="module")
def solve(tmp_path_factory):
    """solve(case): the result of its only scene."""
    folder = tmp_path_factory.mktemp("out")
    return lambda case: runner.run(case, folder, fields=False, picture=False, progress=False)[0]


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """own(mesh, numbering, settings, levels, tail): a case with a mesh file."""
    path = tmp_path_factory.mktemp("own") / "own.msh"

    def case(mesh, changed, level, tail=3.0, numbering=None):
        mesh.write(path, numbering)
        file = path.with_suffix(".case")
        file.write_text(f'geometry = "{path.name}";\n')
        return load(str(file), changed, f"30,{level!r}", f"{tail!r}")

    return case


@pytest.fixture(scope="module")
def mesh():
    """The mesh of the section."""
    return OwnMesh.of(load("dam", SECTION | {"joint_slope": 2.0}))


# -- units
# --------------------------------------------------------------------------------------------------

#: Exponents of length, stress and acceleration in each unit.
DIMENSIONS = {
    **dict.fromkeys(["-", "degrees", "K", "per K", "1/K"], (0, 0, 0)),
    "m": (1, 0, 0),
    "m2": (2, 0, 0),
    "Pa": (0, 1, 0),
    "Pa per m": (-1, 1, 0),
    "m per Pa": (1, -1, 0),
    **dict.fromkeys(["N per m", "N/m"], (1, 1, 0)),
    **dict.fromkeys(["N m per m", "N m/m"], (2, 1, 0)),
    **dict.fromkeys(["m per s2", "m/s2"], (0, 0, 1)),
    "kg per m3": (-1, 1, -1),
    "kg/m2": (0, 1, -1),
    "s": (0.5, 0, -0.5),
    "Hz": (-0.5, 0, 0.5),
    "Pa s": (0.5, 1, -0.5),
    "Pa s per m": (-0.5, 1, -0.5),
    "kg/(m s)": (0.5, 1, -0.5),
}
#: All kinds of loads.
LOADS = {"silt_height": 10.0, "ice_force": 1e5, "anchor_force": 1e5, "k_h": 0.05, "force_x": 1e4}
#: In the first step the joint slips at heel and toe: the next ones start on the yield surface.
LOADS |= {"temperature_dam": -5.0}


def in_units(case, units):
    """A case whose units of length, stress and acceleration are smaller by these factors."""
    factor = lambda unit: float(np.prod(np.power(units, DIMENSIONS[unit])))
    values = {
        name: case[name]
        if p.text or (p.automatic and case[name] == AUTOMATIC)
        else case[name] * factor(re.search(r"\[(.*)\]$", p.label)[1])
        for name, p in declared().items()
        if name not in ("pena_rupture", "pena_tang")  # follow G_f, K_N and K_T
    }
    text = lambda heights: ",".join(repr(height * factor("m")) for height in heights)
    case = load("dam", values, text(case.levels), text(case.tail_levels))
    columns = QUAKE | JOINT | COLUMNS | FLUX | FILM | THICKNESS | HISTORY | IN_TIME | OF_POINT
    scaled = {name: partial(np.multiply, factor(unit)) for name, (unit, _) in columns.items()}
    return case, scaled


@pytest.mark.heavy
@few
@given(joints, levels, st.sampled_from(["level", "crest"]), st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_results_do_not_depend_on_units(solve, joint, level, drive, powers):
    """Each parameter is converted by the unit in its label, each column by that of the tables. The
    units differ by factors up to 3.2: a density of concrete remains below what is allowed.
    """
    case = load("dam", SECTION | LOADS | joint | {"drive": drive}, f"30,{level!r}", "3")
    other, scaled = in_units(case, 10 ** np.array(powers))
    same(solve(case), solve(other), scaled)


#: Factors of length, stress and acceleration from SI units.
SYSTEMS = {"mm, t, s": (1e3, 1e-6, 1e3), "m, t, s": (1.0, 1e-3, 1.0)}
#: Units that change no digit.
BINARY = 2.0**4, 2.0**-4, 2.0**4
RUPTURE, BOND = (LAWS[law] | {"law": law} for law in ("rupture", "bond"))
ENDO = {"law": "endo", "sigma_max": 1e5, "adhesion": 1e5}
MIXED = {"law": "mixed", "softening": "exponential", "sigma_max": 5e5, "G_f": 1e4}
IN_TIME_STEPS = BOND | {"uplift": "flow", "time_unit": 60.0, "storage": 1e-11, "k_h": 0.0}
SHAKEN = BOND | {"drive": "point", "drive_load": "quake", "drive_at": 45.0}
#: Scenes in which rounding grows little: settings, engine.
CONSISTENT = {
    "rupture, drained": (RUPTURE | {"uplift": "drained"}, "auto"),
    "friction, imposed": (LAWS["friction"] | {"law": "friction"}, "auto"),
    "bond, cracked": (BOND | {"uplift": "cracked"}, "auto"),
    "bond, flow": (BOND | {"uplift": "flow", "softening": "exponential"}, "auto"),
    "endo, waterstop": (ENDO | {"uplift": "waterstop", "waterstop": 5.0}, "auto"),
    "controlled": (BOND | {"drive": "crest"}, "auto"),
    "controlled point": (
        BOND | {"drive": "point", "drive_load": "force", "drive_at": 45.0, "force_x": 1e6},
        "auto",
    ),
    "controlled earthquake": (SHAKEN, "auto"),
    "controlled energy": (BOND | {"drive": "dissipation", "drive_energy": 1e3}, "auto"),
    "mixed": (MIXED, "auto"),
    "in time": (IN_TIME_STEPS, "auto"),
    "grouted": (RUPTURE | {"grout_pressure": 5e4}, "auto"),
    "getdp, rupture": (RUPTURE | {"uplift": "cracked"}, "getdp"),
    "getdp, bond": (BOND | {"uplift": "flow"}, "getdp"),
    "getdp, controlled": (SHAKEN, "getdp"),
    "getdp, mixed": (MIXED, "getdp"),
    "getdp, in time": (IN_TIME_STEPS, "getdp"),
}


@pytest.mark.heavy
@few
@given(joints, levels, st.sampled_from(["level", "crest"]), st.sampled_from(list(SYSTEMS)))
def test_results_in_other_consistent_units(solve, joint, level, drive, system):
    """To ten digits, on Gmsh's free mesh."""
    case = load("dam", SECTION | LOADS | joint | {"drive": drive}, f"30,{level!r}", "3")
    other, scaled = in_units(case, SYSTEMS[system])
    same(solve(case), solve(other), scaled, within=1e-10)


@pytest.mark.heavy
def test_gmsh_meshes_a_section_in_mm_as_in_m():
    """Automatic and given sizes; in 3D. The last digit of a length would move nodes."""
    lengths = {"dam_height": 63.07, "dam_base": 47.3, "dam_crest": 6.31, "batter": 2.9}
    for more, others in (
        ({}, {"n_joint": 13.0}),
        ({"h_dam": 2.37}, {"n_joint": 9.0, "lift_heights": (20.3, 41.1)}),
        ({"thickness": 11.3}, {"n_joint": 4.0, "dim": 3.0}),
    ):
        points = []
        for unit in (1.0, 1e3):
            scaled = {name: value * unit for name, value in (lengths | more).items()}
            lifts = tuple(unit * height for height in others.get("lift_heights", ()))
            changed = others | ({"lift_heights": lifts} if lifts else {})
            solids = Mesh(load("dam", scaled | changed, f"{30 * unit}")).solids.values()
            points.append(np.vstack([body.points for body in solids]))
        assert (1e3 * points[0] == points[1]).all()


@pytest.mark.heavy
@pytest.mark.parametrize("scene", [n for n, (_, engine) in CONSISTENT.items() if engine == "auto"])
def test_a_power_of_two_as_unit_changes_no_digit(solve, scene):
    """Every quantity is computed from others of its own unit: no hidden length, stress or time. (Of
    water in time the last digit changes.)
    """
    case = load("dam", SECTION | LOADS | CONSISTENT[scene][0], "30,43", "3")
    other, scaled = in_units(case, BINARY)
    one, two = solve(case), solve(other)
    for a, b in ((one.joint, two.joint), (one.history, two.history)):
        if scene == "in time":
            wanted = {n: scaled[n](v) for n, v in a.items() if n not in COUNTS}
            assert max(differences(wanted, b).values()) < 1e-14
        else:
            assert not {n for n, v in a.items() if (scaled[n](v) != b[n]).any()}


@pytest.mark.parametrize("system", further(1, SYSTEMS))
@pytest.mark.parametrize("scene", further(8, CONSISTENT))
def test_a_scene_in_other_consistent_units_has_the_same_results(tmp_path, scene, system):
    """To ten digits."""
    changed, engine = CONSISTENT[scene]
    case = load("dam", SECTION | LOADS | changed, "30,43", "3")
    other, scaled = in_units(case, SYSTEMS[system])
    one, two = (
        runner.run(c, tmp_path, fields=False, picture=False, progress=False, engine=engine)[0]
        for c in (case, other)
    )
    assert one.last["slip_length"] + one.last["process_zone"] > 0  # the joint is damaged
    for a, b in ((one.joint, two.joint), (one.history, two.history)):
        wanted = {n: scaled.get(n, lambda v: v)(v) for n, v in a.items() if n not in COUNTS}
        assert not {n: off for n, off in differences(wanted, b).items() if off > 1e-10}


@pytest.mark.heavy
def test_derivatives_with_parameters_that_are_zero_do_not_depend_on_units():
    """Their differences have no value to be a part of; with powers of two to the last digit."""
    settings = {"uplift": "imposed", "n_joint": 4.0, "order": 1.0, "h_dam": 15.0, "h_found": 60.0}
    case = load("dam", BOND | settings, "30", "3")
    other, scaled = in_units(case, BINARY)
    names = ["silt_height", "ice_force", "k_h", "joint_head_offset"]
    rows = [sensitivity.of_run(c, names) for c in (case, other)]
    for one, two in zip(*rows, strict=True):
        unit = DIMENSIONS[declared()[one.name].unit]
        factor = float(np.prod(np.power(BINARY, unit)))
        for column in ("crest_ux", "max_opening", "N", "T", "M", "U"):
            wanted = scaled[column](one.derivatives[column]) / factor
            assert two.derivatives[column] == wanted, (one.name, column)
    by = {row.name: row.derivatives for row in rows[0]}
    assert by["ice_force"]["T"] == pytest.approx(1, rel=1e-9)
    # p = K0 rho g h^2/2 has no slope at 0: of the weight of silt 1 m high
    assert abs(by["silt_height"]["T"]) < 1e-5 * 0.5 * 900 * 9.81 / 2
    assert by["joint_head_offset"]["U"] > 0


@pytest.mark.heavy
@pytest.mark.parametrize("units", [BINARY, *SYSTEMS.values()], ids=["binary", *SYSTEMS])
def test_studies_in_other_consistent_units_have_the_same_results(tmp_path, units):
    """Critical level, safety factors, a sweep, natural frequencies, an earthquake: to ten digits,
    with powers of two as units to the last one. (The dam must not rock for long: each time the
    joint closes, the rounding of the values grows tenfold, as any other difference would.)
    """
    within = 0 if units == BINARY else 1e-10
    length, _, acceleration = units
    settings = BOND | {"uplift": "imposed", "n_joint": 10.0, "h_dam": 15.0, "h_found": 60.0}
    case = load("dam", settings, "45", "3")
    other, scaled = in_units(case, units)
    one, two = (Search(c, "level").run() for c in (case, other))
    assert one.mode == two.mode
    assert two.value == pytest.approx(length * one.value, rel=within)
    assert two.gravity == pytest.approx(length * one.gravity, rel=within)
    one, two = (dj.check(c).rows for c in (case, other))
    for name in ("SSF", "OSF"):
        np.testing.assert_allclose(two[name], one[name], rtol=within, atol=within)
    one, two = (dj.sweep(c, jobs=1, mu=[0.7, 0.9]).rows for c in (case, other))
    for name in ("crest_ux", "slip_length"):
        np.testing.assert_allclose(two[name], length * one[name], rtol=within)
    one, two = (dj.modes(c).rows["frequency"] for c in (case, other))
    np.testing.assert_allclose(two, one * np.sqrt(acceleration / length), rtol=within)
    times = np.arange(0, 0.5, 0.02)
    wave = np.column_stack([times, 3 * np.sin(12 * times) * np.exp(-times)])
    record = tmp_path / "wave.csv"
    np.savetxt(record, wave, "%.6g", ",", header="time,horizontal", comments="")
    shaken = {"record_unit": "m/s2", "record_rest": 0.0}
    one = dj.quake(dj.case(case, **shaken), record=record).rows
    two = dj.quake(dj.case(other, **shaken, record_scale=acceleration), record=record).rows
    assert np.abs(one["slip_mean"]).max() > 1e-4 and one["open_length"].max() > 1
    names = [name for name in one.dtype.names if name not in COUNTS]
    wanted, two = {n: scaled[n](one[n]) for n in names}, {n: two[n] for n in names}
    assert not {n: off for n, off in differences(wanted, two).items() if off > within}


@pytest.mark.heavy
def test_reliability_and_calibration_in_mm_are_those_in_m(tmp_path):
    """To ten digits the distance of the design point, by as many critical levels: the size of the
    limit state does not decide where a search ends. Its values, of twelve digits as in the file,
    are differentiated twice for the probabilities.
    """
    units = length, stress, acceleration = SYSTEMS["mm, t, s"]
    density, modulus = stress / (length * acceleration), 2e10 * stress
    slides = {"law": "friction", "adhesion": 0.0, "pena_tang": 0.0, "uplift": "none"}
    case = load("dam", COARSE | slides | {"E_found": 2e10}, "30,36")
    other, _ = in_units(case, units)

    def reliability(case, length, density):
        about = lambda mean, deviation, unit: f"normal({mean * unit!r},{deviation * unit!r})"
        varied = {"rho_dam": about(2400, 50, density), "level": about(38.5, 0.8, length)}
        return dj.reliability(case, mu="lognorm(0.12,scale=0.6)", **varied, samples=0, jobs=1)

    one, two = reliability(case, 1.0, 1.0), reliability(other, length, density)
    assert one.levels.computed == two.levels.computed <= 15
    assert two.beta == pytest.approx(one.beta, rel=1e-10)
    assert two.design["level"] == pytest.approx(length * one.design["level"], rel=1e-10)
    for name in ("form", "breitung", "tvedt"):
        assert getattr(two.rows[0], name) == pytest.approx(getattr(one.rows[0], name), rel=1e-8)

    def calibrate(case, length, modulus):
        lines = [(28, 0.0), (32, -2.1e-4), (36, -5.2e-4), (34, -3.4e-4)]
        rows = [f"{h * length!r},{u * length!r},{1e-5 * length!r}" for h, u in lines]
        path = tmp_path / "m.csv"
        path.write_text("\n".join(["level,crest_ux,crest_ux_sd", *rows]))
        return dj.calibrate(case, path, [f"E_found={modulus / 10!r}:{modulus * 10!r}"], jobs=1)

    one, two = calibrate(case, 1.0, 2e10), calibrate(other, length, modulus)
    np.testing.assert_allclose(two.estimates, stress * one.estimates, rtol=1e-8)
    np.testing.assert_allclose(two.intervals, stress * one.intervals, rtol=1e-8)
    np.testing.assert_allclose(two.squares, one.squares, rtol=1e-8)


# -- meshes
# --------------------------------------------------------------------------------------------------


@pytest.mark.heavy
@few
@given(
    joints,
    levels,
    st.builds(Shuffled, st.integers(0, 10**6), st.integers(1, 10**9), st.integers(1, 1000)),
)
def test_results_do_not_depend_on_the_numbering_of_the_mesh(
    solve, own, mesh, joint, level, numbering
):
    """Nodes, elements, regions and corners in any order, with large tags and gaps."""
    same(solve(own(mesh, joint, level)), solve(own(mesh, joint, level, numbering=numbering)))


@pytest.mark.heavy
@few
@given(joints, levels, st.floats(-1e3, 1e3), st.floats(0, 1e3))
def test_results_do_not_depend_on_the_position(solve, own, mesh, joint, level, along, up):
    """Moved along the river and upwards, with its water."""
    one = solve(own(mesh, joint, level))
    case = own(mesh.moved((along, up, 0)), joint, level + up, 3.0 + up)
    other = solve(replace(case, levels=(30.0 + up, level + up)))
    higher = dict.fromkeys(["level", "tail_level", "y"], lambda v: v + up)
    same(one, other, higher | {"x": lambda v: v + along})


def test_a_mesh_with_the_reservoir_at_large_x_is_refused(solve, own, mesh):
    with pytest.raises(InputError, match="heel at 0: x must point downstream"):
        solve(own(mesh.moved((0, 0, 0), "x"), {}, 40.0))


@pytest.mark.heavy
@settings(few, max_examples=3)
@given(joints)
def test_results_of_a_mirrored_valley(solve, own, joint):
    """In 3D."""
    solid = {"dim": 3.0, "n_joint": 4.0, "mesh_pattern": "split", "thickness": 20.0}
    mesh, joint = OwnMesh.of(load("dam", SECTION | solid)), joint | {"dim": 3.0, "order": 1.0}
    one, other = (solve(own(m, joint, 44.0)) for m in (mesh, mesh.moved((0, 0, 20), "z")))
    mirrored = {"z": lambda v: 20 - v} | dict.fromkeys(["delta_t2", "tau_2", "T_z"], np.negative)
    # rows of a level are sorted by s, then by z
    order = np.lexsort((20 - one.joint["z"].round(6), one.joint["s"].round(6), one.joint["time"]))
    one.joint = {name: column[order] for name, column in one.joint.items()}
    same(one, other, mirrored)


# -- steps
# --------------------------------------------------------------------------------------------------


@pytest.mark.heavy
@few
@given(joints, st.floats(35, 44), st.floats(0.01, 0.99))
def test_filling_in_two_steps_instead_of_one(solve, joint, level, share):
    """From a level on at which the shear of no node changes its direction."""
    case = load("dam", SECTION | joint, f"34,{level!r}", "3")
    one, two = solve(case), solve(replace(case, times=(1.0, 1 + share, 2.0)))
    assert not one.stopped
    off = differences(one.at(2.0), two.at(2.0))
    assert max(off.values()) < 1e-6, off


@pytest.mark.heavy
@few
@given(joints, levels, st.floats(0, 28), st.floats(0.01, 0.99))
def test_emptying_in_two_steps_instead_of_one(solve, joint, level, low, share):
    """Within the difference of theory.md for reversed loading."""
    case = load("dam", SECTION | joint, f"30,{level!r},{low!r},{level!r}", "0")
    times = (1.0, 2.0, 2 + share, 3.0, 3 + share, 4.0)
    one, two = solve(case), solve(replace(case, times=times))
    off = differences(one.at(4.0), two.at(4.0))
    bounds = {"delta_n": 1e-3, "sigma_n_eff": 3e-3, "tau_1": 7e-2, "slip": 9e-2}
    assert not {name: off[name] for name, bound in bounds.items() if off[name] > bound}
