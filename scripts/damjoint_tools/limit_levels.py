"""Critical levels of random dams, each found in several ways that are to agree.

    python -m damjoint_tools.limit_levels 200 --seed 1 --out out/limits.csv

The dams are real ones: sections, concrete, rock and strengths as in practice, one joint on the
base, LAWS and all uplifts but waterstop. The same command continues a file, and prints what its
rows say.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from statistics import median

from damjoint import InputError
from damjoint.input.resolve import load
from damjoint.processes import as_finished, check_jobs, process_count
from damjoint.progress import track
from damjoint.solver.path import RISE
from damjoint.solver.path_point import PRECISION
from damjoint.studies.critical import Search
from damjoint.studies.result_file import rows_session

from .provenance import RECORDED, provenance
from .random_scenes import Drawn, RandomNumbers, RandomScene, endo
from .stress import name_of, same_code

#: The ways: the first level over the dam's height (0: that of the case), the rise of an increment
#: over the usual one, and the relative change of the concrete's modulus, by which all is rounded
#: otherwise, as on another processor.
WAYS = (
    (0.0, 1.0, 0.0),
    (0.3, 1.0, 0.0),
    (0.45, 1.0, 0.0),
    (0.0, 1 / 3, 0.0),
    (0.0, 1.0, 1e-12),
)
#: What is written of each way.
OF_WAY = "level", "confirmed", "growth", "why", "cpu"
COLUMNS = (
    *("dam", "law", "uplift", "command"),
    *(f"{name}_{way}" for way in range(len(WAYS)) for name in OF_WAY),
    *RECORDED,
)
#: The laws in turn.
LAWS = "bond", "rupture", "friction", "endo"


def random_dam(seed: int, number: int) -> RandomScene:
    """Draw a dam of 15 to 120 m with a joint of the law that is next."""
    rng, law = RandomNumbers(seed, number), LAWS[number % len(LAWS)]
    height = rng.log_uniform(15, 120)
    base = float(f"{height * rng.uniform(0.62, 0.92):.4g}")
    K_N = rng.log_uniform(3e10, 1e12)
    dam: Drawn = {
        "dam_height": height,
        "dam_base": base,
        "dam_crest": float(f"{base * rng.uniform(0.08, 0.25):.4g}"),
        "n_joint": rng.choice(20, 40),
        "E": rng.log_uniform(1e10, 3e10),
        "nu": rng.uniform(0.17, 0.25),
        "law": law,
        "K_N": K_N,
        "K_T": float(f"{K_N * rng.uniform(0.4, 1):.4g}"),
        "mu": rng.uniform(0.7, 1.2),
        "adhesion": rng.choice(0, *(rng.log_uniform(3e4, 7e5) for _ in range(3))),
        "sigma_max": rng.choice(0, *(rng.log_uniform(1e4, 1e6) for _ in range(2))),
        "uplift": rng.choice("none", "imposed", "drained", "cracked", "flow"),
    }
    dam["E_found"] = float(f"{dam['E'] * rng.log_uniform(0.4, 2.5):.4g}")
    if dam["uplift"] == "drained":
        dam["drain_x"] = float(f"{0.1 * base:.4g}")
    if dam["uplift"] == "flow":
        dam["aperture_min"] = rng.log_uniform(1e-6, 1e-4)
    if law == "bond":
        dam |= {"G_f": rng.log_uniform(20, 250), "G_t": rng.log_uniform(100, 5000)}
    if law == "rupture":
        dam |= {"pena_rupture": rng.log_uniform(0.3, 30), "alpha": rng.choice(0, 1, 1.5, 2)}
    if law == "endo":
        dam |= endo(rng, dam)
    return RandomScene(dam, f"{0.5 * height:.4g}", "0", 1)


def search(dam: RandomScene, way: int) -> dict[str, object]:
    """The columns of one way to find the critical level of a dam."""
    start, rise, change = WAYS[way]
    settings = dam.settings | {"E": (1 + change) * dam.settings["E"]}
    levels = f"{start * dam.settings['dam_height']:.4g}" if start else ""
    begin = time.process_time()
    found = Search(load(dam.base, settings, levels or dam.levels, "0"), "level")
    found.rise = rise * RISE
    result = found.run()
    if result.error:
        raise result.error
    values: dict[str, object] = {
        "level": "" if result.value is None else f"{result.value:.9g}",
        "confirmed": int(result.confirmed),
        "growth": "" if result.growth is None else f"{result.growth:.9g}",
        "why": result.why or result.doubt,
        "cpu": f"{time.process_time() - begin:.2f}",
    }
    return {f"{name}_{way}": value for name, value in values.items()}


def row_of(seed: int, number: int) -> dict[str, object]:
    """The row of a dam."""
    dam = random_dam(seed, number)
    row: dict[str, object] = {name: dam.settings[name] for name in ("law", "uplift")}
    row |= {"dam": name_of(seed, number), "command": " ".join(["damjoint", *dam.critical])}
    for way in range(len(WAYS)):
        row |= search(dam, way)
    return row


def limit_levels(count: int, seed: int, out: Path, jobs: int | None = None) -> list[dict[str, str]]:
    """Find the critical levels of those of the first `count` dams of a seed that are not in the
    result file yet; returns the rows of all.

    Raises InputError, also if the rows in the file were computed by other code.
    """
    check_jobs(jobs)
    now, about = provenance(), {"rows": count, "seed": seed}
    columns = COLUMNS, tuple(name for name in COLUMNS if name.startswith("cpu"))
    with rows_session("limit levels", out, *columns, {"limit_levels": about}) as (study, done):
        same_code(out, done.values(), now)
        missing = [n for n in range(count) if name_of(seed, n) not in done]
        rows = as_finished(partial(row_of, seed), missing, process_count(jobs, len(missing)) or 1)
        for _, row in track(rows, "limit levels", len(missing)):
            cells = row | now
            study.add([str(cells.get(name, "")) for name in COLUMNS])
        done = study.file.read()
    return [done[name_of(seed, n)] for n in range(count)]


def doubtful(row: dict[str, str], way: int) -> bool:
    """Whether a way has led to a level that is not confirmed, or to none on a dam that has one."""
    limits = any(row[f"level_{way}"] for way in range(len(WAYS)))
    return limits and row[f"confirmed_{way}"] == "0"


def spread(row: dict[str, str]) -> float:
    """The relative difference of the confirmed levels of a dam."""
    ways = range(len(WAYS))
    levels = [float(row[f"level_{way}"]) for way in ways if row[f"confirmed_{way}"] == "1"]
    return (max(levels) - min(levels)) / max(levels) if levels else 0.0


def summary(rows: list[dict[str, str]]) -> list[str]:
    """What the rows say of each law: a table, and the dams that do not agree."""
    lines = ["law       dams  not confirmed   largest spread   CPU s median, largest"]
    for law in LAWS:
        with_law = [row for row in rows if row["law"] == law]
        if not with_law:
            continue
        count = len(with_law)
        searches = [(row, way) for row in with_law for way in range(len(WAYS))]
        doubts = sum(doubtful(row, way) for row, way in searches)
        times = [float(row[f"cpu_{way}"]) for row, way in searches]
        lines.append(
            f"{law:9} {count:4}  {doubts:3} of {len(searches):3} {doubts / len(searches):6.1%}  "
            f"{max(map(spread, with_law)):14.1e}   {median(times):.1f}, {max(times):.0f}"
        )
    for row in rows:
        ways = range(len(WAYS))
        if any(doubtful(row, way) for way in ways) or spread(row) > PRECISION:
            levels = ", ".join(
                (row[f"level_{way}"] or "no limit") + " not confirmed" * doubtful(row, way)
                for way in ways
            )
            lines.append(f"{row['dam']} {row['law']} {row['uplift']}: {levels}")
    return lines


def main() -> None:
    """Find the levels, and print what they say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("count", type=int, help="number of dams")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random numbers")
    parser.add_argument("--out", type=Path, default=Path("out/limits.csv"), help="result file")
    parser.add_argument("--jobs", type=int, help="number of processes")
    options = parser.parse_args()
    try:
        rows = limit_levels(options.count, options.seed, options.out, options.jobs)
    except InputError as error:
        parser.error(str(error))
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    main()
