"""The laws of the package along random jumps, beside their replay by the verification."""

import numpy as np
import pytest
from damjoint.input.resolve import load
from damjoint_witness.reader import read
from damjoint_witness.replay import laws

EXPONENTIAL = {"softening": "exponential"}
SETTINGS = {
    "bond": {"sigma_max": 2e5, "adhesion": 3e5, "G_f": 5.0, "G_t": 8.0},
    "brittle": {"law": "bond", "sigma_max": 0.0, "adhesion": 1e6, "G_f": 2.0, "G_t": 60.0},
    "exponential": {"law": "bond", "adhesion": 3e5, "G_f": 5.0, "G_t": 8.0} | EXPONENTIAL,
    "exponential rupture": {"law": "rupture", "G_f": 2.0} | EXPONENTIAL,
    "friction": {"adhesion": 1e5, "pena_tang": 1e9},
    "rupture": {"sigma_max": 2e5, "G_f": 2.0, "alpha": 1.0},
    "endo": {"sigma_max": 2e5, "adhesion": 2e5, "G_f": 5.0},
}


def columns_of(law, jump, variables, **others):
    """The rows of a joint's points in steps.csv after an update."""
    traction, _ = law.traction_and_tangent(jump, variables)
    same = {"joint": 1.0, "begin": 1.0, "time": 1.0, "frozen": 0.0, "earthquake": 0.0} | others
    return {
        **{name: np.full(len(jump), value) for name, value in same.items()},
        **dict(zip(("delta_n", "delta_t1", "delta_t2"), jump.T, strict=True)),
        **dict(zip(("sigma_n_eff", "tau_1", "tau_2"), traction.T, strict=True)),
        "damage": law.damage(jump, variables),
        "slip": law.slip(variables, len(jump)),
        **law.column_values(variables),
    }


def joined(blocks):
    """The rows of all updates."""
    return {column: np.concatenate([block[column] for block in blocks]) for column in blocks[0]}


def joints_of(settings):
    """The values of the joint, as the verification reads them."""
    words = [word for n, v in settings.items() for word in ("--set", f"{n}={v}")]
    return read(["run", "dam", *words, "--levels", "40"]).joints


@pytest.mark.parametrize("with_frozen", [False, True])
@pytest.mark.parametrize("name", SETTINGS)
def test_random_histories_are_replayed(name, with_frozen):
    """Also with steps that are solved with frozen damage, after which a point may slip further."""
    settings = {"law": name} | SETTINGS[name]
    law, rng = load("dam", settings, "40").law, np.random.default_rng(3)
    number, updates = 30, 25
    variables, jump = law.initial(number), np.zeros((number, 3))
    blocks = []
    for k in range(updates):
        frozen = with_frozen and k % 3 == 1
        used = law.freeze(jump, variables) if frozen else law
        jump = rng.normal(0, 1, (number, 3)) * [8e-6, 1e-5, 5e-6] + [-2e-6, 0, 0]
        variables = used.update_internal_variables(jump, variables)
        blocks.append(columns_of(law, jump, variables, update=k + 1.0, frozen=float(frozen)))
    steps, joints = joined(blocks), joints_of(settings)
    assert list(laws(steps, joints)) == []
    assert steps["slip"].max() > 0
    steps["tau_1"] = steps["tau_1"] * (1 + 1e-4)
    assert any("shear stress off" in line for line in laws(steps, joints))


def test_within_the_release_shear_is_compared_to_the_rounding_of_the_opening():
    """Over a release of 4.5e-12 m it changes the shear of a grouted joint by more than 1e-6 of the
    strength (random dam 193-8).
    """
    settings = {"law": "rupture", "sigma_max": 0.0, "grout_pressure": 1e4, "saw_thickness": 1e-6}
    law, rng = load("dam", settings, "40").law, np.random.default_rng(3)
    jump, variables, blocks = rng.uniform(1e-4, 2e-4, (30, 3)), law.initial(30), []
    for begin, end in ((0.0, 0.5), (0.5, 1.0)):  # the grout grows, by differences
        jump = jump + rng.uniform(0, 1e-4, (30, 3))
        variables = law.begin_step(variables, begin, end)
        variables = law.update_internal_variables(jump, variables)
        blocks.append(columns_of(law, jump, variables, update=2 * end, begin=begin, time=end))
    variables = law.begin_step(variables, 1.0, 2.0)
    jump = np.column_stack([law.added_thickness(variables, 30), jump[:, 1:] + 1e-4])
    jump[:, 0] += rng.uniform(0.2, 0.8, 30) * law.L_CT
    variables = law.update_internal_variables(jump, variables)
    blocks.append(columns_of(law, jump, variables, update=3.0, time=2.0))
    steps, joints = joined(blocks), joints_of(settings)
    assert list(laws(steps, joints)) == []
    steps["tau_1"] = steps["tau_1"] * (1 + 1e-6)
    assert any("shear stress off" in line for line in laws(steps, joints))
