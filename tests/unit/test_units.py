"""Units of values: factors that Gmsh, GetDP and Python read from one file."""

import math
import re
import subprocess

import gmsh
import pytest
from damjoint import InputError, data
from damjoint.engines.getdp.process import find_getdp
from damjoint.input import casefile, parameters
from damjoint.input.arithmetic import units
from damjoint.input.resolve import load
from damjoint.studies.calibrate import free_of
from damjoint.studies.plan import plan_of, sample_of, tie, values_of

UNITS = data("pro") / "units.pro"
CASE = (
    "default_E_dam = 20*GPa; default_rho_dam = 2.4*t/m3; default_K_N = 1e5*MPa/m;\n"
    "default_ice_force = 150*kN/m; default_joint_slope = Pi/36*rad;\n"
    "levels() = {3000*cm, 0.04*km};\n"
)
VALUES = {"E_dam": 2e10, "rho_dam": 2400, "K_N": 1e11, "ice_force": 1.5e5, "joint_slope": 5}


def test_the_units_are_those_of_the_international_system():
    expected = dict.fromkeys(("m", "m2", "m3", "N", "Pa", "kg", "K", "deg"), 1)
    expected |= {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "kN": 1e3, "MN": 1e6}
    expected |= {"kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "t": 1e3, "rad": 180 / math.pi}
    assert units() == expected


def test_gmsh_getdp_and_python_read_the_same_units(tmp_path):
    """And the same values of a case that uses them."""
    (tmp_path / "my.case").write_text(CASE)
    ours = casefile.read(tmp_path / "my.case")
    assert ours.defaults == pytest.approx(VALUES) and ours.lists == {"levels": [30, 40]}
    text = f'Include "{UNITS}";\nInclude "{tmp_path}/my.case";\n'
    by_gmsh = parameters.parse(text)
    by_gmsh = {name: values[0] for name, values in by_gmsh.items() if name != "levels"}
    assert gmsh.parser.getNumber("levels").tolist() == [30, 40]
    expected = units() | {f"default_{name}": value for name, value in ours.defaults.items()}
    assert by_gmsh == pytest.approx(expected, rel=1e-15)
    text += "".join(f'Printf("value {name} %.17g", {name});\n' for name in expected)
    (tmp_path / "my.pro").write_text(text)
    run = [find_getdp(), str(tmp_path / "my.pro"), "-v", "4"]
    out = subprocess.run(run, capture_output=True, text=True).stdout
    by_getdp = {name: float(value) for name, value in re.findall(r"value (\w+) (\S+)", out)}
    assert by_getdp == pytest.approx(expected, rel=1e-15)


def test_no_parameter_and_no_variable_has_the_name_of_a_unit():
    assert not units().keys() & parameters.declared().keys()
    pattern = re.compile(rf"(?:^\s*|For )({'|'.join(units())})(?:\(\))? *(?:=|\+=|In\b)", re.M)
    for path in [*data("pro").glob("*.pro"), *data("geo").glob("*.geo")]:
        if path != UNITS:
            assert not pattern.findall(path.read_text()), path
    assert len(pattern.findall(UNITS.read_text())) == len(units())


def test_the_name_of_a_unit_can_not_be_set(command, tmp_path):
    (tmp_path / "my.case").write_text("MPa = 1;")
    assert command("run", "my.case")[0] == 2
    code, _, err = command("run", "a", "--set", "MPa=1")
    assert code == 2 and "MPa: unknown parameter" in err


def test_values_with_units_in_all_options():
    settings = parameters.settings(["E_dam=20*GPa", "sigma_max = 0.2*MPa", "anchor_angle=-10*deg"])
    assert settings == {"E_dam": 2e10, "sigma_max": 2e5, "anchor_angle": -10}
    case = load("a", {"K_N": "1e6*MPa/m"}, "300*cm,6*m,9", "0.1*km/100")
    assert (case["K_N"], case.levels, case.tail_levels[0]) == (1e12, (3, 6, 9), 1)
    sample = sample_of(["4", "E=uniform(20*GPa,scale=1*GPa)"])
    vary = ["mu=0.5,1", "adhesion=0.1*MPa:0.3*MPa:100*kPa", "level=600*cm,9*m"]
    plan = plan_of(vary, ["sigma_max=0.1*MPa*mu"], sample, {})
    rows = list(plan.rows())
    assert plan.varied["adhesion"] == pytest.approx([1e5, 2e5, 3e5])
    assert plan.varied["level"] == [6, 9] and len(rows) == 48
    assert all(row["sigma_max"] == pytest.approx(1e5 * row["mu"]) for row in rows)
    assert all(20e9 <= row["E"] <= 21e9 for row in rows)


@pytest.mark.parametrize(
    "refused, parts",
    [
        (lambda: parameters.settings(["E_dam=20*Gpa"]), ["E_dam = 20*Gpa", "> 0", "mean GPa"]),
        (lambda: load("a", {"mu": "1*furlong"}), ["mu = 1*furlong", "furlong is unknown", "GPa"]),
        (lambda: load("a", levels="3,6*M"), ["levels = 3,6*M", "M is unknown"]),
        (lambda: plan_of(["E=1*Gpa,2"], [], None, {}), ["E = 1*Gpa", "GPa"]),
        (lambda: plan_of(["E=1:2*Gpa:1"], [], None, {}), ["--vary E=1:2*Gpa:1", "GPa"]),
        (lambda: plan_of(["level=6,9*km2"], [], None, {}), ["level = 9*km2", "km2 is unknown"]),
        (
            lambda: plan_of([], [], sample_of(["2", "E=normal(20*Gpa,1)"]), {}),
            ["--sample E=normal(20*Gpa,1)", "mean GPa"],
        ),
        (
            lambda: list(plan_of(["mu=1"], ["adhesion=1*Mpa*mu"], None, {}).rows()),
            ["--tie adhesion=1*Mpa*mu", "mean MPa"],
        ),
    ],
)
def test_an_unknown_unit_is_refused_in_one_line(refused, parts):
    """It names the parameter, its value and the unit that was meant."""
    with pytest.raises(InputError) as error:
        refused()
    text = str(error.value)
    assert [part for part in parts if part not in text] == [] and "\n" not in text


@pytest.mark.parametrize(
    "setting, unit",
    [
        ("sigma_max=0.2*kN", "in Pa"),
        ("ice_force=150*kN", "in N/m"),
        ("time_unit=3*m", "in s"),
        ("K_N=1e5*MPa*m", "in Pa/m"),
        ("E_dam=20*GPa + 3*m", "in Pa"),
        ("dam_height=45*m^2", "in m"),
        ("mu=0.8*Pa", "without a unit"),
    ],
)
def test_a_unit_that_does_not_fit_is_refused(setting, unit, command, tmp_path):
    name, value = setting.split("=")
    with pytest.raises(InputError) as error:
        parameters.settings([setting])
    assert str(error.value).startswith(f"{name} = {value}: must be {unit}")
    (tmp_path / "my.case").write_text(f"default_{setting};\n")
    code, _, err = command("run", "my.case")
    assert code == 2 and "line 1: default_" in err and f": must be {unit}" in err


@pytest.mark.parametrize(
    "refused, message",
    [
        (lambda: values_of("sigma_max=1*kPa,2*kN"), "sigma_max = 2*kN: must be in Pa"),
        (lambda: values_of("level=1:3*Pa:1"), "--vary level=1:3*Pa:1: must be in m"),
        (lambda: tie("adhesion", "2*kN/m", {}), "--tie adhesion=2*kN/m: must be in Pa"),
        (
            lambda: sample_of(["2", "E_dam=normal(20*GPa, scale=1*kN)"]),
            "--sample E_dam=normal(20*GPa, scale=1*kN): must be in Pa",
        ),
        (
            lambda: free_of(load("a"), ["K_N=1e9:1e13*Pa"]),
            "--free K_N=1e9:1e13*Pa: must be in Pa/m",
        ),
    ],
)
def test_a_unit_that_does_not_fit_is_refused_in_all_options(refused, message):
    with pytest.raises(InputError, match=re.escape(f"{message}, or without a unit")):
        refused()


def test_units_that_fit_in_another_way():
    """Products and quotients; a force per area; numbers and other names have any unit."""
    texts = ["2e-5*MN/m^2", "20*N/(m*m)", "0.02*kN/m2", "-(-20)*Pa", "20", "2*10"]
    for text in texts:
        assert parameters.settings([f"sigma_max={text}"])["sigma_max"] == pytest.approx(20)
    assert parameters.settings(["visc=1e-3*Pa", "g=9.81*m", "storage=1*mm/MPa"])["visc"] == 1e-3
    with pytest.raises(InputError, match=r"levels = 3\*Pa: must be in m, or without a unit"):
        load("a", levels="3*Pa")


def test_an_unknown_unit_in_a_case_file_is_refused(command, tmp_path):
    (tmp_path / "my.case").write_text("default_mu = 1;\ndefault_E_dam = 20*Gpa;\n")
    code, _, err = command("run", "my.case")
    assert code == 2 and len(err.splitlines()) == 1
    assert "line 2: default_E_dam = 20 * Gpa" in err and "did you mean GPa" in err
