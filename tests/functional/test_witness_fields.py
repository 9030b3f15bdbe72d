"""Water and elasticity of the independent verification: they hold for what a run writes, and notice
files in which a quantity has been altered.
"""

import csv
import shutil

import numpy as np
import pytest
from damjoint import cli
from damjoint_witness import elasticity, network, statics, water, water_in_time
from damjoint_witness.files import Files, read_table
from damjoint_witness.reader import read
from variants import further

pytest.importorskip("skfem")

SMALL = "--set n_joint=8 --set h_dam=12 --set h_found=40 --no-picture --all-steps"
LOADS = (
    "--set batter=4 --set batter_height=20 --set silt_height=12 --set silt_weight=1 "
    "--set ice_force=5e4 --set anchor_force=1e6 --set k_h=0.05 --set k_v=0.03 --set floor_water=1 "
    "--set temperature_dam=3 --set temperature_linear=-6 --set E_found=1e10 --set nu_found=0.3"
)
SCENES = {
    "flow": "run dam --set uplift=flow --set drains=1 --set drain_x=9 --set sigma_max=2e4 "
    f"--levels 30,44 --tail-levels 5 {LOADS}",
    "lifts": "run dam --set order=1 --set lift_heights=14,30 --set joint_slope=4,-2,0 "
    "--set uplift=cracked,drained,waterstop --set waterstop=3 --set sigma_max=0 --levels 44 "
    "--tail-levels 18",
    "sloping lifts": "run koyna --set order=1 --set lift_heights=50,80 --set joint_slope=2,0,4 "
    "--set temperature_linear=-6 --set k_h=0.05 --levels 91.75 --tail-levels 75",
    "polygon": "run dam --set downstream_face=30,12,12,30,4,40 --set lift_heights=20,36 --set "
    "temperature_linear=-6 --set k_h=0.05 --levels 44 --tail-levels 25",
    "monoliths": "run monoliths --run-geo --set uplift=flow,cracked,imposed --levels 43",
    "flood": "run dam --set law=friction --set adhesion=0 --set mu=1.5 --set dam_base=28 --set "
    "order=1 --set uplift=flow --set time_unit=3 --set storage=1e-11 --set pressure_min=-1e5 --set "
    "drains=1 --set drain_x=7 --levels 30,44,40 --tail-levels 0,5,2 --steps 3",
    "voids at drains": "run dam --set dam_height=42.3 --set dam_base=21.1 --set dam_crest=3.02 "
    "--set E=2e12 --set order=1 --set K_N=7e11 --set sigma_max=0 --set alpha=2 "
    "--set weight_first=0 --set joint_slope=7.5 --set uplift=flow --set aperture_min=7e-8 "
    "--set drains=1 --set drain_x=7 --set drain_effectiveness=0.3 --set time_unit=660 "
    "--set storage=6e-13 --levels 43 --steps 4",
    "turbulent film": "run dam --set law=friction --set adhesion=0 --set mu=1.5 --set dam_base=28 "
    "--set order=1 --set lift_heights=20 --set uplift=flow,cracked --set turbulent=1 "
    "--set visc=1e-5 --set aperture_elastic=2e-4 --set drains=1 --set drain_x=7 --levels 30,44 "
    "--tail-levels 5",
    "turbulent flood": "run dam --set law=friction --set adhesion=0 --set mu=1.5 --set dam_base=28 "
    "--set order=1 --set uplift=flow --set turbulent=1 --set visc=1e-5 --set aperture_elastic=2e-4 "
    "--set time_unit=3 --set storage=1e-11 --set drains=1 --set drain_x=7 --levels 44 --steps 2",
    "soft dam on stiff rock": "run dam --set order=1 --set law=friction --set adhesion=0 --set "
    "mu=0.5 --set K_N=1.4e13 --set K_T=1.6e13 --set E=1e9 --set E_found=1.6e11 --set pena_tang=0 "
    "--set tolerance=1e-4 --levels 36",
    "uniform pressure": "run dam --set face_load=uniform --set force_y=2e5 --set force_face="
    "downstream --set force_at=20 --set rho_found=2600 --set in_situ=0 --set neck_height=6 --set "
    "neck_batter=2 --set quadrature=published --set joint_head_offset=1 --set floor_water=1 "
    "--set joint_slope=-4 --levels 20",
    "fading drains": "run dam --set dam_height=80 --set dam_base=60 --set uplift=cracked --set "
    "drains=1 --set drain_x=6 --set sigma_max=0 --levels 60,78",
    "flood of blocks": "run monoliths --run-geo --set uplift=flow --set time_unit=60 --set "
    "storage=1e-12 --levels 30,44,20 --steps 2",
}
SCENES_3D = {
    pattern: "run dam --set dim=3 --set n_layers=2 --set thickness=9 --set hold_z=1 "
    f"--set mesh_pattern={pattern} --set uplift=flow --set sigma_max=2e4 --levels 44 {LOADS}"
    for pattern in ("free", "layers")
} | {
    "regular": "run dam --set dim=3 --set mesh_pattern=regular --set order=1 --set uplift=flow "
    "--set drains=1 --set drain_x=9 --set drain_effectiveness=0.6 --set time_unit=60 --set "
    "time_start=1 --set storage=1e-11 --set turbulent=1 --set visc=4e-7 --levels 40,44 --steps 2"
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """written(name): folder and words of the run of a scene."""
    done = {}

    def once(name):
        if name not in done:
            words = [*(SCENES | SCENES_3D)[name].split(), *SMALL.split()]
            folder = tmp_path_factory.mktemp(name)
            cli.main([*words, "--out", str(folder)])
            done[name] = folder, tuple(word for word in words if word != "--all-steps")
        return done[name]

    return once


def found(check, folder, words):
    files = Files(folder, words)
    return list(check.violations(files, read(words), read_table(folder / "steps.csv")))


@pytest.mark.parametrize("name", further(6, SCENES))
def test_water_and_jumps_are_those_of_the_run(written, name):
    assert found(water, *written(name)) == []
    assert found(water_in_time, *written(name)) == []
    assert found(elasticity, *written(name)) == []


def test_water_that_is_stored_is_replayed(written):
    """Another unit of time, and with voids: a void that lost its water would show."""
    folder, words = written("flood")
    for changed in ("time_unit=3.1", "storage=1.02e-11", "pressure_min=0", "drain_x=9"):
        name = changed.split("=")[0]
        other = tuple(changed if word.startswith(f"{name}=") else word for word in words)
        assert other != words
        assert "p of the flow in time off" in "".join(found(water_in_time, folder, other)), name


@pytest.mark.parametrize("name", ["turbulent film", "turbulent flood"])
def test_films_are_told_apart(written, name):
    """The cubic law, another viscosity and another aperture of the unstressed joint show."""
    folder, words = written(name)
    check = water if name == "turbulent film" else water_in_time
    for changed in ("turbulent=0", "visc=1.1e-5", "aperture_elastic=2.1e-4"):
        parameter = changed.split("=")[0]
        other = tuple(changed if word.startswith(f"{parameter}=") else word for word in words)
        assert other != words
        assert "joint 1: " in "".join(found(check, folder, other)), changed


#: Parameters that random scenes do not draw, and other values of them, which the balance of the
#: loads notices, or the elasticity of the bodies.
OF_LOADS = {
    "silt_t": (2, 2.5),
    "ice_t": (2, 2.5),
    "force_t": (2, 2.5),
    "anchor_t": (2, 2.5),
    "quake_t": (3, 3.5),
    "ice_level": (38, 38.8),
    "force_at": (1, 1.1),
    "anchor_at": (2, 2.1),
    "force_y": (-2e5, -2.1e5),
    "rho_dam": (2350, 2360),
    "rho_silt": (1100, 1110),
    "rho_water": (1020, 1021),
    "g": (9.7, 9.71),
    "crest_water": (1, 0),
}
OF_BODIES = {"nu_dam": (0.25, 0.251), "expansion_dam": (8e-6, 8.1e-6), "temperature_t": (2, 2.5)}
ALL_LOADS = (
    "run dam --set order=1 --set uplift=drained --set drain_x=5 --set silt_height=12 "
    "--set ice_force=2e5 --set force_x=1e5 --set anchor_force=4e5 --set anchor_angle=20 "
    "--set k_h=0.05 --set k_v=0.03 --set temperature_dam=-2 --levels 38,40,46 --tail-levels 4 "
    "--steps 2 "
) + " ".join(f"--set {name}={was:g}" for name, (was, _) in (OF_LOADS | OF_BODIES).items())


@pytest.mark.heavy
def test_times_places_and_densities_of_loads_are_told_apart(tmp_path):
    words = ALL_LOADS.split()
    cli.main([*words, *SMALL.split(), "--out", str(tmp_path)])

    def problems(check, **changed):
        new = {f"{name}={was:g}": f"{name}={to:g}" for name, (was, to) in changed.items()}
        other = tuple(new.get(word, word) for word in [*words, *SMALL.split()[:-1]])
        files, request = Files(tmp_path, other), read(other)
        if check is statics:
            return list(statics.balance(files, request))
        return list(elasticity.violations(files, request, read_table(tmp_path / "steps.csv")))

    for check, parameters in ((statics, OF_LOADS), (elasticity, OF_BODIES)):
        assert problems(check) == []
        for name, values in parameters.items():
            assert problems(check, **{name: values}), name


@pytest.mark.heavy
@pytest.mark.parametrize("name", SCENES_3D)
def test_water_and_jumps_in_3d(written, name):
    assert found(water, *written(name)) == []
    assert found(water_in_time, *written(name)) == []
    assert found(elasticity, *written(name)) == []


@pytest.mark.heavy
def test_water_that_is_stored_is_replayed_in_3d(written):
    folder, words = written("regular")
    stored = "time_unit=61", "storage=1.1e-11", "drain_effectiveness=0.61"
    for changed in (*stored, "visc=4.1e-7", "turbulent=0"):
        name = changed.split("=")[0]
        other = tuple(changed if word.startswith(f"{name}=") else word for word in words)
        problems = "".join(found(water_in_time, folder, other))
        assert "p of the flow in time off" in problems and "water = " in problems, changed


def altered(folder, tmp_path, name, column, factor):
    """A copy of the files in which a column of a table is multiplied."""
    copy = tmp_path / "altered"
    shutil.copytree(folder, copy)
    with (copy / name).open() as file:
        heads, *rows = csv.reader(file)
    k = heads.index(column)
    for row in rows:
        row[k] = repr(factor * float(row[k]))
    with (copy / name).open("w", newline="") as file:
        csv.writer(file).writerows([heads, *rows])
    return copy


@pytest.mark.parametrize(
    "name, table, column, factor, what",
    [
        ("flow", "joint.csv", "p", 1.01, "p off"),
        ("flow", "joint.csv", "flux", 1.0001, "flux off"),
        ("flow", "history.csv", "flux", 1.0001, "leakage off"),
        ("flow", "steps.csv", "delta_n", 1.0001, "p off"),
        ("flood", "history.csv", "water", 1 + 1e-5, "joint 1: water = "),
        ("flood", "history.csv", "water_in", 1 + 1e-4, "joint 1: water_in = "),
        ("flood", "history.csv", "void", 1 + 1e-3, "joint 1: void = "),
        ("lifts", "joint.csv", "p", 1 + 1e-6, "joint 3: p off"),
        ("monoliths", "joint.csv", "p", 1 + 1e-6, "joint 2: p off"),
    ],
)
def test_altered_water_is_noticed(written, tmp_path, name, table, column, factor, what):
    folder, words = written(name)
    copy = altered(folder, tmp_path, table, column, factor)
    check = water_in_time if name == "flood" else water
    assert any(what in violation for violation in found(check, copy, words))


def test_jumps_are_off_by_the_residual_of_the_step_and_no_more(written, tmp_path):
    """The forces that move soft concrete by what is off are those out of balance, whatever part of
    the displacements that stiff rock leaves there (random dam 112-37) it is.
    """
    folder, words = written("soft dam on stiff rock")
    residual = read_table(folder / "history.csv")["residual"].max()
    assert 1e-6 < residual < 1e-4 and not found(elasticity, folder, words)
    copy = altered(folder, tmp_path, "history.csv", "residual", 0.05)
    assert "of the forces" in "".join(found(elasticity, copy, words))


@pytest.mark.parametrize("column", ["delta_n", "delta_t1", "sigma_n_eff", "tau_1"])
def test_altered_jumps_and_tractions_are_noticed(written, tmp_path, column):
    folder, words = written("lifts")
    copy = altered(folder, tmp_path, "steps.csv", column, 1 + 1e-4)
    assert found(elasticity, copy, words)


@pytest.mark.parametrize(
    "change",
    [
        *("E_found=1.001e10", "nu_dam=0.201", "temperature_linear=-6.01", "rho_silt=901"),
        *("ice_force=50100", "k_h=0.0501", "added_mass=2", "anchor_angle=0.1", "floor_water=0"),
    ],
)
def test_other_values_than_those_of_the_run_are_noticed(written, change):
    """As if the program took other values than those that the command asks for."""
    folder, words = written("flow")
    assert found(elasticity, folder, (*words, "--set", change))


@pytest.mark.parametrize(
    "change", ["neck_batter=2.1", "rho_found=2610", "in_situ=1", "force_face=upstream", "force_y=0"]
)
def test_other_values_of_seldom_loads_are_noticed(written, change):
    folder, words = written("uniform pressure")
    try:
        assert found(elasticity, folder, (*words, "--set", change))
    except ValueError:  # the mesh has no such face
        assert change.startswith("neck")


@pytest.mark.parametrize(
    "change", ["drain_effectiveness=0.501", "drains=0", "aperture_min=1.01e-5", "visc=1.01e-3"]
)
def test_other_values_of_the_water_are_noticed(written, change):
    folder, words = written("flow")
    assert found(water, folder, (*words, "--set", change))


@pytest.mark.heavy
@pytest.mark.parametrize(
    "uplift, level, tail",
    [
        ("flow", 12, 3),
        ("flow", 8, 3),
        ("flow,flow,none", 8, 3),
        ("cracked,flow,cracked", 12, 0),
        ("imposed", 8, 12),
    ],
)
def test_water_where_joints_meet_in_3d(tmp_path, uplift, level, tail):
    """Two or three joints at a line, each with its aperture, also a dry end; another is noticed."""
    words = f"run ssnp143 --set dim=3 --set uplift={uplift} --set aperture_min=1e-4,2e-4,3e-4 "
    words += f"--levels {level} --tail-levels {tail}"
    cli.main([*words.split(), "--no-picture", "--all-steps", "--out", str(tmp_path)])
    assert found(water, tmp_path, tuple(words.split())) == []
    if "flow" in uplift:
        other = words.replace("2e-4", "4e-4")
        assert any("p off" in text for text in found(water, tmp_path, tuple(other.split())))


def test_elimination_in_a_network_is_exact_for_any_conductances():
    """Three lines from a node, one of them closed: the head by hand."""
    graph = network.Graph(np.array([[0, 3], [1, 3], [2, 3]]), np.array([1e18, 1.0, 3.0]), 4)
    flow = graph.solve({0: 30.0, 1: 20.0, 2: 10.0})
    assert flow.drops[0] == pytest.approx((10 + 3 * 20) / 1e18, rel=1e-12)
    assert flow.inflow == pytest.approx([70, -10, -60, 0], rel=1e-12)
