"""Random scenes verified from their files; and that the verification finds what is wrong."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from damjoint import __version__, run
from damjoint.model.case import load
from damjoint.post.tables import write_csv
from damjoint_tools import pages, stress, verification
from damjoint_tools.verification import Written, read_table, unjustified, violations

SCENES = {
    "rupture": {"law": "rupture", "uplift": "flow", "sigma_max": 1e4, "G_f": 10.0},
    "friction": {"law": "friction", "uplift": "cracked", "pena_tang": 5e9, "adhesion": 1e4},
    "bond": {"law": "bond", "uplift": "imposed"},
}
DRAINED = {"drains": 1.0, "drain_x": 6.8}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """written(law, drained): a run of that law with cracks, as the command leaves it."""
    done = {}

    def once(law, drained=False):
        if (law, drained) not in done:
            settings = SCENES[law] | {"n_joint": 20.0} | (DRAINED if drained else {})
            case = load("dam", settings, "30,44,35", "3")
            folder = tmp_path_factory.mktemp(law)
            run.run(case, folder, fields=False, picture=False, progress=False)
            done[law, drained] = Written(case, folder, 0)
        return done[law, drained]

    return once


@pytest.mark.parametrize("law, drained", [*((law, False) for law in SCENES), ("rupture", True)])
def test_what_a_run_has_written_stands_every_test(written, law, drained):
    assert violations(written(law, drained)) == []


@pytest.mark.parametrize("law", SCENES)
@pytest.mark.parametrize(
    "table, column, change, said",
    [
        ("history", "N", lambda v: v * 1.001, "N + U"),
        ("history", "T", lambda v: v * 1.001, "T ="),
        ("history", "M", lambda v: v * 1.001, "M ="),
        ("history", "level", lambda v: v + 1e-3, "not at the level"),
        ("history", "slip_length", lambda v: 1 - 0.1 * np.arange(len(v)), "slip_length falls"),
        ("joint", "p", lambda v: v * 1.01, "the integral of p"),
        ("joint", "sigma_n_eff", lambda v: v + 1e6, "tension"),
        ("joint", "sigma_n_eff", lambda v: v * 1.01, "contact"),
        ("joint", "tau_1", lambda v: v * 100 + 1e6, "shear"),
    ],
)
def test_what_is_wrong_is_found(written, tmp_path, law, table, column, change, said):
    found = violations(tampered(written(law), tmp_path, table, column, change))
    assert any(said in line for line in found), found


def tampered(whole, folder, table, column, change):
    """A run's files with a column of a table changed."""
    shutil.copytree(whole.folder, folder, dirs_exist_ok=True)
    path = folder / f"{table}.csv"
    changed = read_table(path)
    changed[column] = change(changed[column])
    write_csv(path, changed)
    return Written(whole.case, folder, 0)


def falling(column):
    """Nothing left in the last of three tables."""
    return np.where(np.arange(len(column)) < len(column) * 2 // 3, column, 0)


@pytest.mark.parametrize(
    "law, table, column, change, said",
    [
        ("rupture", "joint", "damage", falling, "damage falls"),
        ("bond", "joint", "damage", falling, "damage falls"),
        ("bond", "joint", "damage", lambda v: v + 1, "damage is out of its range"),
        ("friction", "joint", "lambda", falling, "lambda falls"),
        ("friction", "joint", "lambda", lambda v: 0.999 * v, "shear: beyond the law"),
        ("friction", "joint", "lambda", lambda v: 0.999 * v, "slip is more than lambda"),
        ("friction", "joint", "lambda", np.negative, "lambda is out of its range"),
        ("rupture", "joint", "p", lambda v: v + 1e6, "pressure above the reservoir's head"),
        ("rupture", "joint", "p", lambda v: 0 * v + 1, "pressure below the tailwater's head"),
        ("rupture", "joint", "flux", lambda v: v * np.linspace(1, 1.01, len(v)), "flux varies"),
        ("bond", "joint", "sigma_n_eff", np.negative, "contact: off"),
        ("bond", "history", "tail_level", lambda v: v + 1e-3, "not at the tailwater"),
        ("bond", "history", "time", lambda v: v[::-1], "times do not increase"),
    ],
)
def test_what_no_law_does_is_found(written, tmp_path, law, table, column, change, said):
    found = violations(tampered(written(law), tmp_path, table, column, change))
    assert any(said in line for line in found), found


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda v, s: np.where(s == s.min(), 1.01 * v, v), "flux varies"),
        (lambda v, s: np.where(s < 6.8, 0, v), "drains give"),
    ],
)
def test_drains_take_a_part_of_the_flux(written, tmp_path, change, said):
    """As much is taken in everywhere before them, and no less than leaks."""
    whole = written("rupture", drained=True)
    s = read_table(whole.folder / "joint.csv")["s"]
    found = violations(tampered(whole, tmp_path, "joint", "flux", lambda v: change(v, s)))
    assert found and all(said in line for line in found), found


def test_a_wrong_exit_code_is_found(written):
    whole = written("rupture")
    assert violations(Written(whole.case, whole.folder, 1)) == [
        "exit code 1 with state complete, verdict stands"
    ]


@pytest.mark.parametrize(
    "level, mu, said, wrong",
    [
        (30, 0.8, "sliding", "where an equilibrium is certain"),
        (44, 0.6, "sliding", ""),
        (44, 0.6, "overturning", "which the rigid block does not explain"),
    ],
)
def test_a_stop_is_laid_beside_the_rigid_block(tmp_path, level, mu, said, wrong):
    """The shear is within 40.6 m of what mu = 0.6 holds (T = mu N), the resultant well inside."""
    settings = {"law": "friction", "adhesion": 0.0, "mu": mu, "pena_tang": 0.0, "n_joint": 20.0}
    case = load("dam", settings, str(level), "3")
    run.run(case, tmp_path, fields=False, picture=False, progress=False)
    told = json.loads((tmp_path / "run.json").read_text())
    told |= {"state": "stopped", "verdict": said}
    (tmp_path / "run.json").write_text(json.dumps(told))
    found, why = unjustified(Written(case, tmp_path, 1))
    assert found == bool(wrong) and why.endswith(wrong) and bool(why) == bool(wrong)


def test_stress_is_seeded_resumed_and_has_a_page(command, monkeypatch):
    monkeypatch.setattr(stress, "PATIENCE", 60)
    code, out, _ = command("stress", 2, "--seed", 3, "--out", "s.csv")
    assert code == 0 and "0 defect; s.csv" in out
    before = Path("s.csv").read_text()
    command("stress", 2, "--seed", 3, "--out", "s.csv")
    assert Path("s.csv").read_text() == before
    rows = list(csv.DictReader(before.splitlines()))
    assert {row["scene"] for row in rows} == {"3-0", "3-1"}
    assert stress.random_scene(3, 1) == stress.random_scene(3, 1) != stress.random_scene(3, 0)
    page = pages.trust_page(Path("s.csv"))
    assert "2 random scenes" in page and stress.VERIFIED in page
    assert f"Measured with damjoint {__version__} (" in page
    assert rows[0]["date"] in page and rows[0]["machine"] in page
    # no row of other code is added to, and none gets into one page
    other = before.replace(rows[0]["code"], "of-other-code", 1)
    Path("s.csv").write_text(other)
    code, _, error = command("stress", 3, "--seed", 3, "--out", "s.csv")
    assert code == 2 and error.count("\n") == 1 and "s.csv: begun with damjoint" in error
    assert Path("s.csv").read_text() == other
    with pytest.raises(ValueError, match="figures of different versions"):
        pages.trust_page(Path("s.csv"))


@pytest.mark.heavy
def test_random_scenes(tmp_path):
    """Sixty scenes of the page's seed: each is verified, or its stop is justified."""
    rows = stress.stress(60, 7, tmp_path / "stress.csv")
    bad = [row for row in rows if row["class"] == stress.DEFECT]
    assert len(rows) == 60 and not bad, bad


def test_verification_knows_no_engine():
    assert "engines" not in Path(verification.__file__).read_text()
