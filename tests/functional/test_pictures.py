"""Pictures of a run and the process that draws them."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import damjoint as dj
import numpy as np
import pytest
from damjoint import RunError
from damjoint.input.resolve import load
from damjoint.mesh.body import Body
from damjoint.pictures import run_picture as pictures
from damjoint.pictures.drawing import runs_of, widen
from damjoint.pictures.drawing_process import DrawingProcess, joined
from damjoint.pictures.scene import state_label, water_surface
from damjoint.statics import gravity
from damjoint.studies import critical_picture
from damjoint.studies.critical_value import CriticalValue
from damjoint.studies.quake_picture import draw_strength
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.table import Table as MplTable
from matplotlib.text import Text
from numpy.testing import assert_allclose
from PIL import Image
from scipy.integrate import trapezoid

COARSE = {"n_joint": 10, "h_dam": 12, "h_found": 60}
#: Cases of different legends: silt, drains, earthquake, tailwater; overturning, softening; closed;
#: uniform pressure; flow.
CASES = {
    "sloping": ("sloping", {**COARSE, "order": 1}),
    "overturning": ("dam", {**COARSE, "dam_base": 22, "law": "bond"}),
    "closed": ("dam", {**COARSE, "levels": [12]}),
    "k": ("k", {"n_joint": 10, "h_dam": 3, "h_found": 4}),
    "flow": ("e", {"n_joint": 10, "h_dam": 3, "h_found": 4}),
}
#: A page A4 across, over its height, with margins.
PAGE = (297 - 20) / (210 - 20)


@pytest.fixture(scope="module")
def runs():
    """The run of one of CASES."""

    @cache
    def run(name):
        source, settings = CASES[name]
        return dj.run(dj.case(source, **settings))

    return run


@pytest.fixture(scope="module")
def figures(runs):
    """The picture of one of CASES."""
    return cache(lambda name: runs(name).plot())


@pytest.mark.heavy
@pytest.mark.parametrize("name", CASES)
def test_a_picture_fits_a_page_and_nothing_is_clipped(figures, name):
    figure = figures(name)
    width, height = figure.get_size_inches()
    assert width / height == pytest.approx(PAGE, rel=0.05)
    assert len(figure.findobj(Axes)) >= 7 and len(figure.findobj(Legend)) >= 5
    assert_nothing_is_clipped(figure)


@pytest.mark.heavy
@pytest.mark.parametrize("name", CASES)
def test_nothing_is_clipped_in_half_a_page(runs, name):
    """As in a report."""
    solution = runs(name).solution
    for draw in (pictures.draw_dam, pictures.draw_joint):
        figure = pictures.figure_of(5.2, 4.5)
        draw(figure, solution, pictures.shown_time(solution.result))
        assert_nothing_is_clipped(figure)


def assert_nothing_is_clipped(figure):
    """Axes with their labels, legends and texts are within the figure."""
    figure.canvas.draw()
    texts = [text for part in (figure, *figure.subfigs) for text in part.texts if text.get_text()]
    for part in (*figure.findobj(Axes), *figure.findobj(Legend), *texts):
        box = part.get_tightbbox()
        assert box.x0 >= 0 and box.y0 >= 0, part
        assert box.x1 <= figure.bbox.x1 + 1 and box.y1 <= figure.bbox.y1 + 1, part


@pytest.mark.parametrize("name", CASES)
def test_lines_of_a_panel_differ_without_colors(figures, name):
    """In style of the line or marker."""
    figure = figures(name)
    for axes in figure.findobj(Axes):
        lines = [line for line in axes.get_lines() if not line.get_label().startswith("_")]
        styles = {(line.get_linestyle(), line.get_marker()) for line in lines}
        assert len(styles) == len(lines)


def test_a_joint_that_stays_closed_has_no_negative_opening():
    figure = dj.run(dj.case("dam", **COARSE, levels=[20, 30])).plot()
    (axes,) = (a for a in figure.findobj(Axes) if a.get_ylabel().startswith("largest opening"))
    assert axes.get_yticks().tolist() == [0]


@pytest.mark.heavy
def test_a_picture_in_3d(runs):
    """It fits a page upright; without fields there are no view and maps."""
    solution = dj.run(dj.case("d", n_joint=6, h_dam=3, h_found=4, levels=[6])).solution
    figure = pictures.picture(solution)
    width, height = figure.get_size_inches()
    assert 1 / PAGE < width / height < PAGE
    titles = [axes.get_title(loc="left") for axes in figure.findobj(Axes)]
    assert sum(title.startswith(("opening", "effective", "shear")) for title in titles) == 3
    assert_nothing_is_clipped(figure)
    without = pictures.picture(replace(solution, bodies={}, fields={}))
    without.canvas.draw()
    assert without.get_size_inches()[1] < height


def test_the_title_is_just_above_the_panels(figures):
    """Without a message there is no room for one."""
    heads = {name: figures(name).subfigs[0].bbox.height for name in ("closed", "overturning")}
    assert heads["closed"] < heads["overturning"]


def test_runs_of_equal_values():
    assert list(runs_of(np.array([3, 3, 0, 3, 1, 1]))) == [
        (3, 0, 2),
        (0, 2, 3),
        (3, 3, 4),
        (1, 4, 6),
    ]
    assert list(runs_of(np.array([], int))) == []


def test_the_stress_profile_of_the_gravity_method_carries_the_resultant():
    """Its integral is -N, its moment about the toe -M, cracked or not; zero in the crack."""
    for settings, level in (({"dam_base": 34}, 45), ({"dam_base": 26}, 45)):
        case = load("dam", settings, [level])
        method = gravity.at(case, 1.0, level)
        s, stress = pictures.gravity_profile(method)
        length = method.body.length
        fine = np.linspace(0, length, 200_001)
        profile = np.interp(fine, s, stress)
        assert_allclose(trapezoid(profile, fine), -method.N, rtol=1e-6)
        assert_allclose(trapezoid(profile * (length - fine), fine), -method.M, rtol=1e-5)
        assert (np.abs(profile[fine < method.crack_length - 1e-3]) == 0).all()
    assert method.crack_length > 0


def test_a_map_has_the_shape_of_the_joint():
    """Projected onto the plane in which its area is largest; a valley is no line."""
    z = np.linspace(-60, 60, 13)
    points = np.array([(x, 35 * (w / 60) ** 2, w) for w in z for x in (0.0, 30.0)])
    quads = np.array([(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(12)])
    joint = Body(points, np.arange(26), [("quad", quads)], np.arange(12), ["joint"])
    names, places = pictures.projected(joint)
    assert names == ["z", "x"]
    assert_allclose(places, points[:, [2, 0]].T)
    upright = points[:, [1, 2, 0]]  # a contraction joint, y upwards
    joint = Body(upright, np.arange(26), [("quad", quads)], np.arange(12), ["joint"])
    names, places = pictures.projected(joint)
    assert names[1] == "y"
    assert_allclose(places[1], upright[:, 1])


def test_extremes_of_a_map_do_not_set_its_scale():
    values = np.linspace(-1.0, 1.0, 1000)
    assert pictures.scale_of(values) == (-1.0, 1.0)
    values[500] = 100.0
    low, high = pictures.scale_of(values)
    assert low == -1.0 and 0.9 < high <= 1.0


@pytest.mark.parametrize("values", [np.zeros(4), np.array([-2.0, -1.0, 0.0, 5.0]), -np.arange(4.0)])
def test_a_map_of_any_values(values):
    """A thick line at zero where the sign changes; one in which nothing is open, too."""
    figure = pictures.figure_of(4, 3)
    axes = figure.subplots()
    x, y = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]).T
    shape = pictures.Triangulation(x, y, [(0, 1, 2), (0, 2, 3)])
    pictures.draw_map(axes, shape, values, "opening [mm]", True)
    figure.canvas.draw()
    thick = [c for c in axes.collections if np.max(c.get_linewidth()) > 1.2]
    assert len(thick) == (values.min() < 0 < values.max())


def test_a_view_shows_what_is_nearest_last():
    """Its axes are orthonormal; the second one points up."""
    assert_allclose(pictures.VIEW.T @ pictures.VIEW, np.eye(3), atol=1e-12)
    assert pictures.VIEW[1, 1] > 0.5 and pictures.VIEW[1, 0] == pytest.approx(0, abs=1e-12)
    assert np.linalg.det(pictures.VIEW) == pytest.approx(1)


@pytest.mark.heavy
def test_a_process_draws_the_same_picture(painted, runs, tmp_path):
    solution = runs("flow").solution
    for name in ("here", "there", "too"):
        (tmp_path / name).mkdir()
    pictures.draw(solution, tmp_path / "here")
    with DrawingProcess() as drawing:
        for name in ("there", "too"):
            drawing.send(solution, tmp_path / name)
        for _ in range(2):
            drawing.wait()
    drawn = [(tmp_path / name / "e.png").read_bytes() for name in ("here", "there", "too")]
    assert drawn[0] == drawn[1] == drawn[2]
    assert Image.open(tmp_path / "there" / "e.png").size[0] > 1200


def test_an_error_of_the_drawing_process_is_raised(runs, tmp_path):
    with DrawingProcess() as drawing:
        drawing.send(runs("flow").solution, tmp_path / "missing")
        with pytest.raises(FileNotFoundError, match="missing"):
            drawing.wait()
        os.killpg(drawing.group, signal.SIGKILL)
        drawing.send(runs("flow").solution, tmp_path)
        with pytest.raises(RunError, match="has ended"):
            drawing.wait()


@pytest.mark.heavy
def test_the_drawing_process_ends_with_its_parent():
    script = """
import time
from damjoint.pictures.drawing_process import DrawingProcess, joined
with DrawingProcess() as drawing:
    print(drawing.group, flush=True)
    time.sleep(600)
"""
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        group = int(process.stdout.readline())
        process.kill()
    end = time.monotonic() + 60
    while is_alive(group):
        assert time.monotonic() < end
        time.sleep(0.05)


def is_alive(group):
    """Whether a process of a group runs; ended ones (Z) may be listed until init removes them."""
    listed = subprocess.run(["ps", "-e", "-o", "pgid=,stat="], capture_output=True, text=True)
    rows = (line.split() for line in listed.stdout.splitlines())
    return any(int(number) == group and not state.startswith("Z") for number, state in rows)


@pytest.mark.heavy
def test_a_run_loads_neither_meshio_nor_the_plotting_library(tmp_path):
    """It writes its fields itself; the second process draws."""
    words = ["run", "c", "--set", "n_joint=10", "--out", str(tmp_path / "out")]
    tell = f"import sys; from damjoint import cli; cli.main({words})"
    tell += "; print([m for m in ('meshio', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", tell], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert (tmp_path / "out" / "c.png").exists() and (tmp_path / "out/fields/dam_t1.vtu").exists()


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["flow", "k"])
def test_two_processes_draw_the_same_picture(painted, runs, tmp_path, name):
    solution = runs(name).solution
    pictures.draw(solution, tmp_path)
    (file,) = tmp_path.glob(f"{solution.result.case.name}.png")
    whole = file.read_bytes()
    pictures.draw(solution, tmp_path, joined)
    assert file.read_bytes() == whole


def test_a_half_that_its_process_does_not_draw_is_drawn_by_the_other():
    mine, white = os.getpid(), np.full((2, 2), 255)

    def draw(half):
        if half and os.getpid() != mine:
            os._exit(1)
        return white - 100 * np.eye(2)[half]

    assert np.array_equal(joined(draw), 155 * np.ones((2, 2)))


@pytest.mark.heavy
def test_a_half_whose_process_is_killed_while_it_sends_is_drawn_by_the_other():
    mine = os.getpid()

    def draw(half):
        if not half:
            time.sleep(0.5)  # the pipe is full
            (child,) = multiprocessing.active_children()
            child.kill()
            child.join()
        return np.full((2000, 2000), 5 - half if os.getpid() == mine else 0)

    assert np.array_equal(joined(draw), np.full((2000, 2000), 4))


@pytest.mark.heavy
@pytest.mark.parametrize("sending", [False, True])
def test_a_drawing_process_that_is_killed_is_an_error(runs, tmp_path, monkeypatch, sending):
    """Also while the process of its second half sends. The next picture is drawn."""

    def killed(half):
        if half:
            return np.zeros((2000, 2000))
        time.sleep(0.5)
        return os.kill(os.getpid(), signal.SIGKILL)

    def draw(_, folder, __):
        if folder.name == "killed":
            joined(killed) if sending else killed(0)

    monkeypatch.setattr(pictures, "draw", draw)
    with DrawingProcess() as drawing:
        drawing.send(runs("flow").solution, tmp_path / "killed")
        with pytest.raises(RunError, match="the process that draws it has ended"):
            drawing.wait()
        drawing.send(runs("flow").solution, tmp_path)
        drawing.wait()


def test_the_table_of_a_run_is_printed_before_its_pictures_are_drawn(command, monkeypatch):
    def ended(_):
        raise RunError("the process that draws it has ended")

    monkeypatch.setattr(DrawingProcess, "wait", ended)
    small = "--set", "n_joint=10", "--set", "h_dam=3", "--set", "h_found=4", "--levels", "6"
    code, out, err = command("run", "c", *small)
    assert code == 1 and "has ended" in err and "c, uplift imposed: stands" in out
    assert "N' at x" in out and "K_N h/E" in out


def texts_of(figure):
    """All texts of a figure that are shown."""
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def test_a_picture_says_verdict_loads_factor_and_position(figures, runs):
    texts = texts_of(figures("sloping"))
    result = runs("sloping").solution.result
    assert texts[0].endswith("level 42 m, tailwater 4 m: stands")
    facts = "\n".join(texts)
    assert (
        "loads: weight, water 42 m, tailwater 4 m, silt 10 m, uplift drained, k_h = 0.05" in facts
    )
    (factor,) = (
        f for n, f in gravity.factors_of_state(result.case, result.last).items() if n == "SSF"
    )
    where = gravity.position(result.last["x_resultant"], result.case.joint_length)
    assert f"SSF {factor:.3g}, N' at {result.last['x_resultant']:.3g} m: {where}" in facts


def test_a_factor_below_one_of_an_equilibrium_is_explained():
    """With bond T is at most the friction under the compression and the cohesion that is left; the
    tension of the joint lowers N' alone.
    """
    case = load("dam", {"mu": 0.8, "adhesion": 2e5})
    state = {"N": 12e6, "T": 13e6, "U": 9e6, "bonded_length": 17.0, "x_resultant": 31.0}
    known = (0.8 * 12e6 + 2e5 * 17.0) / 13e6
    above, below = state_label(case, state), state_label(case, state | {"T": 14e6})
    assert f"SSF {known:.3g}" in above and "below 1" not in above
    assert " (below 1 in equilibrium: tension in the joint lowers N', but no friction)" in below
    # 0.9998, printed as 1, needs no explanation
    assert "below 1" not in state_label(case, state | {"T": 1.0002 * known * state["T"]})


def test_a_high_picture_of_a_section_has_less_rock_than_dam():
    """Of many joints; the legend, below it, has then a single column."""
    solution = dj.run(dj.case("lifts", n_joint=10, order=1)).solution
    figure = pictures.figure_of(5, 14)
    pictures.draw_dam(figure, solution, solution.result.last["time"])
    (axes,), (legend,) = figure.axes, figure.legends
    figure.draw_without_rendering()
    assert -axes.get_ylim()[0] < 45 < axes.get_ylim()[1]
    assert legend._ncols == 1
    box = legend.get_window_extent()
    assert box.y1 < axes.get_window_extent().y0 and box.x1 < figure.bbox.x1


def test_the_step_of_the_earthquake_is_marked_where_the_level_stands_twice(runs):
    """With levels 30, 42, 42 the third step; with a level that no earlier step had, none is."""
    result = runs("sloping").solution.result
    assert pictures.changes_at_a_level(result) == [(len(result.history["time"]) - 1, "k_h = 0.05")]
    rising = replace(result, history=result.history | {"level": np.array([30.0, 40.0, 42.0])})
    assert pictures.changes_at_a_level(rising) == []


def test_the_largest_opening_is_not_negative(runs):
    result = runs("closed").solution.result
    assert (result.history["max_opening"] < 0).all()
    opening, *_ = pictures.history_panels(result)
    assert_allclose(opening.lines[0][0], 0.0)


@pytest.mark.heavy
def test_several_joints_are_shown_as_equals():
    """Curves and a row of a table for each; the heading does not speak for the first one."""
    run = dj.run(dj.case("dam", **COARSE, law="friction", levels=[40], lift_heights=[15, 30]))
    figure, result = run.plot(), run.solution.result
    names = result.case.joint_names
    titles = [axes.get_title(loc="left") for axes in figure.findobj(Axes)]
    assert [titles.count(name) for name in names] == [3, 3, 3]
    (table,) = figure.findobj(MplTable)
    cells = {place: cell.get_text().get_text() for place, cell in table.get_celld().items()}
    heads = [cells[0, column].split("\n")[0] for column in range(7)]
    assert heads == ["joint", "SSF", "N' at x", "crack", "broken", "slipped", "N' in"]
    for row, own in enumerate(result.joints, 1):
        factor = gravity.factors_of_state(own.case, own.last)["SSF"]
        assert cells[row, 0] == names[row - 1] and cells[row, 1] == f"{factor:.3g}"
    assert "curves" not in texts_of(figure)[0]
    assert_nothing_is_clipped(figure)


def test_an_axis_does_not_zoom_into_the_last_digits():
    axes = pictures.figure_of(4, 3).subplots()
    axes.plot([0, 1], [45.0, 45.01])
    widen(axes.yaxis)
    low, high = axes.get_ylim()
    assert high - low == pytest.approx(0.05 * 45.01, rel=1e-2) and low < 45 < 45.01 < high
    axes.set_ylim(0, 45)
    widen(axes.yaxis)
    assert axes.get_ylim() == (0, 45)


def test_a_narrow_map_has_a_single_tick():
    """Ticks of a joint 5 m long and 0.1 m thick would overlap."""
    axes = pictures.figure_of(4, 3).subplots()
    x, y = np.array([(0, 0), (5, 0), (5, 0.1), (0, 0.1)]).T
    shape = pictures.Triangulation(x, y, [(0, 1, 2), (0, 2, 3)])
    pictures.draw_map(axes, shape, np.arange(4.0), "opening [mm]", True)
    assert axes.get_yticks().tolist() == [0.1]


def test_the_surface_of_the_reservoir_ends_at_dam_and_ground():
    """A valley 1:1 whose bottom is along x, a dam from x = 0 on: at a level of 4.7 m the water is
    9.4 m wide and ends at the dam.
    """
    x, z = np.meshgrid(np.linspace(-20, 20, 41), np.linspace(-10, 10, 41))
    points = np.column_stack([x.ravel(), np.abs(z).ravel(), z.ravel()])
    corners = np.arange(41 * 41).reshape(41, 41)
    quads = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], -1)
    ground = Body(points, np.arange(len(points)), [("quad", quads.reshape(-1, 4))], np.arange(1600))
    dam = Body(np.array([(0.0, 0, 0), (5, 0, 0)]), np.arange(2), [], np.arange(0))
    cells = water_surface({"foundation": ground, "dam": dam}, 4.7)
    corners = np.concatenate(cells)
    assert_allclose(corners[:, 1], 4.7)
    assert corners[:, 0].max() == pytest.approx(0) and corners[:, 0].min() == pytest.approx(-20)
    # its banks are straight, between the lines of the grid
    shores = [cell[np.abs(cell[:, 2]) > 4.7 - 1e-9] for cell in cells]
    assert max(np.abs(shore[:, 2]).max(initial=0) for shore in shores) == pytest.approx(4.7)
    assert sum(np.ptp(shore[:, 0]) for shore in shores if len(shore)) == pytest.approx(40)
    assert len(water_surface({"foundation": ground, "dam": dam}, -1.0)) == 0


def test_the_strength_of_a_joint_is_a_band_of_both_signs():
    """Never negative, also where T exceeds it."""
    rows = {"time": np.arange(2.0), "T": np.array([-2e6, 1e6]), "shear_reserve": [1e6, -3e6]}
    axes = pictures.figure_of(4, 3).subplots()
    draw_strength(axes, SimpleNamespace(joint=0, joint_rows=lambda _: rows))
    assert_allclose([line.get_ydata() for line in axes.get_lines()], [(3, 0), (-3, 0)])


def test_the_picture_of_a_critical_level_names_the_joint_and_all_values():
    answer = CriticalValue(
        *(50.0, "sliding", "why", "", None),
        gravity=48.0,
        gravity_joint="base",
        gravity_there=49.0,
        gravity_with={"without tension on base": 47.0},
        joint="lift 15 m",
    )
    content = critical_picture.Content(load("dam", {}, [45.0]), "level", " m", [], answer, None)
    assert critical_picture.heading(content).endswith("level 50 m, sliding on lift 15 m")
    named = {label for _, _, label in critical_picture.critical_lines(content)}
    assert named == {
        "critical 50",
        "gravity method on base 48",
        "gravity method on lift 15 m 49",
        "gravity method without tension on base 47",
    }
    axes = pictures.figure_of(4, 3).subplots()
    critical_picture.draw_levels(axes, content)
    assert [line.get_label() for line in axes.get_lines()] == ["crest 45 m"]
    # the legend is below the diagram: no curve is behind it
    figure = critical_picture.figure_of(content)
    figure.draw_without_rendering()
    (legend,), (axes,) = figure.findobj(Legend), figure.findobj(Axes)
    box = legend.get_window_extent()
    assert 0 < box.y0 < box.y1 < axes.xaxis.label.get_window_extent().y0


def test_the_crest_of_a_geometry_of_ones_own_is_in_the_picture_of_its_critical_level():
    case = load("monoliths", COARSE, [40.0])
    answer = CriticalValue(50.0, "", "", "", None)
    axes = pictures.figure_of(4, 3).subplots()
    content = critical_picture.Content(case, "level", " m", [], answer, None)
    critical_picture.draw_levels(axes, content)
    assert [line.get_label() for line in axes.get_lines()] == ["crest 45 m"]


@pytest.mark.heavy
def test_bases_speak_for_the_dam_and_all_curves_have_a_name():
    """A contraction joint slips whole while the dam stands; without water it has no curve of it."""
    run = dj.run(dj.case("monoliths", **COARSE, levels=[45.0]))
    contraction = run.solution.result.joints[2]
    assert contraction.last["slip_length"] == pytest.approx(contraction.case.joint_along)
    figure = run.plot()
    assert "base: N' " in texts_of(figure)[1] and "contraction: N' " not in texts_of(figure)[1]
    labels = {text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts()}
    assert {"total, tension > 0", "effective", "uplift"} <= labels
