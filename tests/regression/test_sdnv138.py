"""SDNV138 b, c, d of code_aster: SSNP142's dam through the first 0.16 s of a record from 3.01 s on.

Compared with an independent solver under the conventions of this package: dam of 9.9 m (the mesh
has a joint of 0.1 m thickness), face pressure integrated exactly, dashpots at the Gauss points,
triangles; beta and gamma of alpha = -0.05 with equilibrium at the end of the step, as published.
The published digits depend on the quadrature of the face (a few points on sides of up to 2.9 m) and
on dashpots by element: 2.2347e-5, 1.5878e-5, 3.8130e-7 m.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damjoint.dynamics.scheme import HHT
from damjoint.dynamics.stepper import Earthquake
from damjoint.engines.condensed.recover import recover
from damjoint.fem.bodies import Bodies
from damjoint.joint.interface import interface_of
from damjoint.model.case import load
from damjoint.solver.load_stepper import LoadStepper

RECORD = Path(__file__).parents[2] / "reference" / "friuli.csv"
HEIGHT = 9.9
SCENE = {
    "dam_height": HEIGHT,
    "mesh_pattern": "free",
    "h_dam": 0.5,
    "h_found": 1.0,
    "joint_head_offset": 0.1,
    "damping": 0.0,
    "added_mass": 0.0,
    "joint_damping_n": 1e9,
    "joint_damping_t": 2e9,
    "record_unit": "m/s2",
    "record_start": 3.01,
    "record_rest": 0.0,
}


@pytest.mark.parametrize(
    "settings, vertical, crest, heel",
    [
        ({"order": 1.0, "uplift": "imposed", "dt": 0.005}, 2.104e-5, -1.5526, -1.4015),
        ({"order": 2.0, "uplift": "imposed", "dt": 0.01}, 1.775e-5, -1.5225, -1.4048),
        ({"order": 2.0, "uplift": "none", "dt": 0.01}, 3.953e-7, -1.4045, -1.4050),
    ],
    ids=["b", "c", "d"],
)
def test_displacement_and_acceleration_at_016_s(settings, vertical, crest, heel):
    """u_y of the crest, and the absolute accelerations along x of crest and heel."""
    case = load("c", SCENE | settings, "2.9,5.9,7.9,8.4,8.9", record=RECORD)
    bodies = Bodies.of(case)
    static = LoadStepper(case, interface_of(case))
    static.run()
    equilibrium = static.model.equilibrium
    (fields,) = recover(bodies, [(equilibrium, static.history)])
    before = fields[case.times[-1]].displacement["dam"]
    quake = Earthquake(static.case, static.model, static.state, bodies)
    quake.problem = replace(quake.problem, scheme=HHT(-0.05, weighted=False))
    begin = quake.record.times[1]  # of the record; before it a row of zeros
    step = next(s for s in quake.steps() if s.end.time > begin + 0.16 - 1e-6)
    points, moved = bodies.by_name["dam"].space.body.points, quake.system.motion["dam"]
    top, bottom = (np.argmin(np.abs(points - [0, y, 0]).sum(axis=1)) for y in (HEIGHT, 0))
    displacement = moved @ step.end.motion.displacement
    acceleration = moved @ step.end.motion.acceleration
    assert displacement[2 * top + 1] + before[top, 1] == pytest.approx(vertical, rel=5e-3)
    assert acceleration[2 * top] + step.ground[0] == pytest.approx(crest, rel=5e-3)
    assert acceleration[2 * bottom] + step.ground[0] == pytest.approx(heel, rel=5e-3)
