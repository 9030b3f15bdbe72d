"""Critical values: closed forms, mechanisms that confirm them, and what must not be taken for
one."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import BASE, CENTROID, HEIGHT, WATER, WEIGHT, slide_level
from damjoint.model.case import load
from damjoint.solver import path
from damjoint.statics import gravity
from damjoint.statics.verdict import highest_by_statics
from damjoint.studies import branch
from damjoint.studies.critical import Search, critical
from scipy.optimize import brentq

#: A real dam, 45 m high, on a mesh that is enough for limits of the rigid block.
DAM = {"E_dam": 2e10, "E_found": 3e10, "n_joint": 20.0}
#: Friction alone.
PLAIN = {"law": "bond", "sigma_max": 0.0, "adhesion": 0.0}


def found(case, of="level", settings=None, levels=None, tail_levels=None):
    search = Search(case, of, settings, levels, tail_levels)
    return search, search.run()


@pytest.mark.parametrize("uplift", ["none", "imposed"])
def test_sliding_level(uplift):
    """T = mu N + c L, 7.45784 m dry and 6.63399 m with uplift, by both methods."""
    _, answer = found("c", settings={"pena_tang": 0.0, "uplift": uplift})
    limit = slide_level(0.35, 1000, uplift == "imposed")
    assert answer.value == pytest.approx(limit, rel=path.PRECISION)
    assert answer.gravity == pytest.approx(limit, rel=path.PRECISION)
    assert answer.mode == "sliding" and answer.confirmed and "the whole joint slips" in answer.why


@pytest.mark.parametrize("wet", [False, True])
def test_overturning_level(wet):
    """Without tension, above the crest by the trapezoid of pressure: 11.687 m dry, 10.019 m with
    uplift, where N stands at the toe; here it can not go beyond the last point of integration.
    """

    def moment(level, arm):
        depth = min(level, HEIGHT)
        thrust = WATER * (level * depth**2 / 2 - depth**3 / 3)
        normal = WEIGHT - wet * WATER * BASE * level / 2
        about_toe = WEIGHT * (BASE - CENTROID) - thrust - wet * WATER * BASE**2 * level / 3
        return about_toe - normal * arm

    uplift = {"uplift": "imposed" if wet else "none"}
    settings = {"sigma_max": 0.0, "crest_water": 0.0, "n_joint": 20.0}
    _, answer = found("i", settings=uplift | settings)
    arm = (1 - 1 / np.sqrt(3)) / 2 * BASE / 20
    assert answer.value == pytest.approx(brentq(moment, 5, 15, arm), rel=path.PRECISION)
    assert answer.gravity == pytest.approx(brentq(moment, 5, 15, 0.0), rel=path.PRECISION)
    assert answer.mode == "overturning" and answer.confirmed


@pytest.mark.parametrize(
    "mu, level, levels, tails",
    [(0.6, 40.619, None, "3"), (0.7, 43.161, None, "3"), (0.7, 43.161, "30,40", "0,3")],
)
def test_friction_alone(mu, level, levels, tails):
    """Of a real dam with linear uplift and a tailwater of 3 m, which has risen or was there."""
    _, answer = found("dam", "level", DAM | PLAIN | {"mu": mu}, levels, tails)
    assert answer.value == pytest.approx(level, abs=1e-3)
    assert answer.gravity == pytest.approx(level, abs=1e-3)


def test_strength():
    """(mu N + c L) / T at 45 m: (12683 + 34 x 200) / 9888, fracture energies and all."""
    settings = DAM | {"law": "friction", "mu": 1.0, "adhesion": 2e5}
    search, answer = found("dam", "strength", settings, tail_levels="3")
    assert answer.value == pytest.approx((12683 + 34 * 200) / 9888, rel=2e-4)
    assert answer.point.level == pytest.approx(45, rel=path.PRECISION)
    ends = [t.value for t in search.trials if not t.stands]
    assert 0 < min(ends) / answer.value - 1 < 1.1 * path.PRECISION


@pytest.mark.heavy
def test_drains():
    """The less they take away, the less the dam holds."""
    settings = DAM | PLAIN | {"mu": 0.7, "uplift": "drained"}
    _, answer = found("dam", "uplift", settings, tail_levels="3")
    assert 0 < answer.value < 0.5
    assert answer.value == pytest.approx(answer.gravity, rel=5e-4)


@pytest.mark.heavy
def test_earthquake():
    """It comes with the only level: too strong a one lets no first step be found, but halves of it.
    T = mu N, whatever the crack."""
    settings = DAM | {"law": "friction", "mu": 0.6, "adhesion": 0.0, "uplift": "none"}
    _, answer = found("dam", "k_h", settings, levels="30", tail_levels="0")
    assert answer.confirmed and answer.mode == "sliding"
    assert answer.value == pytest.approx(answer.gravity, rel=1e-3)


@pytest.mark.heavy
def test_any_parameter_whatever_its_direction():
    """T = mu N at 45 m: no equilibrium with less."""
    _, answer = found("dam", "mu", DAM | PLAIN, tail_levels="3")
    assert answer.value == pytest.approx(9888 / 12683, rel=2e-4)


def test_the_gravity_method_without_tension(command, tmp_path):
    """A strength that the heel's linear stress does not reach, and its elastic stress does."""
    strong = "law=bond", "mu=5", "dam_base=30", "sigma_max=2e6", "G_f=100", "adhesion=5e6"
    settings = *strong, "G_t=1e5", "n_joint=60"
    words = [word for setting in settings for word in ("--set", setting)]
    _, out, _ = command("critical", "dam", *words, "--levels", "40,48")
    told = json.loads((tmp_path / "out/dam_critical/run.json").read_text())["critical"]
    free = told["gravity_method_with"]["without tension"]
    assert told["value"] == pytest.approx(free, rel=0.02) and told["gravity_method"] > 70
    assert f"gravity method: {told['gravity_method']:.6g} m; without tension: {free:.6g} m" in out
    assert "(n_joint = 60), " in out and "kPa, exceeds the strength of 2000 kPa" in out


def test_the_gravity_method_with_drains_that_are_passed():
    """The short crack holds until it comes to the drains; mu N = T with the one past them."""
    drains = {"dam_base": 30.0, "uplift": "cracked", "drains": 1.0, "drain_x": 6.0, "mu": 1.0}
    search = Search("dam", "level", DAM | PLAIN | drains, "40,44", "3")
    first, longer = (search.by_gravity(44.4, True, longest) for longest in (False, True))
    method = gravity.at(search.own, 2.0, first - 1e-5)
    assert method.SSF > 1 and method.crack_length == pytest.approx(6, abs=1e-3)
    (other,) = gravity.at(search.own, 2.0, longer).further
    assert other.SSF == pytest.approx(1, abs=1e-4) and longer < first - 0.5


def test_unstable_crack_growth_is_passed():
    """A bond that breaks over 20 m at once: the level falls by a metre and more before it rises to
    what friction holds; the branch goes on over that."""
    brittle = {"law": "bond", "mu": 5.0, "dam_base": 30.0, "sigma_max": 2e6, "G_f": 100.0}
    brittle |= {"adhesion": 5e6, "G_t": 1e5, "n_joint": 60.0}
    search, answer = found("dam", settings=brittle, levels="40,48")
    (trial,) = search.trials
    levels = np.array([point.level for point in trial.branch.points])
    falls = np.maximum.accumulate(levels) - levels
    top = trial.branch.top
    assert answer.confirmed and answer.mode == "overturning" and falls[:top].max() > 1
    assert answer.value == pytest.approx(52.32, abs=0.01)


def test_hardening_is_no_limit():
    """Asked for, it carries the dam beyond T = mu N + c L, and it is said; else it is left out."""
    _, hard = found("c")
    assert hard.value > 1.4 * slide_level(0.35, 1000, True) and "mu N" not in hard.why
    settings = DAM | {"law": "friction", "mu": 0.6, "adhesion": 0.0}
    _, answer = found("dam", settings=settings, tail_levels="3")
    assert answer.value == pytest.approx(40.619, abs=1e-3)


def test_crushed_toe():
    _, answer = found("dam", settings=DAM | {"f_c": 5e6}, tail_levels="3")
    assert answer.mode == "crushed toe" and "f_c = 5e+06" in answer.why
    assert 0.999 * 5e6 < answer.point.compression <= 5e6


def test_what_no_push_confirms_is_not_confirmed(monkeypatch, command):
    monkeypatch.setattr(branch.Branch, "pushes", lambda self: ())
    code, out, _ = command("critical", "c", "--set", "pena_tang=0", "--levels", "6,8")
    assert code == 1 and "not confirmed: no further equilibrium is found" in out


@pytest.mark.parametrize(
    "name, settings, limit, mode",
    [
        ("i", {"uplift": "imposed", "sigma_max": 0.0, "crest_water": 0.0}, 10.0171, "overturning"),
        ("c", {"pena_tang": 0.0}, 6.63399, "sliding"),
    ],
)
def test_what_statics_allows(name, settings, limit, mode):
    """The level at which the resultant leaves a joint without tension; T = mu N + c L."""
    case = load(name, settings, "6")
    method = gravity.at(case, 1.0)
    last = {"time": 1.0, "level": 6.0, "crack_length": method.crack_length, "M": method.M}
    level, found, _ = highest_by_statics(case, last)
    assert level == pytest.approx(limit, abs=1e-3) and found == mode
    strong = replace(case, values=case.values | {"sigma_max": 1e6, "mu": 10.0, "adhesion": 1e6})
    assert highest_by_statics(strong, last)[0] > 1.2 * limit


def test_statics_confirms_a_level_that_is_near(monkeypatch):
    """Where the search is stuck, and only there; the value is that of an equilibrium."""
    monkeypatch.setattr(branch.Branch, "pushes", lambda self: ())
    settings = {"uplift": "imposed", "sigma_max": 0.0, "crest_water": 0.0, "n_joint": 20.0}
    _, answer = found("i", settings=settings, levels="9,9.8,9.95,10.1")
    assert answer.confirmed and answer.mode == "overturning" and 9.9 < answer.value < 10.0171
    assert "by statics there is no equilibrium above 10.01" in answer.why
    _, answer = found("i", settings=settings, levels="7,12")
    assert answer.value < 9.8 and not answer.confirmed


def test_a_tension_that_lasts_is_said():
    """c/mu of the law friction holds the open joint down; the value without it stands beside."""
    settings = {"law": "friction", "adhesion": 1e6, "n_joint": 20.0}
    search, answer = found("dam", settings=settings)
    lines = "\n".join(answer.lines(search))
    assert "kPa (" in lines and "% of the overturning moment) at any opening" in lines
    assert answer.gravity_with["without tension"] < answer.value


@pytest.mark.heavy
def test_a_rigid_block_that_opens_to_its_toe():
    """Friction of 3 holds any shear; full head in the crack."""
    settings = PLAIN | {"mu": 3.0, "uplift": "cracked", "n_joint": 40.0}
    _, answer = found("dam", settings=settings)
    assert answer.confirmed and answer.mode == "overturning"
    assert answer.value == pytest.approx(answer.gravity, rel=0.01)


def test_no_limit_is_said(command):
    words = ("critical", "c", "--of", "visc", "--levels", "3")
    code, out, _ = command(*words)
    assert code == 1 and "no critical visc found: stands with all that was tried" in out


@pytest.mark.parametrize(
    "words, said",
    [
        (("--of", "law"), "--of law: must be level, strength, uplift or"),
        (("--of", "n_joint"), "--of n_joint: must be level, strength, uplift or"),
        (("--of", "uplift"), "--of uplift: needs drains; uplift = imposed: must be drained"),
        (("--of", "mus"), "mus: unknown parameter"),
        (("--levels", "21"), "levels = 21: must be between 0 and 20 m"),
    ],
)
def test_bad_input(command, tmp_path, words, said):
    code, _, err = command("critical", "c", *words)
    assert code == 2 and said in err and len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_what_is_written(command, tmp_path):
    words = ("critical", "c", "--set", "pena_tang=0")
    code, out, _ = command(*words)
    assert code == 0 and out.startswith("c: critical level 6.63399 m (sliding)\n")
    folder = tmp_path / "out/c_critical"
    names = {"run.json", "joint.csv", "history.csv", "critical.csv", "c_critical.png"}
    assert {path.name for path in folder.iterdir()} == names
    told = json.loads((folder / "run.json").read_text())
    assert told["critical"]["mode"] == "sliding" and told["critical"]["of"] == "level"
    assert told["parameters"]["drive"] == "level"
    with (folder / "critical.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert max(float(row["level"]) for row in rows) == pytest.approx(told["critical"]["value"])
    assert {row["displacement_control"] for row in rows} == {"0", "1"}
    assert command("report", folder) == (0, "report.html\n", "")
    page = (tmp_path / "report.html").read_text()
    assert "<td>critical level, and the last state before it</td><td>6.63399 m; sliding;" in page


def test_an_interrupted_search_leaves_what_it_has_found(monkeypatch, tmp_path):
    advance, calls = branch.Branch.advance, []

    def interrupted(self):
        calls.append(self)
        if len(calls) > 3:
            raise KeyboardInterrupt
        advance(self)

    monkeypatch.setattr(branch.Branch, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        critical("c", "level", {"pena_tang": 0.0}, out=tmp_path / "out")
    assert (tmp_path / "out/critical.csv").read_text().count("\n") > 4
    told = json.loads((tmp_path / "out/run.json").read_text())
    assert told["state"] == "interrupted" in told["statement"]
