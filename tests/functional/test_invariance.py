"""Invariance: order, dimension, scale, steps and engine do not change the results."""

import numpy as np
import pytest
from closed_forms import JUMPS_AND_STRESSES, differences
from damjoint import runner
from damjoint.engines.getdp import law
from damjoint.input.resolve import load
from numpy.testing import assert_allclose
from variants import further


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["a", "c"])
def test_order_1_converges_to_order_2(solve, name):
    """At half the element size half the difference or less; well inside the joint below 0.3 %."""
    crest = []
    for n in (25, 50):
        size = {"n_joint": n, "h_dam": 35 / n, "h_found": 70 / n, "uplift": "none"}
        one, two = (solve(name, "6", order=order, **size)[0] for order in (1, 2))
        crest.append(abs(one.history["crest_ux"][-1] / two.history["crest_ux"][-1] - 1))
        a, b = (np.interp([1, 2.5, 4], r.at()["x"], r.at()["sigma_n"]) for r in (one, two))
        assert_allclose(a, b, rtol=3e-3)
    assert crest[1] < 0.5 * crest[0]


@pytest.mark.parametrize(
    "name, flat, solid",
    [
        ("a", {}, {"mesh_pattern": "layers", "n_layers": 2}),  # nu = 0: nothing varies along z
        ("c", {}, {"n_layers": 1, "hold_z": 1}),
    ],
)  # nu = 0.25, fixed along z: plane strain
def test_3d_is_equal_to_2d(solve, name, flat, solid):
    size = {"n_joint": 20, "h_dam": 2, "h_found": 3}
    (two,) = solve(name, "6,9", uplift="imposed", **size, **flat)
    (three,) = solve(name, "6,9", uplift="imposed", **size, **solid, dim=3, thickness=0.2)
    assert max(differences(two, three)) < 1e-3
    assert_allclose(three.history["crest_ux"], two.history["crest_ux"], rtol=5e-3)


@pytest.mark.heavy
def test_split_layers_contain_the_plane_solution(solve):
    """Order 2, one layer as thick as the joint is long: as accurate as 2D, and close to it."""
    size = {"n_joint": 20, "h_dam": 2, "h_found": 3, "order": 2, "uplift": "imposed", "nu": 0.25}
    (two,) = solve("a", "6,9", **size)
    (three,) = solve("a", "6,9", **size, dim=3, mesh_pattern="split", thickness=5, hold_z=1)
    assert max(differences(two, three)) < 6e-3
    assert_allclose(three.history["crest_ux"], two.history["crest_ux"], rtol=2e-3)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "order, pattern, bound", [(1, "layers", 1e-9), (2, "layers", 1e-9), (2, "split", 5e-3)]
)
def test_nothing_varies_along_z(solve, order, pattern, bound):
    """nu = 0: the 3D solution is plane; nearly so in split layers, where the diagonals of the
    joint's rectangles have one direction.
    """
    (result,) = solve(
        "a",
        "3",
        uplift="none",
        dim=3,
        order=order,
        mesh_pattern=pattern,
        thickness=0.2,
        n_joint=10,
        h_dam=2,
        h_found=3,
    )
    rows = result.at()
    for x in np.unique(rows["x"].round(6)):
        across = rows["delta_n"][np.isclose(rows["x"], x)]
        assert np.ptp(across) < bound * np.abs(rows["delta_n"]).max()
    assert np.abs(rows["delta_t2"]).max() < bound * np.abs(rows["delta_n"]).max()


STIFF = {"E": 3e11, "K_N": 1e11}  # a tenth


@pytest.mark.parametrize(
    "name, settings", [("a", {"K_T": 1e11}), ("c", {"K_T": 2e11, "pena_tang": 2e10})]
)
def test_a_tenth_of_all_stiffnesses_gives_ten_times_the_jumps(solve, name, settings):
    """The stresses are the same."""
    one, other = solve(name)[0], solve(name, uplift="imposed", **STIFF, **settings)[0]
    assert max(differences(one, other, factors={"delta_n": 0.1, "delta_t1": 0.1})) < 1e-7


@pytest.mark.parametrize(
    "name, settings", [("a", {"sigma_max": 1000}), ("c", {"adhesion": 10_000})]
)
def test_ten_times_all_loads_and_strengths_give_ten_times_all_results(solve, name, settings):
    one, other = (
        solve(name)[0],
        solve(name, uplift="imposed", rho_dam=24_000, rho_water=10_000, **settings)[0],
    )
    assert max(differences(one, other, factors=dict.fromkeys(JUMPS_AND_STRESSES, 0.1))) < 1e-7


@pytest.mark.parametrize("name, steps", [("c", 5), ("c", 20), ("a", 4)])
def test_monotone_filling_does_not_depend_on_the_steps(solve, name, steps):
    one, other = (
        solve(name, "9", uplift="imposed")[0],
        solve(name, "9", steps=steps, uplift="imposed")[0],
    )
    assert max(differences(one, other)) < 1e-6


@pytest.mark.heavy
def test_emptying_depends_little_on_the_steps(solve):
    """Friction, 6, 9, 2, 8 m: where the heel closes again, its slip is that of the step before, so
    the shear there depends on the steps; the openings hardly do.
    """
    one, twenty = (solve("c", "6,9,2,8", steps=steps, uplift="imposed")[0] for steps in (1, 20))
    for time in (1, 2, 3, 4):
        opening, slip, normal, shear = differences(one, twenty, time)
        assert opening < 1e-3 and normal < 1e-3 and slip < 5e-3 and shear < 2e-2


@pytest.mark.parametrize(
    "name, levels", further(2, [("c", "6,9,2,8"), ("g", "9,4,9"), ("a", "6,9,2,8"), ("i", "9,1,9")])
)
@pytest.mark.parametrize("nodes", further(1, [4, 12]))
def test_every_row_of_the_joint_table_obeys_the_law(solve, name, levels, nodes):
    """The law along the jumps of each node, level after level, gives the same stresses."""
    result = solve(name, levels, uplift=load(name)["uplift"])[0]
    steps = [result.at(time) for time in result.case.requested]
    picked = np.linspace(0, len(steps[0]["x"]) - 1, nodes).astype(int)
    for node in picked:
        column = lambda key: np.array([step[key][node] for step in steps])  # noqa: B023
        stiffness = "K_N", "K_T", "pena_rupture", "pena_tang"
        answer = law.evaluate(
            result.case["law"],
            np.column_stack([column(n) for n in ("delta_n", "delta_t1", "delta_t2")]),
            column("p"),
            {n: result.case[n] for n in (*stiffness, "sigma_max", "alpha", "mu", "adhesion")},
        )
        for key in ("sigma_n", "tau_1"):
            assert_allclose(
                column(key),
                answer[key],
                rtol=1e-6,
                atol=1,
                err_msg=f"{key} at x = {steps[0]['x'][node]:g}",
            )


def test_a_second_run_reads_the_condensed_bodies_from_the_cache(tmp_path, monkeypatch):
    """Also with another load or joint."""
    monkeypatch.setenv("DAMJOINT_CACHE", str(tmp_path / "cache"))
    one, again, other = (
        runner.run(load("c", settings), tmp_path / "out", False, False, False)[0]
        for settings in ({}, {}, {"mu": 0.4, "rho_dam": 2300})
    )
    assert ["cache" in r.info["wall_seconds"] for r in (one, again, other)] == [False, True, True]
    assert max(differences(one, again)) == 0
    monkeypatch.setenv("DAMJOINT_CACHE", "")
    (fresh,) = runner.run(
        load("c", {"mu": 0.4, "rho_dam": 2300}), tmp_path / "out", False, False, False
    )
    assert "cache" not in fresh.info["wall_seconds"]
    assert max(differences(fresh, other)) < 1e-9
