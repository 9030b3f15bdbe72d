"""Faults of the environment: signals, full disks, links, a second run in the same folder."""

import argparse
import contextlib
import fcntl
import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import numpy as np
import pytest
from damjoint import RunError
from damjoint.csr import CsrMatrix
from damjoint.engines import engine_of
from damjoint.fem import factor, memory
from damjoint.input.parameters import interruptible, start_gmsh
from damjoint.processes import ProcessKilled, process_pool
from damjoint.storage import atomic_write, locked_folder
from PIL import Image
from processes import without_progress
from scipy import sparse

BARE = ("--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4", "--no-fields")
RUN = ("run", "c", *BARE, "--no-picture", "--levels", "6")


def wait_for(what, seconds=120):
    """Wait until a condition is true."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_sigterm_ends_a_run_as_ctrl_c_does(tmp_path):
    """Its GetDP is ended, too, and no temporary file remains."""
    fake, record = tmp_path / "getdp", tmp_path / "out" / "run.json"
    version = '[ "$1" = --version ] && echo 3.2.0 && exit'
    fake.write_text(f"#!/bin/sh\n{version}\ntouch begun\nexec sleep 600\n")
    fake.chmod(0o755)
    (tmp_path / "tmp").mkdir()
    process = subprocess.Popen(
        [sys.executable, "-m", "damjoint", *RUN, "--engine", "getdp", "--out", record.parent],
        env=os.environ | {"GETDP": str(fake), "TMPDIR": str(tmp_path / "tmp")},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(lambda: list((tmp_path / "tmp").glob("*/*/begun")))
    process.send_signal(signal.SIGTERM)
    _, error = process.communicate(timeout=120)
    assert process.returncode == 130 and len(without_progress(error).splitlines()) == 1
    assert json.loads(record.read_text())["state"] == "interrupted"
    assert not any((tmp_path / "tmp").iterdir())
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


@pytest.mark.heavy
def test_an_interrupt_does_not_wait_for_a_long_mesh():
    """Nor is Gmsh used again before it is made."""
    made, handler = [], signal.signal(signal.SIGALRM, signal.default_int_handler)

    def long_mesh():
        hashlib.pbkdf2_hmac("sha256", b"", b"", 600_000)  # in C: no signal is handled in it
        made.append(True)

    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        with pytest.raises(KeyboardInterrupt):
            interruptible(long_mesh)
    finally:
        signal.signal(signal.SIGALRM, handler)
    assert not made
    start_gmsh()
    assert made


@pytest.mark.parametrize("words", [RUN, ("critical", "c"), ("check", "c"), ("plot", "out/c")])
def test_an_interrupt_that_leaves_no_result_does_not_say_so(command, monkeypatch, words):
    """Before the first step, also if an earlier command of the process has saved some; one line."""
    assert command(*RUN)[0] == 0

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("damjoint.solver.model.Model.start", interrupted)
    monkeypatch.setattr("damjoint.pictures.run_picture.draw", interrupted)
    code, _, err = command(*words)
    assert (code, err) == (130, "damjoint: interrupted\n")


def test_an_interrupt_that_waits_for_an_import_is_no_failure(command, monkeypatch):
    """Its signal has also ended a process of a pool."""

    def killed(*_, **__):
        signal.signal(signal.SIGALRM, signal.SIG_IGN)
        signal.setitimer(signal.ITIMER_REAL, 60)
        raise ProcessKilled

    monkeypatch.setattr("damjoint.solver.model.Model.start", killed)
    try:
        code, _, err = command(*RUN)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    assert (code, err) == (130, "damjoint: interrupted\n")


def test_worker_processes_end_with_their_parent(tmp_path):
    script = """
import os, time
from damjoint.processes import ProcessKilled, process_pool
with process_pool(2) as pool:
    print(*{pool.submit(os.getppid).result(), *pool._processes}, flush=True)
    time.sleep(600)
"""
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True) as process:
        assert len(process.stdout.readline().split()) == 3
        process.kill()
    # ended processes (Z) may be listed until init has removed them
    alive = ["ps", "-o", "stat=", "--sid", str(process.pid)]
    wait_for(lambda: not subprocess.run(alive, capture_output=True).stdout.strip(b" Z\n"))


def test_an_interrupt_where_python_ignores_exceptions_is_sent_again():
    """As around a fork: the command would go on."""
    script = """
import os, signal, time
from damjoint import __main__
class Deleted:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)
__main__.handle_signals()
try:
    Deleted()
    time.sleep(60)
    print("lost")
except KeyboardInterrupt:
    print("interrupted")
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("interrupted\n", "")


def test_a_fork_of_a_command_ends_by_an_interrupt_without_words():
    """Also before it has handlers of its own."""
    script = """
import os, signal, time
from damjoint import __main__
__main__.handle_signals()
begun, begin = os.pipe()
child = os.fork()
if not child:
    os.write(begin, b"1")
    time.sleep(60)
    os._exit(0)
os.read(begun, 1)
os.kill(child, signal.SIGTERM)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("130\n", "")


def test_a_pool_does_not_wait_for_its_tasks_if_its_caller_is_interrupted():

    def interrupted():
        with process_pool(1) as pool:
            pool.submit(time.sleep, 60)
            raise KeyboardInterrupt

    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - start < 30


@pytest.mark.heavy
@pytest.mark.parametrize("after", [0.5, 1.0, 5.0])
def test_stress_ends_at_once_by_a_signal_to_its_group(tmp_path, after):
    """With its commands; no folder of them remains."""
    words = "stress", "40", "--jobs", "2", "--out", str(tmp_path / "s.csv")
    (tmp_path / "tmp").mkdir()
    process = subprocess.Popen(
        [sys.executable, "-m", "damjoint", *words],
        env=os.environ | {"TMPDIR": str(tmp_path / "tmp")},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    time.sleep(after)
    os.killpg(process.pid, signal.SIGTERM)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130 and len(without_progress(error).splitlines()) == 1
    assert not any((tmp_path / "tmp").iterdir())


@pytest.mark.heavy
def test_a_backend_that_matplotlib_does_not_know_is_not_used(tmp_path):
    """Pictures are files."""
    done = subprocess.run(
        [sys.executable, "-m", "damjoint", *RUN[:-3], "--levels", "6"],
        cwd=tmp_path,
        env=os.environ | {"MPLBACKEND": "nonsense"},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, without_progress(done.stderr)) == (0, "")
    assert np.ptp(np.asarray(Image.open(tmp_path / "out/c/c.png"))) > 100


def test_a_full_disk_leaves_no_partial_file(command, tmp_path, monkeypatch):
    """One line with the name of the file; the next run succeeds."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def full(*words):
        """Once the input is read, which takes a larger temporary file."""
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
        return engine_of(*words)

    try:
        with monkeypatch.context() as patch:
            patch.setattr("damjoint.runner.engine_of", full)
            code, _, err = command(*RUN, "--levels", "3,4,5,6")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert code == 1 and "File too large: 'out/c/" in err and len(err.splitlines()) == 1
    assert not list((tmp_path / "out" / "c").glob(".*"))
    assert command(*RUN)[0] == 0


def test_an_interrupted_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("old")
    with contextlib.suppress(KeyboardInterrupt), atomic_write(path) as part:
        part.write_text("ne")
        raise KeyboardInterrupt
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_nothing_is_written_through_links_in_the_output_folder(command, tmp_path):
    (tmp_path / "mine.csv").write_text("mine")
    out = tmp_path / "out" / "c"
    out.mkdir(parents=True)
    (out / "joint.csv").symlink_to(tmp_path / "mine.csv")
    assert command(*RUN)[0] == 0
    assert (tmp_path / "mine.csv").read_text() == "mine" and not (out / "joint.csv").is_symlink()
    (out / "fields").symlink_to(tmp_path)
    code, _, err = command(*RUN)
    assert code == 2 and "fields must be a folder, and not a link" in err


def test_nothing_is_written_through_a_link_at_the_temporary_file(tmp_path):
    (tmp_path / "mine.csv").write_text("mine")
    (tmp_path / ".part.table.csv").symlink_to(tmp_path / "mine.csv")
    with atomic_write(tmp_path / "table.csv") as part:
        part.write_text("new")
    assert (tmp_path / "mine.csv").read_text() == "mine"
    assert (tmp_path / "table.csv").read_text() == "new"


def test_a_second_run_in_a_locked_folder_is_refused(command, tmp_path):
    assert command(*RUN)[0] == 0
    before = {p: p.read_bytes() for p in (tmp_path / "out" / "c").iterdir()}
    with locked_folder(tmp_path / "out" / "c"):
        code, _, err = command(*RUN)
    assert code == 2 and "out/c: another damjoint is writing to it" in err
    assert {p: p.read_bytes() for p in (tmp_path / "out" / "c").iterdir()} == before
    assert command(*RUN)[0] == 0


@pytest.mark.heavy
def test_a_second_sweep_into_a_locked_file_is_refused(command, tmp_path):
    words = "sweep", "c", *BARE[:-1], "--vary", "mu=0.5", "--out", "mu.csv"
    with (tmp_path / "mu.csv").open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        code, _, err = command(*words)
        assert code == 2 and "mu.csv: another damjoint is writing to it" in err
    assert command(*words)[0] == 0


@pytest.mark.heavy
def test_a_damaged_run_json_is_reported(command, refused, tmp_path):
    assert command(*RUN)[0] == 0
    file = tmp_path / "out" / "c" / "run.json"
    whole_one = json.loads(file.read_text())
    for changed in ({"mesh": None}, {"hints": None}, {"wall_seconds": {"solve": "long"}}):
        file.write_text(json.dumps(whole_one | changed))
        assert "out = out/c: damaged" in refused("report", "out/c")


NESTED = "[" * 100_000 + "]" * 100_000


@pytest.mark.heavy
@pytest.mark.parametrize(
    "old, new",
    [
        ("{", NESTED),
        ('"state": "complete"', f'"state": {NESTED}'),
        ('"wall_seconds": {', '"wall_seconds": [1], "seconds": {'),
        ('"versions": {', '"versions": ["damjoint"], "numbers": {'),
        ('"title": "', '"title": "\\ud800'),
        ('"case": "c"', '"case": ".."'),
        ('"case": "c"', '"case": ["c"]'),
        ('"levels": [', '"levels": [1e400, '),
        *(('"case": "c"', f'"case": "{name}"') for name in ("\\ud800", "c\\u0000")),
    ],
)
def test_an_invalid_value_in_run_json_is_reported(command, tmp_path, old, new):
    """In one line; a new run may overwrite the folder."""
    assert command(*RUN)[0] == 0
    file = tmp_path / "out" / "c" / "run.json"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    for words in (("report", "out/c"), ("plot", "out/c")):
        code, _, err = command(*words)
        drawn = words[0] == "plot" and "seconds" in new  # a value that is not used
        assert code == (0 if drawn else 2) and len(err.splitlines()) == (0 if drawn else 1)
    assert command(*RUN)[0] == 0
    assert command("plot", "out/c")[0] == 0


@pytest.fixture
def alarm():
    """Interrupts what waits for ever."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("waits for ever"))
    signal.alarm(100)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("name", ["run.json", "history.csv"])
def test_a_pipe_in_place_of_a_file_is_not_read(command, refused, tmp_path, alarm, name):
    assert command(*RUN)[0] == 0
    (tmp_path / "out" / "c" / name).unlink()
    os.mkfifo(tmp_path / "out" / "c" / name)
    for words in (("report", "out/c"), ("plot", "out/c"), RUN):
        assert name in refused(*words)


@pytest.mark.parametrize("table", ["joint.csv", "history.csv"])
def test_an_infinite_number_in_a_table_is_reported(command, refused, tmp_path, table):
    assert command(*RUN)[0] == 0
    file = tmp_path / "out" / "c" / table
    head, *rows = file.read_text().splitlines()
    cells = rows[-1].split(",")
    cells[head.split(",").index("level")] = "1e400"
    file.write_text("\n".join([head, *rows[:-1], ",".join(cells)]) + "\n")
    for word in ("report", "plot"):
        line = refused(word, "out/c")
        assert table in line and "infinite" in line


@pytest.mark.parametrize("to", ["/", ".", "out/c/run.json", "out/c/../c/joint.csv", "out/c/c.png"])
def test_a_report_does_not_replace_a_folder_or_a_file_of_a_run(command, refused, tmp_path, to):
    assert command(*RUN)[0] == 0
    before = {p: p.read_bytes() for p in (tmp_path / "out" / "c").iterdir()}
    assert f"to = {to}" in refused("report", "out/c", "--to", to)
    assert {p: p.read_bytes() for p in (tmp_path / "out" / "c").iterdir()} == before


@pytest.mark.heavy
def test_output_in_a_locale_without_the_letters_of_the_units(tmp_path):
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(
        [sys.executable, "-m", "damjoint", *RUN, "--set", "E=1e10"],
        cwd=tmp_path,
        env=os.environ | locale,
        capture_output=True,
    )
    assert (done.returncode, done.stderr) == (0, b"") and b"[?m]" in done.stdout


@pytest.mark.parametrize("damage", [b"half", b"\xff", b'"', b"1,2"])
@pytest.mark.usefixtures("no_pictures")
def test_a_damaged_sweep_is_reported_and_not_changed(command, refused, tmp_path, damage):
    """With the line of the damage."""
    words = "sweep", "c", *BARE[:-1], "--vary", "mu=0.5", "--out", "mu.csv"
    assert command(*words)[0] == 0
    file = tmp_path / "mu.csv"
    head, row = file.read_bytes().splitlines()
    cells = row.split(b",")
    cells[2] = damage  # the column time
    file.write_bytes(damaged := head + b"\n" + b",".join(cells) + b"\n")
    assert "mu.csv: line 2 is damaged" in refused(*words)
    assert file.read_bytes() == damaged


def limited(address_space, *words, cwd):
    """Run the command with limited address space [bytes]; exit code and standard error."""
    bound = lambda: resource.setrlimit(resource.RLIMIT_AS, (address_space, address_space))
    done = subprocess.run(
        [sys.executable, "-m", "damjoint", *words],
        cwd=cwd,
        env=os.environ | {"DAMJOINT_CACHE": ""},
        preexec_fn=bound,
        capture_output=True,
        text=True,
        timeout=300,
    )
    return done.returncode, without_progress(done.stderr)


@pytest.mark.parametrize("megabytes", [100, 310, 410])
def test_too_little_memory_for_the_libraries_is_one_line(tmp_path, megabytes):
    """Otherwise they would crash."""
    code, err = limited(megabytes * 1_000_000, *RUN, cwd=tmp_path)
    assert code == 1 and "memory" in err and len(err.splitlines()) == 1
    assert not any(tmp_path.iterdir())


@pytest.mark.heavy
@pytest.mark.parametrize("words", [("b", "--no-picture"), ("c", *BARE, "--set", "n_joint=1500")])
def test_too_little_memory_for_the_case_is_one_line(tmp_path, words):
    """Refused before the linear algebra would wait for memory for ever."""
    code, err = limited(921_600_000, "run", *words, cwd=tmp_path)
    assert code == 1 and "memory" in err and len(err.splitlines()) == 1, err


@pytest.mark.heavy
def test_a_run_in_little_memory(tmp_path):
    assert limited(921_600_000, *RUN[:-3], "--levels", "6", cwd=tmp_path) == (0, "")


def test_a_memory_error_is_one_line(command, monkeypatch):
    def full(*_):
        raise MemoryError("no 3 GB")

    monkeypatch.setattr("damjoint.engines.condensed.solve.condensed_bodies", full)
    code, out, err = command(*RUN)
    assert (code, out) == (1, "") and "memory" in err and "no 3 GB" in err
    assert len(err.splitlines()) == 1


@pytest.mark.skipif(factor.is_slow(), reason="MUMPS")
def test_mumps_out_of_memory_is_one_line(monkeypatch):
    matrix, none = sparse.eye(3, format="csr"), np.zeros(0, int)

    def full(*words):
        words[-1]._obj.value = factor.NO_MEMORY

    with pytest.raises(MemoryError, match="3 unknowns"):
        factor.MumpsFactors(
            types.SimpleNamespace(damjoint_factorise=full), matrix, none, "3 unknowns"
        )
    for module in factor, memory:
        monkeypatch.setattr(module, "available", lambda: 0.0)
    with pytest.raises(RunError, match="3 unknowns need about"):
        factor.solve_symmetric(CsrMatrix.of_scipy(matrix), np.ones((3, 1)))


@pytest.mark.heavy
def test_a_closed_pipe_is_an_error_also_after_gmsh_has_started():
    """Gmsh sets SIGPIPE to the system's default, which ends the process without a word."""
    code = (
        "import os; from damjoint.input.parameters import start_gmsh; start_gmsh(); "
        "end, pipe = os.pipe(); os.close(end); os.write(pipe, b'0')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1 and "BrokenPipeError" in done.stderr


def test_a_getdp_run_that_exceeds_the_memory_is_refused(command, monkeypatch):
    """By an estimate before meshing, and by the mesh."""
    words = "run", "dam", "--engine", "getdp", "--levels", "30", "--no-fields", "--no-picture"
    code, _, err = command(*words, "--set", "n_joint=50000")
    assert code == 1 and "need about" in err and len(err.splitlines()) == 1
    monkeypatch.setattr("damjoint.fem.memory.available", lambda: 1e6)
    monkeypatch.setattr("damjoint.engines.getdp.solve.bulk_size", lambda _: 0)
    code, _, err = command(*words, "--set", "n_joint=20")
    assert code == 1 and "need about" in err and len(err.splitlines()) == 1


@pytest.mark.heavy
@pytest.mark.parametrize(
    "engine, streams",
    [
        ("condensed", "<&- >&- 2>&-"),
        ("condensed", "2>&-"),
        ("condensed", ">&-"),
        ("getdp", "<&- >&- 2>&-"),
        ("getdp", "2>&-"),
        ("getdp", ">&-"),
    ],
)
def test_a_run_with_closed_standard_streams(tmp_path, streams, engine):
    """As cron and services may start a command."""
    words = " ".join([*RUN, "--out", "out", "--engine", engine])
    line = f"exec {sys.executable} -m damjoint {words} {streams}"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, stdout=subprocess.PIPE)
    assert done.returncode == 0 and (b"stands" in done.stdout) == (streams == "2>&-")
    assert {"run.json", "joint.csv"} <= {path.name for path in (tmp_path / "out").iterdir()}


def test_an_interrupt_during_an_import_is_delayed(tmp_path):
    """Until the import is over; one line."""
    kill = "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n"
    (tmp_path / "argparse.py").write_text(kill + Path(argparse.__file__).read_text())
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "damjoint", *RUN],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 130 and "interrupted" in done.stderr
    assert len(done.stderr.splitlines()) == 1
