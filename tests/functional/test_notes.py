"""Notes on a case: the same from all commands; loads that never act are refused by all of them."""

import json
from functools import partial

import pytest
from damjoint import InputError
from damjoint import library as dj
from damjoint.gui.numbers import warnings
from damjoint.input.constraints import STAGED, WORKS
from damjoint.input.parameters import independent
from damjoint.input.resolve import load, varied
from damjoint.statics.notes import notes
from quakes import smooth_record

#: A coarse dam with a law that has all works on the joint.
COARSE = "default_n_joint = 6; default_order = 1; default_h_dam = 15; default_h_found = 60;"
MINE = COARSE + 'default_law = "friction"; default_record_unit = "m/s2"; default_record_rest = 0;'
#: The commands that compute a case.
COMMANDS = {
    "run": ("run", "mine.case", "--no-fields", "--no-picture"),
    "check": ("check", "mine.case"),
    "critical": ("critical", "mine.case", "--of", "mu"),
    "sweep": ("sweep", "mine.case", "--vary", "mu=0.8,0.9", "--jobs", "1"),
    "quake": ("quake", "mine.case", "--record", "record.csv", "--no-picture"),
}
#: The functions of Python that do.
FUNCTIONS = {
    "run": lambda: dj.run("mine.case"),
    "load_steps": lambda: list(dj.load_steps("mine.case")),
    "check": lambda: dj.check(["mine.case"]),
    "critical": lambda: dj.critical("mine.case", "mu"),
    "sweep": lambda: dj.sweep("mine.case", mu=[0.8], jobs=1),
}


@pytest.fixture
def mine(tmp_path, command, no_pictures):
    """mine(text): write mine.case and a short record into the current folder."""
    smooth_record(tmp_path / "record.csv", 0.1, duration=0.05)

    def write(text):
        (tmp_path / "mine.case").write_text(MINE + text)

    return write


@pytest.mark.heavy
@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_prints_the_notes(command, mine, name):
    mine("default_rho_dam = 24; default_G_t = 500; levels() = {9};")
    _, _, err = command(*COMMANDS[name])
    unusual = "rho_dam = 24 kg per m3 is unusual (1500 to 4000); is it in another unit?"
    lines = err.splitlines()
    for note in ("G_t has no effect; it needs law = bond", unusual):
        assert lines.count(f"damjoint: mine: {note}") == 1, err


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_warns_with_the_notes(mine, name):
    mine("default_G_t = 500; levels() = {9};")
    with pytest.warns(UserWarning, match="mine: G_t has no effect; it needs law = bond") as caught:
        FUNCTIONS[name]()
    assert {warning.filename for warning in caught} == {__file__}


def test_a_sweep_prints_the_notes_on_its_rows(command, mine):
    """The first one on each parameter."""
    mine("levels() = {9};")
    words = "--vary", "G_t=500,600", "--vary", "rho_dam=24,25,2400"
    code, _, err = command("sweep", "mine.case", *words, "--jobs", "1")
    assert code == 0 and [line.split()[2] for line in err.splitlines()[:2]] == ["G_t", "rho_dam"]
    assert err.count(" is unusual ") == err.count(" has no effect") == 1


@pytest.mark.heavy
def test_notes_are_stored_and_reported(command, mine, tmp_path):
    mine("default_G_t = 500; levels() = {9};")
    note = "G_t has no effect; it needs law = bond"
    for words in (COMMANDS["run"], COMMANDS["critical"], COMMANDS["quake"]):
        command(*words, "--out", "out")
        assert json.loads((tmp_path / "out" / "run.json").read_text())["notes"] == [note]
    command("report", "out", "--to", "report.html")
    assert note in (tmp_path / "report.html").read_text()


def test_the_window_shows_the_notes(mine):
    mine("default_G_t = 500; levels() = {9};")
    with pytest.warns(UserWarning, match="G_t has no effect"):
        results = dj.run("mine.case").results
    assert "G_t has no effect; it needs law = bond" in warnings(results)


def test_a_run_prints_what_it_understood_of_a_geometry(command, tmp_path):
    words = "--set", "n_joint=6", "--set", "h_dam=15", "--set", "h_found=60", "--levels", "30"
    words = *words, "--tail-levels", "4", "--no-fields", "--no-picture"
    code, _, err = command("run", "stepped", *words)
    line = "geometry: dam 45 m high, from y = 0 to 45 m; joint 38 m from heel to toe; weight 20.5"
    assert code == 0 and err.startswith(f"damjoint: stepped: {line}") and err.count("\n") == 1
    (note,) = json.loads((tmp_path / "out" / "stepped" / "run.json").read_text())["notes"]
    assert err == f"damjoint: stepped: {note}\n" and "upstream 30 of 45 m" in note


def test_settings_of_a_preset_cause_no_note(command, mine):
    """But the user's own do, before or after it."""
    preset = 'Include "presets/usace_uplift.case"; levels() = {9};'
    mine(preset)
    assert command(*COMMANDS["run"])[2] == "" and notes(load("mine.case")) == []
    mine(preset + "levels() = {0};")  # empty: drains that never act
    assert notes(load("mine.case")) == []
    mine(preset + "default_aperture_min = 1e-4;")
    assert notes(load("mine.case")) == ["aperture_min has no effect; it needs uplift = flow"]
    mine('default_quake_uplift = "zero";' + preset)
    assert notes(load("mine.case")) == []
    mine(preset + 'default_quake_uplift = "zero";')
    assert [note.split()[0] for note in notes(load("mine.case"))] == ["quake_uplift"]


#: A value of each load, with which the dam stands.
SIZES = {
    "silt_height": 5.0,
    "ice_force": 1e4,
    "force_x": 1e3,
    "force_y": 1e3,
    "anchor_force": 1e4,
    "k_h": 0.01,
    "k_v": 0.01,
    "temperature_dam": 1.0,
    "temperature_linear": 1.0,
    "temperature_found": 1.0,
    "grout_pressure": 1e4,
    "saw_thickness": 1e-5,
}
#: A traction is a load of geometries of one's own.
LATE = [
    (n, parameter)
    for n, values in (STAGED | WORKS).items()
    for parameter in values
    if n != "traction"
]


@pytest.mark.parametrize("load_name, parameter", LATE)
def test_a_load_that_never_acts_is_refused(load_name, parameter):
    law, size = "rupture" if load_name in WORKS else "friction", SIZES[parameter]
    settings, time = {"law": law, parameter: size}, f"{load_name}_t"
    for late in (3.0, 7.0):
        with pytest.raises(InputError) as error:
            load("dam", settings | {time: late}, "6,9")
        message = str(error.value)
        assert message.startswith(f"{time} = {late:g}: must be < 3, as the loading ends at t = 2 ")
        assert f"{parameter} = {size:g}, which begins" in message
    assert notes(load("dam", settings | {time: 2.0}, "6,9")) == []
    part = f"{parameter} = {size:g} acts in part: in full at {time} = 2.5, and the loading ends at"
    (note,) = notes(load("dam", settings | {time: 2.5}, "6,9"))
    assert note == f"{part} t = 2"
    late = load("dam", {"law": law, time: 3.0}, "6,9")
    # rows of a sweep
    changes = [partial(varied, late)] + [late.changed] * (parameter in independent())
    for change in changes:
        with pytest.raises(InputError, match=f"{time} = 3"):
            change({parameter: size})


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_refuses_a_load_that_never_acts(refused, mine, name):
    mine("default_k_h = 0.1; default_quake_t = 3; levels() = {3, 6, 9};")
    message = refused(*COMMANDS[name], "--levels", "6,9")
    assert "quake_t = 3: must be < 3" in message and "k_h = 0.1" in message


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_refuses_a_load_that_never_acts(mine, name):
    mine("default_k_h = 0.1; default_quake_t = 3; levels() = {6, 9};")
    with pytest.raises(InputError, match="quake_t = 3: must be < 3"):
        FUNCTIONS[name]()


def test_a_row_of_a_sweep_in_which_a_load_never_acts_is_refused(refused, mine):
    """Its level is below the first one of the case: t = 1 is its last time."""
    mine("default_k_h = 0.1; default_quake_t = 2; levels() = {6, 9};")
    words = "sweep", "mine.case", "--jobs", "1", "--vary"
    assert "quake_t = 2: must be < 2" in refused(*words, "level=5,8")
    assert "quake_t = 3: must be < 3" in refused(*words, "quake_t=2,3")


@pytest.mark.parametrize(
    "text, note",
    [
        ('default_uplift = "drained"; default_drain_level = 9;', "drain_level = 9 m: the drains"),
        ("default_ice_force = 1e4; default_ice_level = 40;", "ice_level = 40 m is above the water"),
        ("default_silt_height = 5; default_rho_silt = 0;", "silt_height = 5: no load, by rho_silt"),
        (
            "default_temperature_found = 5; default_expansion_found = 0;",
            "temperature_found has no effect: expansion_found = 0",
        ),
        ("default_dam_height = 8;", "the highest level is above the crest, 8 m: the overflow acts"),
        ("times() = {2};", "the level 6 m at t = 1 is no load step"),
        ("times() = {1, 1.5};", "the level 9 m at t = 2 is no load step"),
    ],
)
def test_what_acts_in_part_or_not_at_all_is_noted(mine, text, note):
    mine(text + "levels() = {6, 9};")
    (found,) = notes(load("mine.case"))
    assert note in found
    mine("levels() = {6, 9};")
    assert notes(load("mine.case")) == []


@pytest.mark.parametrize(
    "settings, message",
    [
        ("mu=0.8,0.8,0.6,0.5", "mu = 0.8,0.8,0.6,0.5: must be one value, or one for each joint"),
        ("mu=0.8,0.6", "mu = 0.8,0.6: must be one value, or one for each joint"),
        ("law=friction,bond", "law = friction,bond: must be one value, or one for each joint"),
    ],
)
def test_the_list_of_the_wrong_length_is_blamed(refused, settings, message):
    """The case has right ones besides, with a value for each of the three joints."""
    line = refused("run", "monoliths", "--set", settings)
    assert message in line and "(3: upstream base, downstream base, contraction)" in line


@pytest.mark.heavy
def test_a_single_list_of_the_wrong_length_is_blamed(refused):
    """Where no other list tells the number of joints."""
    line = refused("run", "stepped", "--set", "mu=0.6,0.7")
    assert "mu = 0.6,0.7: must be one value, or one for each joint" in line and "(1: joint)" in line


@pytest.mark.parametrize("uplift, noted", [("none", True), ("imposed", False)])
def test_the_water_of_an_earthquake_needs_uplift(command, mine, uplift, noted):
    """And no seismic coefficients: the record is there."""
    mine(f'default_quake_uplift = "zero"; default_uplift = "{uplift}"; levels() = {{9}};')
    _, _, err = command(*COMMANDS["quake"])
    note = "damjoint: mine: quake_uplift has no effect; it needs uplift"
    assert ([line for line in err.splitlines() if "quake_uplift" in line] == [note]) == noted
    assert "k_h" not in err


@pytest.mark.heavy
def test_flow_in_time_that_begins_after_the_loading(command, mine, tmp_path):
    """Is steady, as the note says, and has no picture of water in time."""
    mine('default_uplift = "flow"; default_time_unit = 60; default_time_start = 5; levels() = {9};')
    code, _, err = command("run", "mine.case", "--set", "visc=1", "--out", "out")
    assert code == 0 and "time_start = 5: no water is stored, the loading ends at t = 1" in err
    assert "visc = 1 Pa s is unusual (0.0001 to 0.1); is it in another unit?" in err
    assert not list((tmp_path / "out").glob("*water*"))
