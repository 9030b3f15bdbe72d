"""The fracture process zone against the mesh: its length, the hint, and --accuracy."""

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint.statics import process_zone
from damjoint.statics.hints import hints

#: A joint of 34 m that opens; its zone has 0.58 m.
BRITTLE = {"law": "rupture", "alpha": 2.0, "sigma_max": 3e5, "G_f": 2.25, "uplift": "cracked"}
BRITTLE |= {"E_dam": 2.5e10, "E_found": 2.5e10, "nu": 0.2}
COARSE = {"n_joint": 20.0, "h_dam": 15.0, "h_found": 60.0}


def test_length_by_rice():
    """9 pi/32 E/(1 - nu^2) G_f/f_t^2 of equal bodies, the harmonic mean of two, none of a joint
    without strength or softening.
    """
    case = load("dam", BRITTLE)
    length = 9 * np.pi / 32 * 2.5e10 / 0.96 * 2.25 / 3e5**2
    assert process_zone.length(case) == pytest.approx(length)
    rigid = load("dam", BRITTLE | {"E_found": 1e20})
    assert process_zone.length(rigid) == pytest.approx(2 * length)
    assert process_zone.length(load("dam", BRITTLE | {"sigma_max": 0.0})) == np.inf
    assert process_zone.length(load("dam", {"law": "friction"})) == np.inf
    n = process_zone.least(case)
    assert n * length / 34 >= 3 > (n - 1) * length / 34


@pytest.mark.parametrize("n_joint, expected", [(20.0, True), (180.0, False)])
def test_the_hint_stands_where_an_opened_zone_has_less_than_three_elements(
    solve, n_joint, expected
):
    (result,) = solve("dam", "45", **BRITTLE | COARSE | {"n_joint": n_joint})
    assert result.last["max_opening"] > 3e5 / 1e11
    wanted = f"n_joint = {process_zone.least(result.case)} or --accuracy resolves it"
    assert any(wanted in hint for hint in hints(result)) == expected
    glass = {"n_joint": n_joint, "G_f": 0.05, "K_N": 1e13}
    (finer,) = solve("dam", "45", **BRITTLE | COARSE | glass)
    needed = f"whatever n_joint: {process_zone.least(finer.case)} elements would be needed"
    assert any(needed in hint for hint in hints(finer))
    (closed,) = solve("dam", "5", **BRITTLE | COARSE)
    assert not any("process zone" in hint for hint in hints(closed))


@pytest.mark.heavy
def test_accuracy_refines_until_the_zone_has_three_elements(command):
    """A large error is met on coarser meshes."""
    settings = [f"{n}={v}" for n, v in (BRITTLE | COARSE).items()]
    words = "run", "dam", *(w for s in settings for w in ("--set", s)), "--levels", "45"
    _, out, _ = command(*words, "--accuracy", "50%", "--no-picture", "--no-fields")
    least = process_zone.least(load("dam", BRITTLE))
    used = int(out.partition("estimated errors with n_joint = ")[2].split()[0])
    assert used >= least > used / 2 and "process zone is" not in out
