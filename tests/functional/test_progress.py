"""Progress in redirected output: lines on stderr, also while the work does not report."""

import io
import re
import threading
from contextlib import redirect_stderr

import pytest
from damjoint import progress
from damjoint.fem.memory import bulk_size, joint_size, joints_size, seconds, sizes
from damjoint.input.resolve import load
from damjoint.mesh.mesh import mesh_of
from damjoint.progress import Progress, track

SMALL = ("--set", "n_joint=10", "--set", "h_dam=15", "--set", "h_found=60")


@pytest.fixture
def frequent(monkeypatch):
    """A line every millisecond."""
    monkeypatch.setattr(progress, "INTERVAL", 1e-3)


class Lines(io.StringIO):
    """Text that is waited for."""

    def __init__(self):
        super().__init__()
        self.written = threading.Condition()

    def write(self, text):
        with self.written:
            count = super().write(text)
            self.written.notify_all()
        return count

    def wait_for(self, pattern):
        with self.written:
            assert self.written.wait_for(lambda: re.search(pattern, self.getvalue()), 60)


def test_lines_have_title_part_done_and_time(frequent):
    with redirect_stderr(Lines()) as err, Progress("work", 4) as shown:
        err.wait_for(r"^work, 0 %, 00:00")
        shown.update(3)
        err.wait_for(r"work, 75 %, 00:00")
        shown.describe("other work")
        err.wait_for(r"other work, 75 %, 00:0\d, nothing new for 00:0\d\n")
        shown.describe("work", "derivatives")
        err.wait_for(r"\nwork, 75 %, derivatives, 00:0\d")


@pytest.mark.parametrize("total, shown", [(4, r"75%"), (None, r"3")])
def test_a_bar_on_a_terminal(monkeypatch, total, shown):
    """After the delay, with what was done before."""
    monkeypatch.setattr(progress, "DELAY", 1e-3)
    with redirect_stderr(Lines()) as err:
        err.isatty = lambda: True
        with Progress("work", total, mininterval=0) as bar:
            bar.update(2)
            err.wait_for("work: ")
            bar.update(1)
            err.wait_for(shown)


def stop_after_a_line(err):
    with Progress("work"):
        err.wait_for("work")
        raise KeyboardInterrupt


def test_no_lines_after_the_end(frequent):
    before = set(threading.enumerate())
    with redirect_stderr(Lines()) as err, pytest.raises(KeyboardInterrupt):
        stop_after_a_line(err)
    for thread in set(threading.enumerate()) - before:
        thread.join(60)
        assert not thread.is_alive()


def test_no_lines_before_the_interval_or_if_not_wanted(monkeypatch):
    with redirect_stderr(Lines()) as err:
        assert list(track("abc", "letters")) == ["a", "b", "c"]
        monkeypatch.setattr(progress, "INTERVAL", 1e-3)
        before = threading.active_count()
        with Progress("work", show=False):
            assert threading.active_count() <= before
    assert not err.getvalue()


@pytest.mark.parametrize(
    "words, pattern",
    [
        (("run", "dam", *SMALL, "--no-fields", "--no-picture"), r"^dam, \d+ %, \d\d:\d\d"),
        pytest.param(
            ("critical", "dam", *SMALL),
            r"^dam: level [\d.]+ m: level [\d.]+ m, \d\d:\d\d",
            marks=pytest.mark.heavy,
        ),
        (("sweep", "dam", *SMALL, "--vary", "mu=0.5,0.6", "--jobs", "1"), r"^sweep dam, \d+ %, "),
    ],
)
def test_commands_print_lines(command, frequent, words, pattern):
    code, _, err = command(*words)
    assert code == 0 and re.search(pattern, err, re.MULTILINE), err


@pytest.mark.heavy
@pytest.mark.parametrize(
    "words",
    [
        ("run", "dam", "--no-picture"),
        ("critical", "dam"),
    ],
)
def test_before_the_first_step_the_lines_say_what_takes_the_time(command, frequent, words):
    """Sizes, also of several joints; then the steps."""
    lifts = ("--set", "lift_heights=15,30")
    code, _, err = command(*words, *SMALL, *lifts, "--levels", "20,30")
    assert code == 0
    first, *rest = [line.split(", 00:")[0] for line in err.splitlines()]
    assert first.startswith("dam, mesh and elimination of about ") and "126 of them on" in first
    assert any(not line.startswith("dam, mesh") for line in rest)


@pytest.mark.heavy
def test_the_memory_of_all_joints_is_estimated():
    """119 lifts on the mesh of a joint, as the unknowns of each are condensed."""
    lifts = tuple(45 * k / 120 for k in range(1, 120))
    case = load("dam", {"lift_heights": lifts, "n_joint": 20.0})
    assert 20 * joint_size(case) < joints_size(case) <= 120 * joint_size(case)
    assert f"{joints_size(case)} of them on the joints" in sizes(case)


def test_a_long_run_is_forecast_at_once(command, monkeypatch):
    """In the first line, which does not wait for the others; a short run has neither."""
    words = "run", "dam", "--no-picture", "--no-fields", *SMALL, "--levels", "20"
    assert command(*words)[2] == ""
    monkeypatch.setattr("damjoint.progress.DELAY", 0.0)
    monkeypatch.setattr("damjoint.fem.memory.FACTORISATION", 1.0)  # of a machine of long ago
    code, _, err = command(*words)
    forecast = r"dam, mesh .* on the joints, about \d+:\d\d:\d\d in all.*\n"
    assert code == 0 and re.fullmatch(forecast, err)


def test_the_forecast_grows_with_bodies_joints_and_steps():
    """By the measured rows of `damjoint bench`: 1.07e6 unknowns in 2D take 26 s; the matrices of 8
    joints of 202 unknowns, 0.87 s more than their bodies.
    """
    lifts = {"lift_heights": tuple(45 * k / 8 for k in range(1, 8))}
    plain, of_lifts = load("dam", {}), load("dam", lifts)
    fine = load("dam", {"h_dam": 0.3, "h_found": 0.6})
    scale = bulk_size(fine) / 1.07e6
    assert seconds(fine) == pytest.approx(26 * scale**1.12, rel=0.5)
    bodies = seconds(plain) * (bulk_size(of_lifts) / bulk_size(plain)) ** 1.12
    assert 0.5 < (seconds(of_lifts) - bodies) / (joints_size(of_lifts) / 1616) ** 3 < 2.5
    assert seconds(load("dam", lifts, steps=50)) > 1.1 * seconds(of_lifts)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"dam_base": 4e4},
        {"found_side": 1e3},
        {"found_depth": 2e3},
        {"dim": 3.0, "n_layers": 2.0, "n_joint": 30.0},
        {"dim": 3.0, "mesh_pattern": "free", "order": 1.0, "n_layers": 20.0, "n_joint": 30.0}
        | {"thickness": 25.0, "h_dam": 5.0, "h_found": 12.0},
    ],
)
def test_the_unknowns_of_the_bodies_are_forecast(settings):
    """Of the mesh, within a factor of five: also where the joint's elements are longer than a body
    is high, in a large foundation, and in a free mesh in 3D, coarser across the valley far from it.
    """
    case = load("dam", settings)
    dim = case["dim"]
    of_mesh = dim * mesh_of(case).nodes * case["order"] ** dim  # of the corners
    assert 1 / 5 < bulk_size(case) / of_mesh < 5
