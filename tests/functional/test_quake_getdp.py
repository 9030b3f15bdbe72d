"""An earthquake by the reference GetDP model against the condensed engine."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from damjoint import InputError, data
from damjoint.dynamics import impact
from damjoint.dynamics.history import QuakeHistory
from damjoint.engines.getdp import quake as engine
from damjoint.engines.getdp.process import find_getdp
from damjoint.input.resolve import load
from damjoint.post import folder
from damjoint.studies import quake_getdp
from quakes import DAM, earthquake, smooth_record, write_record
from variants import further

SHORT = DAM | {"record_rest": 0.0, "dt": 0.005}
BOND = {"law": "bond", "sigma_max": 2e5, "G_f": 100.0, "G_t": 1000.0, "adhesion": 3e5}
ENDO = {"law": "endo", "sigma_max": 2e5, "adhesion": 1.2 * 0.8 * 2e5, "G_f": 100.0}
SOLID = {"dim": 3.0, "thickness": 7.0, "hold_z": 1.0, "mesh_pattern": "split"}
SOLID |= {"n_joint": 6.0, "h_dam": 15.0, "h_found": 45.0}
BATTER = {"batter": 4.0, "batter_height": 20.0}
DRAINS = {"drains": 1.0, "drain_x": 5.0}
SCENES = {"bond": BOND, "rupture": {"law": "rupture", "sigma_max": 2e5}}
#: Further laws, meshes, water, damping, sections; and steps that are halved.
MORE = {
    "friction": {},
    "endo": ENDO,
    "order 2": {"order": 2.0},
    "quadrangles of order 2": {"order": 2.0, "mesh_pattern": "regular"},
    "dry": {"uplift": "none", "added_mass": 0.0},
    "flow": {"uplift": "flow"},
    "flow, unchanged": {"uplift": "flow", "quake_uplift": "unchanged"},
    "no uplift in the crack": {"quake_uplift": "zero"},
    "flow, none in the crack": {"uplift": "flow", "quake_uplift": "zero"},
    "rupture, none in the crack": {"law": "rupture", "sigma_max": 2e5, "quake_uplift": "zero"},
    "drains, none in the crack": {"uplift": "cracked", "quake_uplift": "zero"} | DRAINS | BOND,
    "drains, flow": {"uplift": "flow"} | DRAINS,
    "waterstop": {"uplift": "waterstop", "waterstop": 5.2},
    "dashpots": {"joint_damping_n": 1e8, "joint_damping_t": 5e7},
    "dashpots, rupture": {"law": "rupture", "sigma_max": 2e5, "joint_damping_n": 1e8},
    "cracked bond": {"uplift": "cracked"} | BOND,
    "Rayleigh, Newmark": {"damping_mass": 1.0, "hht_alpha": 0.0},
    "Rayleigh with the water": {"damping_mass": 2.0},
    "Zangar, batter": {"added_mass": 2.0, "hht_alpha": -0.3} | BATTER,
    "sloping lift": {"joint_height": 10.0, "joint_slope": 3.0} | BATTER,
    "halved": {"dt": 0.02, "damping": 0.0, "sigma_max": 2e5, "G_f": 20.0, "G_t": 50.0}
    | {"law": "bond", "adhesion": 2e5, "record_component": "horizontal"},
    "solid": SOLID,
    "three joints": {
        "lift_heights": (15.0, 30.0),
        "mu": (1.2, 0.7, 0.9),
        "law": ("bond", "friction", "rupture"),
    },
}


def both(tmp_path, settings, levels="30", name="dam"):
    """quake.csv of the reference GetDP model and of the condensed engine, and the latter."""
    times = np.arange(0, 0.2001, max(settings.get("dt", 0.0), 0.005))
    wave = 5 * np.sin(np.pi * times / 0.2) ** 2 * np.sin(10 * np.pi * times)
    record = write_record(tmp_path / "r.csv", times, wave, -0.7 * wave)
    quake = earthquake(record, SHORT | settings, levels, name)
    history = QuakeHistory.of(quake)
    for step in quake.steps():
        history.add(quake, step)
    found = engine.solve(quake.case, quake.record, quake.damping, quake.dt, lambda _: None)
    assert found.error is None and found.stands is not None
    return found.rows, history.table, quake


def agree(rows, expected):
    """Assert equal rows: slips to 1e-5 of the largest one, other columns of their largest value."""
    assert len(rows["time"]) == len(expected["time"])
    assert set(engine.ROWS + engine.ROWS_OF_JOINTS) <= set(rows) <= set(expected)
    slips = [name for name in rows if name.startswith("slip")]
    size = max(np.abs(expected[name]).max() for name in slips)
    for name in set(rows) - {"iterations", "residual"}:
        scale = size if name in slips else np.abs(expected[name]).max()
        if np.isinf(scale):
            assert (rows[name] == expected[name]).all()
        else:
            assert rows[name] == pytest.approx(expected[name], rel=0, abs=1e-5 * scale), name


@pytest.mark.parametrize("scene", further(1, SCENES))
def test_slip_agrees_with_the_condensed_engine(tmp_path, scene):
    rows, expected, _ = both(tmp_path, SCENES[scene])
    agree(rows, expected)
    assert np.abs(expected["slip_mean"]).max() > 1e-4 and expected["open_length"].max() > 10


@pytest.mark.heavy
@pytest.mark.parametrize("added_mass", [0.0, 1.0])
def test_a_geometry_of_its_own_agrees_with_the_condensed_engine(tmp_path, added_mass):
    """Water up to a node. Its mass is not corrected in GetDP on such a face: motion and forces
    agree to 5e-3 of their largest value, with elements of 15 m.
    """
    own = {"h_dam": 15.0, "h_found": 45.0, "uplift": "none", "added_mass": added_mass}
    rows, expected, _ = both(tmp_path, own, "45", "monoliths")
    if added_mass:
        for name in ("crest_ux", "N", "T", "slip_mean"):
            size = np.abs(expected[name]).max()
            assert rows[name] == pytest.approx(expected[name], rel=0, abs=5e-3 * size), name
    else:
        agree(rows, expected)
    assert np.abs(expected["slip_mean"]).max() > 1e-4


@pytest.mark.heavy
def test_an_earthquake_of_a_broken_joint_is_refused(tmp_path):
    """Heel and toe move across and along the chord in GetDP, in the joint's frame elsewhere."""
    with pytest.raises(InputError, match="must be straight"):
        both(tmp_path, {"h_dam": 15.0, "h_found": 45.0}, "30,40,40", "stepped")


@pytest.mark.heavy
@pytest.mark.parametrize("scene", MORE)
def test_further_scenes_agree_with_the_condensed_engine(tmp_path, scene):
    levels = "40" if scene == "halved" else "30"
    rows, expected, quake = both(tmp_path, MORE[scene], levels)
    agree(rows, expected)
    assert np.abs(expected["slip_mean"]).max() > 1e-4
    assert quake.halvings == (1 if scene == "halved" else 0)


# -- the command


@pytest.fixture
def case_file(tmp_path):
    """A case with a record beside it."""
    smooth_record(tmp_path / "wave.csv", 5.0, duration=0.2)
    path = tmp_path / "my.case"
    lines = [
        f'default_{n} = "{v}";' if isinstance(v, str) else f"default_{n} = {v};"
        for n, v in SHORT.items()
    ]
    path.write_text(
        "\n".join(['title = "wave"; record = "wave.csv"; levels() = {20, 30};', *lines, ""])
    )
    return path


@pytest.mark.heavy
def test_the_command_writes_the_tables_of_both_engines(command, case_file, monkeypatch):
    """quake.csv, and the static states before and after the earthquake; the dam lands once, and the
    step of an impact is not halved by GetDP.
    """
    tables = []
    monkeypatch.setattr(impact, "MOST_CHANGE", np.inf)
    for name in "getdp", "condensed":
        words = "--engine", name, "--out", name, "--no-picture", "--set", "record_rest=0.7"
        code, out, _ = command("quake", case_file, *words)
        assert code == 0 and "residual slip" in out and "180 steps" in out
        info = json.loads(Path(name, "run.json").read_text())
        assert (info["engine"], info["state"], info["verdict"]) == (name, "complete", "stands")
        assert info["commit"] and "cores" in info["machine"] and info["peak_memory_mb"] > 10
        files = "quake", "history", "joint"
        tables.append([np.genfromtxt(f"{name}/{f}.csv", delimiter=",", names=True) for f in files])
        tables[-1].append(info["quake"])
    (rows, history, joint, found), (expected, last, nodes, wanted) = tables
    agree(*({n: t[n] for n in t.dtype.names} for t in (rows, expected)))
    assert history["time"].tolist() == last["time"].tolist() == [1, 2, 3]
    for name in "crest_ux", "N", "T", "M":
        assert history[name] == pytest.approx(last[name], rel=1e-6)
    assert joint["time"].tolist() == nodes["time"].tolist()
    size = np.abs(nodes["delta_t1"]).max()
    assert joint["delta_t1"] == pytest.approx(nodes["delta_t1"], abs=1e-6 * size)
    for name in "frequencies", "modes", "damping", "duration", "dt", "steps", "halvings", "notes":
        assert found[name] == wanted[name]
    assert found["residual"]["slip"] == pytest.approx(wanted["residual"]["slip"], rel=1e-5)
    assert command("report", "getdp")[0] == 0
    assert "earthquake wave.csv, " in Path("report.html").read_text()


@pytest.mark.parametrize(
    "options, message",
    [
        (
            ["--set", "face_load=uniform"],
            "face_load = uniform: must be hydrostatic for an earthquake",
        ),
        (
            ["--set", "rock_mass=1", "--set", "rho_found=2600"],
            "rock_mass = 1: must be 0 for an earthquake with engine = getdp",
        ),
        (
            ["--set", "time_integration=published"],
            "time_integration = published: must be HHT for an earthquake with engine = getdp",
        ),
        (["--set", "k_h=0.1"], "k_h = 0.1: must be 0 for damjoint quake"),
        (["--fields"], "--fields: must not be given with --engine getdp"),
        (["--engine", "fast"], "engine = fast: must be one of auto, condensed, getdp"),
    ],
)
def test_what_the_model_can_not_compute_is_one_line(refused, case_file, options, message):
    assert message in refused("quake", case_file, "--engine", "getdp", *options)


def test_what_a_run_leaves_out_is_said_before_it(case_file, tmp_path):
    """The picture; and that an interrupted run starts again."""
    case = load(str(case_file))
    assert list(quake_getdp.omitted_files(tmp_path, False)) == []
    (picture,) = quake_getdp.omitted_files(tmp_path, True)
    assert "--engine getdp draws no picture" in picture
    folder.write_state(case.name, tmp_path / "out" / folder.RECORD, "interrupted")
    again, _ = quake_getdp.omitted_files(tmp_path / "out", True)
    assert again.endswith("--engine getdp starts an interrupted earthquake again")


@pytest.mark.heavy
def test_a_dam_without_static_equilibrium_is_a_failed_run(command, case_file):
    code, _, err = command("quake", case_file, "--engine", "getdp", "--set", "mu=0.1")
    assert code == 1 and "static loads have no equilibrium" in err
    assert json.loads(Path("out/my_quake/run.json").read_text())["state"] == "failed"


@pytest.mark.heavy
def test_an_earthquake_without_python(tmp_path):
    """A .pro file with record, damping and time step as reference/usage.md describes it."""
    times = np.arange(0, 0.2001, 0.005)
    wave = 5 * np.sin(np.pi * times / 0.2) ** 2 * np.sin(10 * np.pi * times)
    quake = earthquake(write_record(tmp_path / "r.csv", times, wave), SHORT | BOND, "30")
    expected = engine.solve(quake.case, quake.record, quake.damping, quake.dt, lambda _: None)
    for name in ("geo", "pro"):
        shutil.copytree(data(name), tmp_path / name)
    values = "".join(
        f'default_{name} = "{v}";\n' if isinstance(v, str) else f"default_{name} = {v!r};\n"
        for name, v in (SHORT | BOND | {"dt": float(quake.dt)}).items()
    )
    pairs = np.column_stack([quake.record.times, quake.record.acceleration[:, 0]]).ravel()
    (tmp_path / "own.case").write_text(values + "levels() = {30};\n")
    (tmp_path / "own.geo").write_text('Include "own.case";\nInclude "geo/dam.geo";\n')
    (tmp_path / "own.pro").write_text(
        'Include "own.case";\n'
        f"record_x() = {{{', '.join(map(repr, pairs.tolist()))}}};\n"
        f"record_y() = {{0, 0, {float(quake.record.times[-1])!r}, 0}};\n"
        f"damping_a0 = {float(quake.damping.a0)!r};\ndamping_a1 = {float(quake.damping.a1)!r};\n"
        'out_dir = StrCat[CurrentDirectory, "res/"];\nInclude "pro/damjoint.pro";\n'
    )
    gmsh = "import sys, gmsh; gmsh.initialize(['gmsh', *sys.argv[1:]], run=True)"
    mesh = [sys.executable, "-c", gmsh, "own.geo", "-2", "-o", "own.msh"]
    subprocess.run(mesh, cwd=tmp_path, check=True, capture_output=True)
    solve = [find_getdp(), "own.pro", "-msh", "own.msh", "-solve", "Fill", "-v", "2"]
    done = subprocess.run(solve, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert "Error" not in done.stdout + done.stderr
    rows = engine.read_rows(quake.case, tmp_path / "res")
    agree(rows, expected.rows)
