"""damjoint law: a path file in, the path with stresses and internal variables out."""

import csv
import io

import numpy as np
from damjoint.engines.getdp import law
from numpy.testing import assert_allclose


def columns(text):
    rows = list(csv.DictReader(io.StringIO(text)))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_path_file_to_standard_output_and_to_a_file(command, tmp_path):
    """By hand: peak at 1e-10 m, half of it at 1.1e-10 m, contact at -1e-9 m; p is subtracted."""
    (tmp_path / "path.csv").write_text(
        "delta_n,delta_t1,delta_t2,p\n1e-10,0,0,0\n1.1e-10,0,0,1000\n-1e-9,2e-9,-1e-9,0\n"
    )
    settings = "K_N=1e12", "K_T=5e11", "sigma_max=100", "pena_rupture=0.2"
    words = "law", "rupture", "--path", "path.csv", *(w for s in settings for w in ("--set", s))
    code, out, err = command(*words)
    assert (code, err) == (0, "")
    assert command(*words, "--out", "answer.csv") == (0, "", "")
    for table in (columns(out), columns((tmp_path / "answer.csv").read_text())):
        jumps, stresses = ["delta_n", "delta_t1", "delta_t2"], ["sigma_n", "tau_1", "tau_2"]
        assert list(table)[:7] == [*jumps, "p", *stresses]
        assert_allclose(table["sigma_n"], [100, 50 - 1000, -1000], rtol=1e-9)
        assert_allclose(table["tau_1"], [0, 0, 1000], rtol=1e-9, atol=1e-9)
        assert_allclose(table["tau_2"], [0, 0, -500], rtol=1e-9, atol=1e-9)
        assert_allclose(table["kappa"], [1e-10, 1.1e-10, 1.1e-10], rtol=1e-9)


def test_path_of_a_grouted_joint(command, tmp_path):
    """Opened by 1 mm at t = 1, grouted at t = 2, pressed against the grout at t = 3."""
    (tmp_path / "path.csv").write_text(
        "delta_n,delta_t1,delta_t2\n1e-3,0,0\n1e-3,0,0\n9.9995e-4,0,0\n"
    )
    settings = "K_N=1e12", "grout_pressure=5e4", "grout_t=2"
    words = "law", "rupture", "--path", "path.csv", *(w for s in settings for w in ("--set", s))
    code, out, _ = command(*words)
    assert code == 0
    table = columns(out)
    assert_allclose(table["sigma_n"], [0, -5e4, -1e5], rtol=1e-9)
    assert_allclose(table["thickness"], [0, 1.00005e-3, 1.00005e-3], rtol=1e-12)


def test_works_after_the_end_of_the_path_are_refused(command, tmp_path):
    (tmp_path / "path.csv").write_text("delta_n,delta_t1,delta_t2\n1e-3,0,0\n1e-3,0,0\n")
    words = "--set", "saw_thickness=1e-3", "--set", "saw_t=3"
    code, out, err = command("law", "rupture", "--path", "path.csv", *words)
    assert (code, out) == (2, "") and "saw_t = 3: must be < 3" in err
    assert command("law", "rupture", "--path", "path.csv", *words[:3], "saw_t=2")[0] == 0


def test_friction_without_a_pressure_column(command, tmp_path):
    (tmp_path / "path.csv").write_text("delta_n, delta_t1, delta_t2\n-1e-8, 3e-9, 0\n")
    settings = "K_N=1e12", "K_T=2e12", "mu=0.35", "adhesion=1000", "pena_tang=0"
    words = "law", "friction", "--path", "path.csv", *(w for s in settings for w in ("--set", s))
    code, out, _ = command(*words)
    assert code == 0
    table = columns(out)
    assert_allclose([table["sigma_n"][0], table["tau_1"][0]], [-1e4, 4500], rtol=1e-9)
    assert_allclose(
        [table["lambda"][0], table["slip_1"][0], table["slip_2"][0]],
        [0.75e-9, 0.75e-9, 0],
        rtol=1e-9,
    )


def test_a_path_of_a_thousand_rows():
    """More than GetDP reads in one line."""
    closing = -np.linspace(1e-10, 1e-9, 1000)
    jumps = np.column_stack([closing, closing, 0 * closing])
    answer = law.evaluate("rupture", jumps, settings={"K_N": 1e12})
    assert_allclose(answer["sigma_n"], 1e12 * closing, rtol=1e-12)


def test_a_law_has_no_values_of_several_joints(command, tmp_path):
    (tmp_path / "path.csv").write_text("delta_n,delta_t1,delta_t2\n1e-6,0,0\n")
    code, out, err = command("law", "friction", "--path", "path.csv", "--set", "mu=0.5,0.7")
    assert (code, out) == (2, "") and "mu = 0.5,0.7: must be a single value" in err
