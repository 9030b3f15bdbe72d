"""The sections of reference/trust.md: random dams and earthquakes verified, from a result file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from .markdown import markdown
from .mutations import MUTATIONS
from .provenance import source_line
from .quake_comparison import MEASURES
from .stress import CLASSES, DEFECT, IN_TIME, UNDECIDED, counts, read_rows

#: Place of each mutation in the table.
NUMBERS = {mutation.name: number for number, mutation in enumerate(MUTATIONS)}

#: A row of a result file.
Row = dict[str, str]

#: What is compared: quantity, with what, and to which tolerance.
COMPARED = (
    (
        "parameters of each joint, levels, times, verdict and exit code",
        "the words of the command and the defaults of `pro/parameters.pro`, by a reader of its own",
        "all digits",
    ),
    (
        "$N + U$, $T$, $M + M_U$ of every row of `history.csv`",
        "weight, water, tailwater, silt, ice, line forces, anchor, earthquake with added mass "
        "on the polygon of the section, pressures by quadrature",
        "1e-7 of the weight (times the base), and ten times the residual",
    ),
    (
        "$N$, $T$, $M$; rows of `joint.csv`",
        "integrals of the tractions, and rows of the nodes, in `steps.csv`",
        "1e-9",
    ),
    (
        "traction, damage, slip, hardening, grout and saw at every node and integration point "
        "after every step",
        "each law replayed along the jumps, a scalar implementation for each of rupture, "
        "friction, bond, endo and mixed; also the rounds of unstable crack growth",
        "1e-6 of the strength",
    ),
    (
        "pressure and flux in the joint",
        "the flow through the written openings: resistances in series or a network in 2D, "
        "finite elements in 3D, with drains, waterstop, elastic aperture and turbulence",
        "1e-9 of the largest pressure, 1e-6 in 3D",
    ),
    (
        "pressure and mass of the water in time (`time_unit`, `quake_uplift` = transient)",
        "what each node stores and what flows to it, replayed step by step along the written "
        "openings, with voids and drains, in 3D by finite elements on the written faces; no longer "
        "after a step in which water that runs down leaves no set of nodes with voids",
        "1e-9 of the largest pressure, 1e-6 in 3D; 1e-6 of the mass",
    ),
    (
        "displacement jumps",
        "both bodies by scikit-fem on the written mesh, under the loads, temperature, and the "
        "written tractions and pressures",
        "1e-10 of the largest displacement; what is more must be the residual of the step: the "
        "forces that move the bodies by it are at most ten times that part of the loads",
    ),
    (
        "a run that stops",
        "limit analysis: it is *justified* if no distribution of stress within the strength "
        "that is left has the resultants of the next step (a linear program over the "
        "integration points), or if the shear exceeds friction and the cohesion that is left; "
        "*wrong* if friction alone certainly bears the block, under the most uplift, with a "
        "margin of 5 %",
        "the smallest step",
    ),
    (
        "the last state with twice the load steps, of every fifth scene",
        "the same scene again; not where the state follows its history: temperature, works, loads "
        "against the water, falling levels, `cracked`, unstable growth, slip in a 3D joint, slip "
        "or damage that ends or turns at a point",
        "1e-6 of the largest jump",
    ),
    (
        "the critical level, of every fifth scene in 2D whose state does not follow its history",
        "`damjoint critical` from three levels, where it is confirmed; the state at 0.995 of it by "
        "all of the above; but for unstable growth, limit analysis at 1.005, and runs to 1.002 of "
        "it with 1, 4 and 16 load steps, which do not stand unless they say that they have jumped "
        "to another branch",
        "1e-4",
    ),
)

#: What `damjoint stress` verifies in every scene, around that table.
VERIFIED = """\
The package `damjoint_witness` reads the command line and the files of a run, with those of
`--all-steps` and the mesh in `fields/`. It imports nothing of `damjoint` (a test) and computes
everything again, slowly and plainly, from the formulas of [theory](theory.md)."""
UNDECIDED_OR_NOT = """\
*Undecided* is a stop between these two bounds: a joint whose cohesion or tensile strength is lost
point by point may fail below the first one, and water may enter a crack beyond the last state; so
is one under displacement control, whose level is not known beforehand. A command that exceeds its
time limit is a defect.

Not checked here: stresses in the bodies and pictures; the default values themselves; that the
branch which the load steps follow is the one that a dam would take, where there are several
equilibria; whether a first unstable growth is too low (a run may pass over the growth of a point);
geometries of one's own, but for two blocks whose joints meet, and so tractions on a
region of theirs; the factors of safety of `damjoint check`; derivatives, reliability and
calibration (the tests compare them with differences and closed forms); the reference GetDP model
(the tests compare it with the engine of these runs)."""

#: What `damjoint stress --quake` verifies in every scene, and beside it.
QUAKES_VERIFIED = """\
- *Start*: the first frame of `quake_joint.csv` is the static state; the motion begins at rest. Of a
  dam that is said not to stand before the earthquake: the stop of `damjoint run`, as of dams.
- *Motion*: the displacement of the crest is the integral of its acceleration, by Newmark's
  differences; the acceleration of the ground is that of the record, in rock with mass later by the
  travel time of the wave.
- *Momentum*: $T$, $N + U$ and, if the water does not change, $M$ of every joint at every step, with
  the dashpots of the joint, equal the static loads, the inertia of all that is above the joint, the
  mass of the water included, and the damping by the mass (of concrete and water), to 1e-6 of the
  weight (times the base). Loads and masses by the polygon, dashpots from the jumps. Damping by the
  stiffness and absorbing boundaries have no resultant there: they are not verified here (tests:
  the decay of a free vibration, waves in a column of rock). Nor is the balance with
  `damping_mass = 1` beside added mass, as the velocity of the concrete without the water is in no
  table: that mass of the water in the damping by mistake would not be noticed.
- *Joint law*: replayed as above, at every node and integration point of every time step.
- *Water*: the pressure at every node and integration point of every time step, by `quake_uplift`:
  the flow through the openings at the beginning of the step, that of the static state, or none in
  the elements of the crack that are open then, by the replayed law; to 1e-9 of the largest
  pressure, 1e-6 in 3D; with `transient` as flow in time. $U$ of up to 200 frames is its integral
  (2D).
- *Tables*: the static states before and after, laws, water and sums, as those of a run.
- *End*: the static state after the earthquake by hand, and that there is one if the rigid block
  certainly stands; peaks and residual slip are those of the rows; the exit code."""
QUAKES_BESIDE = """\
- *Equations of all unknowns*: the residual of the equations of motion at every step with the
  matrices of the bodies, laws, water, dashpots and the waves in rock with mass, at most 1e-8 of the
  static loads. *Energy*: the work of the ground equals kinetic and strain energy and the work on
  damping and joints, to 1e-8 with `hht_alpha = 0`, with which it also never rises while the ground
  is at rest; the time integration gives no energy with other `hht_alpha`. In half of the dams, all
  dams with dashpots and all rigid blocks. The only check that uses matrices of the package.
- *Elastic joint*: the reversed record gives the reversed motion, a hundredth of the record a
  hundredth of the motion, to 1e-5; the error falls with the square of the step, at least with its
  first power in the published scheme (if the steps resolve the first mode).
- *Rigid block*: the slip under the random record is that of Newmark's sliding block at every step,
  but for errors where the block stops or turns: $\\mu g\\,\\Delta t$ and
  $2 \\mu N/\\sqrt{K_T L m}$ in velocity.
- *Engines*: `quake.csv` of the reference GetDP model is the same to 1e-5, up to where that stops,
  if it does. Where it is not, this is asked of steps of an eighth of the length: a step in which a
  joint softens can have several equilibria.
- Measured, without a limit: by how much half the time step changes the residual slip, and 1.25
  times the friction and cohesion the largest slip."""


def trust_section(results: Path) -> tuple[str, str]:
    """Return the name of a section, `dams`, `earthquakes` or `mutations`, and its text.

    Raises ValueError if the rows are of different code.
    """
    rows = read_rows(results)
    if "mutation" in rows[0]:
        return "mutations", mutation_section(rows)
    quakes = rows[0]["command"].startswith("damjoint quake")
    return ("earthquakes", quake_section(rows)) if quakes else ("dams", dam_section(rows))


def dam_section(rows: list[Row]) -> str:
    """Return the section on dams under static loads."""
    parts = [
        f"{len(rows)} random scenes of `damjoint stress` ({seeds_of(rows)}). "
        "Each is computed by `damjoint run` and verified from its result files, by code that "
        "imports nothing of the package. The scenes: dams from 5 to 150 m, "
        "$E$ from 1e9 to 1e13 Pa, $K_N$ from "
        "1e8 to 1e15 Pa/m, all laws, all uplifts, "
        "sections with batter, neck, sloping and "
        "lift joint, silt, ice, anchor, a force on any face, earthquake and temperature, weight "
        "of the rock, other densities, rising and falling "
        "water; grouted and sawn joints, waterstops; four in ten have two to "
        "four joints, each with its own law and uplift (the rows of a law "
        "or an uplift below are of dams with one joint); one 2D "
        "scene in ten is a slender dam with the stiffness of concrete on a brittle joint. "
        "The name of a scene is SEED-NUMBER. Written by "
        "`python -m damjoint_tools.pages trust FILE` from the result file.",
        source_line(rows),
        "## What is verified",
        VERIFIED,
        markdown(COMPARED, ("quantity", "is compared with", "to")),
        UNDECIDED_OR_NOT,
        "## Result",
        classes(rows, "law", "uplift", "joints", "dim", "drive", with_words=FEATURES_OF_DAMS),
        "## Defects and undecided stops",
        unsolved(rows),
        "## The slowest scenes",
        SLOWEST,
        slowest(rows),
    ]
    return "\n\n".join(parts)


def mutation_section(rows: list[Row]) -> str:
    """Return the section on errors in copies of the package."""
    noticed = sum(bool(row["scene"]) for row in rows)
    rows = sorted(rows, key=lambda row: NUMBERS.get(row["mutation"], len(NUMBERS)))
    lines = [
        (
            row["mutation"],
            f"`{row['place']}`",
            row["relevant"],
            row["scene"] or "not noticed",
            row["finding"].replace("|", "\\|"),
        )
        for row in rows
    ]
    parts = [
        "## Would it notice an error?",
        f"{noticed} of {len(rows)} mutations were noticed. Each is an error at one place in a copy "
        "of the package; random scenes in which it can matter (at most 60) are run with the copy "
        "until the verification finds something. Written by `damjoint stress --mutate` and "
        "`python -m damjoint_tools.pages trust FILE`.",
        source_line(rows),
        markdown(lines, ("mutation", "place", "scenes", "noticed in", "by")),
    ]
    return "\n\n".join(parts)


def quake_section(rows: list[Row]) -> str:
    """Return the section on earthquakes."""
    parts = [
        "## Earthquakes",
        f"{len(rows)} random earthquakes of `damjoint stress --quake` ({seeds_of(rows)}), "
        "each computed by `damjoint quake`. The scenes: dams from 8 to 120 m, "
        "$E$ from 5e9 to 1e11 Pa, $K_N$ from "
        "1e9 to 1e13 Pa/m, the laws bond, friction, rupture and mixed, all uplifts but waterstop, "
        "batter, sloping joint, one to three joints (most "
        "of the lift joints with a law and water of their own); added mass, water in the crack by "
        "each rule, damping of 1 to 10 % with and without its part by the mass, "
        "dashpots in the joint, rock with mass; `hht_alpha` of 0, -0.05, -0.2, and the published "
        "scheme. Records of 0.8 to 1.6 s of three waves of 1 to 9 Hz, up to 1 g, most with a "
        "vertical component, of both signs. One scene in eight each has an elastic joint (no "
        "earthquake breaks it), "
        "or is a rigid block with dry friction on a rigid ground. Written by the same command.",
        source_line(rows),
        "### What is verified in each earthquake",
        QUAKES_VERIFIED,
        "### And in a part of them, by further runs",
        QUAKES_BESIDE,
        "### Earthquakes: result",
        classes(rows, "kind", "law", "uplift", "joints", "dim", with_words=FEATURES_OF_QUAKES),
        measured(rows),
        "### Earthquakes: defects and undecided stops",
        unsolved(rows),
        "### The slowest earthquakes",
        SLOWEST,
        slowest(rows),
    ]
    return "\n\n".join(parts)


def seeds_of(rows: list[Row]) -> str:
    """Return the seeds of scenes, in words."""
    seeds = sorted({row["scene"].partition("-")[0] for row in rows}, key=int)
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {', '.join(seeds)}"


SLOWEST = "Seconds of the complete command, while other scenes run in parallel."


#: What only a part of the dams has, and of the earthquakes, by regular expressions of the command.
FLOWS_WITH_DRAINS = r".* drains=(0,)*1"
FEATURES_OF_DAMS = IN_TIME | {
    "flow in time, with drains": rf"(?=.* time_unit=){FLOWS_WITH_DRAINS}",
    "turbulent flow": "turbulent=1",
}
FEATURES_OF_QUAKES = {
    "rock with mass": "rock_mass=1",
    "dashpots in the joint": "joint_damping_n=",
    "damping by the mass": "damping_mass=",
    "published scheme": "time_integration=published",
    "flow in time": "quake_uplift=transient",
    "flow in time, with drains": rf"(?=.* quake_uplift=transient){FLOWS_WITH_DRAINS}",
    "flow in time, turbulent": "turbulent=1",
}


def classes(rows: list[Row], *names: str, with_words: dict[str, str] | None = None) -> str:
    """Return the table of the scenes of each class, by columns and features of the command."""
    lines: list[tuple[Any, ...]] = []
    for name in names:
        values = sorted({row[name] for row in rows if "," not in row[name]})
        for value in values:
            selected = [row for row in rows if row[name] == value]
            lines.append((f"{name} = {value}", *counts(selected).values()))
    for words, feature in (with_words or {}).items():
        selected = [row for row in rows if re.search(feature, row["command"])]
        lines.append((words, *counts(selected).values()))
    lines.append(("all", *counts(rows).values()))
    return markdown(lines, ("scenes", *CLASSES))


def measured(rows: list[Row]) -> str:
    """Return the table of the numbers of the further checks."""

    def conserves(row: Row) -> bool:
        return "hht_alpha=0 " in row["command"]

    def frictional(row: Row) -> bool:
        return not any(law in row["law"] for law in ("rupture", "mixed"))

    parts = {
        "energy_lost": ((", alpha = 0", conserves), (", others", lambda row: not conserves(row))),
        "change_by_dt": (
            (", joints with friction", frictional),
            (", with a joint of law = rupture or mixed", lambda row: not frictional(row)),
        ),
    }
    lines: list[tuple[Any, ...]] = []
    for name, meaning in MEASURES.items():
        for words, chosen in parts.get(name, (("", lambda row: True),)):
            selected = [row for row in rows if row.get(name) and chosen(row)]
            values = np.array([float(row[name]) for row in selected])
            if len(values):
                low, middle, high = np.percentile(values, [0, 50, 100])
                cells = (f"{value:.2g}" for value in (low, middle, high))
                lines.append((f"{meaning}{words}", len(values), *cells))
    return markdown(lines, ("measured", "scenes", "smallest", "median", "largest"))


def unsolved(rows: list[Row]) -> str:
    """Return the list of defects and undecided stops, with their commands."""
    return (
        "\n".join(
            f"- {row['scene']}, {row['class']}: {row['findings']}\n\n      {row['command']}"
            for kind in (DEFECT, UNDECIDED)
            for row in rows
            if row["class"] == kind
        )
        or "None."
    )


def slowest(rows: list[Row]) -> str:
    """Return the table of the scenes that take longest."""
    first = sorted(rows, key=lambda row: -float(row["seconds"] or 0))[:5]
    names = "scene", "seconds", "iterations", "cuts", "findings"
    return markdown([tuple(row[name] for name in names) for row in first], names)
