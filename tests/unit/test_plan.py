"""Plan of a sweep: ties are arithmetic only; samples are those of scipy."""

import itertools
import math

import numpy as np
import pytest
from damjoint import InputError
from damjoint.studies import sampling
from damjoint.studies.outcome import STATIC, report
from damjoint.studies.plan import Plan, Sample, plan_of, sample_of
from scipy import stats

MU = ["mu=0.6:1.0:0.2"]


def test_ties_are_computed_from_earlier_names():
    plan = plan_of(MU, ["adhesion=2e5*mu", "sigma_max=(adhesion/2)^1"], None, {})
    rows = [[float(row[n]) for n in plan.names] for row in plan.rows()]
    assert np.allclose(rows, [[m, 2e5 * m, 1e5 * m] for m in (0.6, 0.8, 1.0)])


@pytest.mark.parametrize(
    "tie, message",
    [
        ("adhesion=__import__('os').getpid()", "arithmetic"),
        ("adhesion=().__class__", "arithmetic"),
        ("adhesion=mu if mu else 1", "arithmetic"),
        ("adhesion=K_N", "names varied"),
        ("adhesion=1/(mu-mu)", "arithmetic"),
        ("adhesion=9^9^9^9", "arithmetic"),
        ("adhesion=" + "(" * 5000 + "1" + ")" * 5000, "arithmetic"),
        ("adhesion=-mu", "adhesion = -0.6: must be"),
        ("adhesion", "NAME=EXPRESSION"),
        ("mu=2", "given once"),
        ("K_N=1e11", "given once"),
    ],
)
def test_an_expression_that_is_not_arithmetic_is_refused(tie, message):
    with pytest.raises(InputError) as refused:
        list(plan_of(MU, [tie], None, {"K_N": 1e12}).rows())
    assert message in str(refused.value)


def test_each_combination_has_all_rows_of_the_sample():
    sample = sample_of(["5", "adhesion = uniform(1e5, scale=1e5)"], seed=3)
    rows = list(plan_of(MU, ["sigma_max=adhesion"], sample, {}).rows())
    assert len(rows) == 15 and rows[0]["adhesion"] == rows[5]["adhesion"] == rows[5]["sigma_max"]
    again = list(plan_of(MU, ["sigma_max=adhesion"], sample, {}).rows())
    other = sample_of(["5", "adhesion=uniform(1e5,1e5)"], seed=4)
    assert again == rows != list(plan_of(MU, ["sigma_max=adhesion"], other, {}).rows())


@pytest.mark.parametrize(
    "words, message",
    [
        (["mu=normal(1,0.1)", "3"], "N NAME=DISTRIBUTION"),
        (["3"], "N NAME=DISTRIBUTION"),
        (["3", "mu"], "N NAME=DISTRIBUTION"),
        (["3", "mu=normal"], "scipy.stats with numbers"),
        (["3", "mu=normal(1,__import__('os'))"], "scipy.stats with numbers"),
        (["3", "mu=stats.norm(1,0.1)"], "scipy.stats with numbers"),
        (["3", "mu=rvs(1)"], "rvs is none"),
        (["3", "mu=__import__(1)"], "__import__ is none"),
        (["3", "mu=normal(1,0)"], "normal(loc, scale)"),
        (["3", "mu=lognorm(1,-2,3,4)"], "lognorm(s, loc, scale)"),
        (["9", "mu=normal(0,1)"], "draws mu = -"),
        (["3", "friction=normal(1,0.1)"], "unknown parameter"),
        (["3", "mu=normal(1,0.1)", "mu=normal(1,0.1)"], "given once"),
    ],
)
def test_a_bad_sample_is_refused(words, message):
    with pytest.raises(InputError) as refused:
        plan_of([], [], sample_of(words), {})
    assert message in str(refused.value)


def test_a_latin_hypercube_has_one_value_in_each_part():
    """Parts of equal probability; also with correlated inputs."""
    laws = {"mu": "normal(1.0, 0.15)", "adhesion": "lognorm(0.3, scale=2e5)"}
    drawn = sampling.draw(400, laws, "latin", 0, ["adhesion,mu=-0.5"])
    for name, law in (("mu", stats.norm(1.0, 0.15)), ("adhesion", stats.lognorm(0.3, scale=2e5))):
        assert np.array_equal(np.sort(np.floor(law.cdf(drawn[name]) * 400)), np.arange(400))
    assert sampling.sensitivity(drawn["mu"], drawn["adhesion"]) == pytest.approx(-0.5, abs=0.1)


@pytest.mark.parametrize("design", ["latin", "monte-carlo"])
@pytest.mark.parametrize("number, error", [(30, 0.05), (100, 0.01), (1000, 1e-3)])
@pytest.mark.parametrize(
    "wanted", [{"ab": -0.5}, {"ab": 0.95}, {"ab": 0.6, "bc": -0.3, "cd": 0.5}, {"ad": -0.8}]
)
def test_the_sample_has_the_required_correlations(design, number, error, wanted):
    """Of the sample itself, 0 where none is set; the values of each input stay the same."""
    laws = {"a": "normal(1,0.1)", "b": "lognorm(0.3)", "c": "uniform(0,1)", "d": "gumbel_r(2,3)"}
    texts = [f"{a},{b}={rank}" for (a, b), rank in wanted.items()]
    for seed in range(5):
        drawn = sampling.draw(number, laws, design, seed, texts)
        free = sampling.draw(number, laws, design, seed, [])
        for one, other in itertools.combinations(laws, 2):
            found = sampling.sensitivity(drawn[one], drawn[other])
            assert found == pytest.approx(wanted.get(one + other, 0.0), abs=error)
        assert all(np.array_equal(np.sort(drawn[n]), np.sort(free[n])) for n in laws)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_correlated_sample_of_few_values(number):
    laws = dict.fromkeys("abc", "normal(1,0.1)")
    drawn = sampling.draw(number, laws, "latin", 0, ["a,b=-0.5"])
    free = sampling.draw(number, laws, "latin", 0, [])
    assert all(np.array_equal(np.sort(drawn[n]), np.sort(free[n])) for n in laws)


@pytest.mark.parametrize("text", ["mu=0.5", "mu,mu=0.5", "mu,K_N=0.5", "mu,adhesion=1", "mu,E=x"])
def test_a_bad_correlation_is_refused(text):
    laws = {"mu": "normal(1,0.1)", "adhesion": "normal(1,0.1)"}
    with pytest.raises(InputError, match="--correlate"):
        sampling.draw(3, laws, "monte-carlo", 0, [text])


def test_contradictory_correlations_are_refused():
    laws = dict.fromkeys("abc", "normal(1,0.1)")
    with pytest.raises(InputError, match="positive definite"):
        sampling.draw(3, laws, "latin", 0, ["a,b=0.9", "b,c=0.9", "a,c=-0.9"])


def test_confidence_interval_of_a_probability():
    """Clopper and Pearson's closed form; undecided rows count but for the lower limit."""
    share, low, high = sampling.probability(0, 0, 50)
    assert (share, low) == (0, 0) and high == pytest.approx(1 - 0.025 ** (1 / 50))
    share, low, high = sampling.probability(0, 50, 50)
    assert (share, low, high) == (1, 0, 1)


def test_a_constant_outcome_has_no_sensitivity():
    assert math.isnan(sampling.sensitivity(np.arange(4.0), np.ones(4)))
    assert sampling.sensitivity(np.arange(4.0), np.array([5, 4, 1, np.nan])) == -1


@pytest.mark.heavy
def test_sobol_indices_of_a_function_with_an_interaction():
    """Of Ishigami's function with a = 7, b = 0.1, in closed form."""
    design = sampling.sobol_design(2048, 3, seed=1)
    x, y, z = np.pi * (2 * design.T - 1)
    first, total, first_width, total_width = sampling.sobol_indices(
        np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x), 3
    )
    assert first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.02)
    assert total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    assert (first_width > 0).all() and (total_width < 0.1).all()


def test_sobol_indices_of_an_outcome_that_seldom_differs_have_no_interval(recwarn):
    """Samples that are drawn again may have one value only; scipy's warnings were printed."""
    design = sampling.sobol_design(32, 2, seed=0)
    first, total, *widths = sampling.sobol_indices(np.maximum(design[:, 0] - 0.97, 0.0), 2)
    assert np.isfinite([first, total]).all() and np.isnan(widths).any() and not recwarn.list


def test_the_design_of_sobol_indices_has_blocks_of_a_power_of_two():
    sample = Sample(4, {"mu": "uniform(0.5,0.2)", "adhesion": "uniform(1e4,1e4)"}, "sobol")
    assert len(sample.values()["mu"]) == sample.rows == 4 * 4
    for number, given in ((3, ()), (4, ["mu,adhesion=0.5"])):
        with pytest.raises(InputError):
            Sample(number, sample.distributions, "sobol", correlate=given)


@pytest.mark.parametrize("number, few", [(32, True), (256, False)])
def test_too_few_rows_for_sobol_indices_are_said(tmp_path, number, few):
    """The third input changes nothing: its indices are 0, without an interval."""
    names = "mu", "adhesion", "rho_dam"
    sample = Sample(number, dict.fromkeys(names, "uniform(0.5,1)"), "sobol")
    x = np.column_stack([*sample.values().values()])
    plan = Plan({}, sample.values(), {}, sobol=number)
    outcome = np.maximum(x[:, 0] - 1.45, 0) if few else x[:, 0] + x[:, 1]
    known = {"verdict": "stands", "failed": "0", **dict.fromkeys(STATIC, "")}
    rows = [
        {**known, "crest_ux": str(y), **dict(zip(names, cells, strict=True))}
        for y, cells in zip(outcome.tolist(), x.astype(str).tolist(), strict=True)
    ]
    text = report(plan, rows, tmp_path / "s.csv")
    assert (f"{number} rows in a block are too few for the indices of crest_ux" in text) == few
