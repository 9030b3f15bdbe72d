"""damjoint check: finite elements and gravity method have the same resultants; pass or fail by the
required factors.
"""

import csv
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import damjoint as dj
import matplotlib.image
import numpy as np
import pytest
from blocks import write_blocks
from damjoint import cli
from damjoint.pictures import check_picture
from damjoint.pictures.check_picture import draw_check, draw_joint
from damjoint.post import folder as folders
from damjoint.statics import gravity
from damjoint.statics.verdict import verdict
from damjoint.studies import check_study
from damjoint.studies.check import (
    UNCHECKED,
    SafetyCheck,
    by_gravity,
    compare_joints,
    hand_calculation,
    worst_verdict,
)
from damjoint.studies.check_study import picture_content
from damjoint.studies.check_tables import labelled_notes, picture_table, text_table
from damjoint.studies.critical import last_state
from matplotlib.figure import Figure
from matplotlib.table import Table
from matplotlib.text import Text
from own_mesh import OwnMesh

#: Parameters common to all load combinations: SSNP142's dam on a coarse mesh.
COMMON = """
default_dam_base = 5; default_dam_crest = 1.5; default_dam_height = 10;
default_found_side = 5; default_found_depth = 5; default_order = 1; default_n_joint = 20;
default_E = 3e12; default_nu = 0; default_K_N = 1e12; default_K_T = 1e12;
default_law = "friction"; default_mu = 0.8; default_adhesion = 1e5; default_f_c = 1e7;
default_required_SSF = 1.5; default_required_OSF = 1.2;
"""
COMBINATIONS = {
    "usual": 'title = "usual"; levels() = {7};',
    "flood": 'title = "flood"; default_required_SSF = 1.3; default_required_OSF = 1.1; '
    "levels() = {7, 9.5}; tail_levels() = {0, 1};",
}


@pytest.fixture
def combinations(tmp_path):
    (tmp_path / "common.case").write_text(COMMON)
    for name, text in COMBINATIONS.items():
        (tmp_path / f"{name}.case").write_text(f'Include "common.case"; {text}')
    return [f"{name}.case" for name in COMBINATIONS]


def rows(path):
    with path.open() as file:
        return {(row["case"], row["answer"]): row for row in csv.DictReader(file)}


@pytest.mark.heavy
def test_two_load_combinations(command, combinations, tmp_path, texts_drawn):
    code, out, _ = command("check", *combinations, "--jobs", "1")
    assert code == 0
    table = rows(tmp_path / "out/check/check.csv")
    assert len(table) == 6
    diagrams = {"uplift", "effective stress, tension > 0"}
    assert sum(diagrams <= {*texts} for texts in texts_drawn) == len(COMBINATIONS)
    for name in COMBINATIONS:
        answers = "finite elements", "gravity method", "difference"
        computed, by_hand, less = (table[name, answer] for answer in answers)
        for column in ("N", "T", "M", "U", "x_resultant", "OSF"):
            assert float(computed[column]) == pytest.approx(float(by_hand[column]), rel=1e-6)
        for column in ("sigma_n_eff_toe", "crack_length", "SSF"):
            expected = float(computed[column]) - float(by_hand[column])
            assert float(less[column]) == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert computed["verdict"] == by_hand["verdict"] == "pass" and less["verdict"] == ""
        folder = tmp_path / "out/check" / name
        assert (folder / "run.json").is_file() and (folder / "fields/fields.pvd").is_file()
        assert (folder / f"{name}_check.png").is_file()
        with (folder / "gravity.csv").open() as file:
            loads = list(csv.DictReader(file))
        assert loads[0]["load"] == "weight" and loads[-1]["load"] == "sum"
        for column in ("Fx", "Fy", "moment"):
            total = math.fsum(float(row[column]) for row in loads[:-1])
            assert total == pytest.approx(float(loads[-1][column]), rel=1e-9)
        assert float(loads[-1]["Fx"]) == pytest.approx(float(by_hand["T"]))
        folders.clear(folder)
        assert not list(folder.iterdir())
    for message in ("usual", "flood", "gravity method", "required", "1.3", "pass"):
        assert message in out
    assert "fail" not in out


@pytest.mark.parametrize(
    "setting, message",
    [
        ({"required_SSF": 3.0}, "SSF {SSF:.4g} < 3"),
        ({"required_OSF": 5.0}, "OSF {OSF:.4g} < 5"),
        ({"f_c": 1.5e5}, "compression {toe:.4g} kPa at the toe > f_c = 150 kPa"),
    ],
)
def test_a_factor_below_the_required_one_fails(solve, setting, message):
    (result,) = solve("d", "7", dim=2.0, n_joint=20.0)
    for answer in (compare_joints(result)[0].finite_elements, by_gravity(hand_calculation(result))):
        assert not answer.failures and answer.row["verdict"] == "not checked"
        met = replace(answer.case, values=answer.case.values | {"required_OSF": 1.01})
        assert replace(answer, case=met).row["verdict"] == "pass"
        stricter = replace(answer, case=replace(answer.case, values=answer.case.values | setting))
        expected = message.format(**answer.numbers, toe=-answer.numbers["sigma_n_toe"] / 1e3)
        assert stricter.failures == [expected]
        assert (stricter.row["verdict"], stricter.row["why"]) == ("fail", expected)


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_without_required_factors_the_verdict_is_not_checked(command, combinations, tmp_path):
    """Even with a sliding factor of 0.35, under a law without friction."""
    none = "required_SSF=0", "required_OSF=0", "f_c=0", "mu=0.2", "adhesion=0"
    words = [word for setting in ("law=rupture", *none) for word in ("--set", setting)]
    code, out, _ = command("check", "usual.case", *words, "--out", "here")
    assert code == 0
    table = rows(tmp_path / "here/check.csv").values()
    answers = [row for row in table if row["answer"] != "difference"]
    assert len(answers) == 2 * len(table) / 3
    assert max(float(row["SSF"]) for row in answers) < 0.8
    for row in table:
        assert row["verdict"] == ("not checked" if row in answers else "")
    assert out.startswith("usual: check: not checked; equilibrium: yes\n") and "pass" not in out
    assert out.count("not checked") == 3
    assert "only equilibrium is judged: required_SSF, required_OSF, f_c" in out
    assert not re.search(r"usual +required", out)
    # law = friction requires 1 by default: less fails, more is not checked
    code, out, _ = command("check", "usual.case", *words, "--set", "law=friction", "--out", "here")
    assert code == 1 and "fails, SSF" in out
    words[words.index("mu=0.2")] = "mu=2"
    code, out, _ = command("check", "usual.case", *words, "--set", "law=friction", "--out", "here")
    assert code == 0 and "pass" not in out and not re.search(r"usual +required", out)


def test_a_dam_that_slides_below_its_last_level_fails(command, combinations, tmp_path):
    """The gravity method has the last level, the finite elements stop below it."""
    weak = "mu=0.25", "adhesion=1000", "pena_tang=0", "n_joint=8"
    short = "smallest_step=0.004", "relaxation_iterations=30"
    settings = "required_SSF=0", "required_OSF=0", *weak, *short
    words = [word for setting in settings for word in ("--set", setting)]
    code, out, _ = command("check", "flood.case", *words, "--out", "here")
    assert code == 1
    table = rows(tmp_path / "here/check.csv")
    assert set(table) == {("flood", "finite elements"), ("flood", "gravity method")}
    computed, by_hand = table.values()
    assert computed["why"].startswith("sliding: no equilibrium beyond level")
    assert float(computed["level"]) < 9.5 == float(by_hand["level"])
    assert by_hand["why"] == f"SSF {float(by_hand['SSF']):.4g} < 1"
    assert float(computed["SSF"]) == pytest.approx(1, abs=0.01)
    assert "did not reach the last level" in out


@pytest.mark.heavy
def test_a_dam_that_stops_under_a_part_of_the_earthquake_fails(command, tmp_path):
    """At constant level T grows with the earthquake."""
    weak = "law=bond", "sigma_max=0", "adhesion=0", "mu=0.8", "k_h=0.3", "n_joint=12"
    short = "smallest_step=0.02", "relaxation_iterations=30"
    words = [word for setting in (*weak, *short) for word in ("--set", setting)]
    code, out, _ = command("check", "dam", *words, "--levels", "40,40")
    assert code == 1
    table = rows(tmp_path / "out/check/check.csv")
    assert set(table) == {("dam", "finite elements"), ("dam", "gravity method")}
    computed, by_hand = table.values()
    assert computed["level"] == by_hand["level"] == "40"
    assert (computed["load"], by_hand["load"]) == ("partial", "full")
    assert 1 < float(computed["time"]) < 2 == float(by_hand["time"])
    assert float(by_hand["T"]) - float(computed["T"]) > 1e6
    assert computed["verdict"] == "fail" and "finite elements, partial load" in out
    assert f"with all loads, t = {float(computed['time']):.5g} of 2" in out


def test_a_run_under_a_partial_load_does_not_pass(solve):
    """E.g. interrupted. The table of the picture and the differences show it, too."""
    (result,) = solve("d", "7", dim=2.0, n_joint=20.0)
    longer = replace(result, case=replace(result.case, levels=(7.0, 7.0), tail_levels=(0.0,) * 2))
    longer = replace(longer, case=replace(longer.case, times=(1.0, 2.0)))
    found = SafetyCheck(
        compare_joints(longer)[0].finite_elements, by_gravity(hand_calculation(longer))
    )
    computed, by_hand = found.rows
    assert computed["verdict"] == "fail" and computed["why"].startswith("ended at t = 1 of 2")
    assert by_hand["verdict"] == "not checked"
    assert ("load", "partial", "full", "") in picture_table(found)
    full = SafetyCheck(
        compare_joints(result)[0].finite_elements, by_gravity(hand_calculation(result))
    )
    assert len(full.rows) == 3


@pytest.mark.heavy
def test_a_second_crack_in_equilibrium_has_its_own_row(command, tmp_path):
    """The drains stop the shorter crack; the longer one is checked as well."""
    dam = "dam_base=30", "uplift=cracked", "drains=1", "drain_x=6", "law=bond", "sigma_max=0"
    more = "adhesion=0", "mu=1.2", "n_joint=20", "required_SSF=1.2"
    words = [word for setting in (*dam, *more) for word in ("--set", setting)]
    levels = "--levels", "40,44", "--tail-levels", "3"
    code, out, _ = command("check", "dam", *words, *levels)
    table = rows(tmp_path / "out/check/check.csv")
    longer = table["dam", "gravity method, longer crack"]
    assert (
        code == 1
        and longer["verdict"] == "fail"
        and longer["why"] == f"SSF {float(longer['SSF']):.4g} < 1.2"
    )
    assert table["dam", "gravity method"]["verdict"] == "pass"
    assert float(table["dam", "finite elements"]["crack_length"]) > 6
    assert re.search(
        r"gravity method: crack [\d.]+ m before the drains \(6 m\), SSF [\d.]+, OSF [\d.]+; "
        r"if it grows further, crack [\d.]+ m past the drains \(6 m\), SSF [\d.]+",
        out,
    )
    code, *_ = command("report", tmp_path / "out/check/dam")
    page = (tmp_path / "report.html").read_text()
    assert "longer crack" in page and "past the drains (6 m)" in page


def test_a_note_gives_the_crack_without_tensile_strength(solve):
    (result,) = solve("dam", "45", law="rupture", sigma_max=2e6, G_f=100.0, n_joint=20.0)
    (note,) = (note for note in compare_joints(result)[0].notes if "tension" in note)
    assert "below the strength of 2 MPa; without tension: crack 0." in note


#: A dam whose elastic crack passes the drains, while that of the rigid block ends before them.
DRAINED = {"dam_height": 80.0, "dam_base": 60.0, "uplift": "cracked", "drains": 1.0, "drain_x": 6.0}
DRAINED |= {"drain_effectiveness": 2 / 3, "law": "bond", "sigma_max": 0.0, "n_joint": 20.0}


def test_a_note_without_tension_gives_the_shortest_and_the_longest_crack():
    """Each with its side of the drains: the longest alone would hide that the dam stands."""
    strong = DRAINED | {"sigma_max": 2e6, "G_f": 500.0}
    method = gravity.at(dj.case("dam", levels=[85.45], **strong), 1.0)
    free = gravity.at(method.case, 1.0, tension=False)
    assert 3 < free.crack_length < 4 and [state.stands for state in free.further] == [False]
    (note,) = method.notes
    assert note.endswith(
        f"without tension: crack {free.crack_length:.4g} m before the drains (6 m), SSF "
        f"{free.SSF:.4g}, OSF {free.OSF:.4g}; if it grows further, overturning past the drains "
        "(6 m)"
    )


@pytest.mark.heavy
def test_a_note_says_which_crack_passes_the_drains(command):
    """In check, critical and report; with what each method assumes."""
    words = [w for name, value in DRAINED.items() for w in ("--set", f"{name}={value}")]
    _, out, _ = command("check", "dam", *words, "--levels", "60,84")
    passes = re.compile(
        r"drains at 6 m, full head in the crack: finite elements \(stress of the elastic dam, "
        r"largest at the heel\): a crack of 2\d[.\d]* m has passed them: the full head acts, no "
        r"drainage; gravity method \(stress linear along the joint\): no crack: they lower the head"
    )
    assert passes.search(out)
    _, out, _ = command("critical", "dam", *words, "--levels", "60,75")
    assert passes.search(out)
    assert command("report", "out/dam_critical")[0] == 0
    assert passes.search(Path("report.html").read_text())


def test_bad_input_writes_no_file(refused, combinations):
    for words, message in (
        (("usual.case", "usual.case"), "case usual: must be given once"),
        (("usual.case", "none.case"), "case none.case: there is no such file"),
        (("usual.case", "--set", "f_c=-1"), "f_c = -1: must be"),
        (("usual.case", "--levels", "3,x"), "levels = 3,x: must be"),
    ):
        assert message in refused("check", *words)


@pytest.mark.parametrize(
    "name, levels, tail_levels, settings",
    [
        ("a", None, None, {}),
        ("c", None, "1,2,3,4", {}),
        ("k", None, None, {}),
        ("c", "8", "1", {"uplift": "drained", "drain_x": 1.0, "drain_level": 3.0, "n_joint": 20}),
    ],
)
def test_resultants_of_both_methods_agree(solve, name, levels, tail_levels, settings):
    """Finite elements and gravity method, in any state of the joint."""
    for result in solve(name, levels, tail_levels, **settings):
        computed, by_hand = (
            compare_joints(result)[0].finite_elements,
            by_gravity(hand_calculation(result)),
        )
        for column in ("level", "tail_level", "N", "T", "M", "U", "x_resultant", "OSF"):
            expected = pytest.approx(by_hand.numbers[column], rel=1e-6, abs=1e-9)
            assert computed.numbers[column] == expected, column


def test_differences_below_the_printed_digits_are_shown_as_zero(solve):
    computed = compare_joints(solve("c", None, "1,2,3,4")[0])[0].finite_elements
    for much, shown in ((1e-7, "0"), (1e-3, "-")):
        more = computed.numbers["N"] * (1 + much)
        other = replace(computed, numbers={**computed.numbers, "N": more})
        found = SafetyCheck(computed, other)
        assert found.rows[2]["N"] < 0
        (line,) = (line for line in text_table([found]).splitlines() if "difference" in line)
        assert line.split()[3].startswith(shown)


def test_tension_is_positive_in_all_tables_and_pictures(solve):
    """Heel in tension, toe in compression: in check.csv, in the printed table, in the table beside
    the picture and at the ends of its diagram; each states its sign.
    """
    (result,) = solve("dam", "45", n_joint=20, h_dam=8, h_found=30)
    method = hand_calculation(result)
    found = SafetyCheck(compare_joints(result)[0].finite_elements, by_gravity(method))
    heel, toe = (found.rows[1][f"sigma_n_eff_{end}"] for end in ("heel", "toe"))
    assert heel > 0 > toe
    shown = [f"{value / 1e6:.5g}" for value in (heel, toe)]
    printed = text_table([found])
    (line,) = (line for line in printed.splitlines() if "gravity method " in line)
    assert re.search(rf" {shown[0]} +{shown[1]} ", line) and printed.count("tension > 0") == 2
    cells = {head: row for head, *row in picture_table(found)}
    assert [cells[f"eff. {end} [MPa]"][1] for end in ("heel", "toe")] == shown
    assert next(iter(cells)) == "stress: tension > 0"
    axes = Figure().subplots()
    draw_joint(axes, result, method)
    texts = [text.get_text() for text in axes.texts]
    name = texts.index("effective stress, tension > 0")
    computed = result.at()["sigma_n_eff"][[0, -1]]
    assert texts[name + 1 : name + 3] == [
        f"FE {fe / 1e6:.3g} MPa\ngravity {by_hand / 1e6:.3g} MPa"
        for fe, by_hand in zip(computed, (heel, toe), strict=True)
    ]
    # compression is drawn below the line, tension above it
    stress = axes.get_lines()[-3]
    assert stress.get_linestyle() == "--"
    level, depth = (line.get_ydata() for line in (axes.get_lines()[-5], stress))
    assert depth[1] > level[0] > depth[-2]


def test_resultants_but_uplift_agree_with_flow(solve):
    """The uplift differs between the methods, N + U does not."""
    (result,) = solve("e")
    method = gravity.at(result.case, result.case.times[-1])
    last = result.last
    assert last["N"] + last["U"] == pytest.approx(method.N + method.U, rel=1e-6)
    assert last["T"] == pytest.approx(method.T, rel=1e-6)
    assert last["U"] == pytest.approx(method.U, rel=0.1)


def check_of(settings, level="45"):
    """The check of a coarse dam."""
    common = {"n_joint": 10, "h_dam": 15, "h_found": 60, "law": "bond"}
    return dj.check([dj.case("dam", levels=[float(level)], **common | settings)])[0]


@pytest.mark.parametrize(
    "required, level, verdict",
    [
        ("middle third", "30", "pass"),
        ("middle third", "45", "fail"),
        ("middle half", "45", "pass"),
        ("within base", "45", "pass"),
        ("any", "45", "not checked"),
    ],
)
def test_required_position_of_the_resultant(required, level, verdict):
    """M/N of the 45 m dam: 11.0 m of 34 m from the toe at 45 m, in the middle half."""
    check = check_of({"required_position": required}, level)
    assert {result.verdict for result in check.results} == {verdict}
    assert ("N middle half: must be in middle third" in check.why) == (verdict == "fail")
    table, cells = text_table([check]), picture_table(check)
    assert (required in table.split("required")[-1]) == (required != "any")
    assert [row[-1] for row in cells if row[0] == "N' in"] == [required] * (required != "any")
    assert {row["required_position"] for row in check.rows} == {required}


def test_partial_factors_on_friction_and_adhesion():
    """(mu / 1.5 N + c / 3 L) / T."""
    check = check_of({"mu": 0.9, "adhesion": 3e5, "factor_mu": 1.5, "factor_c": 3.0}, "30")
    for result in check.results:
        numbers = result.numbers
        resistance = 0.6 * numbers["N"] + numbers["cohesion"]
        assert numbers["cohesion"] == pytest.approx(1e5 * 34)
        assert numbers["SSF"] == pytest.approx(resistance / numbers["T"], rel=1e-9)
    assert "SSF with the partial factors factor_mu = 1.5, factor_c = 3" in check.notes


def test_the_sliding_factor_counts_the_cohesion_that_is_left(solve):
    """After an overload D is above 0.99 on half of the closed joint: c (1 - D) over the length."""
    (result,) = solve("dam", "50,40", law="bond", n_joint=20.0, mu=1.0, adhesion=2e5, G_t=10.0)
    check, rows, last = compare_joints(result)[0], result.at(), result.last
    left = np.trapezoid(2e5 * (1 - rows["damage"]), rows["s"])
    assert last["crack_length"] == 0 and left < 0.8 * 2e5 * 34
    numbers = check.finite_elements.numbers
    assert numbers["cohesion"] == pytest.approx(left, rel=0.02)
    assert numbers["cohesion_undamaged"] == pytest.approx(2e5 * 34)
    assert numbers["SSF"] == (last["N"] + numbers["cohesion"]) / last["T"]
    assert last["N"] + numbers["cohesion_undamaged"] > numbers["SSF"] * last["T"]
    assert f"the run has destroyed {1 - left / 6.8e6:.0%} of the cohesion" in "; ".join(check.notes)
    shown = {head: cell for head, cell, *_ in picture_table(check)}
    assert (shown["c B [MN/m]"], shown["c L [MN/m]"]) == (f"{numbers['cohesion'] / 1e6:.5g}", "6.8")


def test_friction_keeps_its_cohesion_where_the_joint_is_open():
    """Where the joint slides as a whole, with an open part, the factor is 1."""
    settings = {"law": "friction", "adhesion": 3e5, "mu": 0.9, "n_joint": 20.0}
    found = dj.critical(dj.case("dam", **settings))
    (check,) = compare_joints(last_state(found.search, found.answer.point))
    numbers = check.finite_elements.numbers
    assert numbers["crack_length"] > 20
    assert numbers["SSF"] == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize(
    "solid, order, slope",
    [
        ({}, 1.0, 2.0),
        ({}, 2.0, 0.0),
        pytest.param(
            {"dim": 3.0, "mesh_pattern": "split", "thickness": 20.0, "n_layers": 2.0},
            *(1.0, 2.0),
            marks=pytest.mark.heavy,
        ),
    ],
)
def test_a_mesh_of_ones_own_has_the_factors_of_its_section(tmp_path, solid, order, slope):
    """The gravity method on the loads of the finite elements, and the requirements that N, T, M
    suffice for; OSF needs the loads one by one.
    """
    settings = {"n_joint": 20.0, "law": "bond", "order": order}
    settings |= {"uplift": "cracked", "sigma_max": 1e4, "G_f": 5.0, "adhesion": 2e5, "G_t": 300.0}
    settings |= {"dim": solid.get("dim", 2.0)}
    shape = {"batter": 3.0, "joint_slope": slope, "h_dam": 15.0, "h_found": 60.0} | solid
    required = {"required_SSF": 1.9, "required_OSF": 1.1, "required_position": "middle half"}
    section = dj.case("dam", levels=[45.0], tail_levels=3.0, **settings | shape | required)
    OwnMesh.of(section).write(tmp_path / "own.msh")
    (tmp_path / "own.case").write_text('geometry = "own.msh";')
    own = dj.case(tmp_path / "own.case", levels=[45.0], tail_levels=3.0, **settings | required)
    (mine,), (other,) = dj.check([own]), dj.check([section])
    assert other.gravity.numbers["crack_length"] > 1
    for one, two in zip(mine.results, other.results, strict=True):
        for name, value in two.numbers.items():
            if name == "OSF":
                assert math.isnan(one.numbers[name])
            elif not name.startswith("sigma") or one.method == "gravity method":
                assert one.numbers[name] == pytest.approx(value, rel=1e-6, abs=1e-3), name
        assert one.not_judged == ["required_OSF is not judged: OSF is not known"]
        unmet = [why for why in two.failures if not why.startswith("OSF")]
        assert one.failures == unmet
        assert one.verdict == ("fail" if unmet else "not judged")
    assert other.gravity.verdict == "fail"


@pytest.mark.heavy
def test_a_requirement_that_can_not_be_judged_is_not_passed(command, tmp_path):
    """A stepped joint has no gravity method; SSF is judged, OSF not."""
    stepped = ("stepped", "--levels", "30", "--tail-levels", "0", "--set", "required_SSF=1.2")
    code, out, _ = command("check", *stepped)
    assert code == 0 and "pass" in out and "no gravity method: the joint is not plane\n" in out
    code, out, _ = command("check", *stepped, "--set", "required_OSF=1.1")
    assert code == 1 and "required_OSF is not judged: OSF is not known" in out
    (row,) = rows(tmp_path / "out/check/check.csv").values()
    assert row["verdict"] == "not judged" and float(row["SSF"]) > 1.2
    assert math.isnan(float(row["OSF"]))
    code, out, _ = command("check", *stepped[:-1], "required_SSF=9")
    assert code == 1 and re.search(r"fails, SSF [\d.]+ < 9", out)


@pytest.mark.heavy
def test_joints_between_bodies_that_others_hold_are_not_limited():
    """A contraction joint may slip; the bases are judged one by one."""
    checks = dj.check([dj.case("monoliths", levels=[45.0], required_SSF=1.2)])
    assert [check.finite_elements.joint for check in checks] == [
        "upstream base",
        "downstream base",
        "contraction",
    ]
    assert [check.finite_elements.verdict for check in checks] == ["pass", "pass", "not checked"]
    assert checks[2].finite_elements.numbers["SSF"] < 1.2
    assert all(check.gravity is None for check in checks)


def test_only_the_joint_that_fails_fails(solve):
    """Another one is not judged beyond the loads that the run has reached."""
    weak = {"law": "bond", "mu": 0.3, "adhesion": 1e5, "lift_heights": (15.0,)}
    (result,) = solve("dam", (45.0,), n_joint=24.0, order=1.0, **weak)
    assert verdict(result) == "sliding on base" and result.partial_load
    base, lift = (check.finite_elements for check in compare_joints(result))
    assert base.verdict == "fail" and not base.not_judged
    assert lift.verdict == "not judged" and not lift.failures
    assert re.fullmatch(
        "not judged beyond t = 0[.].* of 1, where the run ended: sliding on base", lift.row["why"]
    )
    lines = text_table(compare_joints(result)).splitlines()
    assert not [line for line in lines if "lift 15 m, finite elements: fails" in line]


@pytest.mark.heavy
def test_picture_of_each_joint_of_a_dam_that_fails(solve, painted, tmp_path):
    """Also of a joint that does not fail."""
    weak = {"law": "bond", "mu": 0.3, "adhesion": 1e5, "lift_heights": (15.0,)}
    (result,) = solve("dam", (45.0,), n_joint=24.0, order=1.0, **weak)
    assert verdict(result) == "sliding on base" and len(result.joints) == 2
    checks = compare_joints(result)
    content = picture_content(result, checks)
    for k, check in enumerate(checks):
        path = draw_check(content._replace(joint=k, cells=picture_table(check)), tmp_path)
        assert matplotlib.image.imread(path).std() > 0.1
        path.unlink()


def test_a_note_on_all_joints_is_printed_once(solve):
    joints = {"uplift": ("none", "flow"), "lift_heights": (15.0,), "mu": 1.0, "adhesion": 1e5}
    (result,) = solve("dam", (30.0,), n_joint=24.0, order=1.0, law="friction", **joints)
    of_all, of_lift = labelled_notes(compare_joints(result))
    assert of_all.startswith("dam: only equilibrium is judged: required_SSF")
    assert of_lift == "dam, lift 15 m: gravity method: full head in the crack, linear beyond it"


# -- several combinations
# --------------------------------------------------------------------------------------------------


def two_cases(folder):
    """Two case files of small dams."""
    for name, mu in (("usual", 0.8), ("flood", 0.6)):
        text = f"default_mu = {mu};\ndefault_n_joint = 10;\nlevels() = {{30, 40}};\n"
        (folder / f"{name}.case").write_text(text)
    return "usual.case", "flood.case"


def contents(folder):
    """Tables below a folder."""
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*.csv")}


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_combinations_in_several_processes_have_the_same_tables(command, tmp_path):
    cases = two_cases(tmp_path)
    printed = [command("check", *cases, "--jobs", n, "--out", f"out{n}")[:2] for n in (1, 2)]
    first, second = (contents(tmp_path / f"out{n}") for n in (1, 2))
    assert first == second and {"check.csv", "flood/gravity.csv", "usual/joint.csv"} <= set(first)
    assert printed[0] == (printed[1][0], printed[1][1].replace("out2", "out1"))


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_an_interrupted_check_continues(command, tmp_path, monkeypatch):
    """The finished case is read, with the same rows; the next one is computed."""
    cases = two_cases(tmp_path)
    assert command("check", *cases, "--jobs", 1, "--out", "whole")[0] in (0, 1)
    run, computed = check_study.run, []

    def interrupted(case, *others, **options):
        if computed:
            raise KeyboardInterrupt
        computed.append(case.name)
        return run(case, *others, **options)

    with monkeypatch.context() as patch:
        patch.setattr(check_study, "run", interrupted)
        assert command("check", *cases, "--jobs", 1, "--out", "out")[0] == 130
    assert computed == ["usual"]
    monkeypatch.setattr(
        check_study, "run", lambda case, *o, **k: computed.append(case.name) or run(case, *o, **k)
    )
    assert command("check", *cases, "--jobs", 1, "--out", "out")[0] in (0, 1)
    assert computed == ["usual", "flood"]
    tables, whole = (contents(tmp_path / name) for name in ("out", "whole"))
    rows, expected = (
        list(csv.DictReader(t.pop("check.csv").splitlines())) for t in (tables, whole)
    )
    assert tables == whole and len(rows) == len(expected)
    for row, of_whole in zip(rows, expected, strict=True):  # tables have twelve digits
        for name, cell in of_whole.items():
            try:
                assert float(row[name]) == pytest.approx(float(cell), rel=1e-9, abs=1e-5)
            except ValueError:
                assert row[name] == cell


def test_the_picture_draws_and_judges_every_joint(solve, monkeypatch, tmp_path):
    """Each with its verdict; the table beside; the earthquake with its coefficient."""
    joints = {
        "lift_heights": (15.0,),
        "adhesion": 0.0,
        "k_h": 0.1,
        "required_SSF": 2.5,
        "mu": (1.0, 2.0),
    }
    (result,) = solve("dam", (30.0, 30.0), n_joint=24.0, order=1.0, law="friction", **joints)
    checks, drawn = compare_joints(result), []
    monkeypatch.setattr(check_picture, "write_picture", lambda figure, *_: drawn.append(figure))
    content = picture_content(result, checks)
    draw_check(content._replace(joint=0, cells=picture_table(checks[0])), tmp_path)
    (figure,) = drawn
    texts = [text.get_text() for text in figure.findobj(Text)]
    *_, beside = figure.findobj(Table)
    cells = {place: cell.get_text().get_text() for place, cell in beside.get_celld().items()}
    verdicts = [check.finite_elements.verdict for check in checks]
    assert len(set(verdicts)) == 2
    for row, (name, judged) in enumerate(zip(result.case.joint_names, verdicts, strict=True), 1):
        assert f"{name}: {judged}" in texts
        assert (cells[row, 0], cells[row, 4]) == (name, judged)
    assert any("; check: fail; diagrams: base" in text for text in texts)
    assert "k_h = 0.1" in texts
    assert any(text.startswith("loads: weight, water 30 m") for text in texts)


@pytest.mark.parametrize("width", [80, 120])
def test_the_table_fits_the_terminal_with_named_columns(solve, width):
    """Verdicts first; all columns without a width; forces in MN/m whatever their size."""
    joints = {"lift_heights": (38.0,), "required_SSF": 1.5, "mu": 1.0, "adhesion": 1e5}
    (result,) = solve("dam", (40.0,), n_joint=24.0, order=1.0, law="friction", **joints)
    checks = compare_joints(result)
    first, table, *_ = text_table(checks, width).split("\n\n")
    assert first.splitlines()[0] == "dam, base: check: pass; equilibrium: yes"
    assert max(map(len, table.splitlines())) <= width
    heads = table.splitlines()[0].split()
    assert {"joint", "method", "SSF", "OSF", "check"} <= set(heads)
    wide = text_table(checks).split("\n\n")[1]
    assert max(map(len, wide.splitlines())) > 120 and "[kN/m]" not in wide
    assert (" U " in table.splitlines()[0]) == (width == 120)


def test_long_names_of_combinations_are_wrapped_over_the_rows_of_each(solve):
    names = "normal operation with drains in service", "flood of the design with drains clogged"
    checks = []
    for name in names:
        (result,) = solve("dam", (30.0,), n_joint=10.0, order=1.0, required_SSF=1.5)
        result = replace(result, case=replace(result.case, name=name))
        checks += compare_joints(result)
    table = text_table(checks, 80).split("\n\n")[1].splitlines()
    assert max(map(len, table)) <= 80
    rows = table[3:7]
    assert [row[:25].strip() for row in rows][2:] == ["", ""]
    assert " ".join(row[:35].split("  ")[0] for row in rows).strip() == names[0]
    assert "FE" in rows[0] and "gravity" in rows[1] and "required" in rows[3]


@pytest.mark.heavy
def test_the_table_of_a_run_that_ends_early_fits_the_terminal(solve):
    """Methods with "partial load" are shortened, too; a name keeps a few characters."""
    settings = {"lift_heights": (12.0,), "required_SSF": 1.2, "adhesion": 0.0}
    (result,) = solve("dam", (60.0,), n_joint=10.0, order=1.0, law="friction", **settings)
    checks = compare_joints(result)
    for width in (20, 64):
        table = text_table(checks, width).split("\n\n")[1]
        assert "FE, partial load" in table and "lift 12" in table
    assert max(map(len, table.splitlines())) <= 64


def test_a_joint_that_others_hold_may_slip_along_its_full_length(tmp_path):
    """Its SSF is 1 less the hardening; the run stands, and so does the check."""
    blocks = {"one": (0.0, 0.0, 10.0, 20.0), "two": (10.0, 0.0, 22.0, 20.0)}
    joints = {"b10": (0, 0, 10, 0), "b1": (10, 0, 22, 0), "between": (10, 0, 10, 20)}
    write_blocks(tmp_path / "own.msh", blocks, joints, size=4.0)
    (tmp_path / "own.case").write_text(
        'geometry = "own.msh"; default_law = "friction"; default_adhesion = 0; levels() = {19};'
        "default_pena_tang = 1e6; Struct Joint::b10 [mu 1.5]; Struct Joint::b1 [mu 0.2];"
        'Struct Joint::between [mu 0.5, uplift "none"];'
    )
    checks = {c.finite_elements.joint: c for c in dj.check([str(tmp_path / "own.case")])}
    b1 = checks["b1"].finite_elements
    assert 0.9 < b1.numbers["SSF"] < 1 and b1.verdict == UNCHECKED and not b1.failures
    assert checks["b10"].finite_elements.numbers["SSF"] > 3


def test_factors_by_friction_are_named_where_the_law_has_none(tmp_path, capsys):
    """Law mixed has neither mu nor adhesion, and so no factor of its own."""
    settings = (f"--set={value}" for value in ("law=mixed", "n_joint=10", "order=1"))
    assert cli.main(["check", "dam", "--levels=20", *settings, f"--out={tmp_path}"]) == 0
    strength = "SSF with mu = 0.8, adhesion = 200000 Pa, which the law mixed does not have"
    assert strength in capsys.readouterr().out


def test_joints_of_which_nothing_is_required_do_not_count_beside_others():
    """As a joint between blocks that other joints hold."""

    def check(*verdicts):
        return SimpleNamespace(results=[SimpleNamespace(verdict=v) for v in verdicts])

    assert worst_verdict(check("pass", "pass"), check("not checked")) == "pass"
    assert worst_verdict(check("not checked")) == "not checked"
    assert worst_verdict(check("pass", "not judged"), check("not checked")) == "not judged"
    assert worst_verdict(check("pass"), check("not judged", "fail")) == "fail"
