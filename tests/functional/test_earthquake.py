"""Earthquake: Zangar's pressure, the water in the joint; silt's weight on an inclined face."""

import numpy as np
import pytest
from damjoint import InputError, RunError
from damjoint.engines import check_engine
from damjoint.input.resolve import load
from damjoint.statics import gravity
from numpy.testing import assert_allclose
from scipy import sparse
from scipy.sparse.linalg import spsolve

SMALL = {"n_joint": 40, "h_dam": 8, "h_found": 30}
QUAKE = {"k_h": 0.1, "law": "bond", "sigma_max": 0, "mu": 1.0}
UPLIFTS = ["imposed", "drained", "cracked", "flow"]


@pytest.mark.parametrize(
    "shape",
    [{"batter": 5, "batter_height": 35}, {"batter": 4, "batter_height": 20, "joint_height": 8}],
)
def test_resultants_of_zangar_and_of_the_weight_of_silt(solve, shape):
    """Those of the gravity method."""
    loads = {"k_h": 0.1, "added_mass": 2, "silt_height": 12, "silt_weight": 1}
    strong = {"sigma_max": 1e6, "G_f": 1000}
    (result,) = solve("dam", "20,41,41", **SMALL, **shape, **loads, **strong)
    block, last = gravity.at(result.case, 3), result.last
    assert_allclose([last[n] for n in "NTM"], (block.N, block.T, block.M), rtol=1e-6)
    lighter = load("dam", shape | loads | {"silt_weight": 0}, "20,41,41")
    assert block.N > gravity.at(lighter, 3).N


def largest_potential_pressure(angle, rows=40):
    """Largest p / (k_h w H) on a face inclined by an angle [degrees] from the vertical, for an
    incompressible reservoir of infinite length: Laplace's equation on linear triangles.
    """
    y = np.linspace(0, 1, rows + 1)
    away = np.concatenate([[0], np.geomspace(0.01, 8, 60)])
    lean = np.tan(np.radians(angle))
    points = np.array([(lean * height - x, height) for x in away for height in y])
    first = (np.arange(60)[:, None] * (rows + 1) + np.arange(rows)).ravel()
    other = first + rows + 1
    table = np.concatenate(
        [np.column_stack(c) for c in ((first, other, other + 1), (first, other + 1, first + 1))]
    )
    corner = points[table]
    edge = np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1)
    area = abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]) / 2
    parts = np.einsum("eik,ejk->eij", edge, edge) / (4 * area[:, None, None])
    entries = np.repeat(table, 3, axis=1).ravel(), np.tile(table, (1, 3)).ravel()
    laplace = sparse.csr_matrix((parts.ravel(), entries))
    flow = np.zeros(len(points))  # the normal acceleration times the face's length is that of dy
    flow[: rows + 1] = np.convolve(np.full(rows, 1 / rows), [0.5, 0.5])
    below = np.flatnonzero(points[:, 1] < 1)
    return spsolve(laplace[below][:, below].tocsc(), flow[below]).max()


def test_coefficients_of_zangar_against_potential_flow():
    """0.7425 on a vertical face [Chwang 1978]; the readings of Zangar's curve are near."""
    assert largest_potential_pressure(0) == pytest.approx(0.7425, abs=2e-3)
    shared = load("dam").shared
    for angle, coefficient in zip(shared["zangar_angle"][:-1], shared["zangar_cm"], strict=False):
        assert coefficient == pytest.approx(largest_potential_pressure(angle), abs=0.05)


@pytest.mark.parametrize("uplift", UPLIFTS)
def test_uplift_unchanged_by_an_earthquake(solve, uplift):
    """The resultant is that of the same level before the earthquake."""
    (result,) = solve("dam", "30,44,44", quake_uplift="unchanged", uplift=uplift, **SMALL, **QUAKE)
    assert not result.stopped
    history = result.history
    before, *during = np.flatnonzero(history["time"] >= 2)
    assert len(during) and history["crack_length"][-1] > history["crack_length"][before]
    assert_allclose(history["U"][during], history["U"][before], rtol=1e-12)
    assert_allclose(result.at(3)["p"], result.at(2)["p"], rtol=1e-12)


@pytest.mark.parametrize("uplift", UPLIFTS)
def test_no_uplift_in_the_crack_that_an_earthquake_opens(solve, uplift):
    """Vertical equilibrium is exact; the water is absent where the joint has opened by more than
    p / K_N, and unchanged where it is closed.
    """
    settings = SMALL | QUAKE | {"uplift": uplift, "k_h": 0.2, "n_joint": 80}
    levels, found = "30,42,42", {}
    for mode in ("unchanged", "zero"):
        (found[mode],) = solve("dam", levels, quake_uplift=mode, **settings)
        assert not found[mode].stopped
    wet, dry = found["unchanged"].last, found["zero"].last
    block = gravity.at(found["zero"].case, 3)
    assert dry["N"] + dry["U"] == pytest.approx(-block.resultant.fy, rel=1e-9)
    assert dry["T"] == pytest.approx(block.T, rel=1e-6)
    assert dry["U"] < 0.9 * wet["U"] and dry["crack_length"] < wet["crack_length"]
    rows, before = found["zero"].at(3), found["zero"].at(2)
    lost = before["p"] / found["zero"].case["K_N"]
    opened = np.flatnonzero((rows["delta_n"] > lost) & (before["delta_n"] <= 0))
    closed = np.flatnonzero(rows["delta_n"] < 0)
    size = before["p"].max()
    assert len(opened) > 3 and len(closed) > 4
    # the nodes have means of the elements beside them
    assert_allclose(rows["p"][opened[1:-1]] / size, 0, atol=0.02)
    assert_allclose(rows["p"][closed[4:]], before["p"][closed[4:]], rtol=1e-9)


def test_what_the_reference_model_and_own_meshes_do_not_have():
    case = load("dam", {"uplift": "cracked", "quake_uplift": "zero", "k_h": 0.1})
    try:
        with pytest.raises(InputError, match="quake_uplift = zero: must be crack"):
            check_engine(case, "getdp")
    except RunError:
        pytest.skip("no GetDP")
    with pytest.raises(InputError, match="added_mass = 2: must be 0 or 1 with a geometry"):
        load("stepped", {"added_mass": 2})
