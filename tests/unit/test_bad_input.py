"""Bad input: exit code 2, one line with parameter, value and allowed range, no file written."""

import subprocess
import sys

import damjoint as dj
import pytest

RUN = "run", "a"
TO_TWICE = "between 0 and 20 m, twice the dam's height"


def missing(parts, message):
    return [part for part in parts if part not in message]


#: A base and two lift joints with drains.
LIFTS = "--set", "lift_heights=15,30", "--set", "uplift=drained"


@pytest.mark.parametrize(
    "setting, allowed",
    [
        ("E=abc", "> 0"),
        ("E=1_000", "> 0"),
        ("E=\u0663", "> 0"),  # a digit of another script
        ("E=0", "> 0"),
        ("E=-3e12", "> 0"),
        ("E=nan", "> 0"),
        ("E=inf", "> 0"),
        ("E=", "> 0"),
        ("nu=0.5", "< 0.5"),
        ("nu=-0.1", ">= 0"),
        ("K_N=0", "> 0"),
        ("K_N=-1e12", "> 0"),
        ("K_T=0", "> 0"),
        ("alpha=-0.1", ">= 0"),
        ("alpha=2.1", "<= 2"),
        ("sigma_max=-1", ">= 0"),
        ("pena_rupture=0", "> 0"),
        ("pena_contact=0", "> 0"),
        ("mu=-0.35", "> 0"),
        ("adhesion=-1", ">= 0"),
        ("pena_tang=-0.5", ">= 0, or -1: (K_N + K_T) 1e-6"),
        ("E_dam=0", "> 0, or -1: E"),
        ("tolerance=1", "<= 0.001"),
        ("visc=0", "> 0"),
        ("time_unit=-1", ">= 0"),
        ("storage=-1e-9", ">= 0"),
        ("aperture_elastic=-1e-5", ">= 0"),
        ("pressure_min=-2e5", ">= -100000"),
        ("pressure_min=1", "<= 0"),
        ("aperture_min=0", "> 0"),
        ("dim=4", "2, 3"),
        ("order=3", "1, 2"),
        ("n_joint=2.5", "integer"),
        ("n_joint=0", ">= 1"),
        ("law=glue", "rupture, friction"),
        ("uplift=some", "none, imposed, drained, cracked, flow"),
        ("mesh_pattern=odd", "free, regular, layers, split"),
        ("thickness=-1", "> 0"),
    ],
)
def test_a_parameter_out_of_range_is_refused(refused, setting, allowed):
    name, value = setting.split("=")
    assert not missing((f"{name} = {value}", allowed), refused(*RUN, "--set", setting))


@pytest.mark.parametrize(
    "words, parts",
    [
        (("run", "z"), ("case z", "unknown", "b, c, c_file")),
        (("run", "none.case"), ("case none.case", "no such file", "damjoint new none.case")),
        (("validate", "zz"), ("case zz", "unknown")),
        (("run", "koyan"), ("case koyan", "did you mean koyna?", "allowed: a, ")),
        (("chek", "a"), ("chek: unknown command; did you mean check?",)),
        (("critical", "a", "--of", "levl"), ("--of levl", "did you mean level?")),
        (("validate", "dam"), ("case dam", "reference", "b, c, c_file")),
        (("sweep", "a", "--vary", "mu"), ("--vary mu", "NAME=V1,V2")),
        (("sweep", "a", "--vary", "mu=0.1:0.5:-0.1"), ("--vary mu=0.1:0.5:-0.1", "step")),
        (("sweep", "a", "--vary", "mu=-1,1"), ("mu = -1", "> 0")),
        (("sweep", "a", "--vary", "mu=0.6:1:5"), ("--vary mu=0.6:1:5", "from first to last")),
        (("sweep", "a", "--vary", "sigma_max=0.1*MPa:0.2*MPa:1"), (": 1 must have a unit",)),
        (("sweep", "a", "--vary", "adhesion=0,0.1,0.2*MPa"), (": 0.1 must have a unit",)),
        (("sweep", "a", "--vary", "mu=0.8,0.8"), ("--vary mu: 0.8 must be given once",)),
        (
            ("sweep", "a", "--sample", "5", "adhesion=normal(3*kPa,0.05)"),
            ("--sample adhesion=normal(3*kPa,0.05)", "0.05 must have a unit"),
        ),
        (
            ("sweep", "a", "--sample", "5", "adhesion=lognorm(0.3,5,scale=2*kPa)"),
            ("5 must have a unit",),
        ),
        (("sweep", "a", "--vary", "mu=1", "--design", "sobol"), ("--design: needs --sample",)),
        (("sweep", "a", "--vary", "mu=1", "--intensity", "arias_x"), ("--intensity: need",)),
        (("sweep", "a", "--vary", "mu=1", "--out", "mu.png"), ("out = mu.png", ".csv")),
        (("sweep", "a", "--vary", "mu=1", "--quake", "slip=5*kN"), ("slip=5*kN", "in m")),
        (("sweep", "a", "--vary", "levels=3,6"), ("levels", "no parameter", "--levels")),
        (("run", "a", "--set", "tail_level=3"), ("tail_level", "no parameter", "--tail-levels")),
        (("run", "lifts", "--set", "mu=0.9,90*cm/m,1,1"), ("0.9 must have a unit",)),
        (("sweep", "a", "--vary", "level=9,22"), ("levels = 22", TO_TWICE)),
        (("sweep", "a", "--vary", "level=9,x"), ("level = x", "metres")),
        (("sweep", "a", "--vary", "mu=1", "--critical", "mu"), ("--critical mu", "varied")),
        (("sweep", "a", "--vary", "mu=1", "--critical", "law"), ("--of law", "must be level")),
        (("sweep", "a"), ("--vary, --sample", "one must be given")),
        (("sweep", "a", "--vary", "mu=0.5", "--tie", "adhesion=x()"), ("--tie adhesion=x()",)),
        (("sweep", "a", "--sample", "5", "mu=normal(0,1)"), ("--sample mu=normal(0,1)", "> 0")),
        (("sweep", "a", "--sample", "0", "mu=normal(0,1)"), ("--sample 0", "N NAME=")),
        (("sweep", "a", "--sample", "²", "mu=normal(0,1)"), ("--sample ²", "N NAME=")),
        (("sweep", "a", "--sample", "5", "mu=norm(1)", "--seed", "-1"), ("seed", "-1", ">= 0")),
        (
            ("sweep", "a", "--vary", "mu=1", "--correlate", "a,b=1"),
            ("--correlate: needs --sample",),
        ),
        (("sweep", "a", "--vary", "mu=1", "--accuracy", "rough"), ("accuracy = rough", "coarse")),
        ((*RUN, "--set", "KN=1e12"), ("KN", "unknown parameter", "K_N")),
        ((*RUN, "--set", "E"), ("--set E", "NAME=VALUE")),
        ((*RUN, "--levels", "3,21"), ("levels = 21", TO_TWICE)),
        ((*RUN, "--levels", "3,-1"), ("levels = -1", TO_TWICE)),
        ((*RUN, "--levels", "3,\u0663"), ("levels = 3,\u0663", "list of levels in metres")),
        ((*RUN, "--levels", "3," * 12000 + "3"), ("levels = 12001 values", "at most 10000")),
        ((*RUN, "--levels", ""), ("levels = ", "list of levels in metres")),
        ((*RUN, "--levels", "3,,6"), ("levels = 3,,6", "list of levels in metres")),
        ((*RUN, "--levels", "3;6"), ("levels = 3;6", "list of levels in metres")),
        ((*RUN, "--set", "dam_height=4"), ("levels = 9", "and 8 m")),
        ((*RUN, "--set", "E_dam=25"), ("E_dam = 25", ">= 2.354e+06 Pa", "25*GPa")),
        (("run", "dam", "--set", "dam_height=4.5e6"), ("dam_height = 4.5e6", "<= 1e+06")),
        (("run", "dam", "--set", "silt_height=46"), ("silt_height = 46", "<= dam_height (45 m)")),
        (("run", "dam", *LIFTS, "--set", "lift_heights=15,45"), ("lift_heights = 15,45", "(45 m)")),
        (("run", "dam", *LIFTS, "--set", "lift_heights=-3"), ("lift_heights = -3", "> 0")),
        (("run", "dam", *LIFTS, "--set", "drain_x=15"), ("lift 30 m: drain_x = 15", "length (14")),
        (
            (*RUN, "--tail-levels", "1,2"),
            ("tail_levels = 1,2", "one level or as many as levels (4)"),
        ),
        ((*RUN, "--levels", "3,6", "--tail-levels", "1,2,3"), ("tail_levels = 1,2,3", "(2)")),
        ((*RUN, "--tail-levels", "-1"), ("tail_levels = -1", TO_TWICE)),
        ((*RUN, "--tail-levels=-1"), ("tail_levels = -1", TO_TWICE)),
        ((*RUN, "--engine", "fast"), ("engine = fast", "getdp")),
        (
            ("run", "f", "--engine", "getdp", "--set", "mesh_pattern=layers"),
            ("mesh_pattern = layers", "free, split"),
        ),
        (
            ("run", "c", "--set", "grout_pressure=5e4"),
            ("grout_pressure = 50000", "law = friction", "must be 0"),
        ),
        (
            (*RUN, "--set", "saw_thickness=1e-3", "--set", "uplift=flow"),
            ("saw_thickness = 0.001", "uplift = flow", "must be 0"),
        ),
        (
            (*RUN, "--set", "time_unit=60", "--set", "uplift=cracked"),
            ("time_unit = 60", "must be 0", "uplift = cracked"),
        ),
        (
            ("run", "dam", "--set", "time_unit=60", "--set", "uplift=flow", "--set", "k_h=0.1"),
            ("time_unit = 60", "must be 0", "k_h"),
        ),
        (
            ("critical", "dam", "--set", "time_unit=60", "--set", "uplift=flow"),
            ("time_unit = 60", "must be 0", "critical value"),
        ),
        (
            (
                *("reliability", "dam", "--set", "time_unit=60", "--set", "uplift=flow"),
                *("--vary", "mu=normal(1,0.1)"),
            ),
            ("time_unit = 60", "must be 0", "critical value"),
        ),
        (
            (
                *("run", "e", "--set", "time_unit=60", "--set", "pressure_step=1e4"),
                *("--engine", "getdp"),
            ),
            ("time_unit = 60", "must be 0", "engine = getdp", "pressure_step = 10000"),
        ),
        ((*RUN, "--out", "o\udcff"), (r"'o\udcff'", "must be text", "LANG=C.UTF-8")),
        ((*RUN, "--steps", "0"), ("steps = 0", "integer >= 1")),
        ((*RUN, "--steps", "-2"), ("steps = -2", "integer >= 1")),
        pytest.param((*RUN, "--steps", "1.5"), ("steps", "1.5", "integer >= 1")),
        pytest.param((*RUN, "--levels", "-1,3"), ("levels = -1", TO_TWICE)),
    ],
)
def test_bad_arguments_are_refused(refused, words, parts):
    assert not missing(parts, refused(*words))


def test_an_output_folder_that_can_not_be_written_is_refused(refused, tmp_path):
    (tmp_path / "file").write_text("in the way")
    message = refused(*RUN, "--out", tmp_path / "file" / "below")
    assert not missing(("out = ", "file/below", "folder that can be written"), message)


@pytest.mark.parametrize(
    "words",
    [
        (*RUN, "--engine", "getdp"),
        ("validate", "a", "--engine", "getdp"),
        ("law", "rupture", "--path", "path.csv"),
    ],
)
def test_a_missing_getdp_is_reported(refused, tmp_path, monkeypatch, words):
    monkeypatch.setenv("GETDP", "/no/such/getdp")
    (tmp_path / "path.csv").write_text("delta_n,delta_t1,delta_t2\n0,0,0\n")
    assert not missing(("GETDP = /no/such/getdp", "GetDP >= 3.2"), refused(*words))


GOOD = "delta_n,delta_t1,delta_t2\n0,0,0\n"


@pytest.mark.parametrize(
    "law, text, parts",
    [
        ("glue", GOOD, ("law = glue", "rupture, friction")),
        ("rupture", None, ("path = path.csv", "No such file")),
        ("rupture", "", ("path = path.csv", "delta_n,delta_t1,delta_t2")),
        ("rupture", "delta_n,delta_t1,delta_t2\n", ("path = path.csv", "at least one row")),
        ("rupture", "delta_n,delta_t1\n0,0\n", ("path = path.csv", "delta_n,delta_t1,delta_t2")),
        (
            "friction",
            "delta_n,delta_t1,delta_t2\n0,zero,0\n",
            ("path = path.csv", "delta_t1", "numbers"),
        ),
        (
            "friction",
            "delta_n,delta_t1,delta_t2\n0,0\n",
            ("path = path.csv", "delta_t2", "numbers"),
        ),
        (
            "friction",
            "delta_n,delta_t1,delta_t2\n0,0,inf\n",
            ("path = path.csv", "delta_t2", "finite"),
        ),
        (
            "friction",
            "delta_n,delta_t1,delta_t2,p\n0,0,0,nan\n",
            ("path = path.csv", "column p", "finite"),
        ),
    ],
)
def test_a_bad_path_file_is_refused(refused, tmp_path, law, text, parts):
    if text is not None:
        (tmp_path / "path.csv").write_text(text)
    assert not missing(parts, refused("law", law, "--path", "path.csv"))


@pytest.mark.parametrize(
    "option, parts",
    [
        ("--out=no/answer.csv", ("out = ", "existing folder")),
        ("--set=alpha=3", ("alpha = 3", "<= 2")),
    ],
)
def test_a_bad_option_of_a_law_is_refused(refused, tmp_path, option, parts):
    (tmp_path / "path.csv").write_text(GOOD)
    assert not missing(parts, refused("law", "rupture", "--path", "path.csv", option))


def test_a_level_that_is_not_a_number_is_refused(tmp_path):
    """In a process of its own, as Gmsh's parser prints an error."""
    done = subprocess.run(
        [sys.executable, "-m", "damjoint", *RUN, "--levels", "3,nan"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stdout == "" and len(done.stderr.splitlines()) == 1 and "nan" in done.stderr


@pytest.mark.parametrize(
    "words, parts",
    [
        (("--sample", "5", "mu=ksone(1000000)"), ("ksone is none",)),
        (("--sample", "5", "mu=normal(1e308,1e308)"), ("mu=normal(1e308,1e308)",)),
        (("--vary", "mu=1e308"), ("mu = 1e308", "<= 1e+06")),
        (("--vary", "mu=0.5", "--tie", "adhesion=1if 1else 2"), ("--tie adhesion=1if 1else 2",)),
        (("--vary", "mu=0.5", "--tie", "adhesion=1+\n2"), (r"--tie adhesion=1+\n2",)),
    ],
)
def test_a_bad_sweep_is_refused_in_one_line(refused, recwarn, words, parts):
    """And without a warning."""
    assert not missing(parts, refused("sweep", "c", *words)) and not recwarn.list


@pytest.mark.parametrize("law, name", [("rupture", "sigma_max"), ("bond", "adhesion")])
def test_a_strength_whose_square_overflows_is_refused(refused, law, name):
    refused(*RUN, "--set", f"{name}=1e308", "--set", f"law={law}")


def test_escape_sequences_do_not_reach_the_terminal(command, tmp_path):
    for text in ('title = "a \x1b[31m";', "bad \x1b[31m = 3;", 'title = "a \x9b31m";'):
        (tmp_path / "my.case").write_text(text, encoding="utf-8")
        code, _, err = command("run", "my.case")
        assert code == 2 and err[:-1].isprintable() and "line 1" in err


@pytest.mark.parametrize("name", ["...case", "..case", "my\x1b[31m.case", "a" * 230 + ".case"])
def test_a_case_file_name_that_is_no_folder_name_is_refused(command, tmp_path, name):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / name).write_text("default_n_joint = 8;")
    code, _, err = command("run", f"in/{name}")
    assert code == 2 and err[:-1].isprintable() and "must be called" in err
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_a_bad_case_has_no_effect_on_the_next_one(tmp_path):
    (tmp_path / "bad.case").write_text(
        "default_nu = unheard_of; default_E = 1e9;\ntimes() = {1};\n"
    )
    script = """
from damjoint import InputError
from damjoint.input.resolve import load
try:
    load("bad.case")
except InputError:
    print(load("a")["E"])
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout.split() == ["3000000000000.0"], done.stderr


@pytest.mark.parametrize("setting", ["h_dam=1e-5", "h_found=1e-5", "n_joint=100000"])
def test_a_mesh_that_exceeds_the_memory_is_refused_before_meshing(command, setting):
    code, _, err = command("run", "dam", "--set", setting, "--no-fields", "--no-picture")
    assert code == 1 and "need about" in err and len(err.splitlines()) == 1


def test_values_whose_system_is_singular_are_reported(command):
    words = "--set", "dam_height=1e-12", "--set", "h_found=4", "--levels", "0"
    code, out, err = command("run", "a", *words)
    assert (code, out) == (1, "") and len(err.splitlines()) == 1 and "eliminated" in err


@pytest.mark.parametrize(
    "setting, limit",
    [
        *((f"{name}=1e21", "1e+20") for name in ("E", "E_dam", "E_found")),
        *((f"{name}=1e6", "100000") for name in ("rho_dam", "rho_found", "rho_water")),
        *((f"{name}=-1e11", "1e+10") for name in ("force_x", "force_y")),
        ("temperature_dam=1e5", "10000"),
        ("joint_head_offset=1e8", "1e+07"),
        ("g=1e7", "1e+06"),
        ("ice_force=1e30", "1e+10"),
    ],
)
def test_a_value_beyond_any_material_or_load_is_refused(refused, setting, limit):
    """With it rounding would decide whether there is an equilibrium."""
    err = refused("run", "dam", "--set", setting)
    name = setting.partition("=")[0].replace("E", "E_dam").replace("E_dam_", "E_")
    assert f"{name} = " in err and f"between -{limit} and {limit} " in err


@pytest.mark.parametrize(
    "words, message",
    [
        ("law=friction K_N=1e5", "K_N = 100000: must be >= 2.354e+06 Pa/m (rho_dam g / 0.01: the"),
        ("law=friction K_T=1e4", "K_T = 10000: must be >= 9.81e+05 Pa/m (rho_water g / 0.01: the"),
        ("law=rupture pena_contact=1e-30", "pena_contact = 1e-30: must be >= 2.354e-05 (rho_dam g"),
        (
            "law=rupture pena_contact=1e20",
            "pena_contact = 1e+20: must be <= 1.471e+06 (2e+08 E_dam",
        ),
        ("K_T=1e20", "K_T = 1e+20: must be <= 1.471e+17 Pa/m (2e+08 E_dam / L: beyond it"),
        ("K_N=1e20 E_found=2e9", "K_N = 1e+20: must be <= 1.176e+16 Pa/m (2e+08 E_found / L"),
        ("law=friction E=1e20 K_N=1e8", "K_N = 1e+08: must be >= 8.824e+10 Pa/m (3e-12 E_dam n_jo"),
        ("E=1e7", "E_dam = 1e+07: must be >= 1.059e+07 Pa (rho_dam g H / 0.1: a small strain"),
        ("E_found=1e7", "E_found = 1e+07: must be >= 1.059e+07 Pa (rho_dam g H / 0.1: a small"),
        (
            "lift_heights=20 law=friction K_T=1e10,1e4",
            "lift 20 m: K_T = 10000: must be >= 9.81e+05",
        ),
    ],
)
def test_a_stiffness_that_makes_the_system_rounding_is_refused(refused, words, message):
    """Before, no equilibrium was found, as if the dam failed."""
    settings = [word for setting in words.split() for word in ("--set", setting)]
    assert message in refused("run", "dam", *settings)


@pytest.mark.parametrize(
    "settings",
    [
        {"law": "friction", "K_N": 2.4e6, "K_T": 1e6},
        {"law": "friction", "K_N": 1.4e17, "K_T": 1.4e17},
        {"law": "friction", "E": 1e20, "K_N": 4e9, "K_T": 4e9},
        {"law": "friction", "E": 1.1e7},
        {"law": "rupture", "pena_contact": 2.4e-5},
        {"law": "rupture", "pena_contact": 1e6},
    ],
)
def test_at_the_limits_of_the_stiffnesses_a_dam_stands(settings):
    """By a joint that only slides and opens the dam stands whatever its stiffness: the limit level
    of friction is that of statics.
    """
    assert dj.run(dj.case("dam", n_joint=20, **settings)).verdict == "stands"


@pytest.mark.heavy
@pytest.mark.parametrize("modulus", [2e7, 1e20])
def test_within_the_range_of_moduli_a_dam_stands(modulus):
    """Also with a rigid body, as of a published foundation."""
    for name in ("E", "E_dam", "E_found"):
        case = dj.case("dam", levels=[20], n_joint=10, h_dam=12, h_found=12, **{name: modulus})
        assert dj.run(case).verdict == "stands"


@pytest.mark.parametrize(
    "words, message",
    [
        ("lift_heights=1e-9", "lift_heights = 1e-09: each must be at least 4.5e-05 m (1e-06 of"),
        ("lift_heights=1e-9,20", "lift_heights = 1e-09,20: each must be at least 4.5e-05 m"),
        ("lift_heights=20,20.00000001", "must increase from above the first joint"),
        ("lift_heights=44.99999999", "and below the crest"),
        ("downstream_face=20", "downstream_face = 20: must be pairs x,y"),
        ("downstream_face=20,x", "downstream_face = 20,x: must be a list of x,y of each corner"),
        ("downstream_face=20,30,10,30", "heights of its corners must increase from above the base"),
        ("downstream_face=20,-1", "increase from above the base's toe (0 m) to below the crest"),
        ("downstream_face=20,44.99999999", "to below the crest (45 m), each by 4.5e-05 m"),
        ("downstream_face=-1,30", "must lie downstream of the upstream face, at x > 0 m at a"),
        ("joint_height=1e-9", "joint_height = 1e-09: must be >= 4.5e-05 m"),
        ("joint_height=44.99999999", "joint_height = 44.99999999: must be at least 4.5e-05 m"),
        ("neck_height=1e-9", "neck_height = 1e-09: must be >= 4.5e-05 m"),
        ("neck_height=44.99999999", "neck_height = 44.99999999: must be at least 4.5e-05 m"),
        ("dam_crest=1e-9", "dam_crest = 1e-09: must be >= 4.5e-05 m"),
        ("found_side=1e-9", "found_side = 1e-09: must be >= 4.5e-05 m"),
        ("found_depth=1e-9", "found_depth = 1e-09: must be >= 4.5e-05 m"),
        ("dam_base=1e-9", "dam_base = 1e-09: must be >= 4.5e-05 m"),
    ],
)
def test_lengths_that_no_mesh_can_have_are_refused_before_meshing(refused, words, message):
    """Not in the mesh generator's words."""
    assert message in refused("run", "dam", "--set", words)


@pytest.mark.parametrize(
    "case, words, message",
    [
        ("dam", "neck_height=5 downstream_face=20,30", "neck_height = 5: must be 0 with downst"),
        ("stepped", "downstream_face=20,30", "downstream_face: must not be set for a geometry of"),
        ("dam", "mesh_pattern=regular downstream_face=20,30", "mesh_pattern = regular: must be"),
        (
            "dam",
            "batter=9 batter_height=20 downstream_face=8.9,18,9.05,30",
            "at x > 9 m at a height of 20 m",
        ),
        (
            "dam",
            "downstream_face=20,-1,10,30 joint_slope=-2",
            "corner at (20, -1) must be above the line of the joint from (0, 0) to (34, -1.18731)",
        ),
        (
            "dam",
            "joint_height=20 joint_slope=-5 downstream_face=30,19.5,5,19.53",
            "its corner at (5, 19.53) must be above the line of the joint from (0, 20) to",
        ),
    ],
)
def test_a_downstream_face_that_no_section_can_have(refused, case, words, message):
    settings = (word for setting in words.split() for word in ("--set", setting))
    assert message in refused("run", case, *settings)


@pytest.mark.parametrize("setting", ["lift_heights=1e-4", "joint_height=1e-4", "dam_crest=1e-4"])
def test_lengths_above_the_least_one_have_a_mesh(setting):
    name, _, value = setting.partition("=")
    case = dj.case("dam", levels=[20], n_joint=10, h_dam=12, h_found=12, **{name: value})
    assert dj.run(case).verdict == "stands"


def test_the_message_names_the_argument(command):
    """Too many steps or rows, a parameter set twice, an empty path (the current folder)."""
    for words, message in (
        (("run", "a", "--out", ""), "out = '': must be a path"),
        (("run", "a", "--steps", "99999999999"), "steps = 99999999999"),
        (("sweep", "a", "--vary", "mu=0:1:1e-12"), "at most"),
        (("sweep", "a", "--vary", "mu=0.5", "--vary", "mu=0.6"), "--vary mu"),
        (("sweep", "a", "--vary", "mu=0.5", "--set", "mu=0.6"), "--vary mu"),
    ):
        code, _, err = command(*words)
        assert code == 2 and message in err and len(err.splitlines()) == 1


@pytest.mark.parametrize("words", [("stress", 1), ("bench", "--short")])
def test_a_command_whose_tools_are_not_installed_is_one_line(command, tmp_path, monkeypatch, words):
    for name in ("damjoint_tools", "damjoint_tools.stress", "damjoint_tools.bench_page"):
        monkeypatch.setitem(sys.modules, name, None)  # makes the import fail
    code, out, err = command(*words)
    assert (code, out) == (1, "") and "damjoint_tools is not installed" in err
    assert len(err.splitlines()) == 1 and not list(tmp_path.iterdir())
