"""Closed forms of a rigid dam (weight, thrust, moments), and the comparison of two runs."""

import numpy as np
from scipy.optimize import brentq

BASE, CREST, HEIGHT = 5.0, 1.5, 10.0
WATER = 1000 * 9.81
AREA = (BASE + CREST) / 2 * HEIGHT
WEIGHT = 2400 * 9.81 * AREA
#: x of the centroid of the trapezoid: rectangle below the crest, triangle downstream of it
CENTROID = (
    CREST * HEIGHT * CREST / 2 + (BASE - CREST) * HEIGHT / 2 * (CREST + (BASE - CREST) / 3)
) / AREA
BATTER = (BASE - CREST) / HEIGHT


def thrust(level):
    """Thrust of the water on the upstream face [N/m]."""
    return WATER * level**2 / 2


def resultants(level, tail, wet):
    """N, T, M of the joint; M of the effective normal force about the toe. wet: linear uplift from
    heel to toe. The thrust of the tailwater on the inclined downstream face acts upstream (T) and,
    times BATTER, downwards (N).
    """
    n = WEIGHT - wet * WATER * BASE * (level + tail) / 2 + BATTER * thrust(tail)
    t = thrust(level) - thrust(tail)
    m = (
        WEIGHT * (BASE - CENTROID)
        - thrust(level) * level / 3
        - wet * WATER * BASE**2 * (level / 3 + tail / 6)
        + (1 + BATTER**2) * thrust(tail) * tail / 3
    )
    return n, t, m


def slide_level(mu, adhesion, wet):
    """Level at which T = mu N + adhesion BASE."""
    a, b, c = WATER / 2, wet * mu * WATER * BASE / 2, -(mu * WEIGHT + adhesion * BASE)
    return (-b + np.sqrt(b**2 - 4 * a * c)) / (2 * a)


def resultants_of_45_m_dam(level, tail=3.0):
    """N and T of the joint of cases/dam.case [N/m]: base 34 m, crest 5 m; linear uplift."""
    n = 2400 * 9.81 * 45 * (34 + 5) / 2 + (34 - 5) / 45 * thrust(tail)
    return n - WATER * 34 * (level + tail) / 2, thrust(level) - thrust(tail)


def slide_level_of_45_m_dam(mu):
    """Level at which T = mu N on the joint of cases/dam.case, with a tailwater of 3 m."""

    def excess(level):
        n, t = resultants_of_45_m_dam(level)
        return mu * n - t

    return brentq(excess, 20, 60)


def overturning_level(wet, arm=0.0):
    """Level at which N acts at a distance arm [m] from the toe; above the crest, the trapezoid of
    pressure below it acts. wet: linear uplift.
    """

    def moment(level):
        depth = min(level, HEIGHT)
        push = WATER * (level * depth**2 / 2 - depth**3 / 3)
        normal = WEIGHT - wet * WATER * BASE * level / 2
        about_toe = WEIGHT * (BASE - CENTROID) - push - wet * WATER * BASE**2 * level / 3
        return about_toe - normal * arm

    return brentq(moment, 5, 15)


def integral(x, *factors):
    """Integral along the joint of a product of columns, linear between nodes (Simpson: exact)."""
    ends = np.prod(factors, axis=0)
    middle = np.prod([(f[1:] + f[:-1]) / 2 for f in factors], axis=0)
    return np.sum(np.diff(x) * (ends[1:] + ends[:-1] + 4 * middle) / 6)


JUMPS_AND_STRESSES = "delta_n", "delta_t1", "sigma_n", "tau_1"


def differences(one, other, time=None, names=JUMPS_AND_STRESSES, factors=()):
    """Largest difference along the joint relative to the largest value, for each column; columns of
    other are multiplied by factors first.
    """
    a, b = one.at(time), other.at(time)
    return [
        np.abs(a[n] - dict(factors).get(n, 1) * np.interp(a["x"], b["x"], b[n])).max()
        / np.abs(a[n]).max()
        for n in names
    ]
