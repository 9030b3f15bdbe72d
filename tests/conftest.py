"""Shared fixtures. A scene is computed once per session."""

import gc
import signal
from contextlib import contextmanager

import numpy as np
import pytest
from damjoint import runner
from damjoint.input.resolve import load
from damjoint.pictures import drawing, run_picture
from damjoint.threads import limited_threads
from matplotlib.figure import Figure
from matplotlib.text import Text


def pytest_collection_finish():
    """Search for garbage rarely, and not among the tests themselves."""
    gc.freeze()
    gc.set_threshold(50_000)


@pytest.fixture(scope="session", autouse=True)
def empty_cache(tmp_path_factory):
    """Use an empty cache instead of the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DAMJOINT_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """In the processes of the tests and in those that they start: on two cores, two processes with
    two threads each take up to five times as long.
    """
    with pytest.MonkeyPatch.context() as patch, limited_threads(1):
        for library in ("OMP", "OPENBLAS"):
            patch.setenv(f"{library}_NUM_THREADS", "1")
        yield


@pytest.fixture(scope="session", autouse=True)
def interrupts():
    """Interrupts reach the commands that tests start, also where a script runs the tests in the
    background, which makes the shell ignore them.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def solve(tmp_path_factory):
    """solve(case, levels, tail_levels, steps, **settings): results, one for each uplift."""
    done = {}

    def once(name, levels=None, tail_levels=None, steps=None, **settings):
        key = name, levels, tail_levels, steps, tuple(sorted(settings.items()))
        if key not in done:
            case = load(name, settings, levels, tail_levels, steps)
            done[key] = runner.run(
                case,
                tmp_path_factory.mktemp(case.name),
                fields=False,
                picture=False,
                progress=False,
            )
        return done[key]

    return once


def blank_pixels(figure, dpi):
    """Grey pixels of the size of a figure."""
    width, height = (round(dpi * inches) for inches in figure.get_size_inches())
    return np.full((height, width, 4), 128, np.uint8)


def blank_file(figure, file, **options):
    """A figure as an empty SVG; in another format as it is."""
    if options.get("format") != "svg":
        return PAINTERS[Figure, "savefig"](figure, file, **options)
    return file.write(b'<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>')


#: What paints pictures, and what does not.
BLANK = {
    (drawing, "pixels_of"): blank_pixels,
    (run_picture, "pixels_of"): blank_pixels,
    (Figure, "savefig"): blank_file,
}
PAINTERS = {place: getattr(*place) for place in BLANK}


@contextmanager
def painted_by(painters):
    """Pictures are painted so in this context."""
    with pytest.MonkeyPatch.context() as patch:
        for place, painter in painters.items():
            patch.setattr(*place, painter)
        yield


@pytest.fixture(scope="module", autouse=True)
def blank_pictures():
    """Pictures are composed and written but not painted, which takes longer than a small scene;
    a test that looks at them uses `painted`.
    """
    with painted_by(BLANK):
        yield


@pytest.fixture(scope="session")
def painting():
    """Pictures are painted in the context painting()."""
    return lambda: painted_by(PAINTERS)


@pytest.fixture
def painted(painting):
    """Pictures are painted."""
    with painting():
        yield


@pytest.fixture
def texts_drawn(monkeypatch):
    """The texts of each picture that this process writes."""
    pictures = []
    for module in (drawing, run_picture):
        original = module.pixels_of

        def pixels_of(figure, dpi, original=original):
            pictures.append([t.get_text() for t in figure.findobj(Text) if t.get_text()])
            return original(figure, dpi)

        monkeypatch.setattr(module, "pixels_of", pixels_of)
    return pictures


@pytest.fixture
def no_pictures(monkeypatch):
    """Sweeps and checks draw no pictures, which take longer than a small scene."""
    monkeypatch.setattr("damjoint.studies.chart.draw", lambda *_: "no chart")
    monkeypatch.setattr("damjoint.studies.check_study.draw_check", lambda *_: None)


@pytest.fixture
def command(capfd, tmp_path, monkeypatch):
    """command(*words): exit code, standard output and standard error of damjoint, run in an empty
    folder, without the lines of progress that a slow machine has time to print.
    """
    from damjoint import cli

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("damjoint.progress.INTERVAL", 1e6)

    def call(*words):
        try:
            code = cli.main([str(word) for word in words])
        except SystemExit as stop:  # argparse
            code = stop.code
        return code, *capfd.readouterr()

    return call


@pytest.fixture
def refused(command, tmp_path):
    """refused(*words): the message on bad input, a line; nothing is printed or written."""

    def call(*words):
        before = sorted(tmp_path.rglob("*"))
        code, out, err = command(*words)
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert sorted(tmp_path.rglob("*")) == before
        return err

    return call
