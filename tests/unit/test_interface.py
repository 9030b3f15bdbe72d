"""Linear systems of the joint: the reduced system against the full one; derivatives of the flow
against differences."""

import numpy as np
import pytest
from damjoint.fem.bodies import Bodies
from damjoint.fem.condensation import condense
from damjoint.input.resolve import load
from damjoint.joint import interface as joint_interface
from damjoint.joint import linear_system
from damjoint.joint.flow import FlowDerivative
from damjoint.joint.interface import Interface, LastInterface
from damjoint.joint.linear_system import Border, DenseSystem, Tangent, WoodburySystem, lu_solve
from numpy.testing import assert_allclose

SMALL = {"n_joint": 10.0, "h_dam": 3.0, "h_found": 4.0, "order": 2.0}
UNDAMAGED = np.diag([1e12, 2e12, 2e12])


@pytest.fixture(scope="module", params=[2, 3])
def interface(request):
    solid = (
        {"dim": 3.0, "thickness": 0.5, "n_layers": 1.0, "hold_z": 1.0}
        if request.param == 3
        else {"dim": 2.0}
    )
    case = load("e", SMALL | solid)
    return Interface(condense(case, Bodies.of(case)), case["quadrature"])


def test_stiffness_of_points(interface, monkeypatch):
    """The assembly by terms is the product of sparse matrices, and that with a dense matrix."""
    rng = np.random.default_rng(24)
    number, size = len(interface.weights), len(interface.bulk.stiffness)
    before, stiffness = rng.normal(size=(number, 3, 3)), rng.normal(size=(size, size))
    for points in (np.arange(number), np.arange(0, number, 3), np.zeros(0, int)):
        tangent = before.copy()
        tangent[points] = rng.normal(size=(len(points), 3, 3))
        added = interface.assembly.with_joints(stiffness, tangent)
        changes = [interface.assembly.change(tangent, before)]
        with monkeypatch.context() as patch:
            patch.setitem(vars(interface.assembly), "terms", None)
            whole = interface.assembly.whole(tangent)
            changes.append(interface.assembly.change(tangent, before))
        assert whole.shape == (size, size)
        least = 1e-14 * np.abs(before).sum()
        assert_allclose(added - stiffness, whole.toarray(), rtol=1e-12, atol=least)
        (one, rows), (other, same_rows) = changes
        assert np.array_equal(rows, same_rows) and one.shape == other.shape == (len(rows), size)
        assert_allclose(one.toarray(), other.toarray(), rtol=1e-12, atol=least)


def test_two_small_interfaces_are_kept(monkeypatch):
    """A run and the search for its critical level take turns; a large one is freed first."""
    of = LastInterface().of
    cases = [load("e", SMALL | {"dim": 2.0, "order": 1.0}, levels) for levels in ("8", "11", "8.5")]
    cases[2] = cases[2].with_values({"E_dam": 1e10})
    first, crest = of(cases[0]), of(cases[1])
    assert first is not crest and of(cases[0]) is first and of(cases[1]) is crest
    of(cases[2])
    assert of(cases[1]) is crest and of(cases[0]) is not first
    monkeypatch.setattr(joint_interface, "SMALL", 0)
    first = of(cases[2])
    assert of(cases[1]) is not crest and of(cases[2]) is not first


@pytest.mark.parametrize(
    ("few", "by_columns"),
    [(0, 0), (linear_system.FEW, 0), (linear_system.FEW, 1)],
    ids=["by rows", "whole", "by columns"],
)
@pytest.mark.parametrize("flowing", [False, True])
@pytest.mark.parametrize("bordered", [False, True])
def test_solution_of_the_linear_system(interface, flowing, bordered, few, by_columns, monkeypatch):
    """A third of the points with another, unsymmetric tangent; pressures that depend on some of the
    unknowns."""
    monkeypatch.setattr(linear_system, "MOST_WHOLE", 0)
    monkeypatch.setattr(linear_system, "FEW", few)
    monkeypatch.setattr(linear_system, "BY_COLUMNS", by_columns)
    rng = np.random.default_rng(142)
    number, size = len(interface.weights), len(interface.bulk.stiffness)
    undamaged = np.broadcast_to(UNDAMAGED, (number, 3, 3))
    tangent = undamaged.copy()
    changed = rng.permutation(number)[: number // 3]
    tangent[changed] = 1e11 * rng.normal(size=(len(changed), 3, 3)) + np.diag([1e8, 2e12, 1e8])
    _, rows = interface.assembly.change(tangent, undamaged)
    assert 0 < len(rows) < size
    system = WoodburySystem(interface.assembly, interface.bulk.stiffness, undamaged)
    matrix = interface.bulk.stiffness + interface.assembly.whole(tangent).toarray()
    flow, lines = None, ()
    if flowing:
        columns = np.sort(rng.permutation(size)[: size // 4])
        lines = (interface.joints[0].flow,)
        lift = system.lift(lines)
        pressure = 1e10 * rng.normal(size=(lift.shape[1], size // 4))
        matrix[:, columns] -= lift @ pressure
        flow = FlowDerivative(pressure=pressure, columns=columns)
    right, slope, row = rng.normal(size=(3, size))
    gap = 0.7e-12  # of the size of x
    border = Border(slope, row, 0.3e-12, gap) if bordered else None
    x, s = system.solve(Tangent(tangent, flow, lines), right, border)
    if bordered:
        whole = np.block([[matrix, slope[:, None]], [row[None, :], np.array([[0.3e-12]])]])
        expected = np.linalg.solve(whole, np.append(right, gap))
        assert s == pytest.approx(expected[-1], rel=1e-6)
        expected = expected[:-1]
    else:
        expected = np.linalg.solve(matrix, right)
        assert s == 0
    assert_allclose(x, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_dense_system(interface):
    """The system of a small time step is that of the whole matrix."""
    rng = np.random.default_rng(142)
    tangent = 1e11 * rng.normal(size=(len(interface.weights), 3, 3)) + UNDAMAGED
    matrix = interface.bulk.stiffness + interface.assembly.whole(tangent).toarray()
    right = rng.normal(size=len(matrix))
    found, _ = DenseSystem(interface.assembly, interface.bulk.stiffness).solve(
        Tangent(tangent), right
    )
    expected = np.linalg.solve(matrix, right)
    assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_pressures_derivatives(interface):
    """With the jump, against central differences; and linear in the imposed head."""
    rng = np.random.default_rng(142)
    (joint,) = interface.joints
    flow, weights = joint.flow, joint.points.weights
    jump, imposed = (rng.normal(1, 0.3, len(interface.bulk.stiffness)), 9e4 * (1 - joint.fields.xi))

    def pressure(jump, imposed=imposed):
        opening = np.maximum(flow.opening @ jump, 0)
        return flow.solve((1 + opening) ** 3 * weights, imposed)

    opening = np.maximum(flow.opening @ jump, 0)
    derivative = flow.derivative(
        pressure(jump), np.where(opening > 0, 3 * (1 + opening) ** 2, 0) * weights
    )
    along = rng.normal(size=len(jump))
    given = derivative.pressure @ along[derivative.columns]
    ahead, behind = (pressure(jump + h * along).pressure for h in (1e-5, -1e-5))
    assert_allclose(given, (ahead - behind) / 2e-5, rtol=0, atol=1e-5 * np.abs(given).max())
    tripled = pressure(jump, 3 * imposed).pressure
    assert_allclose(tripled, 3 * pressure(jump).pressure, rtol=1e-9)


@pytest.mark.parametrize("condition", [1e2, 1e6, 1e11])
def test_single_precision_is_refined_or_given_up(condition):
    """Beyond 1e7 single precision has no correct digit: double has to take over."""
    rng = np.random.default_rng(142)
    left, right = (np.linalg.qr(rng.normal(size=(500, 500)))[0] for _ in range(2))
    matrix = left * np.geomspace(1, 1 / condition, 500) @ right
    expected = rng.normal(size=500)
    found = lu_solve(matrix.copy(), matrix @ expected)
    assert_allclose(found, expected, rtol=0, atol=1e-13 * condition)


def test_singular():
    with pytest.raises(np.linalg.LinAlgError):
        lu_solve(np.zeros((500, 500)), np.ones(500))
