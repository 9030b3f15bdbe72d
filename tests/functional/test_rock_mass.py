"""Earthquakes with rock that has mass: waves in the rock without a dam, in closed form; what the
dam adds to them leaves through the boundary.
"""

import numpy as np
import pytest
from damjoint.solver.history import JointState
from quakes import BLOCK, DAM, earthquake, joint_of, mean_slip, smooth_record, write_record

DEPTH, WIDTH, DENSITY = 40.0, 10.0, 2400.0
#: Rock of 913 m/s (shear) and 1581 m/s, under a dam that weighs almost nothing.
ROCK = BLOCK | {
    "dam_base": 2.0,
    "dam_crest": 2.0,
    "dam_height": 1.0,
    "rho_dam": 1.0,
    "adhesion": 1e9,
    "K_N": 1e10,
    "K_T": 1e10,
    "E": 5e9,
    "nu": 0.25,
    "found_side": 4.0,
    "found_depth": DEPTH,
    "rho_found": DENSITY,
    "rock_mass": 1.0,
    "record_rest": 0.16,
}
#: Duration [s] of a pulse: the velocity of the surface is sin^2, at most 1 m/s.
PULSE = 0.04


def pulse(tmp_path, axis):
    """The record of a pulse along x or y."""
    times = np.linspace(0, PULSE, 201)
    values = np.pi / PULSE * np.sin(2 * np.pi * times / PULSE)
    columns = [values] if axis == 0 else [0 * values, values]
    return write_record(tmp_path / "r.csv", times, *columns)


def absolute(quake, step):
    """Velocities (points, 2) of the rock, and its energy."""
    system, motion = quake.system, step.end.motion
    ground = quake.record.velocity(np.array([step.end.time]))[0]
    v, u = motion.velocity, motion.displacement
    number = len(system.spaces["foundation"].body.points)
    moving = (system.motion["foundation"] @ v).reshape(-1, 2)[:number] + ground
    rigid = ground @ ground * DENSITY * WIDTH * DEPTH
    kinetic = v @ system.mass @ v + 2 * v @ (system.inertia @ ground) + rigid
    return moving, (kinetic + u @ quake.rock.stiffness @ u) / 2


def errors(tmp_path, axis, size, dt):
    """Largest differences [m/s] from the closed form, at the surface and at the base, and after the
    pulse; energy while the wave is on its way up, over that of the closed form, and at the end.
    """
    quake = earthquake(pulse(tmp_path, axis), ROCK | {"h_found": size})
    quake.dt = dt  # longer than the record's interval, which makes its velocity nearly exact
    points = quake.system.spaces["foundation"].body.points
    speed = quake.rock.field.speeds[axis]
    surface, base = (points[:, 1] == y for y in (0, -DEPTH))
    begin = quake.record.times[1]  # of the pulse at the surface

    def velocity(time):
        inside = (time > begin) & (time < begin + PULSE)
        return inside * np.sin(np.pi * (time - begin) / PULSE) ** 2

    worst, after, energies = np.zeros(2), 0.0, []
    for step in quake.steps():
        now = step.end.time
        moving, energy = absolute(quake, step)
        at_base = (velocity(now + DEPTH / speed) + velocity(now - DEPTH / speed)) / 2
        expected = np.zeros((len(moving), 2))
        expected[surface, axis], expected[base, axis] = velocity(now), at_base
        differences = np.abs(moving - expected)
        worst = np.maximum(worst, [differences[surface].max(), differences[base].max()])
        energies.append((now, energy))
        if now > begin + PULSE + DEPTH / speed:
            after = max(after, np.abs(moving).max())
    times, energies = np.array(energies).T
    # of the upward wave, of half the velocity: the integral of rho c v^2 over its duration
    whole = DENSITY * speed * WIDTH * (3 / 8) * PULSE / 4
    return worst, after, np.interp(begin, times, energies) / whole, energies[-1] / whole


@pytest.mark.heavy
@pytest.mark.parametrize("axis", [0, 1])
def test_a_wave_from_below_has_twice_its_velocity_at_the_surface_and_leaves(tmp_path, axis):
    """And at the base the velocity of the upward wave, later that of the reflected one."""
    coarse, _, _, _ = errors(tmp_path, axis, 4.0, dt=1e-3)
    fine, after, risen, end = errors(tmp_path, axis, 2.0, dt=5e-4)
    assert (fine < [8e-3, 4e-3]).all() and after < 1e-3
    assert np.log2(coarse[0] / fine[0]) == pytest.approx(2, abs=0.1)
    assert fine[1] < coarse[1] / 2
    if axis == 0:  # the whole pulse is in the rock when it reaches the surface
        assert risen == pytest.approx(1, abs=1e-3)
    assert end < 1e-9


#: The dam of the other tests on rock that is as heavy as concrete.
HEAVY = DAM | {"rock_mass": 1.0, "rho_found": 2600.0, "record_rest": 1.0}


@pytest.mark.heavy
def test_the_reactions_of_the_static_state_remain(tmp_path):
    """Nothing moves in an earthquake of almost no size, under a full reservoir."""
    record = smooth_record(tmp_path / "r.csv", 1e-9, duration=0.2)
    quake = earthquake(record, HEAVY | {"record_rest": 0.2}, "45")
    static = quake.problem.static
    steps = list(quake.steps())
    largest = max(np.abs(step.end.motion.displacement).max() for step in steps)
    assert largest < 1e-10 < 1e-5 < np.abs(static.jump).max()


@pytest.mark.heavy
def test_what_the_dam_radiates_does_not_come_back(tmp_path):
    """An elastic dam comes to rest by the damping of the boundary; on massless rock it goes on."""
    record = smooth_record(tmp_path / "r.csv", 1.0, duration=0.4, frequency=6.0)
    elastic = HEAVY | {"adhesion": 1e12, "damping": 0.0, "hht_alpha": 0.0, "record_rest": 2.0}

    def motion(settings):
        quake = earthquake(record, elastic | settings, "30")
        crest = [
            (step.end.time, (quake.system.crest @ step.end.motion.velocity)[0])
            for step in quake.steps()
        ]
        time, velocity = np.abs(np.array(crest)).T
        return velocity.max(), velocity[time > time[-1] - 0.2].max()

    (most, last), (most_massless, last_massless) = (motion({"rock_mass": m}) for m in (1.0, 0.0))
    assert last < 2e-2 * most and last_massless > 0.3 * most_massless
    assert most < most_massless


@pytest.mark.heavy
def test_a_section_of_any_thickness_is_in_plane_strain(tmp_path):
    """Both components of the record; the meshes of the section differ a little."""
    times = np.arange(0, 0.4, 0.01)
    wave = 5 * np.sin(np.pi * times / 0.4) ** 2 * np.sin(6 * np.pi * times)
    record = write_record(tmp_path / "r.csv", times, wave, 0.5 * wave)
    small = HEAVY | {"n_joint": 6.0, "h_dam": 15.0, "h_found": 30.0, "order": 2.0}
    small |= {"record_rest": 0.2, "found_side": 45.0, "found_depth": 45.0}
    solid = {"dim": 3.0, "thickness": 7.0, "hold_z": 1.0, "mesh_pattern": "split"}
    results = []
    for settings in (small, small | solid):
        quake = earthquake(record, settings, "30")
        joint, steps = joint_of(quake), list(quake.steps())
        equilibrium = quake.problem.model.equilibrium
        shear = [JointState(equilibrium, step.end.state, 0).row["T"] for step in steps]
        results.append((mean_slip(quake), *np.percentile(shear, [0, 50, 100]), joint.width))
    (plane, thick) = np.array(results)
    assert thick[:-1] == pytest.approx(plane[:-1], rel=2e-2) and abs(plane[0]) > 5e-3
