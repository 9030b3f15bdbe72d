"""The interface for Python: import damjoint as dj."""

import ast
import copy
import csv
import doctest
import pickle
import re
import subprocess
import sys
from pathlib import Path

import damjoint as dj
import matplotlib
import numpy as np
import pytest
from damjoint import library
from damjoint.post import stored
from damjoint.python_words import in_python
from damjoint.solver.load_stepper import LoadStepper
from damjoint.threads import limited_threads
from matplotlib.text import Text
from threadpoolctl import threadpool_info
from variants import as_heavy

PAGE = Path(__file__).parents[2] / "reference" / "python.md"
CASE = {"levels": [30, 40], "n_joint": 20}


@pytest.fixture(scope="module")
def run():
    return dj.run(dj.case("dam", **CASE))


@pytest.mark.heavy
def test_the_code_of_the_page_runs(tmp_path, monkeypatch):
    """One block after the other; nothing is written."""
    monkeypatch.chdir(tmp_path)
    names = {}
    try:
        for block in re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.S | re.M):
            exec(block, names)
    finally:
        dj.LAWS.pop("contact", None)
    assert names["limit"].mode == "sliding" and names["limit"].confirmed
    assert len(names["friction"].rows) == 6 and len(names["random"].rows) == 50
    assert names["pushed"].loading.level > 40 and names["run"].verdict == "stands"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: dj.case(levels=[30, 40], tail_levels=[1, 2, 3]), "tail_levels = 1,2,3: must be"),
        (lambda: dj.critical(dj.case(n_joint=10), of="law"), 'of="law": must be level, strength'),
        (
            lambda: dj.sweep(n_joint=10, mu=[0.5], tie={"mu": "2"}),
            "not by set, vary, sample or tie",
        ),
        (lambda: dj.quake("dam"), 'in the case, or record="FILE.csv"'),
    ],
)
def test_messages_name_arguments_not_options(call, message):
    with pytest.raises(dj.InputError, match=re.escape(message)) as caught:
        call()
    assert "--" not in str(caught.value)


def test_words_of_commands_in_python():
    """Options with a value, with name=value, without any."""
    assert in_python("too coarse: --accuracy 3% chooses the mesh") == (
        'too coarse: accuracy="3%" chooses the mesh'
    )
    assert in_python("--vary mu=1,x: must be numbers") == "mu=1,x: must be numbers"
    assert in_python("the case's own; set --tail-levels") == "the case's own; set tail_levels"
    assert in_python("out of memory; --jobs 1 needs least") == "out of memory; jobs=1 needs least"
    assert 'os.environ["DAMJOINT_RUN_GEO"] = "1"' in in_python("if you trust it, add --run-geo")


def test_hints_and_statements_have_arguments():
    limit = dj.critical(dj.case("dam", f_c=1e5, n_joint=10, levels=[40]))
    assert limit.statement[0].endswith("exceeds f_c = 100 kPa; levels may begin lower")


def test_an_import_loads_nothing_else():
    """Not even numpy or a part of its own: a script that only imports it starts at once."""
    code = "import sys; old = set(sys.modules); import damjoint; print(set(sys.modules) - old)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ast.literal_eval(done.stdout) <= {"damjoint", "__future__"}
    assert set(library.__all__) == set(dj.LIBRARY)
    assert set(dir(dj)) == {*dj.LIBRARY, "InputError", "RunError", "__version__"}
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = dj.nothing


@pytest.mark.heavy
def test_tables_are_those_of_the_command(run, tmp_path):
    """Record arrays with the columns and values of the files that `save` writes."""
    run.save(tmp_path / "out")
    for name, table in (("joint", run.joint), ("history", run.history)):
        path = tmp_path / "out" / f"{name}.csv"
        assert path.read_text().splitlines()[0].split(",") == list(table.dtype.names)
        written = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        columns = np.column_stack([table[n] for n in table.dtype.names])
        np.testing.assert_allclose(written, columns, rtol=1e-11, atol=1e-9)
    assert (tmp_path / "out" / "dam.png").is_file() and (tmp_path / "out" / "fields").is_dir()


def test_rows_of_a_level_or_a_time(run):
    rows = run.joint.at(level=30)
    assert set(rows.level) == {30} and set(rows.time) == {1} and np.all(np.diff(rows.s) >= 0)
    np.testing.assert_array_equal(run.joint.at(time=2).delta_n, run.joint.at(level=40).delta_n)
    with pytest.raises(dj.InputError, match="level = 35: must be one of 30, 40"):
        run.joint.at(level=35)
    with pytest.raises(dj.InputError, match="must have a level or a time"):
        run.joint.at()
    with pytest.raises(dj.InputError, match="not both"):
        run.joint.at(level=40, time=1)


def test_readable_names_are_those_of_columns(run):
    rows = run.joint.at(level=40)
    closed = rows.delta_n < 0
    assert closed.any() and not rows.opening[closed].any()
    np.testing.assert_array_equal(rows.opening[~closed], rows.delta_n[~closed])
    for name, column in (
        ("tangential_jump", "delta_t1"),
        ("normal_stress", "sigma_n_eff"),
        ("shear_stress", "tau_1"),
        ("pressure", "p"),
        ("distance", "s"),
    ):
        np.testing.assert_array_equal(getattr(rows, name), rows[column])


def test_tables_for_pandas_and_xarray(run):
    """The same numbers; units and dimensions in xarray."""
    frame = run.to_pandas("history")
    assert list(frame.columns) == list(run.history.dtype.names)
    np.testing.assert_array_equal(frame["crest_ux"], run.history.crest_ux)
    data = run.to_xarray()
    assert data.sizes == {"time": 2, "node": len(run.joint) // 2} and data.delta_n.units == "m"
    rows = run.joint.at(level=40)
    for name in ("s", "delta_n", "sigma_n_eff"):
        np.testing.assert_array_equal(data.sel(time=2)[name], rows[name])
    history = run.to_xarray("history")
    np.testing.assert_array_equal(history.level, run.history.level)
    assert history.N.attrs["units"] == "N/m"
    with pytest.raises(dj.InputError, match="table = curve: must be one of joint, history"):
        run.to_pandas("curve")


@pytest.mark.heavy
def test_frames_have_the_units_of_their_columns(run, quaked):
    """Of every study; the same as in the tables' documentation."""
    case = dj.case("dam", **CASE, law="friction", adhesion=0.0)
    frames = {
        "joint": run.to_pandas(),
        "history": run.to_pandas("history"),
        "check": dj.check(case).to_pandas(),
        "critical": dj.critical(case).to_pandas(),
        "sweep": dj.sweep(case, mu=[0.8], critical="level", jobs=1).to_pandas(),
        "quake": quaked.to_pandas(),
        "frames": quaked.to_pandas("frames"),
    }
    for name, frame in frames.items():
        texts = {n for n in frame if not np.issubdtype(frame[n].to_numpy().dtype, np.number)}
        unnamed = {"failed", "confirmed"} if name == "sweep" else set()
        assert set(frame) - texts - unnamed <= set(frame.attrs["units"]), name
    units = {name: frame.attrs["units"] for name, frame in frames.items()}
    assert (units["joint"]["delta_n"], units["history"]["N"], units["check"]["f_c"]) == (
        *("m", "N/m"),
        "Pa",
    )
    assert units["critical"]["value"] == units["sweep"]["critical_level"] == "m"
    assert (units["joint"]["time"], units["frames"]["time"]) == ("-", "s")
    with pytest.raises(dj.InputError, match="table = curve: must be one of rows, joint, history"):
        quaked.to_pandas("curve")


@pytest.fixture(scope="module")
def quaked(tmp_path_factory):
    record = tmp_path_factory.mktemp("quake") / "wave.csv"
    rows = [f"{i / 50},{2 * (i % 10 == 0)}" for i in range(20)]
    record.write_text("\n".join(["time,horizontal", *rows]))
    small = {"levels": 30, "n_joint": 10, "record_unit": "m/s2", "record_rest": 0.5}
    return dj.quake(dj.case("dam", **small, record=record, name="shaken"))


@pytest.mark.heavy
def test_each_study_has_its_picture_in_the_style_of_the_commands(run, quaked):
    """Whatever the style of the notebook, which stays as it is."""
    case = dj.case("dam", **CASE, law="friction", adhesion=0.0)
    with matplotlib.rc_context({"axes.grid": True, "font.size": 20.0, "figure.dpi": 70}):
        pictures = {
            "run": run.plot(),
            "check": dj.check([case, dj.case(case, k_h=0.1)]).plot(1),
            "critical": dj.critical(case).plot(),
            "sweep": dj.sweep(case, mu=[0.8, 0.9], jobs=1).plot(),
            "quake": quaked.plot(),
        }
        assert matplotlib.rcParams["font.size"] == 20.0
    for name, figure in pictures.items():
        sizes = [text.get_fontsize() for text in figure.findobj(Text) if text.get_text()]
        assert figure.axes and len(sizes) > 10 and max(sizes) <= 12, name
    sampled = dj.sweep(case, law=["friction", "bond"], mu=[0.8, 0.9], n_joint=[10, 12], jobs=1)
    with pytest.raises(dj.InputError, match="no chart of 3 varied parameters"):
        sampled.plot()


def test_a_case_is_a_mapping_that_prints_what_differs_from_the_defaults():
    case = dj.case("dam", **CASE, mu=0.7, name="weak")
    assert repr(case) == "weak: levels 30, 40 m; n_joint = 20, mu = 0.7"
    assert repr(dj.case("dam")) == "dam: levels 30, 40, 45 m"
    lifts = repr(dj.case("lifts"))
    assert "lift_heights 12, 25, 38 m" in lifts and "lift 25 m: sigma_max = 0, mu = 0.7" in lifts
    assert "mu" in case and "mue" not in case and case.get("mue", 1.0) == 1.0
    assert dict(case)["mu"] == dict(case.items())["mu"] == case.mu == 0.7
    assert list(case.keys()) == list(case) == case._ipython_key_completions_()
    assert len(case) == len(case.values) and {"mu", "sigma_max"} <= set(dir(case))
    assert repr(case.law) == "law bond" and case["law"] == "bond"
    for missing in ("mue", "__array__"):
        with pytest.raises(AttributeError, match=missing):
            getattr(case, missing)
    assert copy.deepcopy(case) == pickle.loads(pickle.dumps(case)) == case


def test_names_of_cases_and_records_stay_in_their_variations(tmp_path):
    """So that the rows of several combinations can be told apart."""
    usual = dj.case("dam", **CASE, name="usual", record=tmp_path / "wave.csv")
    assert dj.case(usual, mu=0.7).name == "usual" and dj.case(usual, mu=0.7).record == usual.record
    checks = dj.check([usual, dj.case(usual, k_h=0.1, name="flood")])
    assert list(dict.fromkeys(checks.rows.case)) == ["usual", "flood"]
    assert repr(checks[1]).startswith("flood, base: check: not checked; equilibrium: yes; finite")
    assert len(checks) == 2 and checks[:1] == [checks[0]]
    with pytest.raises(dj.InputError, match="name = 'a/b': must be a text"):
        dj.case(usual, name="a/b")
    (tmp_path / "wave.csv").write_text("0,0\n0.01,1\n0.02,0\n")
    with pytest.raises(dj.InputError, match="record_unit = unstated"):  # not of the path's type
        dj.sweep("dam", quake=0.05, record=[tmp_path / "wave.csv"], jobs=1)


def test_history_of_several_joints_for_xarray():
    size = {"n_joint": 10, "h_dam": 17, "h_found": 60}
    lifts = dj.run(dj.case("dam", levels=[30.0], lift_heights=[15.0], **size))
    units = {name: column.attrs["units"] for name, column in lifts.to_xarray("history").items()}
    assert units["N"] == units["N_2"] == "N/m" and units["x_resultant_2"] == "m"


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_a_package_that_is_not_installed(run, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=f"{package} is not installed: pip install {package}"):
        getattr(run, f"to_{package}")()


def test_a_notebook_shows_the_table_of_the_levels(run):
    page = run._repr_html_()
    assert "<p>dam: stands, level 40 m</p>" in page and page.count("<tr>") == 3


def test_a_case_is_varied(tmp_path):
    """Parameters that follow others follow again; the file is not read again."""
    path = tmp_path / "my.case"
    path.write_text("default_dam_height = 20; default_mu = 0.5; levels() = {10, 18};")
    first = dj.case(path, n_joint=30)
    path.unlink()
    second = dj.case(first, dam_height=30, levels=[25])
    assert (second["mu"], second["n_joint"], second.levels) == (0.5, 30, (25,))
    assert second["h_found"] > first["h_found"] and first["dam_height"] == 20
    assert dj.case(second) == second and dj.case(first.changed({"mu": 0.7}))["mu"] == 0.7
    with pytest.raises(dj.InputError, match="levels = 70: must be"):
        dj.case(first, levels=70)


def test_a_scene_of_a_published_case_keeps_its_uplift_when_it_is_varied():
    first, second = dj.case("a").scenes()
    assert first["uplift"] != second["uplift"]
    assert dj.case(second, sigma_max=1e5)["uplift"] == second["uplift"]


def test_a_case_of_stored_results_can_not_be_varied(run, tmp_path):
    run.save(tmp_path / "out")
    with pytest.raises(dj.InputError, match="case dam: of stored results"):
        dj.case(stored.read(tmp_path / "out").result.case, mu=0.5)


def test_bad_input_is_one_line():
    for words, message in (
        ({"mu": -1}, "mu = -1: must be"),
        ({"law": "glue"}, "law = glue: must be one of rupture, friction, bond, endo"),
        ({"levels": [-3]}, "levels = -3: must be"),
        ({"colour": 3}, "colour: unknown parameter"),
    ):
        with pytest.raises(dj.InputError, match=message):
            dj.case("dam", **words)


def test_steps_are_the_rows_of_the_history(run):
    steps = list(dj.load_steps(dj.case("dam", **CASE)))
    assert [step.level for step in steps] == list(run.history.level)
    for name in ("N", "T", "M", "crack_length", "crest_ux"):
        rows = [step.row[name] for step in steps]
        assert rows == pytest.approx(list(run.history[name]), rel=1e-12)  # other threads


def test_steps_are_computed_in_one_thread_and_the_loop_over_them_is_not_limited(monkeypatch):
    """Several threads take a hundred times as long beside other processes."""
    steps, during = LoadStepper.steps, set()

    def threads():
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    def watched(stepper):
        for state in steps(stepper):
            during.update(threads())
            yield state

    monkeypatch.setattr(LoadStepper, "steps", watched)
    with limited_threads(2):
        assert all(threads() == {2} for _ in dj.load_steps(dj.case("dam", **CASE)))
    assert during == {1}


def test_a_run_that_stops_is_a_result():
    """Levels beyond what the dam holds: the verdict says so, the steps up to there are rows."""
    case = dj.case("dam", levels=[40, 60], n_joint=20, law="friction", pena_tang=0)
    with pytest.warns(UserWarning, match="the highest level is above the crest, 45 m"):
        stopped = dj.run(case)
    assert stopped.verdict in ("sliding", "overturning") and stopped.statement
    assert stopped.history.level[0] == 40 and stopped.history.level[-1] < 60


def test_a_new_law_needs_its_file_in_getdp(monkeypatch):
    class Springs(dj.Law):
        pass

    monkeypatch.setitem(dj.LAWS, "springs", Springs)
    with pytest.raises(dj.InputError, match=r"law = springs: must have a file pro/law_springs.pro"):
        dj.run(dj.case("dam", **CASE, law="springs"), engine="getdp")


@pytest.mark.heavy
@pytest.mark.usefixtures("no_pictures")
def test_check_and_critical_are_those_of_the_commands(command, tmp_path):
    """The same numbers as check.csv and the same lines as damjoint critical."""
    (found,) = dj.check([dj.case("dam", levels=40, n_joint=20, required_SSF=2)])
    words = "check", "dam", "--levels", "40", "--set", "n_joint=20", "--set", "required_SSF=2"
    command(*words, "--out", "checked")
    lines = (tmp_path / "checked" / "check.csv").read_text().splitlines()
    assert len(lines) == 1 + len(found.rows) and f"{found.rows[0]['SSF']:.9g}" in lines[1]

    words = "critical", "dam", "--levels", "40", "--set", "n_joint=20", "--set", "law=friction"
    _, out, _ = command(*words, "--out", "limit")
    limit = dj.critical("dam", levels=40, n_joint=20, law="friction")
    assert all(line in out for line in limit.statement)
    assert limit.equilibria.level.max() == pytest.approx(limit.value)
    case = dj.case("dam", levels=40, n_joint=20, law="friction")
    dam, _ = limit.plot().axes  # the dam in its last equilibrium, beside the curve
    assert dam.get_title("left").endswith("dashed: undeformed") and dam.get_aspect() == 1
    assert repr(dj.critical(case)) == "\n".join(limit.statement)
    with pytest.raises(dj.InputError, match="needs drains"):
        dj.critical("dam", of="uplift", levels=40, n_joint=20)


@pytest.mark.heavy
@pytest.mark.parametrize("accuracy", [None, "10%"])
@pytest.mark.usefixtures("no_pictures")
def test_a_sweep_is_that_of_the_command(command, tmp_path, monkeypatch, accuracy):
    """The same rows as the file, from the same distribution; with an accuracy on the same mesh."""
    monkeypatch.chdir(tmp_path)
    sample = dj.Sample(2, {"mu": "normal(0.8,0.1)"}, seed=3)
    case = dj.case("dam", **CASE, law="friction", pena_tang=0, accuracy=accuracy)
    swept = dj.sweep(
        case, sample=sample, k_h=[0, 0.5], tie={"adhesion": "1e5*mu"}, critical="level", jobs=1
    )
    assert not list(tmp_path.iterdir())
    words = ["sweep", "dam", "--levels", "30,40", "--set", "n_joint=20", "--vary", "k_h=0,0.5"]
    words += ["--sample", "2", "mu=normal(0.8,0.1)", "--seed", "3", "--tie", "adhesion=1e5*mu"]
    words += ["--set", "law=friction", "--set", "pena_tang=0", "--critical", "level", "--jobs", "1"]
    words += ["--accuracy", accuracy] if accuracy else []
    assert command(*words, "--out", "file.csv")[0] == 0
    with (tmp_path / "file.csv").open() as file:
        written = {(row["k_h"], row["mu"]): row for row in csv.DictReader(file)}
    assert len(written) == len(swept.rows) == 4 and set(swept.rows.failed) == {0, 1}
    for row in swept.texts:
        same = written[row["k_h"], row["mu"]]
        assert set(same) == {"key", *row}
        for name, text in row.items():
            if name not in ("residual", "iterations") and text != same[name]:  # other threads
                assert float(text) == pytest.approx(float(same[name]), rel=1e-6), name
    np.testing.assert_allclose(swept.probability.probability, [0, 1])
    assert list(swept.sensitivity.input) == ["mu", "mu"]
    assert list(swept.to_pandas()["verdict"]) == list(swept.rows.verdict)


@pytest.mark.heavy
def test_a_critical_value_of_a_case_with_an_accuracy():
    """On the mesh of the run, which that accuracy requires."""
    case = dj.case("dam", levels=40, law="friction", adhesion=0, accuracy="3%")
    limit = dj.critical(case)
    assert limit.search.case["n_joint"] == dj.run(case).case["n_joint"] > case["n_joint"]
    assert limit.confirmed and limit.mode == "sliding"


def test_values_of_a_sweep_are_checked():
    case = dj.case("dam", **CASE)
    for words, message in (
        ({}, "sweep: must have values or a sample"),
        ({"vary": {"mu": [0.7, 0.8]}}, "sweep: must have values or a sample, such as mu="),
        ({"mu": [0.8, -1]}, "mu = -1: must be"),
        ({"mu": 0.8, "jobs": 0}, "jobs = 0: must be an integer >= 1"),
        ({"mu": 0.8, "tie": {"mu": "1"}}, "mu: must be given once"),
    ):
        with pytest.raises(dj.InputError, match=message):
            dj.sweep(case, **words)
    with pytest.raises(dj.InputError, match="number = 0: must be an integer from 1 to"):
        dj.Sample(0, {"mu": "normal(1,0.1)"})
    with pytest.raises(dj.InputError, match="design = random: must be one of latin, monte-carlo"):
        dj.Sample(3, {"mu": "normal(1,0.1)"}, design="random")


@pytest.mark.parametrize(
    "words, message",
    [
        ({"distributions": {"nu_rock": "normal(1,0.1)"}}, "nu_rock"),
        ({"distributions": {"mu": "gauss(1,0.1)"}}, "--sample mu=gauss.*; gauss is none"),
        ({"distributions": {"mu": "normal(1"}}, "--sample mu=normal"),
        ({"distributions": {"law": "normal(1,0.1)"}}, "law.*must be of a parameter that is a num"),
        ({"distributions": {}}, "must have a distribution"),
        ({"correlate": "mu,nu_dam=0.5"}, "correlate = mu,nu_dam=0.5: must be a list"),
        ({"correlate": ["mu,rho=0.5"]}, "--correlate mu,rho=0.5: must be A,B=R"),
        ({"seed": -1}, "seed = -1: must be an integer >= 0"),
        ({"seed": 0.5}, "seed = 0.5: must be an integer >= 0"),
    ],
)
def test_a_sample_is_checked_when_it_is_made(words, message):
    with pytest.raises(dj.InputError, match=message):
        dj.Sample(**{"number": 3, "distributions": {"mu": "normal(1,0.1)"}} | words)


def test_a_check_of_a_single_case():
    case = dj.case("dam", **CASE)
    (alone,), (listed,) = dj.check(case), dj.check([case])
    assert alone.rows[0]["SSF"] == listed.rows[0]["SSF"]
    with pytest.raises(dj.InputError, match="case no: unknown"):  # not those of its letters
        dj.check("no")
    with pytest.raises(dj.InputError, match="cases: must be at least one"):
        dj.check([])
    with pytest.raises(
        dj.InputError, match="must be a case, or its name or path; it is of type list"
    ):
        dj.run([case])


@pytest.mark.parametrize(
    "name",
    [
        as_heavy(name) if name in ("Reliability", "reliability", "sweep") else name
        for name in sorted({*library.__all__} - {"Case", "LAWS"})
    ],
)
def test_the_examples_of_the_docstrings(name, tmp_path, monkeypatch):
    """Of all functions and classes; that of Case is in `case`."""
    monkeypatch.chdir(tmp_path)
    example = doctest.DocTestParser().get_doctest(
        getattr(dj, name).__doc__, {**vars(library), "np": np, "Path": Path}, name, None, None
    )
    result = doctest.DocTestRunner().run(example)
    assert result.attempted and not result.failed


def test_numbers_of_numpy_are_numbers():
    """Others are refused as by the command."""
    assert dj.case("dam", n_joint=np.int64(10), mu=np.float32(0.5)).values["mu"] == 0.5
    for settings, words in (({"steps": 2.5}, "steps = 2.5"), ({"mu": None}, "mu = None")):
        with pytest.raises(dj.InputError, match=words):
            dj.case("dam", **settings)
