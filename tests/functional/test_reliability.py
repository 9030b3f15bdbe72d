"""Reliability: probabilities against the closed form of sliding; files, interruptions."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import damjoint as dj
import numpy as np
import pytest
from closed_forms import WATER
from damjoint.input.resolve import load
from damjoint.studies import openturns_process, reliability
from damjoint.studies.critical import Search
from damjoint.studies.reliability import Reliability
from damjoint.studies.reliability_picture import figure_of_reliability
from numpy.testing import assert_allclose
from processes import without_progress
from scipy import stats

SLIDES = {"law": "friction", "adhesion": 0.0, "pena_tang": 0.0, "n_joint": 10, "order": 1}
#: mean 0.75, standard deviation 0.09
MU = "lognorm(0.119571287,scale=0.744657629)"
VARIED = {"mu": MU, "rho_dam": "normal(2400,50)", "level": "gumbel_r(38.5,0.6)"}
SETTINGS = [word for n, v in SLIDES.items() for word in ("--set", f"{n}={v}")]
WORDS = ("reliability", "dam", *SETTINGS, "--levels", "30,36")
WORDS += tuple(word for n, v in VARIED.items() for word in ("--vary", f"{n}={v}"))


def slide_level(mu, rho, foot):
    """Levels at which T = mu N at the joint of the 45 m dam at a height [m], below the crest."""
    base = 34 - (34 - 5) * foot / 45
    weight = rho * 9.81 * (45 - foot) * (base + 5) / 2
    half = mu * base / 2
    return foot - half + np.sqrt(half**2 + 2 * mu * weight / WATER)


def drawn(count, *texts):
    """Independent random values of distributions."""
    generator = np.random.default_rng(1)
    kinds = [reliability.sampling.distribution("x", text) for text in texts]
    return [kind.ppf(generator.random(count)) for kind in kinds]


@pytest.fixture(scope="module")
def trial():
    """The 45 m dam without bond, its friction, density and level uncertain; 30 samples."""
    case = dj.case("dam", levels=[30, 36], **SLIDES)
    return dj.reliability(case, **VARIED, samples=30, jobs=1)


def by_closed_form(case, varied, samples):
    """The same with levels of the closed form."""
    levels = ClosedForm(case, reliability.Variables(varied))
    return list(reliability.analysed(levels, samples, 0, lambda message: None))


@pytest.mark.heavy
def test_form_and_sorm_of_a_dam_that_slides(trial):
    """Beta of the closed form: least distance of its limit state; the probability of it by 2e7
    samples, 4.459e-3 +- 0.029e-3, of which FORM misses a fifth. The samples are those of a study
    with levels of the closed form, of which 500 decide between FORM and SORM.
    """
    (row,) = trial.rows
    assert row.beta == pytest.approx(2.6919, abs=3e-4)
    assert row.form == pytest.approx(stats.norm.cdf(-row.beta), rel=1e-6)
    assert row.breitung == pytest.approx(4.459e-3, rel=0.02)
    few, many = (by_closed_form(trial.levels.case, VARIED, number)[0] for number in (30, 500))
    of_samples = [few.sampled, few.low, few.high]
    assert [row.sampled, row.low, row.high] == pytest.approx(of_samples, rel=1e-3)
    assert many.low < 4.459e-3 < many.high and many.high - many.low < 0.4 * 4.459e-3
    assert row.form < many.low and "20 % below" not in many.words()
    assert "on the unsafe side" in many.words() and "SORM agrees" in many.words()
    design = trial.design
    level = slide_level(design["mu"], design["rho_dam"], 0)
    assert design["level"] == pytest.approx(level, rel=1e-4)
    assert sum(trial.importance.values()) == pytest.approx(1)
    assert trial.importance["mu"] == pytest.approx(0.707, abs=0.01)
    levels = trial.to_pandas("levels")  # the rows of reliability.csv
    assert len(levels) == trial.levels.computed and set(levels["mode"]) == {"sliding"}
    of = levels[levels.d_mu.notna()].iloc[-1]
    assert of.critical_level == pytest.approx(slide_level(of.mu, of.rho_dam, 0), rel=1e-5)
    assert of.d_mu > 0 and levels.d_mu.isna().any()


@pytest.mark.heavy
def test_form_and_sorm_without_derivatives(monkeypatch):
    """Where critical levels have none, as at kinks: by differences of levels, here by the closed
    form, with the same probabilities as with derivatives.
    """

    def row_of(case, names):
        level = slide_level(case["mu"], case["rho_dam"], 0)
        return dict(zip(reliability.RESULTS, (level, "sliding", "base", 1.0, ""), strict=True))

    monkeypatch.setattr(reliability, "row_of", row_of)
    case = dj.case("dam", levels=[30, 36], **SLIDES)
    result = dj.reliability(case, **VARIED, samples=0, jobs=1)
    (row,) = result.rows
    assert result.levels.computed <= 30
    assert row.beta == pytest.approx(2.6919, abs=1e-4)
    assert row.breitung == pytest.approx(4.459e-3, rel=0.02)


@pytest.mark.heavy
def test_form_and_sorm_need_few_critical_levels():
    case = dj.case("dam", levels=[30, 36], **SLIDES)
    result = dj.reliability(case, **VARIED, samples=0, jobs=1)
    assert result.levels.computed <= 15  # 60 allowed
    assert result.beta == pytest.approx(2.6919, abs=1e-4)
    assert np.isnan(result.rows.sampled).all() and result.words == [""]


def test_probability_of_a_normal_margin_is_exact():
    """A level alone is uncertain: g is linear in it, and FORM exact, also far in the tail."""
    case = dj.case("dam", levels=[30, 36], mu=0.6, **SLIDES)
    level = slide_level(0.6, 2400.0, 0)
    for mean in (39.0, 36.0, 42.0):
        result = dj.reliability(case, level=f"normal({mean},0.6)", samples=0, jobs=1)
        beta = (level - mean) / 0.6
        assert result.beta == pytest.approx(beta, rel=1e-4)
        assert result.rows.form[0] == pytest.approx(stats.norm.cdf(-beta), rel=5e-3)


@pytest.mark.heavy
def test_rank_correlation_is_that_of_the_copula():
    """Spearman's correlation of level and density, both normal; the exact beta where the critical
    level is linear in the density.
    """
    case = dj.case("dam", levels=[30, 36], mu=0.6, **SLIDES)
    varied = {"rho_dam": "normal(2400,20)", "level": "normal(39,0.5)"}
    level, slope = slide_level(0.6, 2400.0, 0), slide_level(0.6, 2401.0, 0)
    slope -= level
    for rank in (0.0, 0.6):
        given = [f"rho_dam,level={rank}"] if rank else []
        result = dj.reliability(case, **varied, correlate=given, samples=0, jobs=1)
        pearson = 2 * np.sin(np.pi * rank / 6)
        variance = (slope * 20) ** 2 + 0.5**2 - 2 * pearson * slope * 20 * 0.5
        assert result.beta == pytest.approx((level - 39) / variance**0.5, rel=5e-3)


#: Friction of three joints, of which each is about as probable to slide, or less.
OF_JOINTS = {
    "base.mu": MU,
    "lift 12 m.mu": "lognorm(0.128499,scale=0.614902)",
    "lift 25 m.mu": "lognorm(0.139321,scale=0.495171)",
    "rho_dam": "normal(2400,50)",
    "level": "gumbel_r(38.5,0.6)",
}


FEET = {"base": 0.0, "lift 12 m": 12.0, "lift 25 m": 25.0}


class ClosedForm(reliability.CriticalLevels):
    """Critical levels of sliding, without a computation and without derivatives."""

    def rates(self, joint, row):
        return None

    def of(self, joint, rows, rates=False):
        of_row = lambda row: [
            slide_level(row.get("mu", row.get(f"{name}.mu")), row["rho_dam"], foot)
            for name, foot in (FEET.items() if "base.mu" in row else [("", 0.0)])
            if joint in ("", name)
        ]
        return [{"critical_level": min(of_row(row))} for row in rows]


@pytest.fixture(scope="module")
def of_joints():
    """Reliability by closed-form levels of each of three joints and of the dam, 500 samples."""
    case = dj.case("dam", levels=[25, 30], **SLIDES, lift_heights=(12.0, 25.0))
    return by_closed_form(case, OF_JOINTS, 500)


@pytest.mark.heavy
def test_three_joints_against_closed_form_samples(of_joints):
    """Of each joint alone and of the dam, whose limit state has a kink: FORM has less than half."""
    *mu, rho, level = drawn(100_000, *OF_JOINTS.values())
    fails = [slide_level(m, rho, y) < level for m, y in zip(mu, FEET.values(), strict=True)]
    counts = [int(f.sum()) for f in (*fails, np.any(fails, axis=0))]
    for row, count in zip(of_joints, counts, strict=True):
        exact = stats.binomtest(count, 100_000).proportion_ci(0.95)
        # four intervals of 95 % miss once in five studies: within three standard errors
        error = (row.high - row.low) / 2 / stats.norm.isf(0.025)
        assert exact.low - 3 * error < row.sampled < exact.high + 3 * error, row.joint
        assert error < 0.1 * row.sampled
        if row.joint:  # smooth
            assert exact.low * 0.95 < row.breitung < exact.high * 1.05, row.joint
    whole = of_joints[-1]
    assert whole.form < 0.5 * counts[-1] / 100_000 and whole.breitung < whole.low
    assert "kink" in whole.words()


@pytest.mark.heavy
def test_three_joints_have_the_levels_and_design_points_of_the_closed_form(of_joints):
    case = dj.case("dam", levels=[25, 30], **SLIDES, lift_heights=(12.0, 25.0))
    result = dj.reliability(case, **OF_JOINTS, samples=0, jobs=1)
    assert result.rows.joint.tolist() == [*case.joint_names, ""] == [*FEET, ""]
    levels = result.to_pandas("levels")
    assert len(levels) == result.levels.computed <= 60
    for _, row in levels.iterrows():
        own = [row.of_joint] if row.of_joint else FEET
        mu = {name: row[f"{name}.mu"] for name in own}
        assert row.critical_level == pytest.approx(
            min(slide_level(mu[name], row.rho_dam, FEET[name]) for name in own), rel=1e-5
        )
    for row, exact in zip(result.rows, of_joints, strict=True):
        assert row.beta == pytest.approx(exact.beta, abs=1e-3), row.joint
        assert row.breitung == pytest.approx(exact.breitung, rel=0.01), row.joint
    assert result.design["lift 12 m.mu"] == pytest.approx(0.614902, rel=1e-6)


@pytest.mark.heavy
def test_samples_around_the_design_point_are_unbiased():
    """The mean of 200 studies with closed-form levels, and how many of their intervals have the
    probability: that of 2e7 samples. Of 95 %, 180 to 198 of 200 in 99.8 % of such tests.
    """
    variables = reliability.Variables(VARIED)
    levels = ClosedForm(dj.case("dam", levels=[30, 36], **SLIDES), variables)
    limit = reliability.LimitState(levels)
    with openturns_process.openturns() as library:
        design = reliability.design_point(limit, library, [0.0] * 3)
        studies = [reliability.sampled(limit, library, [design], 100, s) for s in range(200)]
    shares = np.array([share for share, _, _ in studies])
    mean_error = shares.std(ddof=1) / len(shares) ** 0.5
    assert abs(shares.mean() - 4.459e-3) < 3 * mean_error < 0.1 * 4.459e-3
    assert sum(low < 4.459e-3 < high for _, low, high in studies) >= 180


@pytest.mark.heavy
def test_derivatives_are_those_of_the_closed_form():
    """Also through a tied parameter, and with correlated variables in one joint's limit state."""
    case = dj.case("dam", levels=[30, 36], **SLIDES)
    variables = reliability.Variables(
        {"mu": MU, "level": "normal(38,1)"}, (), {"rho_dam": "2000*mu+900"}
    )
    levels = reliability.CriticalLevels(case, variables)
    limit, z = reliability.LimitState(levels), [-0.8, 0.5]
    slope = np.ravel(limit.gradient(z))
    level_of = lambda mu: slide_level(mu, 2000 * mu + 900, 0)
    mu, step = variables.values(z)["mu"], 1e-5
    by_mu = (level_of(mu + step) - level_of(mu - step)) / (2 * step)
    assert slope == pytest.approx([by_mu * mu * 0.119571287, -1.0], rel=1e-6)
    assert levels.computed == 1


def test_an_interval_without_a_failure_begins_at_zero():
    share, low, high = reliability.weighted_share(np.full(50, 1e-3), np.zeros(50, bool))
    assert (share, low) == (0, 0) and 3e-5 < high < 3e-4  # 3/50 samples of this weight: 6e-5


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.heavy
def test_files_and_continuation(painted, command, tmp_path):
    """A second call computes nothing and prints the same; the design point is a case that runs, and
    its critical level is its level.
    """
    words = *WORDS, "--samples", "50", "--out", "out"
    code, out, _ = command(*words, "--jobs", "2")
    assert code == 0
    *head, last = out.splitlines()
    levels = rows(tmp_path / "out/reliability.csv")
    assert last == f"{len(levels)} critical levels, {len(levels)} of them computed now"
    assert head == command(*words, "--jobs", "1")[1].splitlines()[:-1]
    assert levels == rows(tmp_path / "out/reliability.csv")
    info = json.loads((tmp_path / "out/run.json").read_text())
    (entry,) = info["reliability"]["of"]
    assert (tmp_path / "out/dam_reliability.png").stat().st_size > 10_000
    assert info["state"] == "complete" and info["reliability"]["critical_levels"] == len(levels)
    assert entry["agreement"] in out and f"{entry['form']:.4g}" in out
    assert command("report", "out", "--to", "report.html")[0] == 0
    page = (tmp_path / "report.html").read_text()
    for text in (
        *(f"<td>{v}</td>" for v in (MU, "normal(2400,50)", "gumbel_r(38.5,0.6)", "2400")),
        *(entry["agreement"], f"<td>{entry['beta']:.4g}</td>", "SORM, Tvedt", "reservoir level"),
        f"<td>{100 * entry['importance']['mu']:.3g}</td>",
        "P = {:.3g} ({:.3g} to {:.3g})".format(entry["sampled"], *entry["interval"]),
        *(f"All {len(levels)} critical levels are confirmed", "data:image/png;base64,"),
        *("Joint law friction", "<code>mu</code>"),  # of the case itself, and its materials
    ):
        assert text in page, text
    case = load(str(tmp_path / "out/design_point.case"))
    assert case["mu"] == entry["design_point"]["mu"] and case["law"] == "friction"
    assert Search(case, "level").find().value == pytest.approx(case.levels[-1], rel=1e-4)
    (first,) = (row for row in levels if row["rho_dam"] == "2400" and row["mu"] == "0.744657629")
    expected = slide_level(float(first["mu"]), 2400.0, 0)
    assert float(first["critical_level"]) == pytest.approx(expected, rel=1e-4)


@pytest.mark.heavy
def test_other_variables_replace_the_file(command, tmp_path):
    words = "reliability", "dam", *SETTINGS, "--samples", "0", "--jobs", "1", "--out", "out"
    assert command(*words, "--vary", f"mu={MU}", "--vary", "level=normal(38,1)")[0] == 0
    assert command(*words, "--vary", "level=normal(38,1)")[0] == 0
    assert [list(row) for row in rows(tmp_path / "out/reliability.csv")] == [
        ["key", "of_joint", *reliability.RESULTS]
    ]


@pytest.mark.heavy
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_an_interrupted_study_ends_at_once_and_keeps_its_levels(tmp_path, jobs):
    path = tmp_path / "out/dam_reliability/reliability.csv"
    with subprocess.Popen(
        [sys.executable, "-m", "damjoint", *WORDS, "--jobs", jobs],
        cwd=tmp_path,
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        while not path.exists() or len(path.read_text().splitlines()) < 30:
            assert process.poll() is None
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        _, error = process.communicate(timeout=120)
    assert process.returncode == 130
    assert without_progress(error).splitlines() == [
        "damjoint: interrupted; results finished so far are saved"
    ]
    assert 10 <= len(rows(path)) < 500
    assert json.loads((path.parent / "run.json").read_text())["state"] == "interrupted"


@pytest.mark.heavy
def test_a_scheduler_computes_the_same(command, tmp_path):
    from distributed import LocalCluster

    words = *WORDS, "--samples", "8"
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        far = command(*words, "--scheduler", cluster.scheduler_address, "--out", "far")
    near = command(*words, "--jobs", "1", "--out", "near")
    assert far[0] == near[0] == 0
    assert far[1].replace("far", "near") == near[1]
    by_key = lambda name: {r["key"]: r for r in rows(tmp_path / name / "reliability.csv")}
    assert by_key("far") == by_key("near")


def test_the_picture_has_each_probability_its_interval_and_the_importance():
    design, shares = {"mu": 0.56, "level": 39.9}, {"mu": 0.7, "level": 0.3}
    of_base = Reliability("base", 2.7, (2.0, 1.0), design, shares, True, 0.0034, None, 0.0043)
    of_all = replace(of_base, joint="", sampled=0.0025, low=0.001, high=0.005, samples=50)
    values = ["mu = 0.56", "level = 39.9 m"]
    left, right = figure_of_reliability([of_base, of_all], "dam", values).axes
    labels = [text.get_text() for text in left.get_yticklabels()]
    assert labels[:2] == ["base: FORM", "base: SORM (Tvedt)"] and len(labels) == 5
    assert labels[-1] == "all joints: 50 samples"
    interval, sampled = left.get_lines()[-2:]
    assert_allclose(interval.get_xdata(), (0.001, 0.005))
    assert_allclose(sampled.get_xdata(), 0.0025)
    assert_allclose([bar.get_width() for bar in right.patches], (70, 30))
    none = replace(of_all, form=None, tvedt=None, design={}, importance={}, sampled=0.0)
    assert not figure_of_reliability([none], "dam", []).axes[0].get_lines()


@pytest.mark.heavy
def test_a_level_that_is_not_computed_counts_as_a_failure(command, monkeypatch):
    """And is printed."""
    find = Search.find

    def broken(search):
        if search.case["mu"] < 0.7:
            raise RuntimeError("no room")
        return find(search)

    monkeypatch.setattr(Search, "find", broken)
    monkeypatch.setattr(openturns_process, "MOST_ITERATIONS", 2)
    varied = "--vary", "mu=uniform(0.65,0.1)", "--vary", "level=normal(30,0.5)"
    words = "reliability", "dam", *SETTINGS, *varied, "--jobs", "1", "--samples", "5"
    code, out, _ = command(*words)
    assert code == 0 and "critical levels failed: counted as failures" in out


@pytest.mark.parametrize(
    "words, message",
    [
        ([], "--vary: must have a distribution, such as mu=normal(1.0,0.15)"),
        (["--vary", "mu"], "--vary mu: must be NAME=..., such as mu=normal(1.0,0.15)"),
        (["--vary", "law=normal(0,1)"], "--vary law=normal(0,1): must be of a parameter that is"),
        (["--vary", "mu=norma(0,1)"], "--vary mu=norma(0,1): must be a distribution of scipy"),
        (["--vary", "mu=normal(0.5,0.3)"], "truncnorm, uniform or lognorm keep within bounds"),
        (["--vary", "n_joint=normal(40,2)"], "must be of a parameter that is a real number"),
        (["--vary", f"mu={MU}", "--tie", "order=1"], "--tie order: must be of a parameter that is"),
        (["--vary", f"mu={MU}", "--vary", f"mu={MU}"], "--vary mu: must be given once"),
        (["--vary", f"mu={MU}", "--tie", "mu=1"], "--tie mu: must not be varied, and not be"),
        (["--vary", f"mu={MU}", "--correlate", "mu,level=0.5"], "two of the sampled names (mu)"),
        (["--vary", f"mu={MU}", "--scheduler", "nowhere"], "--scheduler nowhere: no scheduler"),
    ],
)
def test_bad_input_is_one_line(command, tmp_path, words, message):
    """And nothing is computed or written."""
    code, out, error = command("reliability", "dam", *SETTINGS, *words)
    assert code == 2 and not out and message in error and len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_openturns_a_message_names_the_extra(command, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "openturns", None)
    code, _, error = command(*WORDS)
    assert code == 2 and not list(tmp_path.iterdir())
    assert error == "damjoint: reliability: needs openturns; pip install 'damjoint[reliability]'\n"
