"""Sparse factorisations against dense linear algebra."""

from pathlib import Path

import numpy as np
import pytest
from damjoint.csr import CsrMatrix
from damjoint.fem import factor
from scipy import sparse


@pytest.fixture
def system():
    """A symmetric positive definite matrix of a grid with two unknowns a node, and loads."""
    line = sparse.diags([-1, 2.5, -1], [-1, 0, 1], (12, 12))
    grid = sparse.kron(line, sparse.eye(12)) + sparse.kron(sparse.eye(12), line)
    matrix = sparse.kron(grid, [[2, 0.5], [0.5, 1]], format="csr")
    return matrix, np.random.default_rng(0).normal(size=(matrix.shape[0], 3))


@pytest.fixture(params=["MUMPS", "MUMPS in METIS's order", "SuperLU"])
def method(request, monkeypatch):
    if request.param == "SuperLU":
        monkeypatch.setattr(factor, "library", lambda: None)
    elif factor.is_slow():
        pytest.skip("MUMPS")
    elif request.param != "MUMPS":
        pytest.importorskip("pymetis")
        monkeypatch.setattr(factor, "LARGE", 0)


def test_schur_complement(system, method):
    matrix, loads = system
    keep = np.array([7, 3, 250, 100, 101])
    inside = np.setdiff1d(np.arange(len(loads)), keep)
    dense = matrix.toarray()
    through = dense[np.ix_(keep, inside)] @ np.linalg.inv(dense[np.ix_(inside, inside)])
    schur, reduced = factor.schur_complement(CsrMatrix.of_scipy(matrix), keep, loads)
    expected = dense[np.ix_(keep, keep)] - through @ dense[np.ix_(inside, keep)]
    assert schur == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert reduced == pytest.approx(loads[keep] - through @ loads[inside], rel=1e-12, abs=1e-13)


def test_schur_complement_without_other_unknowns(system, method):
    matrix, loads = system
    keep = np.arange(len(loads))[::-1]
    schur, reduced = factor.schur_complement(CsrMatrix.of_scipy(matrix), keep, loads)
    assert np.array_equal(schur, matrix.toarray()[::-1, ::-1])
    assert np.array_equal(reduced, loads[::-1])


def test_loads_as_a_border(system, method):
    """Also a load on one unknown, the same twice, and one on a kept unknown only."""
    matrix, loads = system
    keep, size = np.array([7, 3, 250, 100, 101]), len(loads)
    unit = np.eye(size)[:, [40, 40, 3]]
    loads = np.hstack([loads, unit])
    expected, reduced = factor.schur_complement(CsrMatrix.of_scipy(matrix), keep, loads)
    with_loads = factor.bordered(matrix, sparse.csr_matrix(loads))
    schur = factor.dense_schur(with_loads, np.append(keep, np.arange(size, with_loads.shape[0])))
    assert schur[:5, :5] == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert schur[:5, 5:] == pytest.approx(reduced, rel=1e-12, abs=1e-13)
    rounding = 1e-12 if factor.is_slow() else 0.0
    assert np.abs(schur - schur.T).max() <= rounding * np.abs(schur).max()
    inside = np.setdiff1d(np.arange(size), keep)
    moved = np.linalg.solve(matrix.toarray()[np.ix_(inside, inside)], loads[inside])
    assert -schur[5:, 5:] == pytest.approx(loads[inside].T @ moved, rel=1e-12, abs=1e-13)


def test_factors_that_are_stored(system, method):
    """Two right-hand sides, one after the other; two sets of factors at once."""
    matrix, loads = system
    keep = np.array([7, 3, 250, 100, 101])
    factors = factor.partial_factors(matrix, keep)
    others = factor.partial_factors(4 * matrix, keep)
    for right in loads.T:
        reduced = factors.reduce(right)
        others.reduce(right)
        solution = factors.expand(np.linalg.solve(factors.schur, reduced))
        assert matrix @ solution == pytest.approx(right, rel=1e-11, abs=1e-12)
    assert others.schur == pytest.approx(4 * factors.schur, rel=1e-12)


def test_solution(system, method):
    matrix, loads = system
    solution = factor.solve_symmetric(CsrMatrix.of_scipy(matrix), loads)
    assert matrix @ solution == pytest.approx(loads, rel=1e-11, abs=1e-12)


def test_a_library_that_does_not_load_is_compiled_anew(tmp_path, monkeypatch):
    if factor.is_slow():
        pytest.skip("MUMPS")
    monkeypatch.setattr(factor, "INSTALLED", tmp_path / "none")
    path = tmp_path / Path(factor.library()._name).name
    path.write_bytes(b"of another machine")
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    factor.library.cache_clear()
    assert factor.library()._name == str(path) and path.stat().st_size > 1000
    whole = path.read_bytes()
    assert factor.is_whole(path)
    copy = tmp_path / "copy.so"
    for place in range(0, len(whole), 97):  # a library with a changed bit loads, or ends Python
        copy.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert not factor.is_whole(copy)


def test_the_library_of_the_installation_is_used(tmp_path, monkeypatch):
    if factor.is_slow():
        pytest.skip("MUMPS")
    monkeypatch.setattr(factor, "INSTALLED", tmp_path / "lib")
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path / "cache"))
    factor.compile_into(tmp_path / "lib")
    factor.library.cache_clear()
    path = tmp_path / "lib" / factor.file_name()
    assert factor.library()._name == str(path) and not (tmp_path / "cache").exists()


def test_without_a_compiler_there_is_superlu(tmp_path, monkeypatch):
    monkeypatch.setattr(factor, "INSTALLED", tmp_path / "none")
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path))
    monkeypatch.setenv("PATH", "")
    factor.library.cache_clear()
    try:
        assert factor.is_slow() and factor.name().startswith("SuperLU")
        assert not list(tmp_path.iterdir())
    finally:
        factor.library.cache_clear()


def test_without_a_cache_nothing_is_left_of_what_is_compiled(tmp_path, monkeypatch):
    if factor.is_slow():
        pytest.skip("MUMPS")
    monkeypatch.setattr(factor, "INSTALLED", tmp_path / "none")
    monkeypatch.setattr(factor.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("DAMJOINT_CACHE", "")
    factor.library.cache_clear()
    mumps = factor.library()
    factor.library.cache_clear()
    assert mumps.damjoint_mumps_version and not list(tmp_path.iterdir())
