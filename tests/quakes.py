"""Earthquakes of small scenes, for the tests."""

import numpy as np
from damjoint.dynamics.stepper import Earthquake
from damjoint.fem.bodies import Bodies
from damjoint.fem.cache import condensed_bodies
from damjoint.input.resolve import load
from damjoint.joint.interface import Interface
from damjoint.solver.load_stepper import LoadStepper

#: A rigid block on a rigid ground, with dry friction.
BLOCK = {
    "dam_base": 8.0,
    "dam_crest": 8.0,
    "dam_height": 2.0,
    "found_side": 1.0,
    "found_depth": 1.0,
    "E": 1e12,
    "K_N": 1e11,
    "K_T": 1e11,
    "law": "friction",
    "mu": 0.5,
    "adhesion": 0.0,
    "pena_tang": 0.0,
    "uplift": "none",
    "n_joint": 4.0,
    "order": 1.0,
    "h_dam": 1.0,
    "h_found": 1.0,
    "damping": 0.0,
    "record_unit": "m/s2",
    "record_rest": 0.5,
}
#: A dam of 45 m on a coarse mesh, which slides and rocks.
DAM = {
    "law": "friction",
    "mu": 0.8,
    "adhesion": 1e4,
    "pena_tang": 0.0,
    "uplift": "imposed",
    "n_joint": 10.0,
    "order": 1.0,
    "record_unit": "m/s2",
    "record_rest": 0.2,
}


def write_record(path, times, *columns):
    """A record from times and accelerations."""
    rows = [",".join(map(repr, map(float, row))) for row in zip(times, *columns, strict=True)]
    path.write_text("\n".join(["time,horizontal,vertical", *rows, ""]))
    return path


def smooth_record(path, size, duration=1.0, frequency=3.0, interval=0.01):
    """A wave that begins and ends smoothly."""
    times = np.arange(0, duration + interval / 2, interval)
    window = np.sin(np.pi * times / duration) ** 2
    return write_record(path, times, size * window * np.sin(2 * np.pi * frequency * times))


def earthquake(record, settings, levels="0", name="dam"):
    """The earthquake of a case, before its first step."""
    case = load(name, settings, levels, record=record)
    bulk, bodies = condensed_bodies(case)
    static = LoadStepper(case, Interface(bulk, case["quadrature"]))
    static.run()
    assert not static.stopped
    return Earthquake(static.case, static.model, static.state, bodies or Bodies.of(case))


def joint_of(quake, number=0):
    """Joint of an earthquake."""
    return quake.problem.model.equilibrium.interface.joints[number]


def mean_slip(quake):
    """Mean tangential jump since the static state [m]."""
    joint = joint_of(quake)
    jump = quake.now.state.jump - quake.problem.static.jump
    weights = joint.points.weights
    return float(weights @ joint.jumps(joint.at_points, jump)[:, 1] / weights.sum())
