"""Case files are data: their statements; nothing in them is executed."""

import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import gmsh
import pytest
from damjoint import InputError
from damjoint.input import casefile, parameters
from damjoint.input.case_names import CASES
from damjoint.input.parameters import settings
from damjoint.input.resolve import load, varied
from damjoint.post import validation

#: Gmsh, as installed with its Python module: a script, for this Python.
GMSH = sys.executable, str(Path(sysconfig.get_path("scripts"), "gmsh"))

#: Cases that add to the block of a joint of an included case, which Gmsh takes for a second one.
ADDED = {path.stem for path in CASES.glob("ssnp143?*.case")} - {"ssnp143c"}


@pytest.mark.parametrize(
    "path",
    [path for path in sorted(CASES.rglob("*.case")) if path.stem not in ADDED],
    ids=lambda path: path.stem,
)
def test_damjoint_and_gmsh_read_a_case_alike(path):
    """The cases can be opened in Gmsh and GetDP."""
    ours = casefile.read(path)
    parameters.start_gmsh()
    gmsh.open(str(path))  # which forgets the structs of an earlier file, as in the window
    names = gmsh.parser.getNames()
    numbers = {n: gmsh.parser.getNumber(n).tolist() for n in names}
    texts = {n: list(gmsh.parser.getString(n)) for n in names if not numbers[n]}
    expected = {f"default_{n}": [v] for n, v in ours.defaults.items() if isinstance(v, float)}
    expected |= ours.lists
    assert {n: v for n, v in numbers.items() if v} == expected
    expected = {f"default_{n}": [v] for n, v in ours.defaults.items() if isinstance(v, str)}
    for name in {"geometry", "hydrograph"} & texts.keys():  # damjoint: relative to the case file
        texts[name] = [str(path.parent / texts[name][0])]
    assert texts == expected | {n: [v] for n, v in ours.texts.items()}


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["lifts", "monoliths", "valley_blocks", "ssnp143", "ssnp143c"])
def test_gmsh_and_getdp_read_the_block_of_a_joint(tmp_path, name):
    """Struct Joint::NAME [ ... ] is a part of the language of both."""
    blocks = casefile.read(CASES / f"{name}.case").blocks
    values = {f"Joint::{key}.{n}": v for key, own in blocks.items() for n, v in own.items()}
    printed = [
        f'Printf(StrCat("{name} = ", {name}));'
        if isinstance(value, str)
        else f'Printf("{name} = %.17g", {name});'
        for name, value in values.items()
    ]
    text = "\n".join([f'Include "{CASES / name}.case";', *printed]) + "\n"
    for file, words in (("all.geo", (*GMSH, "-parse_and_exit")), ("all.pro", ("getdp",))):
        write(tmp_path, text, file)
        done = subprocess.run([*words, file], cwd=tmp_path, capture_output=True, text=True)
        read = dict(
            line.split(" = ") for line in done.stdout.splitlines() if line.count(" = ") == 1
        )
        assert values and {n: read.get(n) for n in values} == {
            n: v if isinstance(v, str) else f"{v:.17g}" for n, v in values.items()
        }, done.stdout + done.stderr


LIFTS = 'lift_heights() = {12.5, 25};\nStruct Joint::lift_25_m [ law "friction", mu 0.5 + 0.2 ];\n'


def test_a_block_sets_the_values_of_one_joint(tmp_path):
    """Whatever the order of the blocks; all other values are those of all joints."""
    text = "default_mu = 0.9;\nStruct Joint::lift_12_5_m [ sigma_max 0.1*MPa ];\n" + LIFTS
    case = load(str(write(tmp_path, text)))
    assert case.joint_names == ("base", "lift 12.5 m", "lift 25 m")
    assert [joint["mu"] for joint in case.joints] == [0.9, 0.9, 0.7]
    assert [joint["law"] for joint in case.joints] == ["bond", "bond", "friction"]
    assert [joint["sigma_max"] for joint in case.joints] == [2e5, 1e5, 2e5]
    assert {"mu", "law", "sigma_max"} <= case.given.keys()
    for mu in ((0.5, 0.6, 0.8), 0.6):  # of the command line
        values = [joint["mu"] for joint in load(str(tmp_path / "mine.case"), {"mu": mu}).joints]
        assert values == (list(mu) if isinstance(mu, tuple) else [mu] * 3)


def test_a_case_adds_to_the_blocks_of_an_included_one(tmp_path):
    """By the value; a default for all joints replaces included ones; no lifts, no blocks."""
    write(tmp_path, LIFTS + "Struct Joint::base [ mu 0.9 ];", "common.case")

    def values(text, name):
        case = load(str(write(tmp_path, 'Include "common.case";' + text)))
        return [joint[name] for joint in case.joints]

    more = "Struct Joint::lift_25_m [ adhesion 0 ];"
    assert values(more, "mu") == pytest.approx([0.9, 0.8, 0.7])
    assert values(more, "adhesion") == [2e5, 2e5, 0]
    assert values("default_mu = 0.6;", "mu") == [0.6] * 3
    assert values("lift_heights() = {};", "mu") == [0.9]
    assert [j["mu"] for j in load(str(tmp_path / "common.case"), {"lift_heights": ()}).joints] == [
        0.9
    ]


def test_an_included_block_adds_what_is_not_set(tmp_path):
    """With (Append), as in Gmsh and GetDP, which have no other second block of a joint."""
    write(tmp_path, LIFTS.replace("25_m [", "25_m (Append) [ adhesion 0,"), "common.case")
    text = 'Struct Joint::lift_25_m [ mu 0.6 ]; Include "common.case";'
    joint = load(str(write(tmp_path, text))).joints[2]
    assert [joint[name] for name in ("mu", "adhesion", "law")] == [0.6, 0, "friction"]


def test_a_joint_that_is_moved_keeps_its_block(tmp_path):
    """By --set lift_heights or joint_height, of the same number of joints."""
    path = str(write(tmp_path, LIFTS + "Struct Joint::base [ mu 0.9 ];"))
    moved = load(path, {"lift_heights": (13.0, 20.0), "joint_height": 2.0})
    assert moved.joint_names == ("lift 2 m", "lift 13 m", "lift 20 m")
    assert [joint["mu"] for joint in moved.joints] == [0.9, 0.8, 0.7]
    with pytest.raises(InputError, match="Struct Joint::lift_25_m: there is no such joint"):
        load(path, {"lift_heights": (13.0,)})


def test_a_list_of_joints_is_read_with_the_blocks_that_replace_it(command, tmp_path):
    lists = 'lift_heights() = {20}; law() = {"bond", "friction"}; mu() = {0.9, 1}; levels() = {9};'
    path = write(tmp_path, lists)
    small = "--set", "n_joint=8", "--set", "order=1", "--no-fields", "--no-picture"
    code, _, err = command("run", "mine.case", *small)
    head, _, blocks = err.partition("; write instead: ")
    assert (code, err.count("\n")) == (0, 1)
    assert head == "damjoint: mine: law(), mu(): the next version does not read lists of joints"
    other = load(
        str(write(tmp_path, "lift_heights() = {20}; levels() = {9};" + blocks, "new.case"))
    )
    assert other.of_joints == load(str(path)).of_joints and other.values == load(str(path)).values


def write(tmp_path, text, name="mine.case"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_arithmetic_comments_and_earlier_defaults_are_read(tmp_path):
    path = write(
        tmp_path,
        "/* two\nlines */ default_K_N = 2 * 1e11; // half of it\ndefault_K_T = default_K_N / 2 ^ 2;"
        "\nlevels() = {1, (2 + 3) * -1 + 10.5, 1.e1};\n",
    )
    found = casefile.read(path)
    assert found.defaults == {"K_N": 2e11, "K_T": 5e10}
    assert found.lists == {"levels": [1, 5.5, 10]}


def test_values_of_included_files_can_be_changed(tmp_path):
    write(tmp_path, "default_mu = 0.5; default_E = 1e9;", "common.case")
    found = casefile.read(write(tmp_path, 'Include "common.case"; default_mu = 0.7;'))
    assert found.defaults == {"mu": 0.7, "E": 1e9}


def test_presets_are_included_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = 'Include "presets/usbr_uplift.case"; Include "presets/usace_unusual.case";'
    found = casefile.read(write(tmp_path, text + " default_mu = 0.7;"))
    uplift = {"uplift": "drained", "drain_reference": "reservoir", "drain_effectiveness": 2 / 3}
    uplift |= {"quake_uplift": "zero"}
    required = {"required_SSF": 1.7, "required_position": "middle half"}
    assert found.defaults == {**uplift, **required, "mu": 0.7}
    (tmp_path / "presets").mkdir()
    write(tmp_path, "default_required_SSF = 1.4;", "presets/usace_unusual.case")
    found = casefile.read(write(tmp_path, text))  # the file beside the case is preferred
    assert found.defaults == {**uplift, "required_SSF": 1.4}


@pytest.mark.parametrize("path", sorted((CASES / "presets").glob("*.case")), ids=lambda p: p.stem)
def test_every_preset_fits_a_dam(tmp_path, path):
    case = load(str(write(tmp_path, f'Include "presets/{path.name}";')))
    assert case["uplift"] != "imposed" if "uplift" in path.stem else case["required_SSF"] >= 1


@pytest.mark.parametrize(
    "text, message",
    [
        ('SystemCall "touch x";', "SystemCall"),
        ('title = "t"; SystemCall "touch x";', "line 1"),
        ('\n\nPrint("x");', "line 3"),
        ('Printf("hello") > "x";', "not part of a case"),
        ('Include "../pro/parameters.pro";', "must be a .case file"),
        ('Include "/etc/passwd";', "must be a .case file"),
        ("If(1) default_E = 1e9; EndIf", "If"),
        ('default_law = Str["friction"];', "quotes, one of rupture, friction"),
        (LIFTS + "Struct Joint::lift_26_m [ mu 1 ];", "there is no such joint; must be one of J"),
        (LIFTS + "Struct Joint::lift_25_m [ mu 1 ];", "line 3: Struct Joint :: lift_25_m [ mu 1 ]"),
        (LIFTS + "default_mu = 1;", "must stand before the blocks of joints that set mu"),
        ("Struct Joint::base [ mu 1, mu 2 ];", "mu is set twice"),
        ("Struct Joint::base [ muh 1 ];", "muh: unknown parameter; did you mean mu?"),
        ("default_drain_eff = 1;", "did you mean drain_effectiveness or "),
        ("Struct Joint::base [ E 1e10 ];", "E: is of the whole dam: must be set by default_E"),
        ("Struct Joint::base [ mu ];", "must be a number"),
        ("Struct Joint::base [ mu -1 ];", "mu = -1: must be a number > 0"),
        ("Struct Joint::base { mu 1 };", "must be Struct Joint::NAME [ parameter value, ... ]"),
        ("Struct Base [ mu 1 ];", "Struct Joint::<joint> [ <parameter> value, ... ]"),
        ("mu() = {1}; Struct Joint::base [ mu 1 ];", "mu() is a list: must be in blocks for all"),
        ("default_E = GetEnv(1);", "must be a number"),
        ("default_E = __import__;", "must be a number"),
        ("default_E = E;", "must be a number"),
        ("default_E = 9^9^9^9;", "must be a number"),
        ("default_E = (-8)^0.5;", "must be a number"),
        ("default_E = 1/0;", "must be a number"),
        ("default_E = ;", "must be a number"),
        ("default_E = 1e9", "semicolon"),
        ("default_dam_hieght = 12;", "dam_height"),
        ("default_E = 1e9; default_dam_hieght = 12;", "dam_height"),
        ("level() = {3};", "levels()"),
        ("default_E = 1e9; level() = {3};", "levels()"),
        ("titel = 3;", "title"),
        ("levels() = 3;", "braces"),
        ("levels() = {3, };", "must be a number"),
        ("levels() = {3, 6}; times() = {1, 3};", "times = 1,3"),
        ("levels() = {3, 6}; times() = {2, 1};", "times = 2,1"),
        ("levels() = {3, 6}; times() = {1, 1};", "times = 1,1"),
        ("levels() = {3, 6}; times() = {0, 1};", "times = 0,1"),
        ("levels() = {20, 40}; times() = {0.5, 1};", "must end after 1"),
        ("levels() = {};", "at least one number"),
        ("default_mu = True;", "must be a number"),
        ('also_uplift = "none none";', "each once"),
        ('also_uplift = "imposed";', "other modes than uplift"),
        ('also_uplift = "some";', "none, imposed, drained, cracked, flow"),
        ("levels() = {1, 2, 3}; tail_levels() = {1, 2};", "tail_levels = 1,2"),
        ("mu = 0.7;", "default_mu"),
        ("default_law = bond;", "quotes, one of rupture, friction"),
        ('lift_heights() = {9}; law() = {"bond", friction};', "quotes, one of rupture, friction"),
        ('default_law = "glue";', "line 1"),
        ("default_mu = 0,8;", "not a comma"),
        ("levels() = {3, 6} default_mu = 1;", "semicolon between"),
        ('Include "none.case";', 'line 1: Include "none.case": there is no such file'),
    ],
)
def test_other_statements_are_refused_before_gmsh_reads_them(command, tmp_path, text, message):
    write(tmp_path, text)
    before = sorted(tmp_path.rglob("*"))
    code, out, err = command("run", "mine.case", "--no-fields", "--no-picture")
    assert (code, out) == (2, "") and len(err.splitlines()) == 1
    assert message in err and sorted(tmp_path.rglob("*")) == before


def test_parameters_without_effect_are_named(command, tmp_path):
    """Those that the case or the command sets to another value than the default, in the run."""
    write(
        tmp_path,
        'default_law = "friction"; default_G_t = 500; default_sigma_max = 0.2*MPa; levels() = {9};',
    )
    small = "--set", "n_joint=8", "--set", "order=1", "--no-fields", "--no-picture"
    code, _, err = command("run", "mine.case", *small, "--set", "visc=2e-3")
    notes = [f"damjoint: mine: {n} has no effect; it needs " for n in ("G_t", "visc")]
    assert (code, err) == (0, f"{notes[0]}law = bond\n{notes[1]}uplift = flow\n")
    lifts = {"lift_heights": (15.0,), "law": ("bond", "friction"), "G_t": 500.0, "alpha": 0.5}
    assert load("dam", lifts).ineffective == ("alpha",)
    assert load("a").ineffective == ()


def test_values_that_may_be_in_another_unit_are_named(command, tmp_path):
    """Not those of the package's cases, nor zero."""
    write(tmp_path, "default_rho_dam = 24e3; default_mu = 38; default_adhesion = 0;")
    small = "--set", "n_joint=8", "--set", "order=1", "--no-fields", "--no-picture"
    words = *small, "--set", "law=friction", "--set", "mu=0.7", "--levels", "9"
    code, _, err = command("run", "mine.case", *words)
    note = "rho_dam = 24000 kg per m3 is unusual (1500 to 4000); is it in another unit?"
    assert (code, err) == (0, f"damjoint: mine: {note}\n")
    assert load("dam", {"lift_heights": (15.0,), "sigma_max": (2e5, 0.2)}).unusual == {
        "sigma_max": 0.2
    }
    assert load("dam", {"dam_height": 45e3, "dam_base": 34.0}).unusual == {"dam_height": 45e3}


def test_files_that_are_no_cases_are_refused(command, tmp_path):
    (tmp_path / "binary.case").write_bytes(bytes(range(256)))
    write(tmp_path, 'Include "itself.case";', "itself.case")
    write(tmp_path, "// nothing\n" * 200_000, "enormous.case")
    for name, message in (
        ("binary", "decode"),
        ("itself", "includes itself"),
        ("enormous", "bytes"),
    ):
        code, _, err = command("run", f"{name}.case")
        assert code == 2 and message in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('Include "other.case";' * 51, "more than 50 files"),
        ('Include "pipe.case";', "must be a regular file"),
    ],
)
def test_endless_inclusion_is_refused(command, tmp_path, text, message):
    """Of many files in few lines; of a pipe."""
    write(tmp_path, "", "other.case")
    os.mkfifo(tmp_path / "pipe.case")
    code, _, err = command("run", write(tmp_path, text))
    assert code == 2 and len(err.splitlines()) == 1 and message in err


def test_without_times_each_level_is_a_step(tmp_path):
    case = load(str(write(tmp_path, "default_dam_height = 12; levels() = {6, 9, 11, 11.5, 12};")))
    assert case.times == (1, 2, 3, 4, 5)
    assert [case.level_at(t) for t in case.times] == [6, 9, 11, 11.5, 12]


def test_other_levels_have_the_tailwater_of_the_case(tmp_path):
    """One value, or one per level if there are as many levels; otherwise it must be given."""
    text = "default_dam_height = 12; levels() = {6, 9, 11}; tail_levels() = {%s};"
    constant = str(write(tmp_path, text % "2", "constant.case"))
    rising = str(write(tmp_path, text % "1, 2, 3", "rising.case"))
    assert load(constant, levels="5,10").tail_levels == (2, 2)
    assert load(rising, levels="5,8,10").tail_levels == (1, 2, 3)
    with pytest.raises(InputError, match="the case's own; set --tail-levels"):
        load(rising, levels="5,10")
    assert load(rising, levels="5,10", tail_levels="0").tail_levels == (0, 0)


def test_defaults_are_a_realistic_dam():
    """Concrete on rock; dependent defaults follow the geometry."""
    case = load("dam")
    assert 1e10 <= case["E"] <= 5e10 and case["dam_height"] == 45
    assert case["law"] == "bond" and 50 <= case["G_f"] <= 200 <= case["G_t"]  # N/m
    brittle = load("dam", {"law": "rupture"})
    energy = case["sigma_max"] ** 2 * (1 + brittle["pena_rupture"]) / (2 * case["K_N"])
    assert energy == pytest.approx(case["G_f"])
    assert (case["found_side"], case["found_depth"]) == (90, 90)
    assert case.levels[-1] == 45
    taller = load("dam", {"dam_height": 60.0, "E": 3e10})
    assert taller["found_depth"] == 120 and taller["E_found"] == 3e10 and taller.levels[-1] == 60


def test_a_written_case_is_read_again(tmp_path):
    case = casefile.read(CASES / "k.case")
    case.defaults |= {"law": "friction", "drive_by": 1 / 3}
    (tmp_path / "again.case").write_text(casefile.written(case))
    assert casefile.read(tmp_path / "again.case") == case


def mu_of(*words):
    return [joint["mu"] for joint in load("lifts", settings(words)).joints]


@pytest.mark.heavy
def test_a_value_of_one_joint_is_set_by_its_name():
    """As messages print it or as in a case file; beside a value for all it is the one of its joint,
    in either order; a list that comes later, as of `critical --of strength`, replaces it.
    """
    assert mu_of("lift 25 m.mu=0.5") == mu_of("lift_25_m.mu=0.5") == [0.9, 1.0, 0.5, 1.0]
    assert mu_of("base.mu=0.5", "lift 38 m.mu=2") == [0.5, 1.0, 0.7, 2.0]
    assert mu_of("mu=0.8", "lift 25 m.mu=0.5") == [0.8, 0.8, 0.5, 0.8]
    assert mu_of("lift 25 m.mu=0.5", "mu=0.8") == [0.8, 0.8, 0.5, 0.8]
    assert mu_of("lift_heights=12,30,38", "lift 30 m.adhesion=0") == [0.9, 1.0, 0.7, 1.0]
    case = load("lifts", {"lift 25 m.mu": 0.5})
    for further, expected in (
        ({"mu": (1.0, 2.0, 3.0, 4.0)}, [1.0, 2.0, 3.0, 4.0]),
        ({"base.mu": 0.6}, [0.6, 1.0, 0.5, 1.0]),
    ):
        assert [joint["mu"] for joint in varied(case, further).joints] == expected
    moved = load("lifts", settings(["lift_heights=12,30,38", "lift 30 m.adhesion=0"]))
    assert [joint["adhesion"] for joint in moved.joints] == [2e5, 1e6, 0, 1e6]
    assert load("lifts").joints[2]["mu"] == 0.7


def test_a_published_case_with_a_value_of_one_joint_is_another_case():
    assert load("a").published and not load("a", {"base.mu": 0.5}).published


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["lift 26 m.mu=1"], "lift_26_m: there is no such joint; must be one of Joint::base"),
        (["base.E_dam=1e10"], "base.E_dam: E_dam is of the whole dam"),
        (["base.mus=1"], "mus: unknown parameter"),
        (["base.mu=1,2"], "base.mu = 1,2: must be a single value"),
        (["base.mu=-1"], "mu = -1"),
        (["base.mu=1", "mu=1,2,3,4"], "base.mu = 1.0: mu is a list for all joints"),
    ],
)
def test_bad_values_of_one_joint(words, message):
    with pytest.raises(InputError, match=re.escape(message)):
        load("lifts", settings(words))


def test_a_case_file_from_windows_is_read(tmp_path):
    """Byte order mark and CRLF line ends."""
    (tmp_path / "mine.case").write_bytes(b"\xef\xbb\xbfdefault_mu = 0.7;\r\n// words\r\n")
    assert casefile.read(tmp_path / "mine.case").defaults == {"mu": 0.7}


def test_only_published_cases_have_references(tmp_path):
    """Not a case with another loading, another parameter, or another file of that name."""
    copy = tmp_path / "a.case"
    copy.write_text("levels() = {45};")
    assert load("a").published and load("a", {"n_joint": 20.0, "order": 2.0}).published
    others = load("a", levels="6"), load("a", {"sigma_max": 5e4}), load(str(copy))
    assert not any(case.published for case in others)
    assert [validation.references(case) for case in others] == [[]] * len(others)
