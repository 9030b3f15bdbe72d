"""The page and the picture of a benchmark."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from damjoint.input.case import Case
from damjoint.input.resolve import load
from damjoint.post import validation
from damjoint.post.folder import COMPLETE, RECORD
from damjoint.runner import run
from damjoint.session import Record
from damjoint.storage import locked_folder
from tabulate import tabulate
from threadpoolctl import threadpool_limits

from . import bench_accuracy, bench_commands, bench_cost, bench_hard
from .bench_scenes import PARTS, QUANTITIES, SCENES
from .bench_table import Measurements, Table
from .provenance import provenance, source_line

STYLES = {
    (2, "free"): ("o", "triangles"),
    (2, "regular"): ("s", "regular"),
    (3, "layers"): ("^", "layers"),
    (3, "split"): ("D", "split layers"),
    (3, "free"): ("v", "tetrahedra"),
}


def draw(table: Table, path: Path) -> None:
    """Worst error against time, log-log, with the efficient front; a column per scene."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    columns = {n: np.array(c, object) for n, c in table.items()}
    error, seconds = 100 * columns["worst"].astype(float), columns["seconds"].astype(float)
    figure = Figure(figsize=(8.4, 7.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, len(SCENES), sharex=True, sharey=True)
    for row, dim in zip(panels, (2, 3), strict=True):
        for axes, scene in zip(row, SCENES, strict=True):
            shown = (columns["scene"] == scene) & (columns["dim"] == dim)
            patterns = [(p, s) for (d, p), s in STYLES.items() if d == dim]
            for (pattern, (marker, name)), order in product(patterns, (1, 2)):
                some = shown & (columns["pattern"] == pattern) & (columns["order"] == order)
                color = {1: "#cc7a00", 2: "#0b5394"}[order]
                label = f"{name}, order {order}"
                fill = color if order == 2 else "white"  # also in black and white
                style = {"color": color, "mfc": fill, "ms": 5, "alpha": 0.8, "label": label}
                axes.loglog(seconds[some], error[some], marker, **style)
            best = np.flatnonzero(shown)
            best = best[front(seconds[best], error[best])]
            axes.loglog(seconds[best], error[best], "k-", linewidth=1, label="efficient front")
            axes.set_title(f"{scene}, {dim}D", fontsize=11)
            axes.grid(alpha=0.3)
        row[0].set_ylabel("worst error [%]", fontsize=11)
    for axes in panels[-1]:
        axes.set_xlabel("seconds", fontsize=11)
        ticks = [
            t for t in (0.3, 0.5, 1, 2, 5, 10, 20) if seconds.min() / 2 < t < seconds.max() * 2
        ]
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
    shown = {}
    for row in panels:
        shown |= dict(zip(*reversed(row[-1].get_legend_handles_labels()), strict=True))
    shown["efficient front"] = shown.pop("efficient front")  # last
    below: dict[str, Any] = {"loc": "outside lower center", "ncols": 4}
    figure.legend(list(shown.values()), list(shown), fontsize=10, frameon=False, **below)
    figure.savefig(path, dpi=130)


def front(seconds: np.ndarray, error: np.ndarray, gain: float = 1.0) -> np.ndarray:
    """Return the indices of the efficient points by time: each has less than `gain` times the error
    of all faster ones.
    """
    chosen = list[int]()
    for i in np.argsort(seconds):
        if not chosen or error[i] < gain * error[chosen[-1]]:
            chosen.append(i)
    return np.array(chosen)


def short_number(value: object, digits: int = 2) -> str:
    """Format a number with few digits, without an exponent if it is readable without."""
    if not isinstance(value, (float, np.floating)):
        return str(value)
    if not np.isfinite(value):
        return "-"
    if abs(value) >= 10**digits:
        return f"{value:.0f}"
    rounded = float(f"{value:.{digits}g}")
    text = f"{rounded:.{digits}g}"
    return f"{rounded:g}" if "e" in text and 1e-3 <= abs(rounded) < 1e6 else text


def as_text(table: Table, names: dict[str, str] | None = None, digits: int = 2) -> str:
    """Format a table in Markdown; names: the columns that are shown, and their headings."""
    names = names or {n: n for n in table}
    columns = {head: [short_number(v, digits) for v in table[n]] for n, head in names.items()}
    return tabulate(columns, headers="keys", tablefmt="github", disable_numparse=True)


def efficient(table: Table) -> Table:
    """Return the efficient front of each scene and dimension with published steps, thinned: each
    row has two thirds of the error of the row before or less.
    """
    heads = "scene", "dim", "pattern", "order", "n_joint", "grading", "unknowns", "seconds"
    chosen = Table("efficient", *heads, "worst error [%]")
    published = np.array([steps == "published" for steps in table["steps"]])
    error, seconds = (np.array(table[n]) for n in ("worst", "seconds"))
    for scene, dim in product(SCENES, (2, 3)):
        rows = table.rows_where(scene, dim)
        rows = rows[published[rows]]
        for i in rows[front(seconds[rows], error[rows], 2 / 3)]:
            chosen.add(*(table[n][i] for n in heads), 100 * error[i])
    return chosen


def step_spread(table: Table) -> float:
    """Return the largest difference of errors between 1, 2 and 4 steps per level [%]."""
    rows = [i for i, steps in enumerate(table["steps"]) if steps != "published"]
    spread = 0.0
    for scene, quantity in product(SCENES, QUANTITIES):
        some = [table[f"error_{quantity}"][i] for i in rows if table["scene"][i] == scene]
        spread = max(spread, np.ptp(some))
    return 100 * spread


def modelings(measurements: Measurements, cases: Table) -> Table:
    """Table of README.md: subject of each modeling, worst difference of its rows, seconds."""
    columns = "shows", "rows", "worst difference", "seconds", "published code", "times faster"
    table = Table("modelings", "case", *columns)

    def measure(row: int, case: Case) -> tuple[Any, ...]:
        with tempfile.TemporaryDirectory() as folder:
            results = run(case, Path(folder), False, False, False)
        rows = [c for result in results for c in validation.compare(result)]
        difference = 100 * max(abs(c.difference) for c in rows)
        shows = case.title.split(": ", 1)[1]
        spent = (cases[n][row] for n in ("seconds", "published", "times faster"))
        return shows, len(rows), f"{difference:.1f} %", *spent

    for row, name in enumerate(cases["case"][:-1]):
        table.add_measured(measurements, (name.upper(),), partial(measure, row, load(name)))
    return table


def page(
    tables: dict[str, Table], precise: list[str], beyond: str, short: bool, source: str
) -> str:
    """The page: for each study its result in a sentence or two, and the table; source: the line
    with code version, date and machine of the measurements.
    """
    parts = [
        "# Benchmarks",
        f"{source} Written by `damjoint bench{' --short' if short else ''}`. "
        "The published code is code_aster 15.2 on a machine of 2 cores, the complete job without "
        "meshing. Times have two digits; the second one varies from run to run.",
        *of_cases(tables["cases"], short),
        *of_commands(tables),
        *of_accuracy(tables),
        *of_estimates(tables["estimates"]),
        *of_critical(tables["critical"]),
        *of_rows(tables["rows"]),
        *of_costs(tables["switches"], tables["sweeps"]),
        "## Growth with size",
        "; ".join(bench_cost.exponents(tables["growth"])) + ". Uniform refinement, cold start. "
        f"A mesh beyond the memory ends with the message: `{beyond}`",
        as_text(tables["growth"]),
        *of_engines(tables["engines"]),
        *of_orders(tables["orders"]),
        "## Precision on a fine mesh",
        "; ".join(precise) + ".",
        *of_joints(tables["joints"]),
        *of_quakes(tables["quakes"]),
        *of_stress(tables["stress"]),
        *of_hard(tables["hard"]),
    ]
    return "\n\n".join(parts) + "\n"


def of_cases(cases: Table, short: bool) -> list[str]:
    """The eleven modelings."""
    slowest = min(range(len(cases["case"]) - 1), key=lambda i: cases["times faster"][i])
    columns = {n: n for n in ("case", "seconds", *PARTS, "MB", "published", "times faster")}
    plain = ""
    if not short:
        columns |= {"GetDP": "GetDP", "times faster, GetDP": "GetDP, times faster"}
        plain = (
            f" The reference GetDP model takes {cases['GetDP'][-1]:.0f} s, "
            f"{cases['times faster, GetDP'][-1]:.1f} times less than the published code."
        )
    return [
        "## The eleven modelings",
        "With published meshes and steps, cold start (new process, no cache), all scenes, tables "
        f"written: {cases['seconds'][-1]:.0f} s in all, {cases['times faster'][-1]:.0f} times "
        "faster than the published code; the smallest ratio is that of "
        f"{cases['case'][slowest].upper()}, {cases['times faster'][slowest]:.1f}.{plain} The "
        "table has total seconds and those of each phase, peak memory in MB, and seconds of the "
        "published code and of the reference GetDP model, with the ratios.",
        as_text(cases, columns),
    ]


def of_commands(tables: dict[str, Table]) -> list[str]:
    """Start, fields and pictures."""
    begin, files = tables["start"], tables["pictures"]
    *_, cold, cached = begin["times interpreter and numpy"]
    worst = max(range(len(files["case"])), key=lambda i: files["both over tables"][i])
    faster = sum(
        seconds < published
        for seconds, published in zip(files["with both"], files["published"], strict=True)
    )
    return [
        "## Start",
        f"Tables of C take {cold:.1f} times as long as the interpreter with numpy without a cache, "
        f"{cached:.1f} times with its mesh and condensed bodies in the cache. Seconds in a new "
        "process, the smallest of several.",
        as_text(begin),
        "## Fields and picture",
        "With fields and picture, the default, a plane modeling takes at most "
        f"{files['both over tables'][worst]:.1f} times as long as with tables only "
        f"({files['case'][worst].upper()}); {faster} of {len(files['case'])} are faster so than "
        "the published code, which draws nothing. Cold start, seconds.",
        as_text(files),
    ]


def of_critical(searches: Table) -> list[str]:
    """Critical values."""
    slowest = max(range(len(searches["search"])), key=lambda i: searches["seconds"][i])
    return [
        "## Critical values",
        f"A search takes {min(searches['seconds']):.1f} to {searches['seconds'][slowest]:.1f} s "
        f"({searches['search'][slowest]}) and computes at most {max(searches['dams'])} dams; "
        f"{searches['confirmed'].count('yes')} of {len(searches['search'])} values are confirmed. "
        "Case `dam` with the parameters of the first column, in one process.",
        as_text(searches, digits=4),
    ]


def of_rows(table: Table) -> list[str]:
    """Rows of a sweep of critical levels."""
    seconds, alone = table["seconds"], table["LAPACK alone"]
    ratios = np.array(seconds) / alone
    return [
        "## Rows of a sweep of critical levels",
        f"A row takes {min(seconds):.2g} s ({table['row'][np.argmin(seconds)]}) to "
        f"{max(seconds):.2g} s ({table['row'][np.argmax(seconds)]}) of CPU time on condensed "
        f"bodies, {ratios.min():.1f} to {ratios.max():.1f} times as long as LAPACK for as many "
        "matrices of all unknowns; the other ways that have to lead to the same level are part of "
        "it. Case `dam`, one thread, with parts of the time as for hard scenes below.",
        as_text(table, digits=3),
    ]


def of_engines(table: Table) -> list[str]:
    """Condensed and uncondensed bodies in 3D."""
    fitted = bench_cost.exponents(table, "engine", "{}")
    return [
        "## Condensed and uncondensed bodies in 3D",
        ". ".join(["The dam of `valley`, three levels, by either engine", *fitted]) + ".",
        as_text(table),
    ]


def of_orders(orders: Table) -> list[str]:
    """METIS's order of the unknowns beside MUMPS's own."""
    by_metis, by_mumps = orders["METIS"][-1], orders["MUMPS's own"][-1]
    return [
        "## Order of elimination in 3D",
        f"Bodies of {orders['unknowns'][-1]} unknowns are condensed in "
        f"{by_metis:.2g} s in METIS's order and in {by_mumps:.2g} s in MUMPS's own; the stiffness "
        "differs by "
        f"{max(orders['difference']):.0e} of its largest entry. Seconds on one thread.",
        as_text(orders),
    ]


def of_accuracy(tables: dict[str, Table]) -> list[str]:
    """Error against time."""
    recommended, spread = tables["recommended"], step_spread(tables["accuracy"])
    error, spent = (short_number(recommended[f"coarse: {n}"][-1]) for n in ("error [%]", "seconds"))
    heads = {n: n for n in recommended if n == "case" or "seconds" in n or "error" in n}
    heads["published: error [%]"] = "published mesh [%]"
    best = efficient(tables["accuracy"])
    second = sum(order == 2 for order in best["order"])
    return [
        "## Time for an accuracy",
        f"`--accuracy` refines the mesh until the estimated errors are below 3 % (coarse), 1 % "
        f"(standard) or 0.2 % (fine). With coarse the true errors are at most {error} % in the "
        f"modelings below, and all their main scenes take {spent} s. The error is the largest of "
        "opening, toe stress, crack, slip and leakage relative to a reference solution on a very "
        'fine mesh; the seconds include the start of the process. "Published mesh" is the error '
        "on that mesh.",
        as_text(recommended, heads),
        "The reference solution (triangles of order 2, n elements along the joint) and its "
        "convergence, in SI units:",
        as_text(tables["overkill"], digits=4),
        "![Error against time](pictures/accuracy.png)",
        f"Efficient settings, to which no other is superior in both time and error (of "
        f"{len(tables['accuracy']['scene'])} in `accuracy.csv`): {second} of {len(best['order'])} "
        f"are of order 2. One, two and four steps per level differ by {spread:.1g} % at most.",
        as_text(best),
    ]


def of_estimates(estimates: Table) -> list[str]:
    """Errors estimated by --accuracy, and the true ones."""
    return [
        "## Estimated and true errors",
        "Errors estimated by `--accuracy`, and the true ones, in percent: estimated / true, "
        "the largest of all levels, for dams with E = 20 and 30 GPa, K_N 1e11 or 1e12 Pa/m. "
        "Lengths are counted in elements; the error of an opening is relative to the largest jump "
        "of the joint.",
        as_text(estimates),
    ]


def of_costs(costs: Table, sweeps: Table) -> list[str]:
    """What options and rows of a sweep cost."""
    dear = max(range(len(costs["option"])), key=lambda i: costs["ratio"][i])
    level, strength = (
        f"{1e3 * min(sweeps[n]):.0f} to {1e3 * max(sweeps[n]):.0f} ms"
        for n in ("another level", "another strength")
    )
    return [
        "## Cost of options",
        "Seconds with and without the option, in one process, the best of three. The most "
        f'expensive is "{costs["option"][dear]}", {costs["ratio"][dear]:.0f} times.',
        as_text(costs),
        "## Cost of a row in a sweep",
        f"A further level costs {level}, another strength {strength}. Seconds on a mesh that is "
        "already condensed.",
        as_text(sweeps),
    ]


def of_joints(table: Table) -> list[str]:
    """Dams with several joints."""
    return [
        "## Several joints",
        f"A 45 m dam with up to {table['joints'][-1]} joints, the base and lifts at equal "
        "distances, water up to the crest, in one process and one thread: "
        f"{table['joints'][-1]} joints take {table['ratio'][-1]:.1f} times the seconds of one.",
        as_text(table),
    ]


def of_quakes(table: Table) -> list[str]:
    """Time steps of an earthquake."""
    both = [i for i, by_getdp in enumerate(table["GetDP: ms a step"]) if by_getdp != ""]

    def numbers(name: str) -> list[float]:
        return [table[name][i] for i in both]

    times = numbers("ms a step"), numbers("GetDP: ms a step")
    text = (
        f"A time step takes {min(times[0]):.1f} to {max(times[0]):.1f} ms, the set-up up to "
        f"{max(table['set-up in steps']):.0f} steps; the reference GetDP model takes "
        f"{min(times[1]):.0f} to {max(times[1]):.0f} ms a step, and its slip differs by at most "
        f"{max(numbers('difference')):.0e} of the largest one."
    )
    if "2D, order 2, whole record" in table["scene"]:
        text += f" The whole record, 17 s and the rest, takes {table['seconds'][-1]:.0f} s."
    return [
        "## Earthquake",
        "The case `dam` with friction under three times the record `friuli.csv`, in steps of 2.5 "
        f"ms, one thread. {text}",
        as_text(table),
    ]


def of_stress(grid: Table) -> list[str]:
    """Flow with extreme parameters."""
    ends = ", ".join(f"{k} {v}" for k, v in Counter(grid["end"]).items())
    return [
        "## Flow with extreme parameters",
        "aperture_min 1e-9 to 1e-4 m, K_N 1e9 to 1e14 Pa/m, E 1e10 to 3e12 Pa, level to the "
        f"crest. Verdicts of the {len(grid['end'])} combinations: {ends}; at most "
        f"{max(grid['seconds']):.1f} s each (`stress.csv`).",
    ]


def of_hard(table: Table) -> list[str]:
    """Scenes that are hard to solve in 2D."""
    number, seconds = len(bench_hard.NAMED), np.array(table["seconds"])
    others = seconds[number:]
    return [
        "## Hard scenes in 2D",
        f"CPU seconds of the load steps, one thread: of {len(others)} random dams half take at "
        f"most {np.median(others):.2g} s, nine of ten {np.percentile(others, 90):.2g} s, the "
        f"slowest one {others.max():.2g} s. Two further scenes and the slowest ones, with parts of "
        "the time, in solutions that were given up, in linear systems and in the water, and the "
        "seconds of LAPACK alone for as many matrices of all unknowns (`hard.csv`):",
        as_text(bench_hard.slowest(table)),
    ]


def bench(out: Path, short: bool) -> None:
    """Run the benchmark; write tables (CSV), benchmarks.md, modelings.md, accuracy.png, the
    provenance of all (provenance.json) and the record (run.json) into out; print the page.

    out/measured.jsonl is the log from which an interrupted benchmark is resumed.
    """
    out.mkdir(parents=True, exist_ok=True)
    record = Record("bench", out / RECORD)
    with locked_folder(out), record.recording():
        measurements = Measurements(out / "measured.jsonl", short)
        tables, precise = measure(measurements)
        for name, table in tables.items():
            table.write(out / f"{name}.csv")
        draw(tables["accuracy"], out / "accuracy.png")
        last = measurements.provenance | {"date": provenance()["date"]}
        source = source_line([measurements.provenance, last])
        (out / "modelings.md").write_text(f"{as_text(tables['modelings'])}\n\n{source}\n")
        text = page(tables, precise, bench_cost.memory_message(), short, source)
        (out / "provenance.json").write_text(json.dumps(last, indent=1) + "\n")
        (out / "benchmarks.md").write_text(text)
        measurements.path.unlink()
        record.save_without_results(COMPLETE, "", {"bench": {"short": short}})
    print(text)


def measure(measurements: Measurements) -> tuple[dict[str, Table], list[str]]:
    """Measure all tables, {name: table}, and the errors of balances."""
    tables = [cases := bench_cost.cases(measurements)]
    studies = [bench_cost.switches, bench_cost.sweeps, bench_cost.growth, bench_cost.stress]
    studies += [bench_commands.start, bench_commands.pictures, bench_commands.critical]
    studies += [bench_commands.orders, bench_cost.engines, bench_cost.joints]
    studies += [bench_commands.quakes, bench_hard.hard, bench_hard.rows]
    tables += [study(measurements) for study in studies]
    with threadpool_limits(1):
        tables.append(modelings(measurements, cases))
        exact, overkill = bench_accuracy.overkill(measurements)
        tables += [overkill, bench_accuracy.accuracy(measurements, exact, cases["start"][0])]
        tables.append(bench_accuracy.recommended(measurements, exact))
        tables.append(bench_accuracy.estimates(measurements))
        precise = bench_cost.precision(measurements)
    return {table.name: table for table in tables}, precise
