"""Sparse matrices against scipy's, also where these do the work."""

import numpy as np
import pytest
from damjoint import csr
from damjoint.csr import CsrMatrix, added, stacked
from scipy import sparse


@pytest.fixture(params=[csr.LARGE, 0], ids=["numpy", "scipy"])
def matrices(request, monkeypatch):
    """Three matrices of scipy: two of a shape, and one to multiply them with."""
    monkeypatch.setattr(csr, "LARGE", request.param)
    shapes = (30, 20), (30, 20), (20, 12)
    return [sparse.random(*s, 0.1, "csr", random_state=7 + k) for k, s in enumerate(shapes)]


def test_operations(matrices):
    one, other, third = matrices
    a, b, c = map(CsrMatrix.of_scipy, matrices)
    rng = np.random.default_rng(8)
    vector, table = rng.normal(size=20), rng.normal(size=(20, 5))
    weights, rows, columns = rng.normal(size=30), np.array([7, 0, 29, 7]), np.array([3, 5, 19])
    pairs = [
        (a.T, one.T),
        (a @ c, one @ third),
        (added([a, b]), one + other),
        (stacked([a, b]), sparse.vstack([one, other])),
        (a.scaled(weights), sparse.diags(weights) @ one),
        (-a, -one),
        (a[rows], one[rows]),
        (a[1::2], one[1::2]),
        (a.columns(columns), one[:, columns]),
        (a.where(a.data > 0.5), one.multiply(one > 0.5)),
    ]
    for result, expected in pairs:
        assert result.shape == expected.shape
        np.testing.assert_allclose(result.toarray(), expected.toarray(), rtol=1e-14)
    np.testing.assert_array_equal(a @ vector, one @ vector)
    np.testing.assert_array_equal(a.T @ weights, one.T @ weights)
    np.testing.assert_allclose(a @ table, one @ table, rtol=1e-13, atol=1e-14)


def test_entries_of_the_same_place_are_added():
    values, rows, columns = np.array([1.0, 2, 4, 8]), np.array([2, 0, 2, 2]), np.array([1, 3, 1, 0])
    matrix = CsrMatrix.of_entries(values, rows, columns, (4, 4))
    assert matrix.toarray().tolist() == [[0, 0, 0, 2], [0] * 4, [8, 5, 0, 0], [0] * 4]
