"""Derivatives with parameters: closed forms, central differences of runs, messages."""

import csv
from dataclasses import replace

import damjoint as dj
import numpy as np
import pytest
from closed_forms import WATER
from damjoint.input.resolve import varied
from damjoint.solver.derivatives import Side, half_difference
from damjoint.solver.load_stepper import LoadStepper
from damjoint.studies import sensitivity
from damjoint.studies.critical import Search
from damjoint_tools.random_scenes import random_scene
from scipy.optimize import brentq

SLIDES = {"law": "friction", "adhesion": 0.0, "pena_tang": 0.0, "n_joint": 40, "order": 1}


def slopes(mu, rho=2400.0, foot=0.0):
    """Level at which T = mu N at the joint of the 45 m dam at a height [m], and its derivatives
    with mu and the density of the dam: N'/(T' - mu N') and mu N_rho / (T' - mu N').
    """
    base = 34 - (34 - 5) * foot / 45
    area = (45 - foot) * (base + 5) / 2
    half = mu * base / 2
    depth = np.sqrt(half**2 + 2 * mu * rho * 9.81 * area / WATER) - half
    normal = rho * 9.81 * area - WATER * base * depth / 2
    denominator = WATER * depth + mu * WATER * base / 2
    return foot + depth, normal / denominator, mu * 9.81 * area / denominator


def of_critical(case, *names):
    """Derivatives of the critical level by name, and the level."""
    answer = Search(replace(case, all_steps=True), "level").find()
    rows = sensitivity.of_point(answer.point, names)
    assert not any(row.kink for row in rows if row.name in ("mu", "rho_dam"))
    return answer.value, {row.name: row.derivatives["critical_level"] for row in rows}


@pytest.mark.heavy
def test_the_critical_level_of_a_dam_that_slides():
    """In closed form; elastic values do not matter."""
    case = dj.case("dam", levels=[30, 36], mu=0.6, **SLIDES)
    level, rates = of_critical(case, "mu", "rho_dam", "rho_water", "E_dam", "K_N")
    exact, by_mu, by_rho = slopes(0.6)
    assert level == pytest.approx(exact, rel=1e-7)
    assert rates["mu"] == pytest.approx(by_mu, rel=1e-6)
    assert rates["rho_dam"] == pytest.approx(by_rho, rel=1e-6)
    assert rates["rho_water"] == pytest.approx(-by_rho * 2.4, rel=1e-6)  # only their ratio matters
    assert abs(rates["E_dam"]) * 2.5e10 < 1e-6 and abs(rates["K_N"]) * 1e11 < 1e-6


@pytest.mark.heavy
def test_the_critical_level_of_the_joint_that_fails():
    """The friction of another one has no effect."""
    lifts = {**SLIDES, "n_joint": 20, "lift_heights": (12.0,), "mu": 0.8, "lift 12 m.mu": 0.5}
    names = "lift 12 m.mu", "base.mu"
    level, rates = of_critical(dj.case("dam", levels=[25, 30], **lifts), *names)
    exact, by_mu, _ = slopes(0.5, foot=12.0)
    assert level == pytest.approx(exact, rel=1e-6)
    assert rates["lift 12 m.mu"] == pytest.approx(by_mu, rel=1e-5)
    assert abs(rates["base.mu"]) < 1e-6


@pytest.mark.heavy
@pytest.mark.parametrize("beyond", [-1e-7, 1e-7])
def test_a_kink_of_the_critical_level_where_another_joint_fails(beyond):
    """Base and lift slide at the same level but for 2 um: the derivatives are those of the one that
    slides first, in closed form, and a kink is said.
    """
    base, by_base, _ = slopes(0.6)
    tie = brentq(lambda mu: slopes(mu, foot=12.0)[0] - base, 0.3, 0.9, xtol=1e-14)
    lifts = {**SLIDES, "n_joint": 4, "lift_heights": (12.0,), "lift 12 m.mu": tie + beyond}
    case = dj.case("dam", levels=[25, 30], mu=0.6, **lifts)
    answer = Search(replace(case, all_steps=True), "level").find()
    rows = sensitivity.of_point(answer.point, ["base.mu", "lift 12 m.mu"])
    assert answer.value == pytest.approx(base, abs=5e-6) and all(row.kink for row in rows)
    found = [row.derivatives["critical_level"] for row in rows]
    by_lift = slopes(tie, foot=12.0)[1]
    expected = (by_base, 0.0) if beyond > 0 else (0.0, by_lift)
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)


def history(case):
    """The last row of history.csv of a run, with safety factors and the end of the crack."""
    stepper = LoadStepper(case)
    stepper.run()
    return sensitivity.values_of(Side(stepper.model, stepper.state, stepper.history.at_rest))


OF_LAWS = {
    "rupture": ("K_N", "K_T", "sigma_max"),
    "friction": ("mu", "adhesion", "K_T", "pena_tang"),
    "bond": ("mu", "adhesion", "G_t", "sigma_max"),
    "endo": ("mu", "adhesion", "K_N"),
    "mixed": ("K_N", "K_T", "sigma_max", "G_f"),
}
OF_UPLIFTS = {
    "none": {},
    "imposed": {},
    "drained": {"drain_effectiveness": 0.5, "drain_x": 4.0, "drain_level": 3.0},
    "cracked": {},
    "flow": {"aperture_min": 1e-4},
    "turbulent": {"aperture_min": 1e-3, "uplift": "flow", "turbulent": 1},
}
#: Uplifts with which the laws that have two soften exponentially.
EXPONENTIAL = "imposed", "cracked"
#: A force whose factor is unknown, with an energy that is dissipated.
DISSIPATION = {"drive": "dissipation", "drive_load": "force", "force_x": 1e6, "force_t": 1}
DISSIPATION |= {"drive_energy": 10.0, "steps": 1}
#: Columns that are compared, and their size [m], [N/m], [N]; a derivative is exact to 1e-6, or to
#: 1e-9 of the size for a relative change of one.
SIZES = {"crest_ux": 1e-2, "max_opening": 1e-3, "N": 1e7, "T": 1e7, "M": 1e8, "U": 1e7}
SIZES |= {"crack_end": 1e2, "SSF": 1.0, "OSF": 1.0, "x_resultant": 1e2}
EXACT, OF_SIZE = 1e-6, 1e-8


@pytest.mark.heavy
@pytest.mark.parametrize(
    "uplift",
    OF_UPLIFTS,
)
@pytest.mark.parametrize("law", OF_LAWS)
def test_the_results_of_a_run_against_central_differences(law, uplift):
    """Of fourth order, of runs that are converged to round-off; joint cracked and slipping."""
    weak = {"mu": 1.2, "adhesion": 4e4, "sigma_max": 3e4, "dam_base": 26, "tolerance": 3e-14}
    if law == "mixed":  # without friction: strength holds it
        weak |= {"sigma_max": 8e5, "G_f": 500.0}
    weak |= {"softening": "exponential"} if uplift in EXPONENTIAL else {}
    given = {"n_joint": 12, "order": 1, **weak, "uplift": uplift, **OF_UPLIFTS[uplift]}
    case = dj.case("dam", levels=[20, 36, 42], steps=1, law=law, **given)
    names = [*OF_LAWS[law], "rho_dam", "E_dam", *list(OF_UPLIFTS[uplift])[:1]]
    rows = [row for row in sensitivity.of_run(case, names) if row.level == 42]
    assert [row.name for row in rows] == names
    last = history(case)
    if uplift != "none":  # the joint opens
        least = 5e-5 if law != "mixed" else 1e-5
        assert last["max_opening"] > least and (law == "friction") == (last["crack_length"] > 0)
    if law == "mixed":  # and softens
        assert last["bonded_length"] < 26 - 0.1
    if law == "friction":
        assert abs(last["crack_end"] - last["crack_length"]) < 26 / 12
    for row in rows:
        # its points slip one after the other; other laws are smooth farther, and less is round-off
        step = (2e-5 if law == "friction" else 1e-4) * row.value
        at = {k: history(dj.case(case, **{row.name: row.value + k * step})) for k in (-2, -1, 1, 2)}
        for column in SIZES.keys() & row.derivatives.keys():
            size = SIZES[column]
            wide, narrow = (at[k][column] - at[-k][column] for k in (2, 1))
            expected = (8 * narrow - wide) / (12 * step)
            allowed = OF_SIZE * size / row.value
            got = row.derivatives[column]
            assert got == pytest.approx(expected, rel=EXACT, abs=allowed), (row.name, column)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "driven", [{"drive": "heel"}, {"drive": "crest", "drive_load": "quake", "k_h": 0.1}]
)
def test_a_prescribed_displacement_counts_from_a_state_that_has_derivatives(driven):
    """It did not, so that T had five times its derivative with K_T."""
    coarse = {"n_joint": 6, "order": 1, "tolerance": 1e-13, "drive_by": 3e-4, "quake_t": 1}
    weak = {"mu": 1.2, "adhesion": 4e4, "sigma_max": 3e4, "weight_first": 1}
    case = dj.case("dam", levels=[10, 20], steps=1, **driven, **coarse, **weak)
    names = "mu", "K_T", "rho_dam", "drive_by"
    rows = [row for row in sensitivity.of_run(case, names) if row.time == 2]
    assert [row.name for row in rows] == list(names)
    assert all(row.derivatives["T"] != 0 for row in rows if row.name != "mu")
    for row in rows:
        step = 1e-5 * row.value
        low, high = (history(dj.case(case, **{row.name: row.value + k * step})) for k in (-1, 1))
        for column in ("crest_ux", "max_opening", "N", "T", "M"):
            expected, allowed = (high[column] - low[column]) / (2 * step), SIZES[column] / row.value
            got = row.derivatives[column]
            assert got == pytest.approx(expected, rel=EXACT, abs=OF_SIZE * allowed), row.name


def test_states_under_control_of_the_dissipation_have_no_derivative():
    case = dj.case("dam", levels=[20, 20], n_joint=4, order=1, **DISSIPATION)
    with pytest.raises(dj.RunError, match="dissipation control, or after drive_end, has no deriv"):
        sensitivity.of_run(case, ["mu"])


#: Half of a difference of runs over the value of a parameter, and change of the derivative beyond
#: which this one is at a kink, or not smooth [-].
STEP, SMOOTH = 2e-5, 1e-4


def histories(case):
    """Rows at the levels of a run, see `history`; None if it ends early."""
    stepper = LoadStepper(case)
    stepper.run()
    model, saved = stepper.model, stepper.history.saved
    rows = [sensitivity.values_of(Side(model, s, stepper.history.at_rest)) for s in saved]
    return rows if len(rows) == len(case.levels) else None


@pytest.mark.heavy
@pytest.mark.parametrize("numbers", [(0, 2, 3), (6, 7, 9, 11, 12, 13, 15)])
def test_random_dams_against_central_differences(numbers):
    """Of random laws, uplifts, lifts, loads and works; one of their parameters each, to 1e-6 of the
    derivative, or of the result for a relative change of one; away from kinks.
    """
    compared = 0
    for number in numbers:
        case = varied(random_scene(5, number).case, {"n_joint": 4, "order": 1, "tolerance": 1e-13})
        names = sensitivity.all_of(case)
        name = names[np.random.default_rng(number).integers(len(names))]
        value, _, high = half_difference(case, name)
        step = STEP * abs(value) or 10 * (high - value)
        try:
            middle, *ends = (
                histories(varied(case, {name: value + k * step})) for k in (0, -2, -1, 1, 2)
            )
            rows = sensitivity.of_run(case, [name]) if middle else []
        except (dj.InputError, dj.RunError):  # beyond what is allowed; unstable growth
            continue
        if any(end is None for end in ends):
            continue
        for at, row in enumerate(rows):
            for column in SIZES.keys() & row.derivatives.keys():
                here, (far, low, high, top) = (
                    middle[at][column],
                    [end[at][column] for end in ends],
                )
                wide, narrow = (top - far) / (4 * step), (high - low) / (2 * step)
                size = max(abs(here), SIZES[column] / 10) / (abs(value) or 1.0)
                allowed = EXACT * max(abs(narrow), size)
                bends = abs(wide - narrow), abs((high - here) / step - narrow)
                rough = row.kink or max(bends) > SMOOTH * max(abs(narrow), size)
                if rough or not np.isfinite(here):
                    continue
                expected = (4 * narrow - wide) / 3
                got = row.derivatives[column]
                assert got == pytest.approx(expected, rel=0, abs=allowed), (number, name, column)
                compared += 1
    assert compared >= 5 * len(numbers)


@pytest.mark.heavy
def test_fifty_parameters_of_a_dam_with_lifts():
    """All forces are proportional to moduli, stiffnesses, strengths, energies and densities
    together, and displacements do not change with them [Euler's theorem].
    """
    law = {"K_N": 1e11, "K_T": 5e10, "adhesion": 4e5, "sigma_max": 1e5, "G_f": 90.0}
    law |= {"G_t": 900.0, "mu": 0.9}
    varied = {n: tuple(v * (1 + k / 10) for k in range(4)) for n, v in law.items()}
    coarse = {"lift_heights": (12.0, 24.0, 36.0), "n_joint": 6, "order": 1, "uplift": "cracked"}
    loads = {"silt_height": 6.0, "ice_force": 1e5, "anchor_force": 2e5, "temperature_dam": -4.0}
    case = dj.case("dam", levels=[30, 44], law="bond", E_dam=2.1e10, **coarse, **varied, **loads)
    names = sensitivity.all_of(case)
    rows = [row for row in sensitivity.of_run(case, names) if row.level == 44]
    assert len(rows) == len(names) >= 50
    forces = {"E_dam", "E_found", "rho_dam", "rho_found", "rho_water", "rho_silt"}
    forces |= {"ice_force", "anchor_force", *law} - {"mu"}
    last = history(case)
    assert last["max_opening"] > 1e-5
    for column in ("crest_ux", "max_opening", "N", "T", "N_2", "M_4", "crack_end"):
        of = [r for r in rows if r.name.rpartition(".")[2] in forces]
        total = sum(row.value * row.derivatives[column] for row in of)
        expected = last[column] if column[0] in "NTM" else 0.0
        assert total == pytest.approx(expected, rel=1e-6, abs=1e-6 * abs(last[column])), column


@pytest.mark.heavy
@pytest.mark.parametrize("given", [{}, {"G_f": 90.0}, {"pena_rupture": 3.0}])
def test_all_parameters_of_a_law_whose_energy_is_given_twice(given):
    """Of G_f and pena_rupture one follows from the other; each joint has values of its own in a
    list, from which the softening of this joint alone follows.
    """
    lifts = {"lift_heights": (12.0,), "K_N": (1e11, 2e11), "sigma_max": (1e5, 2e5)}
    coarse = {"n_joint": 3, "order": 1, "law": "rupture"}
    case = dj.case("dam", levels=[20], steps=1, **coarse, **lifts, **given)
    names = sensitivity.all_of(case)
    found = {"G_f", "pena_rupture"} & {name.rpartition(".")[2] for name in names}
    expected = set(given or ("G_f", "pena_rupture"))
    assert found == expected
    rows = {row.name: row.derivatives for row in sensitivity.of_run(case, names)}
    assert set(names) - rows.keys() <= {"saw_thickness"}  # a kink
    assert rows["lift 12 m.K_N"]["max_opening_2"] != 0


def test_a_load_that_is_zero_has_a_derivative_on_its_side():
    """The vertical acceleration takes weight off, the line force of ice is not negative."""
    case = dj.case("dam", levels=[20], n_joint=10)
    rows = {row.name: row for row in sensitivity.of_run(case, ["k_v", "ice_force"])}
    weight = 2400 * 9.81 * 45 * (34 + 5) / 2
    assert rows["k_v"].derivatives["N"] == pytest.approx(-weight, rel=1e-6)
    assert rows["ice_force"].derivatives["T"] == pytest.approx(1, rel=1e-4)
    # the first force adds a point to the mesh, which moves the crest by itself
    runs = [dj.run(dj.case("dam", levels=[20], n_joint=10, ice_force=f)) for f in (1e4, 2e4)]
    crest = [run.history["crest_ux"][-1] for run in runs]
    by_difference = (crest[1] - crest[0]) / 1e4
    assert rows["ice_force"].derivatives["crest_ux"] == pytest.approx(by_difference, rel=0.02)


@pytest.mark.parametrize("law", ["bond", "endo"])
def test_a_level_that_is_reached_again_has_the_derivatives_of_the_first_time(law):
    """Its damage is then about to grow, but both sides have the same derivative: no kink. The
    corrections by one tangent grew without end, to -5e13 m for -1e-6 m.
    """
    weak = {"mu": 1.2, "adhesion": 4e4, "sigma_max": 3e4, "dam_base": 26, "n_joint": 12, "order": 1}
    case = dj.case("dam", levels=[40, 20, 40, 20, 40], steps=1, law=law, **weak)
    rows = sensitivity.of_run(case, ["rho_dam"])
    first, _, second, _, third = (row.derivatives["crest_ux"] for row in rows)
    assert second == pytest.approx(first, rel=1e-5) and third == pytest.approx(first, rel=1e-5)
    assert not any(row.kink for row in rows)


@pytest.mark.heavy
def test_a_kink_is_said_and_its_derivative_is_that_for_a_larger_value():
    """At the level at which the first point of a joint without tension opens, a larger density of
    the water opens it, a smaller one does not.
    """
    coarse = {"n_joint": 4, "order": 1, "law": "friction", "adhesion": 0.0, "tolerance": 1e-13}

    def run(level, rho_water=1000.0):
        stepper = LoadStepper(
            dj.case("dam", levels=[level], steps=1, rho_water=rho_water, **coarse)
        )
        stepper.run()
        return stepper

    def opening(level):
        stepper = run(level)
        interface = stepper.model.equilibrium.interface
        return interface.jumps(interface.at_points, stepper.state.jump)[:, 0].max()

    level = brentq(opening, 44.0, 48.0, xtol=1e-10, rtol=1e-12)
    (row,) = sensitivity.of_run(run(level).case, ["rho_water"])
    crest = [run(level, 1000.0 + step).history.last["crest_ux"] for step in (-0.1, 0.0, 0.1)]
    below, above = np.diff(crest) / 0.1
    assert row.kink and abs(above / below - 1) > 1e-4
    assert row.derivatives["crest_ux"] == pytest.approx(above, abs=0.05 * abs(above - below))


@pytest.mark.heavy
def test_the_geometry_by_two_runs():
    """The resultants are linear in the width of the base, without a crack."""
    case = dj.case("dam", levels=[20, 30], n_joint=10)
    (alone,) = sensitivity.of_run(dj.case(case, levels=[30]), ["dam_base"])
    rows = sensitivity.of_run(case, sensitivity.names_of(case, "mu,dam_base", geometry=True))
    of_mu, of_base = (
        next(r for r in rows if (r.name, r.level) == (n, 30)) for n in ("mu", "dam_base")
    )
    assert of_base.of_runs and not of_mu.of_runs
    assert alone.derivatives["N"] == pytest.approx(of_base.derivatives["N"], rel=1e-9)
    assert of_base.derivatives["N"] == pytest.approx(
        2400 * 9.81 * 45 / 2 - WATER * 30 / 2, rel=1e-6
    )
    assert of_base.derivatives["U"] == pytest.approx(WATER * 30 / 2, rel=1e-6)
    last = history(case)
    assert of_mu.derivatives["SSF"] == pytest.approx(last["N"] / last["T"], rel=1e-6)
    assert abs(of_mu.derivatives["OSF"]) < 1e-9


@pytest.mark.heavy
def test_a_run_beyond_the_limit_has_the_derivatives_of_its_last_equilibrium():
    """Its time is not that of a step."""
    case = dj.case("dam", levels=[30, 80], steps=1, law="friction", n_joint=6, order=1)
    rows = sensitivity.of_run(case, ["mu"])
    assert [row.level for row in rows] == [30, pytest.approx(history(case)["level"])]


@pytest.mark.heavy
def test_a_derivative_that_is_not_found_is_said(command, tmp_path):
    """The limits of dams of other widths are at other levels."""
    words = "run", "dam", "--set", "n_joint=6", "--set", "order=1", "--set", "law=friction"
    names = "--levels", "30,80", "--sensitivity", "dam_base,rho_dam"
    _, out, _ = command(*words, *names, "--no-picture", "--no-fields", "--out", "out")
    table = rows_of(tmp_path / "out/sensitivity.csv")
    of_base = [row for row in table if row["parameter"] == "dam_base"]
    assert [np.isfinite(float(row["N"])) for row in of_base] == [True, False]
    assert (
        of_base[1]["level"] == next(r for r in table[::-1] if r["parameter"] != "dam_base")["level"]
    )
    assert "sensitivity: no derivative with dam_base is found" in out and "no effect" not in out
    assert any(line.startswith("rho_dam") for line in out.splitlines())


@pytest.mark.heavy
def test_the_factors_of_a_check(command, tmp_path):
    words = "check", "dam", "--set", "n_joint=10", "--levels", "30", "--out", "out"
    code, out, _ = command(*words, "--sensitivity", "mu,dam_base")
    assert code == 0 and "dam, uplift imposed:\nChange by one percent" in out
    assert "\nof two runs: dam_base\n" in out
    table = {r["parameter"]: r for r in rows_of(tmp_path / "out/dam/sensitivity.csv")}
    row = next(r for r in rows_of(tmp_path / "out/check.csv") if "gravity" in r["answer"])
    expected = float(row["N"]) / float(row["T"])
    assert float(table["mu"]["SSF"]) == pytest.approx(expected, rel=1e-6)
    assert command(*words, "--sensitivity", "mu,dam_base")[1] == out  # from the files
    code, out, _ = command(*words, "--sensitivity", "mu,dam_base", "--vary", "mu=normal(0,0.25)")
    line = next(line for line in out.splitlines() if line.startswith("mu  "))
    assert float(line.split()[3]) == 0.25
    assert float(line.split()[4]) == pytest.approx(0.25 * expected, rel=5e-3)  # three digits
    assert code == 0 and not any(line.startswith("dam_base") for line in out.splitlines())
    assert "Change by" not in command(*words)[1]


def test_the_printed_table_fits_the_terminal():
    heads = "SSF [-]", "OSF [-]", "crest_ux [mm]", "max_opening [µm]", "N [MN/m]", "T [MN/m]"
    of = {"unit": "Pa/m", "value": 1.2345e11} | dict.fromkeys(heads, -1.2345e-5)
    listed = [{"parameter": f"lift {k} m.adhesion", **of, "note": "at a kink"} for k in (12, 25)]
    narrow, wide = sensitivity.text(listed, 80), sensitivity.text(listed)
    assert max(map(len, narrow.splitlines())) <= 80 < max(map(len, wide.splitlines()))
    assert "SSF" in narrow and "(--wide shows also: T, N" in narrow
    for printed in (narrow, wide):
        assert printed.endswith("at a kink: lift 12 m.adhesion, lift 25 m.adhesion")


@pytest.mark.heavy
def test_only_the_last_step_is_printed_where_its_level_stands_twice(command, texts_drawn):
    """As of an earthquake after the last level; results that do not change have no panel."""
    words = "run", "dam", "--set", "n_joint=10", "--levels", "20,30,30", "--set", "k_h=0.05"
    code, out, _ = command(*words, "--no-fields", "--sensitivity", "mu,rho_dam,E_found")
    lines = out[out.index("Change by") :].splitlines()
    assert code == 0 and [line[:7] for line in lines].count("rho_dam") == 1
    assert len([line for line in lines if line.startswith("E_found")]) == 1
    texts = {text for of_one in texts_drawn for text in of_one}
    assert "change of crest_ux [mm]" in texts and "change of N [MN/m]" in texts
    code, _, _ = command(*words, "--no-fields", "--sensitivity", "E_found")
    assert code == 0 and "change of N [MN/m]" not in texts_drawn[-1]


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_of_a_run(command, tmp_path):
    words = "run", "dam", "--set", "n_joint=10", "--levels", "20,30", "--no-picture", "--no-fields"
    code, out, _ = command(*words, "--out", "one", "--sensitivity", "rho_dam,E_dam,f_c")
    assert code == 0 and "Change by one percent more of a parameter" in out
    table = rows_of(tmp_path / "one/sensitivity.csv")
    assert [(r["parameter"], r["time"], r["level"]) for r in table] == [
        (name, *at) for name in ("rho_dam", "E_dam", "f_c") for at in (("1", "20"), ("2", "30"))
    ]
    assert float(table[0]["N"]) == pytest.approx(9.81 * 45 * (34 + 5) / 2, rel=1e-6)
    lines = out.splitlines()
    assert any(line.startswith("E_dam") for line in lines)
    assert not any(line.startswith("f_c") for line in lines)
    assert "sensitivity: no effect of f_c" in lines
    assert command(*words, "--out", "one")[0] == 0
    assert not (tmp_path / "one/sensitivity.csv").exists()


@pytest.mark.heavy
def test_the_table_of_a_critical_level(command, tmp_path, texts_drawn):
    settings = [w for n, v in SLIDES.items() for w in ("--set", f"{n}={v}")]
    words = "critical", "dam", *settings, "--set", "mu=0.6", "--levels", "30,36", "--out", "out"
    code, out, _ = command(*words, "--sensitivity", "all")
    assert (tmp_path / "out/dam_sensitivity.png").exists()
    assert any("1 % more" in texts and "mu" in texts for texts in texts_drawn)
    table = {r["parameter"]: r for r in rows_of(tmp_path / "out/sensitivity.csv")}
    _, by_mu, _ = slopes(0.6)
    assert code == 0 and float(table["mu"]["critical_level"]) == pytest.approx(by_mu, rel=2e-5)
    case = dj.case("dam", levels=[30, 36], mu=0.6, **SLIDES)
    vary = {"rho_dam": "normal(2400,100)"}
    rows = dj.sensitivity(case, "mu", "rho_dam", critical=True, vary=vary)
    assert rows.critical_level[0] == pytest.approx(by_mu, rel=2e-5)
    assert np.isnan(rows.deviation[0]) and rows.deviation[1] == 100
    assert {"rho_dam", "g", "K_N", "E_found"} <= table.keys()
    assert out.index("rho_dam") < out.index("mu  ")


@pytest.mark.heavy
def test_changes_of_a_critical_level_by_one_standard_deviation(command, tmp_path, texts_drawn):
    """Of the density more than of friction here, other than by one percent each."""
    settings = [w for n, v in SLIDES.items() for w in ("--set", f"{n}={v}")]
    words = "critical", "dam", *settings, "--set", "mu=0.6", "--levels", "30,36", "--out", "out"
    vary = "--vary", "mu=uniform(0.5,0.1)", "--vary", "rho_dam=normal(2400,100)"
    code, out, _ = command(*words, "--sensitivity", "all", *vary)
    _, by_mu, by_rho = slopes(0.6)
    lines = out[out.index("Change by one standard deviation more") :].splitlines()
    listed = [line.split() for line in lines if line.startswith(("mu", "rho_"))]
    assert code == 0 and [cells[0] for cells in listed] == ["rho_dam", "mu"]
    expected = 100 * by_rho, 0.1 / np.sqrt(12) * by_mu
    assert [float(cells[-1]) for cells in listed] == pytest.approx(expected, rel=5e-3)
    assert (tmp_path / "out/dam_sensitivity.png").exists()
    drawn = next(texts for texts in texts_drawn if "one standard deviation more" in texts)
    assert {"mu", "rho_dam"} <= set(drawn) and "g" not in drawn
    code, out, _ = command(*words, "--sensitivity", "f_c")
    assert code == 0 and out.endswith("sensitivity: no effect of f_c\n")


@pytest.mark.parametrize(
    "words, message",
    [
        (["run", "dam", "--sensitivity", "mux"], "mux: unknown parameter"),
        (["run", "dam", "--sensitivity", "law"], "--sensitivity law: must be a parameter that is"),
        (["run", "dam", "--sensitivity", "h_dam"], "neither of geometry, mesh nor solver"),
        (["critical", "dam", "--sensitivity", "dam_base"], "neither of geometry, mesh nor solver"),
        (["run", "dam", "--sensitivity", "mu,mu"], "must be NAME,NAME,... or all, each once"),
        (["run", "lifts", "--sensitivity", "mu"], "differs between the joints; must be of one"),
        (["run", "dam", "--sensitivity", "no.mu"], "--sensitivity no.mu: must be of a joint: base"),
        (["critical", "dam", "--of", "strength", "--sensitivity", "mu"], "needs --of level"),
        (["run", "dam", "--vary", "mu=normal(1,0.1)"], "--vary: needs --sensitivity"),
        (["run", "dam", "--sensitivity", "mu", "--vary", "rho_dam=normal(1,1)"], "must be a param"),
        (["check", "dam", "--sensitivity", "mu", "--vary", "mu=t(1.5)"], "a finite standard dev"),
        (
            ["critical", "dam", "--sensitivity", "ice_force", "--vary", "ice_force=norm(1,1)"],
            "zero",
        ),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(command, tmp_path, words, message):
    code, out, error = command(*words)
    assert code == 2 and not out and not list(tmp_path.iterdir())
    assert message in error and len(error.splitlines()) == 1


@pytest.mark.heavy
def test_a_level_of_unstable_growth_has_no_derivative():
    """Where a point is about to break the level of the path still rises: the derivative at the
    displacement there is not that of the highest level (-0.3 m for 7 m with 8 elements).
    """
    case = dj.case("dam", n_joint=6, order=1, mu=1.0, uplift="none", h_dam=8.0, h_found=16.0)
    answer = Search(replace(case, all_steps=True), "level").find()
    assert answer.confirmed
    with pytest.raises(dj.RunError, match="the critical level has no derivative"):
        sensitivity.of_point(answer.point, ["mu"])
