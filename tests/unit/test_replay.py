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
        traction, _ = law.traction_and_tangent(jump, variables)
        columns = {
            "joint": np.ones(number),
            "update": np.full(number, k + 1.0),
            **dict.fromkeys(("begin", "time"), np.ones(number)),
            "frozen": np.full(number, float(frozen)),
            "earthquake": np.zeros(number),
            **dict(zip(("delta_n", "delta_t1", "delta_t2"), jump.T, strict=True)),
            **dict(zip(("sigma_n_eff", "tau_1", "tau_2"), traction.T, strict=True)),
            "damage": law.damage(jump, variables),
            "slip": law.slip(variables, number),
            **law.column_values(variables),
        }
        blocks.append(columns)
    steps = {column: np.concatenate([block[column] for block in blocks]) for column in blocks[0]}
    words = [word for n, v in settings.items() for word in ("--set", f"{n}={v}")]
    joints = read(["run", "dam", *words, "--levels", "40"]).joints
    assert list(laws(steps, joints)) == []
    assert steps["slip"].max() > 0
    steps["tau_1"] = steps["tau_1"] * (1 + 1e-4)
    assert any("shear stress off" in line for line in laws(steps, joints))
