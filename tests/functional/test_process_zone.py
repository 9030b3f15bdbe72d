"""The fracture process zone against the mesh: its length, the hint, and --accuracy."""

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.model import process_zone
from damjoint.statics.hints import hints

#: A joint of 34 m that opens; its zone has 0.58 m.
BRITTLE = {"law": "rupture", "alpha": 2.0, "sigma_max": 3e5, "G_f": 2.25, "uplift": "cracked"}
BRITTLE |= {"E_dam": 2.5e10, "E_found": 2.5e10, "nu": 0.2}
COARSE = {"n_joint": 20.0, "h_dam": 15.0, "h_found": 60.0}


def test_length_by_rice():
    """9 pi/32 E/(1 - nu^2) G_f/f_t^2 of equal bodies, the harmonic mean of two, none of a joint
    without strength or softening; in shear with the energy and the cohesion of the law bond.
    """
    case = load("dam", BRITTLE)
    length = 9 * np.pi / 32 * 2.5e10 / 0.96 * 2.25 / 3e5**2
    zone = process_zone.tension(case)
    assert zone.length == pytest.approx(length)
    rigid = load("dam", BRITTLE | {"E_found": 1e20})
    assert process_zone.tension(rigid).length == pytest.approx(2 * length)
    assert process_zone.tension(load("dam", BRITTLE | {"sigma_max": 0.0})) is None
    assert process_zone.tension(load("dam", {"law": "friction"})) is None
    assert zone.least * length / 34 >= 3 > (zone.least - 1) * length / 34
    bond = BRITTLE | {"law": "bond", "adhesion": 6e5, "G_t": 90.0}
    assert process_zone.shear(load("dam", bond)).length == pytest.approx(10 * length)
    assert process_zone.shear(case) is process_zone.shear(load("dam", {"adhesion": 0.0})) is None


@pytest.mark.heavy
@pytest.mark.parametrize("n_joint, expected", [(20.0, True), (180.0, False)])
def test_the_hint_stands_where_an_opened_zone_has_less_than_three_elements(
    solve, n_joint, expected
):
    (result,) = solve("dam", "45", **BRITTLE | COARSE | {"n_joint": n_joint})
    assert result.last["max_opening"] > 3e5 / 1e11
    wanted = f"n_joint = {process_zone.tension(result.case).least} or --accuracy resolves it"
    assert any(wanted in hint for hint in hints(result)) == expected
    glass = {"n_joint": n_joint, "G_f": 0.05, "K_N": 1e13}
    (finer,) = solve("dam", "45", **BRITTLE | COARSE | glass)
    needed = f"whatever n_joint: {process_zone.tension(finer.case).least} elements would be needed"
    assert any(needed in hint for hint in hints(finer))
    (closed,) = solve("dam", "5", **BRITTLE | COARSE)
    assert not any("process zone" in hint for hint in hints(closed))


@pytest.mark.heavy
@pytest.mark.parametrize("n_joint, G_t, expected", [(20, 10, True), (20, 1e3, False)])
def test_the_hint_on_shear_stands_where_the_joint_has_slipped(solve, n_joint, G_t, expected):
    """A closed joint with a cohesion of 250 kPa: zones shorter and longer than three elements."""
    settings = {"law": "bond", "sigma_max": 5e6, "G_f": 1e4, "adhesion": 2.5e5, "mu": 0.3}
    (result,) = solve("dam", "45", **settings | COARSE | {"n_joint": n_joint, "G_t": G_t})
    assert (process_zone.shear(result.case).elements < 3) == expected
    assert result.last["slip_length"] > 2 * 1.7 and result.last["crack_length"] == 0
    assert any("(9 pi/32 E' G_t/c^2)" in hint for hint in hints(result)) == expected


@pytest.mark.heavy
def test_accuracy_refines_until_the_zone_has_three_elements(command):
    """A large error is met on coarser meshes."""
    settings = [f"{n}={v}" for n, v in (BRITTLE | COARSE).items()]
    words = "run", "dam", *(w for s in settings for w in ("--set", s)), "--levels", "45"
    _, out, _ = command(*words, "--accuracy", "50%", "--no-picture", "--no-fields")
    least = process_zone.tension(load("dam", BRITTLE)).least
    used = int(out.partition("estimated errors with n_joint = ")[2].split()[0])
    assert used >= least > used / 2 and "process zone is" not in out
