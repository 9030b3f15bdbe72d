"""Flow in time: closed forms, mass balance, cavitation, steady limit."""

from dataclasses import replace
from math import erfc

import numpy as np
import pytest
from blocks import write_blocks
from damjoint import InputError, cli
from damjoint.engines.condensed.solve import check
from damjoint.input.resolve import load
from damjoint.joint.flow_in_time import TimeStep
from damjoint.model.loads import Loading
from damjoint.pictures import water_picture
from damjoint.solver.controls import LevelControl
from damjoint.solver.load_stepper import LoadStepper
from damjoint.solver.model import Model, StepOptions
from damjoint.statics.hints import hints
from damjoint.studies.report import water_of

WATER, VISC = 9810.0, 1e-3
#: Dam of 28 m on a joint without tension, that opens under 40 m of water.
OPENS = {"law": "friction", "adhesion": 0.0, "mu": 1.5, "dam_base": 28.0, "n_joint": 20.0}
#: Two blocks on bases of 10 and 5 m; the joint between them and, if it is dry, the second base end
#: the water's path.
BLOCKS = {"left": (0, 0, 10, 10), "right": (10, 0, 15, 10)}
JOINTS = {"left base": (0, 0, 10, 0), "right base": (10, 0, 15, 0), "contraction": (10, 10, 10, 0)}
STIFF = {"law": "friction", "adhesion": 1e30, "pena_tang": 0.0, "E": 2e10, "order": 1.0}


@pytest.fixture
def blocks(tmp_path):
    """blocks(uplift, **settings): the blocks as a Model, with a mesh of 1 m."""

    def build(uplift, levels=(5.0,), blocks=BLOCKS, joints=JOINTS, **settings):
        write_blocks(tmp_path / "own.msh", blocks, joints)
        (tmp_path / "own.case").write_text('geometry = "own.msh";')
        settings = STIFF | {"uplift": uplift, "time_unit": 1.0} | settings
        case = load(str(tmp_path / "own.case"), settings, levels, (0.0,))
        check(case)
        return Model(case)

    return build


def dam(levels=(30.0, 44.0), steps=5, **settings):
    """A loading of the dam that opens."""
    case = load("dam", OPENS | {"uplift": "flow"} | settings, levels, None, steps)
    return LoadStepper(case)


def opened(model, sizes):
    """Unknowns for which each joint is open by a length [m], or by a function of the place."""
    jump = np.zeros(len(model.start().jump))
    for joint, size in zip(model.equilibrium.interface.joints, sizes, strict=True):
        size = size(joint.space.locations) if callable(size) else size
        wanted = np.outer(
            np.broadcast_to(size, len(joint.space.locations)), joint.surface.normals[0][: joint.dim]
        )
        jump += np.linalg.lstsq(joint.unknowns.toarray(), wanted.ravel(), rcond=None)[0]
    return jump


class Slot:
    """The water of a model's joints under prescribed openings, from water at rest on."""

    def __init__(self, model, jump, loading=None):
        (self.system,) = model.equilibrium.flowing
        self.loading = loading or Loading(0.0, 0.0)
        self.variables, self.time = model.start().variables, 0.0
        self.stored = self.system.stored_at(jump, self.variables, Loading(0.0, 0.0), 0.0)

    def solve(self, jump, seconds):
        step = TimeStep(seconds=seconds, begin=self.stored)
        return self.system.solve(jump, self.variables, self.loading, None, step)

    def step(self, jump, seconds):
        """The pressure at the nodes after a step to an opening."""
        solution = self.solve(jump, seconds)
        self.time += seconds
        self.stored = solution.stored(self.time, self.stored)
        head = WATER * self.system.heads(self.loading) + self.system.expand_to_nodes(solution)
        return head - WATER * self.system.fields.joint.surface.points[:, 1]

    @property
    def x(self):
        return self.system.fields.joint.surface.points[:, 0]


@pytest.mark.heavy
@pytest.mark.parametrize("gap", [1e-4, 2e-3])
def test_squeeze_film_with_a_sealed_tip(blocks, gap):
    """p = 6 eta V (L^2 - (L - x)^2) / w^3, thrust 4 eta V L^3 / w^3 [Reynolds 1886]."""
    model = blocks(("flow", "none", "none"), aperture_min=1e-6)
    first, then = opened(model, [gap, 0, 0]), opened(model, [0.9 * gap, 0, 0])
    slot, seconds = Slot(model, first), 0.25
    pressure = slot.step(then, seconds)
    speed, width, L = 0.1 * gap / seconds, 1e-6 + 0.9 * gap, 10.0
    expected = 6 * VISC * speed * (L**2 - (L - slot.x) ** 2) / width**3
    assert pressure == pytest.approx(expected, rel=1e-9, abs=1e-9 * expected.max())
    assert slot.stored.void.max() == 0
    assert slot.stored.inflow.sum() == pytest.approx(-0.1 * gap * L, rel=1e-9)
    water = model.equilibrium.water[0]
    lift = water.force(water.wetted.fields @ pressure[water.nodes])
    force = opened(model, [1.0, 0, 0]) @ lift
    assert force == pytest.approx(4 * VISC * speed * L**3 / width**3, rel=5e-3)  # elements of 1 m


def test_a_film_follows_openings_far_below_its_aperture(blocks):
    """The same film of 10 um that closes by 1e-19 m: 6 Pa. The volume is known to its openings'
    last digit, 1e-25 m, not to that of the aperture, 2e-21 m.
    """
    model = blocks(("flow", "none", "none"), aperture_min=1e-5)
    gap, closing, seconds, L = 3e-9, 1e-19, 1e-5, 10.0
    slot = Slot(model, opened(model, [gap, 0, 0]))
    pressure = slot.step(opened(model, [gap - closing, 0, 0]), seconds)
    width = 1e-5 + gap
    expected = 6 * VISC * closing / seconds * (L**2 - (L - slot.x) ** 2) / width**3
    assert pressure == pytest.approx(expected, rel=1e-4, abs=1e-4 * expected.max())


@pytest.mark.heavy
def test_slot_that_stores_water():
    """p0 erfc(x / (2 sqrt(D t))), D = w^3 N / (12 eta), after a sudden rise at the mouth."""
    storage, width = 1e-12, 1e-4
    settings = {"time_unit": 1.0, "storage": storage, "aperture_min": width, "n_joint": 200.0}
    model = Model(load("dam", OPENS | {"uplift": "flow"} | settings, (30.0,)))
    closed = model.start().jump
    diffusivity = width**3 / (12 * VISC * storage)
    end = 4.0 / diffusivity  # s; sqrt(4 D t) = 4 m, the joint has 28 m
    errors = []
    for number in (50, 100, 200):
        slot = Slot(model, closed, Loading(30.0, 0.0))
        for _ in range(number):
            pressure = slot.step(closed, end / number)
        expected = 30 * WATER * np.array([erfc(x / 4.0) for x in slot.x])
        errors.append(np.abs(pressure - expected).max() / (30 * WATER))
        entered = slot.stored.inflow.sum()
    assert errors[-1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.3)  # order 1 in time
    by_hand = 2 * 30 * WATER * storage * np.sqrt(diffusivity * end / np.pi)
    assert entered == pytest.approx(by_hand, rel=1e-2)


@pytest.mark.heavy
def test_the_steady_limit():
    steady, slow = dam(), dam(time_unit=1e18)
    (first, second) = (stepper.run() for stepper in (steady, slow))
    for name in ("p", "delta_n", "sigma_n"):
        scale = np.abs(first.joint[name]).max()
        assert second.joint[name] == pytest.approx(first.joint[name], abs=1e-12 * scale)
    assert first.history["max_opening"][-1] > 1e-4


@pytest.fixture
def scene(request, blocks):
    """scene(**settings): to its last level, with drains, joints that meet, or 3D; few elements."""
    drains = {"drains": 1.0, "drain_x": 4.0, "drain_effectiveness": 0.8}
    solid = {"dim": 3.0, "thickness": 3.0, "hold_z": 1.0, "mesh_pattern": "layers"}
    further = {"drains": drains, "3D": solid}.get(request.param)

    def build(**settings):
        if further is None:
            return LoadStepper(blocks(("flow",) * 3, (6.0, 9.0), **settings).case)
        coarse = {"n_joint": 12.0, "order": 1.0}
        return dam((38.0, 43.0), 2, **coarse | further | settings)

    return build


ALL_SCENES = pytest.mark.parametrize("scene", ["drains", "junction", "3D"], indirect=True)


@ALL_SCENES
def test_the_steady_limit_of_networks(scene):
    """With drains, at a junction of joints, in 3D: the pressure of each joint, and its opening."""
    steady, slow = (scene(time_unit=unit).run() for unit in (0.0, 1e18))
    for first, second in zip(steady.joints, slow.joints, strict=True):
        for name in ("p", "delta_n"):
            scale = np.abs(first.joint[name]).max()
            assert second.joint[name] == pytest.approx(first.joint[name], abs=1e-12 * scale)
    assert steady.joint["p"].max() > 5e4


@pytest.mark.heavy
@ALL_SCENES
def test_order_in_time_of_networks(scene):
    """Joints that open linearly in time and store water: halved steps halve the error."""
    settings = {"storage": 1e-8, "aperture_min": 5e-4, "pressure_min": -1e5}
    model = scene(time_unit=1.0, **settings).model
    last = opened(model, [1e-4] * len(model.equilibrium.interface.joints))
    pressures, inflow = [], []
    for number in (20, 40, 80):
        slot = Slot(model, 0 * last, Loading(model.case.levels[-1], 0.0))
        for k in range(number):
            pressure = slot.step((k + 1) / number * last, 60 / number)
        pressures.append(pressure)
        inflow.append(slot.stored.inflow.sum())
    for values in pressures, inflow:
        coarse, fine = np.abs(np.diff(values, axis=0)).reshape(2, -1).max(axis=1)
        assert coarse / fine == pytest.approx(2, abs=0.05)
        assert fine > 1e-6 * np.abs(values).max()


@pytest.mark.heavy
@pytest.mark.parametrize("lowest", [0.0, -1e5])
@pytest.mark.parametrize("unit", [1.0, 600.0, 1e5])
def test_mass_is_kept_in_every_step(unit, lowest):
    """Water in = water stored, to rounding; no pressure is below the least one."""
    result = dam(time_unit=unit, pressure_min=lowest).run()
    history = result.history
    assert not result.stopped and history["max_opening"][-1] > 1e-5
    start = 28 * result.case["aperture_min"]
    balance = history["water"] - history["water_in"]
    assert balance == pytest.approx(start, abs=1e-11 * history["water"].max())
    assert history["p_min"].min() >= lowest - 1e-6
    assert (history["void"] >= 0).all()
    void = result.joint["void_fraction"]
    assert 0 <= void.min() and void.max() <= 1 and (void.max() > 0) == (history["void"][-1] > 0)
    assert result.joint["Re"].max() <= history["Re"].max() * (1 + 1e-12)
    end = result.at(result.case.times[-1])
    s, mass = (end[name][np.argsort(end["s"])] for name in ("s", "water_mass"))
    total = np.diff(s) @ (mass[1:] + mass[:-1]) / 2
    assert total == pytest.approx(1000 * history["water"][-1], rel=1e-9)
    if unit == 1:
        assert history["void"].max() > 1e-7 and history["p_min"].min() == pytest.approx(lowest)


@pytest.mark.heavy
def test_faster_floods_leave_the_crack_behind():
    cracks = [dam(time_unit=unit).run().last["crack_length"] for unit in (1.0, 600.0, 1e5)]
    assert cracks == sorted(cracks) and cracks[0] < cracks[-1]


@pytest.mark.heavy
def test_voids_are_filled_before_pressure_returns(blocks):
    """Opened faster than water follows, closed by less than the void: no pressure; then by more."""
    model = blocks(("flow", "none", "none"), aperture_min=1e-5, pressure_min=-5e4)
    slot = Slot(model, opened(model, [0, 0, 0]))
    pressure = slot.step(opened(model, [1e-3, 0, 0]), 1e-5)
    assert pressure[slot.x > 9] == pytest.approx(-5e4)
    void = slot.stored.void.sum()
    assert void + slot.stored.inflow.sum() == pytest.approx(1e-3 * 10, rel=1e-9)
    pressure = slot.step(opened(model, [2e-4, 0, 0]), 1e-5)
    assert pressure[slot.x > 9] == pytest.approx(-5e4)
    pressure = slot.step(opened(model, [0.0, 0, 0]), 1e-5)
    assert slot.stored.void.max() == 0 and pressure.max() > 1e5
    assert slot.stored.volume.sum() - slot.stored.inflow.sum() == pytest.approx(1e-4, rel=1e-9)


@pytest.mark.heavy
@pytest.mark.parametrize("uplift", [("flow", "flow", "none"), ("flow",) * 3])
@pytest.mark.parametrize("storage", [0.0, 1e-12])
def test_joints_that_meet_exchange_water(blocks, uplift, storage):
    """The water of the network is kept, and its derivative is that of finite differences."""
    model = blocks(uplift, (12.0,), aperture_min=(1e-4, 2e-4, 3e-4), storage=storage)
    wave = lambda size: lambda x: size * (1 + 0.5 * np.sin(x @ [1.0, 0.7, 0.3]))
    slot = Slot(model, opened(model, [0, 0, 0]), Loading(12.0, 1.0))
    start = slot.stored.volume.sum()
    jump = opened(model, [wave(s) for s in (2e-3, 3e-3, 4e-3)])
    for seconds in (1e-4, 1e-2, 100.0):
        slot.step(jump, seconds)
        stored = slot.stored
        assert stored.volume.sum() - stored.inflow.sum() == pytest.approx(
            start, abs=1e-11 * (stored.volume.sum() + np.abs(stored.inflow).sum())
        )
        step = TimeStep(seconds=seconds, begin=stored)
        solution = slot.solve(0.999 * jump, seconds)
        derivative = slot.system.derivative(0.999 * jump, slot.variables, solution, None, step)
        way = np.random.default_rng(1).normal(size=len(jump)) * 1e-9
        above, below = (slot.solve(0.999 * jump + s * way, seconds).pressure for s in (1, -1))
        expected = derivative.pressure @ way[derivative.columns]
        assert (above - below) / 2 == pytest.approx(expected, rel=1e-3, abs=1e-4 * np.ptp(expected))


@pytest.mark.heavy
def test_drains_take_water():
    drained, free = (
        dam(time_unit=600.0, drain_x=4.0, drains=on, drain_effectiveness=0.8).run() for on in (1, 0)
    )
    history = drained.history
    assert history["U"][-1] < free.history["U"][-1]
    assert history["water"] - history["water_in"] == pytest.approx(2.8e-4, rel=1e-9)


def test_water_at_drains_of_part_effect():
    """A slot that fills: e times its pressure with drains of full effect plus 1 - e times that
    without drains, with steps of any length; in the end that of steady flow, to rounding.
    """
    settings = {"time_unit": 1.0, "storage": 1e-12, "aperture_min": 1e-4, "n_joint": 28.0}
    settings |= OPENS | {"uplift": "flow", "drains": 1.0, "drain_x": 4.0}
    scale = 28**2 * 12 * VISC * 1e-12 / 1e-4**3  # s, of the diffusion through the joint
    by_effect = []
    for effect in (0.0, 0.7, 1.0):
        model = Model(load("dam", settings | {"drain_effectiveness": effect}, (30.0,)))
        closed, pressures = model.start().jump, []
        for number, seconds in (10, 0.02 * scale), (40, 0.02 * scale), (2, 1e18 * scale):
            slot = Slot(model, closed, Loading(30.0, 0.0))
            for _ in range(number):
                pressure = slot.step(closed, seconds / number)
            pressures.append(pressure)
            stored, inflow = slot.stored.volume.sum(), slot.stored.inflow
            assert stored - inflow.sum() == pytest.approx(28e-4, abs=1e-12 * abs(inflow).max())
        by_effect.append(pressures)
    free, part, full = by_effect
    for n in range(3):
        assert part[n] == pytest.approx(0.3 * free[n] + 0.7 * full[n], abs=1e-6)
    at_drains = np.abs(slot.x - 4).argmin()
    assert part[2][at_drains] == pytest.approx(0.3 * 30 * WATER * 24 / 28, rel=1e-12)
    assert abs(part[0] - part[1]).max() < 0.05 * 30 * WATER


@pytest.mark.heavy
def test_in_three_dimensions():
    """A slice has the pressures of the section, and keeps its water."""
    settings = {"n_joint": 10.0, "order": 1.0, "mesh_pattern": "layers", "time_unit": 600.0}
    flat, solid = (dam(dim=dim, thickness=2.0, hold_z=1.0, **settings).run() for dim in (2.0, 3.0))
    assert solid.history["water"] - solid.history["water_in"] == pytest.approx(2.8e-4, rel=1e-9)
    for name in ("water", "p_max", "max_opening"):
        assert solid.history[name][-1] == pytest.approx(flat.history[name][-1], rel=2e-2)


@pytest.mark.heavy
def test_flow_beyond_laminar_is_said():
    """2 rho q / eta over 2000: of the steady run by the leakage, in time by the largest flow."""
    for settings in ({}, {"time_unit": 600.0}):
        calm, wild = (dam(**settings, aperture_min=w).run() for w in (1e-5, 2e-3))
        said = [any("Reynolds" in hint for hint in hints(run)) for run in (calm, wild)]
        assert said == [False, True]
    steady = 2 * 1000 * 9810 * 44 * 2e-3**3 / (12e-3 * 28) / VISC  # closed
    assert wild.history["Re"][-1] > 0.5 * steady > 2000


def test_a_dry_end_has_no_suction():
    """Its head is its elevation, above the water: a joint between two dry ends stays dry."""
    settings = {"joint_height": 20.0, "pressure_min": -1e5, "n_joint": 8.0, "order": 1.0}
    runs = [
        dam((10.0,), steps=1, **settings | water).run()
        for water in ({"time_unit": 60.0, "storage": 1e-12}, {"uplift": "none"})
    ]
    assert np.abs(runs[0].joint["p"]).max() < 1e-6
    assert runs[0].last["N"] == pytest.approx(runs[1].last["N"], rel=1e-12)


@pytest.mark.heavy
def test_a_dry_end_gives_no_water_to_drains_below_it():
    """Air enters at a dry toe, however its head is rounded: the drains empty the joint."""
    size = {"dam_height": 6.71, "dam_base": 5.3, "dam_crest": 0.414, "aperture_min": 8.85e-5}
    drains = {"drains": 1.0, "drain_effectiveness": 1.0, "pressure_min": -1e5}
    for slope in (3.0, 3.36):
        settings = size | drains | {"joint_slope": slope, "time_unit": 2400.0, "n_joint": 8.0}
        run = LoadStepper(load("dam", {"uplift": "flow"} | settings, (6.8,), None, 2))
        run.run()
        (pressure,), joint = run.state.pressures, run.model.equilibrium.interface.joints[0]
        beyond = pressure.nodes[(joint.xi > 0.25) & (joint.xi < 1)]
        assert len(beyond) > 4 and (beyond < -1).all()


@pytest.mark.heavy
def test_water_flows_in_time_in_a_lift_only():
    """Whatever the uplift of the first joint; picture and report name the lift."""
    lifts = {"lift_heights": (15.0,), "uplift": ("none", "flow"), "n_joint": 8.0, "order": 1.0}
    results = dam((40.0,), steps=2, time_unit=3600.0, **lifts).run()
    assert results.last["water"] == 0 and results.last["water_2"] > 0
    title = water_picture.figure(results).texts[0].get_text()
    assert title.startswith("own dam, water in lift 15 m in time")
    text = water_of(results.joints[1], "lift 15 m")
    assert f"Water in lift 15 m at the end: {1e3 * results.last['water_2']:.4g} l/m" in text


@pytest.mark.heavy
def test_steady_before_the_start():
    """As steady flow up to the level of `time_start`, then slower than it."""
    steady, late = dam(), dam(time_unit=60.0, time_start=1.0)
    first, second = steady.run(), late.run()
    assert np.array_equal(first.at(1)["p"], second.at(1)["p"])
    assert second.history["crack_length"][-1] < first.history["crack_length"][-1]


@pytest.mark.heavy
def test_steps_are_halved_where_pressure_moves_too_far():
    """Then no step changes it by more; the history counts the halvings."""
    most = 2e4
    result = dam(steps=2, time_unit=3600.0, pressure_step=most).run()
    free = dam(steps=2, time_unit=3600.0).run()
    history = result.history
    assert history["cuts"].max() > 2 and len(history["time"]) > 2 * len(free.history["time"])
    assert np.abs(np.diff(history["p_max"])).max() <= most


@pytest.mark.heavy
def test_a_step_of_a_film_may_have_two_equilibria():
    """A crack that opens faster than water follows: a step of 0.2 s also has the equilibrium of a
    step of 0.1 s, that loses all uplift, to rounding; mass is kept in both. Short steps, or
    `pressure_step`, decide, and the run with the other one says that its step may have several.
    """
    film = {"time_unit": 1.0, "pressure_min": -1e5}
    runs = {}
    for steps, settings in (5, {}), (10, {}), (20, {}), (40, {}), (10, {"pressure_step": 2e5}):
        case = load("dam", OPENS | {"uplift": "flow"} | film | settings, (30.0, 44.0), None, steps)
        run = runs[steps, len(settings)] = LoadStepper(case)
        run.states = [state for state in run.steps() if state.time < 1.81]
    at = {key: next(s for s in run.states if abs(s.time - 1.8) < 1e-9) for key, run in runs.items()}
    long, model = runs[5, 0], runs[5, 0].model
    (begin,) = (state for state in long.states if abs(state.time - 1.6) < 1e-9)
    for state in at[5, 0], at[10, 0]:
        options = StepOptions(model.strategies[:1], guess=(state.jump, 41.2))
        step = model.advance(begin, 1.8, LevelControl(41.2), options)
        assert step.iterations == 0 and step.residual < 1e-9  # of the loads
        (stored,) = step.state.stored
        assert stored.volume.sum() - stored.inflow.sum() == pytest.approx(2.8e-4, rel=1e-12)
    histories = {key: run.results().history for key, run in runs.items()}
    uplift = {key: np.interp(1.8, rows["time"], rows["U"]) for key, rows in histories.items()}
    assert uplift[10, 0] < -1e6
    for key in (5, 0), (20, 0), (10, 1):
        assert uplift[key] == pytest.approx(uplift[40, 0], rel=0.04)
    said = {
        key: [text for text in hints(run.results()) if "several equilibria" in text]
        for key, run in runs.items()
    }
    assert len(said[10, 0]) == 1 and "pressure_step = 2.2e+05" in said[10, 0][0]


@pytest.mark.heavy
def test_a_film_without_compressibility_in_steps_of_milliseconds():
    """A point that has just opened by 3 nm between closed ones changes the pressure by 1e18 Pa/m:
    the iterates go to and fro between full film and void, 1e-13 m apart, and steps are cut. The
    compressibility of the water itself is enough; the hint on a run that stops there has it.
    """
    settings = {"time_unit": 0.01, "joint_slope": 3.0}
    cut = dam((30.0, 44.0, 20.0), **settings).run()
    assert not cut.stopped and cut.history["cuts"].any()
    (hint,) = (text for text in hints(replace(cut, stopped=True)) if "storage" in text)
    assert hint.endswith("storage = 4.5e-15")
    run = dam((30.0, 44.0, 20.0), storage=float(hint.split()[-1]), **settings).run()
    assert not run.stopped and not run.history["cuts"].any()


@pytest.mark.heavy
def test_a_sealed_joint_must_store_water(blocks, tmp_path, capsys):
    """The base of the middle one of three blocks, between dry joints: its volume is given."""
    bounds = {"left": (0, 5), "middle": (5, 10), "right": (10, 15)}
    three = {name: (a, 0, b, 10) for name, (a, b) in bounds.items()}
    joints = {f"{name} base": (a, 0, b, 0) for name, (a, b) in bounds.items()}
    joints |= {"first": (5, 10, 5, 0), "second": (10, 10, 10, 0)}
    uplift = "none", "flow", "none", "none", "none"
    with pytest.raises(InputError, match="storage = 0: must be > 0"):
        blocks(uplift, (5.0,), three, joints)
    values = "uplift=none", "middle base.uplift=flow", "time_unit=60", "order=1"
    given = [str(tmp_path / "own.case"), *(w for value in values for w in ("--set", value))]
    studies = {
        "modes": ["modes"],
        "rows.csv": ["sweep", "--vary", "mu=0.8,1"],
        "reliability": ["reliability", "--vary", "mu=normal(1,0.1)"],
    }
    for name, study in studies.items():
        out = tmp_path / name
        assert cli.main([*study, *given, "--levels", "5", "--out", str(out)]) == 2
        assert "storage = 0: must be > 0 in joints" in capsys.readouterr().err
        assert not out.exists()
    model = blocks(uplift, (5.0,), three, joints, storage=1e-9)
    slot = Slot(model, opened(model, [0.0] * 5))
    pressure = slot.step(opened(model, [0, 1e-4, 0, 0, 0]), 1.0)
    assert pressure == pytest.approx(0, abs=1e-9)  # the opening is a void
    assert slot.stored.void.sum() == pytest.approx(5e-4, rel=1e-9)


@pytest.mark.heavy
def test_a_fracture_that_its_pressure_widens():
    """OpenGeoSys, LIE single_fracture, after Wijesinghe (1986): w = 10 um + (p - 11 MPa)/1e11 Pa/m,
    11.9 MPa at the inlet of 25 m; the reference is its own 1D solution at 100 s.
    """
    width, stiffness, steps = 1e-5, 1e11, 500
    settings = {"time_unit": 1.0, "storage": 1 / stiffness, "aperture_min": width}
    settings |= {"dam_base": 25.0, "n_joint": 500.0, "order": 1.0}
    model = Model(load("dam", OPENS | {"uplift": "flow"} | settings, (30.0,)))
    closed = model.start().jump
    slot = Slot(model, closed, Loading(0.9e6 / WATER, 0.0))
    system, fields = slot.system, slot.system.fields
    heads = WATER * system.heads(slot.loading)
    pressure, none = np.zeros(fields.nodes), np.zeros(0)
    for _ in range(steps):
        step = TimeStep(seconds=100 / steps, begin=slot.stored)
        for _ in range(3):  # the conductivity follows the pressure
            wider = (1 + fields.at_points @ pressure / stiffness / width) ** 3
            conductivity = system.reference * wider * system.flow.points.weights
            widths = [water.widening(closed, None)[0] for water in system.members]
            solution = system.flow_in_time(step, widths, heads, heads, none.astype(int), none)(
                conductivity
            )
            pressure = heads + system.expand_to_nodes(solution)
        slot.stored = solution.stored(0.0, slot.stored)
    order = np.argsort(slot.x)
    found = 11 + np.interp([2.5, 5.0, 7.5], slot.x[order], pressure[order]) / 1e6
    assert found == pytest.approx([11.34009, 11.00209, 11.0], rel=1e-4)
