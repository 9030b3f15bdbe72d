"""Limit analysis: loads that no joint can resist, by their resultants, against closed forms."""

from dataclasses import replace

import pytest
from closed_forms import BASE, resultants
from damjoint.input.resolve import load
from damjoint.joint.interface import interface_of
from damjoint.statics.limit import mechanism

COARSE = {"n_joint": 10, "pena_tang": 0, "law": "friction", "uplift": "imposed"}


def verdict_of(values, level):
    case = load("c", COARSE, f"{level}")
    case = replace(case, values=case.values | values)
    return mechanism(case, interface_of(case))


@pytest.mark.parametrize("law", ["friction", "bond"])
def test_sliding_limit(law):
    """T > mu N + c L, a per mille on both sides."""
    n, t, _ = resultants(9.0, 0.0, True)
    for factor, expected in ((1.001, ""), (0.999, "sliding")):
        cohesion = (t - 0.35 * n) / BASE * factor
        values = {"law": law, "mu": 0.35, "adhesion": cohesion, "sigma_max": 0}
        assert verdict_of(values, 9)[0] == expected


def test_overturning_limit():
    """Without tension no M < 0; with tensile strength f no M < - f L^2/2."""
    n, _, m = resultants(10.0, 0.0, True)
    assert m > 0 and n > 0
    heavy = {"law": "rupture", "rho_water": 1200.0}
    m -= 0.2 * (resultants(0.0, 0.0, True)[2] - m)
    assert m < 0
    for factor, expected in ((1.001, ""), (0.999, "overturning")):
        strength = -2 * m / BASE**2 * factor
        assert verdict_of(heavy | {"sigma_max": strength}, 10)[0] == expected


def test_hardening_and_computed_uplift_have_no_limit():
    weak = {"mu": 0.01, "adhesion": 0.0}
    assert verdict_of(weak, 9)[0] == "sliding"
    assert verdict_of(weak | {"pena_tang": 1.0}, 9) == ("", "")
    assert verdict_of(weak | {"uplift": "flow"}, 9) == ("", "")
