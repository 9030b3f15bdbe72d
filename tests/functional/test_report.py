"""Pictures and report of runs, made from their files."""

import base64
import csv
import html
import io
import json
import os
import re
import shutil
import sys

import damjoint as dj
import numpy as np
import pytest
from damjoint import InputError, cli, runner
from damjoint.input.resolve import load
from damjoint.pictures import report_picture
from damjoint.pictures.run_picture import shear_limit
from damjoint.post import stored
from damjoint.statics import gravity
from damjoint.studies import body_stress, report, report_input
from damjoint.studies.check import compare_joints
from numpy.testing import assert_allclose
from PIL import Image

SMALL = "--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4"
CASE = """title = "<i>my</i> dam & joint";
default_dam_height = 12;  default_dam_base = 8;  default_dam_crest = 2;
default_law = "friction";  default_mu = 0.75;  default_K_N = 2e10;
default_uplift = "drained";  default_required_SSF = 50;
levels() = {8, 10};  tail_levels() = {0, 1};
"""


@pytest.fixture(scope="module")
def ran(painting, tmp_path_factory):
    """The folder of a run."""
    work = tmp_path_factory.mktemp("ran")
    (work / "my.case").write_text(CASE)
    with painting():
        assert cli.main(["run", str(work / "my.case"), *SMALL, "--out", str(work / "my")]) == 0
    return work / "my"


def page_of(folder):
    """Page of the report of a folder."""
    path = folder.parent / "page.html"
    assert cli.main(["report", str(folder), "--to", str(path)]) == 0
    return path.read_text()


@pytest.fixture(scope="module")
def page(ran):
    return page_of(ran)


@pytest.fixture
def folder(ran, tmp_path):
    """A copy of it that a test may change."""
    return shutil.copytree(ran, tmp_path / "out" / "my")


@pytest.mark.heavy
def test_plot_redraws_the_pictures_of_a_run(painted, command, folder):
    path = folder / "my.png"
    drawn = np.asarray(Image.open(path)).astype(float)
    path.unlink()
    code, out, err = command("plot", folder)
    assert (code, out, err) == (0, f"{path}\n", "")
    again = np.asarray(Image.open(path)).astype(float)
    assert again.shape == drawn.shape and np.ptp(again) > 100
    # the tables have 12 digits: a line may be rounded to the next pixel
    assert np.mean(np.abs(again - drawn) > 8) < 1e-3


@pytest.mark.heavy
def test_plot_of_a_run_with_displacement_control(command, texts_drawn):
    """Also its load curve; without fields there is no section."""
    assert command("run", "k", *SMALL, "--no-fields", "--no-picture")[0] == 0
    assert command("plot", "out/k")[0] == 0
    curve, picture = texts_drawn
    assert {"level prescribed", "heel prescribed", "opening of the heel [µm]"} <= {*curve}
    assert "no section: the run wrote no fields" in picture


@pytest.mark.heavy
def test_plot_and_report_of_a_user_geometry(painted, command, tmp_path):
    """A stepped base, the joint's ends read from the mesh; no gravity method without a section."""
    few = "--set", "n_joint=20", "--set", "order=1", "--levels", "40", "--tail-levels", "4"
    assert command("run", "stepped", *few)[0] == 0
    path = tmp_path / "out/stepped/stepped.png"
    drawn = np.asarray(Image.open(path)).astype(float)
    assert command("plot", "out/stepped")[0] == 0
    assert np.mean(np.abs(np.asarray(Image.open(path)) - drawn) > 8) < 1e-3
    read = stored.read(tmp_path / "out/stepped")
    assert read.result.case.joint_length == pytest.approx(np.hypot(34, 4))
    assert command("report", "out/stepped")[0] == 0
    page = (tmp_path / "report.html").read_text()
    assert "geometry stepped.geo" in page and "Loads of the gravity method" not in page
    assert "dam_base" not in page and "n_joint" in page


def damaged(folder, name, text):
    (folder / name).write_text(text)


def test_a_critical_value_names_the_joint_that_fails():
    found = {"value": 40.0, "unit": "m", "of": "level", "doubt": "", "mode": "sliding"}
    found |= {"joint": "lift 9 m", "gravity_method": 41.0, "gravity_method_joint": "base"}
    words = "critical level 40 m; sliding on lift 9 m; gravity method on base 41 m"
    assert words in report.critical_value(found)
    assert "40 m; sliding;" in report.critical_value(found | {"joint": ""})


@pytest.mark.parametrize("words", [("plot",), ("report", "--to", "page.html")])
@pytest.mark.parametrize(
    "harm, message",
    [
        (lambda f: (f / "run.json").unlink(), "must be the folder of a run"),
        (lambda f: damaged(f, "joint.csv", "x,y\n1\n"), "damaged"),
        (lambda f: damaged(f, "fields/dam_t2.vtu", "<VTKFile"), "damaged"),
        (lambda f: change(f, parameters={}), "lacks parameters"),
        (lambda f: change(f, case="../../elsewhere"), "must be the name of a case"),
    ],
)
def test_a_bad_folder_is_reported_in_one_line(refused, folder, harm, message, words):
    harm(folder)
    line = refused(*words, folder)
    assert message in line and str(folder) in line


def change(folder, **entries):
    record = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(record | entries))


def words_of(text):
    """Text of a part of a page, without its marks."""
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", " ", text))).strip()


def rows_below(page, heading):
    """Cells of the first table below a heading: [row][column], with the heads."""
    table = page.split(f">{heading}<", 1)[1].split("<table", 1)[1].split("</table>", 1)[0]
    return [
        [words_of(f"<{cell}") for cell in re.split(r"<(?=t[hd])", row)[1:]]
        for row in table.split("<tr>")[1:]
    ]


def column(rows, head):
    """Numbers of a column, in SI units by the unit in its head."""
    (i,) = (i for i, cell in enumerate(rows[0]) if cell.split(" [")[0] == head)
    size = {"MN": 1e6, "kN": 1e3, "N": 1, "MPa": 1e6, "kPa": 1e3, "mm": 1e-3, "µm": 1e-6}
    unit = re.sub(r".*\[([^ /\]]*).*", r"\1", rows[0][i])
    numbers = [float("nan" if row[i] == "-" else row[i]) for row in rows[1:]]
    return np.array(numbers) * size.get(unit, 1)


def test_report_has_results_and_parameters(command, folder, tmp_path):
    """One page without external files."""
    assert command("run", "a", *SMALL, "--set", "order=1")[0] == 0
    code, out, err = command("report", folder, "out/a", "--to", "page.html")
    assert (code, out, err) == (0, "page.html\n", "")
    page = (tmp_path / "page.html").read_text()
    assert not re.search(r"(src|href)=\"(?!data:|#)|url\(|@import", page)
    assert "<i>" not in page and "&lt;i&gt;my&lt;/i&gt; dam &amp; joint" in page
    mine, first, second, common = page.split("<section")[1:]  # a has two scenes
    assert mine.count("data:image/svg+xml;base64,") == 4
    assert re.search(r"SSF [\d.]+ &lt; 50", mine) and ">fail<" in mine  # required by the case
    for scene in (first, second):  # case a requires none
        assert ">not checked<" in scene and 'class="verdict not-checked"' in scene
    assert ">pass<" not in page
    words = words_of(common)
    assert "Error of the mesh: not estimated; damjoint run --accuracy 1% estimates it." in words
    assert "K_N Normal stiffness K_N 1 20 GPa/m 100" in words
    assert "sigma_max Tensile strength sigma_max, not friction 2, 3" in words
    assert "levels Reservoir levels at t = 1, 2, ... 1 8, 10 m" in words
    assert "E_dam Young's modulus of the dam 1 25 GPa" in words
    record = json.loads((folder / "run.json").read_text())
    for name in ("gmsh", "numpy", "python"):
        assert f"{name} {record['versions'][name]}" in words
    assert f"machine {record['machine']}" in words and "cores" in record["machine"]


@pytest.mark.heavy
def test_all_input_of_a_run_is_in_its_report(page, ran):
    """Every parameter that matters in the scene, with its value."""
    case = stored.read(ran).result.case
    entries = report_input.parameters(case)
    assert len(entries) > 40 and not entries.keys() & report_input.COMMON_MODULI
    text = words_of(page)
    for name, entry in entries.items():
        table = rf"{name} {re.escape(entry.meaning)} {re.escape(entry.value)} "
        dense = rf"{name} = {re.escape(f'{entry.value} {entry.unit}'.strip())}[;.]"
        assert re.search(rf"{table}|{dense}", text), name


def test_tables_of_the_report_have_the_values_of_the_files(page, ran):
    """History at the levels; both methods; loads with lever arms; to the four digits printed."""
    result = stored.read(ran).result
    levels = rows_below(page, "At the requested levels, by finite elements")
    for head, name in (("N'", "N"), ("T", "T"), ("M", "M"), ("crest movement", "crest_ux")):
        assert_allclose(column(levels, head), result.history[name], rtol=1e-3)

    method = gravity.at(result.case, 2.0)
    both = rows_below(page, "Finite elements and gravity method, at level 10 m")
    assert [row[0] for row in both[1:]] == ["finite elements", "gravity method", "required"]
    assert_allclose(column(both, "SSF"), [method.SSF, method.SSF, 50], rtol=1e-3)
    assert_allclose(column(both, "U")[:2], method.U, rtol=1e-3)
    stresses = result.at()["sigma_n_eff"][-1], method.sigma_n_eff_toe
    assert_allclose(column(both, "eff. toe")[:2], stresses, rtol=1e-3)
    factor = re.search(r"SSF = \(µ N' \+ c B\)/T = \(.*?\)/[\d.]+ = ([\d.]+)", words_of(page))[1]
    assert float(factor) == pytest.approx(method.SSF, rel=1e-3)

    loads = rows_below(
        page, "Loads of the gravity method on the body above the joint, at the last level"
    )
    table = method.table()
    assert [row[0] for row in loads[1:]] == table["load"]
    fx, fy, moment = (column(loads, h) for h in ("downstream", "upwards", "moment about the toe"))
    for shown, name in ((fx, "Fx"), (fy, "Fy"), (moment, "moment")):
        assert_allclose(shown, table[name], rtol=1e-3, atol=1e-9)
    height, away = (
        column(loads, h) for h in ("height above the toe", "distance upstream of the toe")
    )
    arms = np.nan_to_num(height) * fx + np.nan_to_num(away) * fy
    assert_allclose(arms[:-1], -moment[:-1], rtol=2e-3)
    reservoir = table["load"].index("reservoir")
    assert height[reservoir] == pytest.approx(10 / 3, rel=1e-3)  # of a triangle of pressure


def test_lever_arms_of_the_uplift_on_a_sloping_joint():
    """It acts on the joint, and normal to it."""
    case = load("sloping")
    method = gravity.at(case, case.times[-1])
    rows = {row[0]: row[1:] for row in report.loads_table(method).rows}
    fx, height, fy, away, moment = map(float, rows["uplift"])
    slope = np.tan(np.radians(case["joint_slope"]))
    assert fx / fy == pytest.approx(-slope, rel=1e-3)
    assert height / away == pytest.approx(-slope, rel=1e-3)  # the toe is the higher end
    assert height * fx + away * fy == pytest.approx(-moment, rel=1e-3)


COMBINATIONS = {"usual": (8, 0.1), "flood": (11, 50), "empty": (0.5, 0)}


def check_into(work):
    """The folder of damjoint check for three load combinations."""
    for name, (level, factor) in COMBINATIONS.items():
        text = CASE.replace("<i>my</i> dam & joint", name).replace("{8, 10}", f"{{8, {level}}}")
        (work / f"{name}.case").write_text(text.replace("SSF = 50", f"SSF = {factor}"))
    cases = [str(work / f"{name}.case") for name in COMBINATIONS]
    assert cli.main(["check", *cases, *SMALL, "--out", str(work / "out")]) == 1
    return work / "out"


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    return check_into(tmp_path_factory.mktemp("checked"))


@pytest.fixture(scope="module")
def painted_check(painting, tmp_path_factory):
    """The same with painted pictures."""
    with painting():
        return check_into(tmp_path_factory.mktemp("painted"))


@pytest.fixture(scope="module")
def page_of_check(checked):
    return page_of(checked)


@pytest.mark.parametrize("level, end", [(45.0, "toe"), (5.0, "heel")])
def test_the_eccentricity_has_its_direction(level, end):
    """The weight alone is upstream of the middle."""
    rigid = gravity.at(load("dam", {}, (level,)), 1)
    line = report.formulas(rigid)[0]
    assert f"= {rigid.eccentricity:.4g} m, towards the {end}; " in line
    assert (rigid.eccentricity > 0) == (end == "toe")


@pytest.mark.heavy
def test_report_of_load_combinations(checked, page_of_check):
    """The summary has the factors and verdicts of check.csv, in its order."""
    summary = rows_below(page_of_check, "Summary")
    with (checked / "check.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row[1].split(",")[0] for row in summary[1:]] == list(COMBINATIONS)
    verdicts = [" ".join(row[-1].split()[:-1]) for row in summary[1:]]
    assert verdicts == ["pass", "fail", "not checked"]
    for head, method, name in (
        ("SSF", "finite elements", "SSF"),
        ("SSF gravity", "gravity method", "SSF"),
        ("OSF gravity", "gravity method", "OSF"),
        ("N'", "finite elements", "N"),
    ):
        values = [float(row[name]) for row in rows if row["answer"] == method]
        assert_allclose(column(summary, head), values, rtol=1e-3)
    assert_allclose(column(summary, "SSF required"), [1, 50, np.nan])  # friction needs 1


def test_a_damaged_table_of_load_combinations_is_reported(refused, checked, tmp_path):
    copy = shutil.copytree(checked, tmp_path / "out")
    for text in ("x,y\n1,2\n", "case\n../elsewhere\n"):
        (copy / "check.csv").write_text(text)
        assert "out = out: its check.csv is damaged" in refused("report", "out")


def test_report_of_a_critical_value(command, tmp_path):
    """Requirements do not apply at the limit; both methods are compared at the critical level."""
    (tmp_path / "my.case").write_text(CASE)
    assert command("critical", "my.case", *SMALL, "--set", "adhesion=0", "--out", "limit")[0] == 0
    level = json.loads((tmp_path / "limit/run.json").read_text())["critical"]["value"]
    assert command("report", "limit")[0] == 0
    page = (tmp_path / "report.html").read_text()
    assert 'class="verdict not-judged">not judged<' in page and ">fail<" not in page
    assert '<p class="fail lead">required_SSF: not judged in the state before failure</p>' in page
    assert f"critical level {level:.6g} m" in words_of(page)
    both = rows_below(page, f"Finite elements and gravity method, at level {level:.4g} m")
    assert_allclose(column(both, "N'")[0], column(both, "N'")[1], rtol=1e-3)
    heading = f"Stress in the bodies, by finite elements, tension &gt; 0, at level {level:.4g} m"
    stress = rows_below(page, heading)
    largest, smallest = column(stress, "largest"), column(stress, "smallest")
    assert [row[0] for row in stress[1:]] == ["dam", "rock"] and (smallest < 0).all()
    assert (largest > smallest).all()


def test_limits_of_the_model_follow_the_case():
    """A sentence for each choice of the model; loads that are zero are named."""
    plane = " ".join(report_input.limits(load("dam", {"uplift": "none"})))
    assert "Plane strain" in plane and "no water pressure" in plane
    assert "Loads that are zero: silt, ice, post-tensioning, earthquake, temperature." in plane
    quake = {"k_v": 0.1, "law": "bond", "uplift": "drained", "ice_force": 1e4}
    loaded = load("dam", quake | {"temperature_found": -2})
    sentences = " ".join(report_input.limits(loaded))
    assert "expansion_found" in report_input.materials(loaded) and "no conduction" in sentences
    assert "expansion_found" not in report_input.other_input(loaded)
    assert "pseudo-static" in sentences and "Joint law bond: coupled" in sentences
    assert "Drains 3.4 m from the heel" in sentences
    assert "independent of the opening" in sentences  # then not that of the crack at each moment
    assert "uplift: as before the earthquake." in sentences and "at each moment" not in sentences
    follows = load("dam", {"k_h": 0.1, "uplift": ("cracked", "none"), "lift_heights": (15.0,)})
    both = "uplift: that of the crack at each moment (base); no water pressure (lift 15 m)."
    assert both in " ".join(report_input.limits(follows))
    assert "Loads that are zero: silt, post-tensioning." in sentences
    solid = " ".join(report_input.limits(load("b")))
    assert "Three dimensions: the section over 1 m" in solid and "Plane strain" not in solid
    own = " ".join(report_input.limits(load("stepped")))
    assert "gravity method" not in own and "foundation reaches" not in own


def test_input_of_several_joints_is_in_the_report():
    own = {"law": ("bond", "friction"), "mu": (0.7, 0.8), "adhesion": (1e5, 1e5)}
    case = load("dam", own | {"lift_heights": (15.0,), "uplift": "drained"})
    materials, other = report_input.materials(case), report_input.other_input(case)
    assert (materials["mu"].value, materials["mu"].default) == ("0.7, 0.8", "0.8")
    assert (materials["adhesion"].value, materials["adhesion"].default) == ("100", "200")
    assert materials["drain_x"].default == "" and "G_t" in materials and "pena_tang" in materials
    values = {n: other[n].value for n in ("joints", "lift_heights", "law")}
    assert values == {"joints": "base, lift 15 m", "lift_heights": "15", "law": "bond, friction"}
    sentences = [*report_input.limits(case)]
    assert sum("Joint law" in words for words in sentences) == 2
    assert any(words.endswith("(lift 15 m).") for words in sentences)


@pytest.mark.heavy
def test_report_of_several_joints_has_the_levels_of_each(command, tmp_path):
    lifts = "--set", "lift_heights=15", "--set", "law=bond,friction", "--levels", "30,40"
    command("run", "dam", *SMALL, *lifts, "--out", "dam")
    assert command("report", "dam")[0] == 0
    page = (tmp_path / "report.html").read_text()
    result = stored.read(tmp_path / "dam").result
    history = result.history
    for joint, normal in (("Base", history["N"]), ("Lift 15 m", history["N_2"])):
        rows = rows_below(page, f"{joint}: at the requested levels, by finite elements")
        assert_allclose(column(rows, "N'"), normal, rtol=1e-3)
        assert rows[0][-2:] == ["crest movement [mm]", "N' in"]
    # as equals: a row of each in the summary, the loads of each
    summary = rows_below(page, "Summary")
    assert [row[2] for row in summary[1:]] == ["base", "lift 15 m"]
    assert_allclose(column(summary, "T"), [history["T"][-1], history["T_2"][-1]], rtol=1e-3)
    for joint, own in zip(("Base", "Lift 15 m"), result.joints, strict=True):
        words = "loads of the gravity method on the body above the joint, at the last level"
        loads = rows_below(page, f"{joint}: {words}")
        method = gravity.at(own.case, 2.0)
        assert_allclose(column(loads, "moment about the toe")[-1], method.M, rtol=1e-3)
    assert page.count("SSF = (µ N") == 2


@pytest.mark.heavy
def test_stress_on_the_faces_is_that_of_water_and_of_a_beam(tmp_path):
    """Of a wall: along its faces weight and bending stress, normal to them the water; the mean
    pressure on the rock is that of the weight.
    """
    wall = {"dam_height": 40, "dam_base": 6, "dam_crest": 6, "h_dam": 0.8, "n_joint": 20}
    joint = {"law": "friction", "adhesion": 1e8, "uplift": "none"}
    runner.run(load("dam", wall | joint, "30"), tmp_path, picture=False, progress=False)
    solution = stored.read(tmp_path)
    section = body_stress.undeformed(solution, 1.0)
    rows = np.array(body_stress.faces(solution, 1.0, section).rows, float)
    height, up, water, down, dry = rows.T
    assert_allclose(height, [4, 10, 20, 30])
    water_above = np.maximum(30 - height, 0)
    assert_allclose(-1e6 * water, 9810 * water_above, atol=3e3)  # 1 % of the largest
    assert_allclose(dry, 0, atol=2e-3)
    bending = 9810 * water_above**3 / 6**2 / 1e6  # 6 M/b^2
    weight = 2400 * 9.81 * (40 - height) / 1e6
    # a load that is not at the ends adds about 0.2 of its pressure [Timoshenko]
    assert_allclose(up[1:], (bending - weight)[1:], atol=0.25 * 9810e-6 * 20)
    assert_allclose(down[1:], -(bending + weight)[1:], atol=0.25 * 9810e-6 * 20)
    result = solution.result
    pressure = body_stress.rock_pressure(solution, compare_joints(result), 1.0)
    assert_allclose([float(row[1]) for row in pressure.rows], 2400 * 9.81 * 40 / 1e6, rtol=1e-2)
    mean, edge = 2400 * 9.81 * 40 / 1e6, 9810 * 30**3 / 6**2 / 1e6
    ends = [float(value) for value in pressure.rows[1][2:4]]
    assert_allclose(ends, [mean - edge, mean + edge], rtol=1e-2)
    # the largest tension and compression are near the two edges of the base
    dam = [float(value) for value in body_stress.extremes(solution, 1.0).rows[0][1:]]
    assert 0 < dam[1] < 2 and 4 < dam[4] < 6 and dam[0] > up[1] and dam[3] < down[1]


def test_principal_stresses_are_those_of_mohr():
    """In the plane, of a rotated state, and in space."""
    rotated = np.array([[3.0, 1.0, 0.5, 2.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 4.0, 0.0]])
    found = body_stress.principal(rotated)
    radius = np.hypot(1, 2)
    assert_allclose(found[0], sorted([2 - radius, 0.5, 2 + radius]))
    assert_allclose(found[1], [-4, 0, 4], atol=1e-12)


@pytest.mark.heavy
def test_the_name_of_the_dam_is_in_the_report(command, page, folder, tmp_path):
    """By default the title of the case."""
    assert '<td contenteditable="true">&lt;i&gt;my&lt;/i&gt; dam &amp; joint</td>' in page
    assert command("report", folder, "--dam", "Pine Flat")[0] == 0
    named = (tmp_path / "report.html").read_text()
    assert "<h1>Pine Flat</h1>" in named and '<td contenteditable="true">Pine Flat</td>' in named


def test_a_picture_is_cut_where_it_is_white(tmp_path):
    """Into bands that have all of it: the labels below a panel, the legend above the next one."""
    drawn = np.full((200, 400, 3), 255, np.uint8)
    labels, legend = (53, 56), (123, 126)
    for top, bottom in ((10, 50), labels, (80, 120), legend, (130, 170)):
        drawn[top:bottom, 20:80] = 0
    Image.fromarray(drawn).save(tmp_path / "all.png")
    parts = [
        np.asarray(Image.open(io.BytesIO(base64.b64decode(address.split(",")[1]))))
        for address in report_picture.bands(tmp_path / "all.png")
    ]
    assert [len(part) for part in parts] == [68, 53, 79]
    assert np.array_equal(np.concatenate(parts), drawn)
    assert all(part[0].min() == part[-1].min() == 255 for part in parts)


def test_parameters_of_a_report_are_those_of_its_own_case():
    """Not those of the case that the process read last, nor none if the case is cached."""
    dry, wet = load("dam", {"uplift": "none"}), load("dam", {"uplift": "flow"})
    listed = [report_input.visible(case) for case in (dry, wet, dry, wet)]
    assert "visc" in listed[1] - listed[0] and listed[2:] == listed[:2]


def test_values_are_merged_over_runs():
    runs = [{"a": 1, "b": 1}, {"a": 1, "b": 2}, {"a": 1}, {"a": 1, "b": 2}, {"a": 1, "b": 2}]
    merged = report_input.by_runs(runs)
    assert merged == [("a", 1, ""), ("b", 1, "1"), ("b", 2, "2, 4, 5")]
    assert report_input.by_runs([{"a": 1}] * 3 + [{"a": 2}])[0] == ("a", 1, "1 to 3")


@pytest.mark.heavy
def test_pages_of_the_report_as_pdf(painted, painted_check, command, tmp_path, monkeypatch):
    """Nothing is wider than the page's text, no page ends with a heading, none is half empty."""
    weasyprint = pytest.importorskip("weasyprint", exc_type=(ImportError, OSError))
    render, documents = weasyprint.HTML.render, []

    def kept(*words, **options):
        documents.append(render(*words, **options))
        return documents[-1]

    monkeypatch.setattr(weasyprint.HTML, "render", kept)
    assert command("report", painted_check, "--to", "my.PDF") == (0, "my.PDF\n", "")
    content = (tmp_path / "my.PDF").read_bytes()
    assert content.startswith(b"%PDF-") and content.rstrip().endswith(b"%%EOF")
    (pages,) = (document.pages for document in documents)
    chapters = [label for part in pages for level, label, *_ in part.bookmarks if level == 2]
    assert [chapter.split()[0] for chapter in chapters[:5]] == ["Summary", "Limits", *["Run"] * 3]
    for number, part in enumerate(pages):
        box, ends = part._page_box, dict[float, str]()
        left, right = box.content_box_x(), box.content_box_x() + box.width
        bottom = box.content_box_y() + box.height
        for child in box.children[0].descendants():
            if child.element_tag in ("td", "th", "img", "p", "li"):
                assert left - 0.1 <= child.position_x, words_of(str(child))
                assert child.position_x + child.border_width() <= right + 0.1
                assert child.position_y + child.border_height() <= bottom + 0.1
            if child.element_tag in ("td", "img", "p", "li", "h2", "h3"):
                ends[child.position_y + child.border_height()] = child.element_tag
        assert ends[max(ends)] not in ("h2", "h3")
        if number < len(pages) - 1:
            assert max(ends) > bottom / 2


@pytest.mark.heavy
def test_the_caption_of_maps_of_a_joint_has_no_colors_of_curves():
    def captions(name, **settings):
        solution = dj.run(dj.case(name, n_joint=6, h_dam=15, h_found=60, **settings)).solution
        return [caption for _, caption, _ in report.drawn(solution)]

    valley = captions("valley", levels=[40.0])
    assert "Joint at level 40 m." in valley and not [text for text in valley if "Red" in text]
    dam = captions("dam", levels=[40.0])
    assert any(text.startswith("Joint at level 40 m. Red: broken") for text in dam)


@pytest.mark.heavy
def test_a_pdf_whose_pictures_are_not_whole_is_not_written(command, checked, monkeypatch):
    """weasyprint catches all that stops it in a picture, also a signal, and only logs it."""
    images = pytest.importorskip("weasyprint.svg", exc_type=(ImportError, OSError))

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(images.SVG, "draw", interrupted)
    code, _, err = command("report", checked, "--to", "my.pdf")
    assert code == 1
    assert err.endswith("to = my.pdf: nothing is written, weasyprint: Failed to render SVG image\n")
    assert "my.pdf" not in os.listdir()


def test_a_pdf_without_weasyprint_is_refused(command, checked, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    code, out, err = command("report", checked, "--to", "my.pdf")
    assert (code, out) == (1, "") and len(err.splitlines()) == 1
    assert "to = my.pdf" in err and "pip install weasyprint" in err and "browser" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.heavy
def test_report_of_a_dam_that_passes_with_its_estimated_error(command, tmp_path):
    """The required factors are met; the estimated error of --accuracy is that of run.json."""
    needs = "--set", "required_SSF=0.1", "--levels", "40", "--accuracy", "coarse", "--no-picture"
    assert command("run", "dam", *needs)[0] == 0
    estimate = json.loads((tmp_path / "out/dam/run.json").read_text())["error_estimate"]
    assert command("report", "out/dam")[0] == 0
    page = (tmp_path / "report.html").read_text()
    assert 'class="verdict pass"' in page and 'not-checked"' not in page
    assert estimate["statement"] and estimate["statement"] in html.unescape(page)
    assert "not estimated" not in page


@pytest.mark.heavy
def test_report_of_a_run_without_a_converged_step(command, tmp_path):
    """A dam too light to stand has no state to draw; the page states it."""
    light = "--set", "rho_dam=10", "--set", "law=friction", "--set", "smallest_step=0.5"
    assert command("run", "c", *SMALL, *light, "--levels", "9", "--out", "light")[0] == 1
    assert command("report", "light")[0] == 0
    assert ">fail<" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("law", ["friction", "bond"])
def test_the_strength_drawn_is_that_of_the_law(solve, law):
    """Where a node has slipped, its shear is at the limit; nowhere is it above."""
    (result,) = solve("c", levels="7", n_joint=20, law=law, adhesion=2e4, G_t=100)
    rows = result.at()
    _, limit = shear_limit(result.case, rows)
    slipped = rows["slip"] > 0
    assert slipped.any() and not slipped.all()
    assert_allclose(np.abs(rows["tau_1"][slipped]), limit[slipped], rtol=1e-6)
    assert np.all(np.abs(rows["tau_1"]) <= limit * (1 + 1e-6))


def test_the_runs_of_several_earthquakes(tmp_path):
    """In the order of their table; another folder is a run itself."""
    assert report.parts_of(tmp_path) == [tmp_path]
    (tmp_path / "records.csv").write_text("folder,record\nsecond,b.csv\nfirst,a.csv\n")
    assert report.parts_of(tmp_path) == [tmp_path / "second", tmp_path / "first"]
    (tmp_path / "records.csv").write_text("folder,record\n../other,b.csv\n")
    with pytest.raises(InputError, match=r"records\.csv is damaged"):
        report.parts_of(tmp_path)
