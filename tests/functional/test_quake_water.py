"""quake_uplift = transient: flow of the water and motion of the dam solved together."""

from dataclasses import replace

import numpy as np
import pytest
from damjoint.dynamics import checkpoint
from damjoint.dynamics.history import QuakeHistory
from damjoint.dynamics.step import lift
from damjoint.input.resolve import load
from damjoint.solver.controls import LevelControl
from damjoint.solver.model import Model
from damjoint.studies.quake import static_step
from quakes import DAM, earthquake, mean_slip, smooth_record

#: Water with a little air in a joint of 0.05 mm, on the dam that slides and rocks.
WET = DAM | {
    "uplift": "flow",
    "quake_uplift": "transient",
    "aperture_min": 5e-5,
    "storage": 1e-12,
    "record_rest": 0.0,
}


@pytest.fixture
def record(tmp_path):
    return smooth_record(tmp_path / "r.csv", 6.0, duration=0.5)


@pytest.mark.parametrize(
    "lowest, turbulent", [(0.0, 0.0), pytest.param(-1e5, 1.0, marks=pytest.mark.heavy)]
)
def test_momentum_and_mass_are_balanced_at_every_step(record, lowest, turbulent):
    """Residual of the uncondensed equations with the film's pressure; water in = water stored; a
    void only where the pressure is the least one.
    """
    alpha = -0.05
    water = {"pressure_min": lowest, "turbulent": turbulent}
    quake = earthquake(record, WET | {"hht_alpha": alpha} | water, "30")
    problem, system = quake.problem, quake.system
    equilibrium = problem.model.equilibrium
    interface, laws = equilibrium.interface, equilibrium.laws

    def forces(state, motion):
        at_points = interface.jumps(interface.at_points, state.jump)
        traction, _ = laws.evaluate(at_points, state.variables)
        result = system.stiffness @ motion.displacement + problem.damping @ motion.velocity
        result[system.jumps] += interface.forces(traction) - lift(equilibrium, state.pressures)
        return result

    static = before = forces(problem.static, problem.at_rest.motion)
    start = problem.static.stored[0]
    ground_before, largest, highest, void = np.zeros(2), 0.0, 0.0, 0.0
    for step in quake.steps():
        state, motion = step.end.state, step.end.motion
        now = forces(state, motion)
        ground = (1 + alpha) * step.ground - alpha * ground_before
        residual = system.mass @ motion.acceleration + system.inertia @ ground
        residual += (1 + alpha) * (now - static) - alpha * (before - static)
        largest = max(largest, np.linalg.norm(residual) / problem.model.reference)
        before, ground_before = now, step.ground
        (stored,), pressure = state.stored, state.pressures[0].nodes
        through = np.abs(stored.inflow).sum() + stored.volume.sum()
        balance = stored.volume.sum() - stored.inflow.sum() - start.volume.sum()
        assert abs(balance) < 1e-11 * through
        assert pressure.min() >= lowest - 1e-6 and stored.void.min() >= 0
        inside = equilibrium.water[0].joint.fields.inside  # air comes in at the dry toe
        empty = inside[stored.void[inside] > 0]
        assert pressure[empty] == pytest.approx(lowest, abs=1e-6)
        highest, void = max(highest, pressure.max()), max(void, stored.void.max())
    assert abs(mean_slip(quake)) > 1e-3
    assert highest > 2 * problem.static.pressures[0].nodes.max()  # squeezed
    assert void > 1e-6  # opened faster than water follows
    assert largest < 1e-8


@pytest.mark.heavy
def test_thin_water_is_the_steady_flow_of_the_moment(record):
    """A viscosity of a millionth: the pressure of each step is that of steady flow at its end."""
    settings = WET | {"visc": 1e-9, "storage": 1e-14, "aperture_min": 1e-3}
    quake, seen = earthquake(record, settings, "30"), 0.0
    equilibrium = quake.problem.model.equilibrium
    static = quake.problem.static.pressures[0].nodes
    for step in quake.steps():
        state = step.end.state
        water = equilibrium.water_in_step(state.variables)
        (steady,) = water.pressures(state.jump, state.loading)
        assert state.pressures[0].nodes == pytest.approx(steady.nodes, abs=1e-2 * static.max())
        seen = max(seen, np.abs(steady.nodes - static).max())
    assert seen > 0.1 * static.max()


def test_drains_of_part_effect_keep_the_pressure_of_a_closed_joint(record):
    """It does not open: water that is stored is at rest in every step, as before the earthquake."""
    drains = {"drains": 1.0, "drain_x": 5.0, "drain_effectiveness": 0.6, "n_joint": 6.0}
    quake = earthquake(record, WET | drains | {"adhesion": 1e9, "storage": 1e-9}, "30")
    (before,) = quake.problem.static.pressures
    for _, step in zip(range(10), quake.steps(), strict=False):
        (pressure,) = step.end.state.pressures
        assert pressure.nodes == pytest.approx(before.nodes, abs=1e-9 * before.nodes.max())


@pytest.mark.heavy
def test_an_interrupted_earthquake_continues_with_its_water(record, tmp_path):
    settings = WET | {"n_joint": 6.0}
    quake = earthquake(record, settings, "30")
    history = QuakeHistory.of(quake)
    for number, step in enumerate(quake.steps()):
        history.add(quake, step)
        if number == 20:
            checkpoint.write(tmp_path / "state", "key", quake, history)
    other = earthquake(record, settings, "30")
    again = QuakeHistory.of(other)
    checkpoint.read(tmp_path / "state", "key", other, again)
    assert len(again) == 21
    for step in other.steps():
        again.add(other, step)
    for name in ("slip_mean", "U", "p_max", "void", "water", "water_in"):
        first, second = (np.array(h.rows[name]) for h in (history, again))
        assert second == pytest.approx(first, rel=1e-6, abs=1e-6 * np.abs(first).max())


@pytest.mark.parametrize(
    "words, message",
    [
        (("uplift=imposed",), "transient: must be crack, unchanged or zero without uplift = flow"),
        (("uplift=flow",), "storage = 0: must be > 0 with quake_uplift = transient"),
        (("uplift=cracked",), "transient: must be another with uplift = cracked"),
        (("uplift=flow", "time_unit=60", "quake_uplift=crack"), "must be transient, unchanged or"),
    ],
)
def test_refused(command, record, words, message):
    settings = [
        w
        for word in ("record_unit=m/s2", "quake_uplift=transient", *words)
        for w in ("--set", word)
    ]
    code, out, error = command("quake", "dam", "--record", str(record), *settings)
    assert (code, out) == (2, "") and len(error.splitlines()) == 1 and message in error, error


@pytest.mark.heavy
def test_a_dam_that_floats_after_an_earthquake_finds_its_static_state():
    """Its joint is open by 5 mm throughout: from there, Newton's method has no contact."""
    coarse = {"n_joint": 10.0, "h_dam": 6.0, "h_found": 12.0}
    model = Model(load("dam", WET | coarse | {"law": "friction", "adhesion": 0.0}, (20.0,)))
    step = model.advance(model.start(), 1.0, LevelControl(20.0))
    assert step
    rest, interface = step.state, model.equilibrium.interface
    opening = interface.at_points.toarray()[::2]
    apart = np.full(len(opening), 5e-3) - opening @ rest.jump
    floating = replace(rest, jump=rest.jump + np.linalg.lstsq(opening, apart)[0])
    assert (opening @ floating.jump > 4e-3).all()
    assert not model.advance(floating, floating.time, LevelControl(20.0))
    found = static_step(model, floating)
    assert found
    # [m], of steps whose residual is 1e-9 of the loads
    assert found.state.jump == pytest.approx(rest.jump, abs=1e-6 * np.abs(rest.jump).max())
