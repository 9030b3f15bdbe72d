"""The pages that are made from the code: python -m damjoint_tools.pages NAME.

Run from the checkout: `make pages` (parameters, results, tour, laws, validation: all), or
`make bench`.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from damjoint.arrays import Values
from damjoint.dynamics.frames import MOST_FRAMES
from damjoint.input.parameters import declared
from damjoint.laws import COLUMNS
from damjoint.model.results import (
    FILM,
    FLUX,
    HISTORY,
    IN_TIME,
    JOINT,
    LATERAL,
    MODES,
    QUAKE,
    STEPS,
    THICKNESS,
)
from damjoint.post.validation import Comparison, Reference
from damjoint.statics.rigid_block import LOADS
from damjoint.studies.check import CHECK
from damjoint.studies.failure_path import CRITICAL

from .law_picture import draw as draw_laws
from .markdown import markdown
from .trust import trust_section

REFERENCE = Path("reference")


def parameters_page() -> str:
    """reference/parameters.md: every parameter, by group."""
    parts = [
        "# Parameters",
        "Made from [pro/parameters.pro](../pro/parameters.pro) by `make pages`. A parameter is set "
        "by `--set name=value`, by `default_name = value;` in a case file, or in the Gmsh window. "
        "A value is in the unit of its row, or has a [unit of its own](usage.md#units): `20*GPa`. "
        "The defaults are those of a 45 m dam of ordinary concrete on rock; "
        "[cases/ssnp142.case](../cases/ssnp142.case) contains those of the verification case. "
        'The default -1 means a value computed from others: see the column "allowed". A parameter '
        'has no effect unless the condition "used if" holds. Terms and symbols: '
        "[glossary](glossary.md).",
        "The water levels are lists in the case file, or options: `levels() = {30, 40, 45};` "
        "(`--levels`) [m above the base's heel], from 0 at t = 0, level number i reached at t = i; "
        "`tail_levels()` (`--tail-levels`) likewise, one value for all levels or one per level; "
        "`times()` (`--steps` between two levels) are the times at the end of the load steps. "
        "`lift_heights()` (`--set lift_heights=12,25`): heights of lift joints above the first "
        "joint; then the parameters of a joint may have a list with a value for each joint, "
        "`mu() = {0.9, 1, 1};` (`--set mu=0.9,1,1`): those of the group Joint, law, uplift, slope, "
        "aperture, drains, waterstop, grouting and sawing. "
        "`downstream_face()` (`--set downstream_face=22,30,15,62`): $x$ and height of each corner "
        "of the downstream face between base and crest, upwards, in place of `neck_height` and "
        "`neck_batter`. "
        "Default levels: two thirds and eight ninths of the height, and the crest. In the Gmsh "
        "window they are in the group Water levels.",
    ]
    groups: dict[str, list[tuple[object, ...]]] = {}
    for parameter in declared().values():
        notes = parameter.help if not parameter.automatic else ""
        groups.setdefault(parameter.group, []).append(
            (
                f"`{parameter.name}`",
                parameter.description,
                parameter.unit,
                parameter.default,
                parameter.allowed(),
                parameter.matters,
                notes,
            )
        )
    heads = "name", "meaning", "unit", "default", "allowed", "used if", "notes"
    for group, rows in groups.items():
        parts += [f"## {group}", markdown(rows, heads)]
    return "\n\n".join(parts) + "\n"


def results_page() -> str:
    """reference/results.md: the columns of the tables."""
    joint, history, steps, check, loads, critical, quake, modes = (
        markdown([(f"`{n}`", u, m) for n, (u, m) in columns.items()], ("column", "unit", "meaning"))
        for columns in (
            JOINT | COLUMNS | FLUX | FILM | THICKNESS,
            HISTORY | LATERAL | IN_TIME,
            STEPS,
            CHECK,
            LOADS,
            CRITICAL,
            QUAKE,
            MODES,
        )
    )
    parts = [
        "# Results",
        "The columns of the tables that the commands write; `run.json` repeats the units. Signs: "
        "[theory](theory.md#1-conventions); terms and symbols: [glossary](glossary.md). Made by "
        "`make pages`.",
        "## joint.csv",
        "A row per joint node and requested level, sorted by level, joint, x and z; with order 2 "
        "the midpoints of edges and rectangles, too. Stresses are those of the joint law at the "
        "node, with internal variables of its own. `lambda` is written with law = friction only, "
        "`flux` with uplift = flow only, `void_fraction`, `Re` and `water_mass` with "
        "`time_unit` > 0 only; of several joints, those without it have nan.",
        joint,
        "## history.csv",
        "A row per converged step. Forces are per metre of thickness, in 3D too. Of several "
        "joints, the columns of lengths, openings and resultants are those of joint 1; those of "
        "joint 2, 3, ... follow with its number: `N_2`, `T_2`, ... `water` and the columns after "
        "it are written with `time_unit` > 0 only.",
        history,
        "## steps.csv",
        "Written with `--all-steps`, also by `damjoint quake`: for every update of the internal "
        "variables, in their order, a row per joint node and per integration point. Besides the "
        "converged steps these are the weight alone, the increments of an equilibrium path that "
        "lead to a step, and the rounds of unstable crack growth; with `damjoint quake` also the "
        "static state after the record. Numbers have all digits; "
        "`lambda` and `joint_thickness` as in joint.csv.",
        steps,
        "## curve.csv",
        "Written by a run under displacement control: `time`, `level` [m], `pressure` [Pa] at the "
        "foot of the face, `heel_opening` [m], `crest_ux` [m] of each converged step; with "
        "`drive_load` also `load_factor` [-], with `drive = point` also `point_u` [m].",
        "## check.csv",
        "Written by `damjoint check`: for each joint of a scene a row by the finite elements, a "
        "row by the gravity method, and, where both have the same load, a row with their "
        "difference (first minus second).",
        check,
        "## gravity.csv",
        "Written by `damjoint check`: the resultants of the gravity method, a row per load, the "
        "uplift and the sum.",
        loads,
        "## critical.csv",
        "Written by `damjoint critical`: a row per equilibrium of each trial value; if the dam "
        "fails, also those after the highest level, under displacement control. Of several joints, "
        "the columns of joint 2, 3, ... follow as in history.csv.",
        critical,
        "## quake.csv",
        "Written by `damjoint quake`: a row per time step. `run.json` has the summary under "
        "`quake`; the last row of history.csv and the last state in joint.csv are static ones, "
        "after the earthquake. `quake_joint.csv` has the columns of joint.csv at up to "
        f"{MOST_FRAMES} times [s], from 0, the static state. `quake_stress.npz` (numpy): `time` "
        "[s], `s` [m] and `sigma_n_eff` [Pa] (rows, nodes) of the first joint. Of several records "
        "`records.csv` has a row for each: `folder`, `record`, then as in a row of a sweep with "
        "`--quake`, `verdict` and `statement`.",
        quake,
        "## modes.csv",
        "Written by `damjoint modes`, and in `run.json` under `modes`, with the parameters.",
        modes,
        "## CASE_sweep.csv",
        "Written by `damjoint sweep`, a row per combination, in the order of computation: `key`, "
        "of all that decides the row (values, loading, mesh, record, code), by which an "
        "interrupted sweep continues; the varied, sampled and tied values (a level as "
        "`level_requested`); the last row of "
        "history.csv; `failed` (1 where `damjoint run` ends with exit code 1), `verdict`, "
        "`statement`; with `--critical` the critical value, its `mode`, whether it is `confirmed` "
        "and by what; with `--quake` `peak_ground_ax` [m/s2], `residual_slip` [m], "
        "`residual_tilt` (both empty if the dam is not at rest), `rigid_block_slip` [m], "
        "`end_slip` [m], `peak_opening` [m], of the ground motion along x also `peak_ground_vx` "
        "[m/s], Arias' intensity `arias_x` [m/s] and `spectral_ax` [m/s2], the spectral "
        "acceleration at the dam's first period with a damping of 5 %. In a sample, "
        "a row whose loads exceed the largest possible strength of the joint is not "
        "computed; its `statement` gives this reason. Further files:",
        "- `_probability.csv`: probability of failure with the interval of Clopper and Pearson. "
        "Rows without a result are `undecided`; they count as failures, except for the lower "
        "limit.\n"
        "- `_sensitivity.csv`: Spearman's rank correlation of each sampled input with `failed` "
        "and, over the rows that stand, with `crack_length`, `max_opening` and `crest_ux`; of "
        "earthquakes, over the rows at rest, with `residual_slip` and `residual_tilt`.\n"
        "- `_sobol.csv`, with `--design sobol`: `outcome`, `input`, Sobol's `first`-order and "
        "`total` index, each with half the width of its 95 % interval.\n"
        "- `_fragility.csv` and `.png`, with `--quake`: of each limit `median` of the intensity "
        "with its 95 % interval and `dispersion` of the lognormal curve, numbers of rows, `reason` "
        "where there is no curve.\n"
        "- `.png`: a chart of one or two varied parameters, or of the sample.",
        "## sensitivity.csv",
        "Written by `damjoint run --sensitivity`, `check` and `critical`, a row per parameter and "
        "level: `parameter`, its `unit` and `value`, the time and the level [m], `kink` (1: a "
        "point of the joint is about to open, to slip or to break, and the derivative towards the "
        "other side differs), `of_runs` (1: of the geometry, by two runs), and the derivatives, in "
        "SI units per unit of the parameter, of columns of history.csv, of `SSF`, `OSF` and of "
        "`crack_end`, the end of the crack from the heel [m], or of `critical_level`.",
        "## reliability.csv",
        "Written by `damjoint reliability`, a row per critical level: `key`, by which an "
        "interrupted study continues; `of_joint`, the only joint that can fail (empty: all); the "
        "varied values; the critical level [m], its `mode`, the `joint` that fails, whether it is "
        "`confirmed` and by what, its derivatives `d_...` with the parameters where FORM and SORM "
        "have asked for them. `run.json` has the results under `reliability`; "
        "`design_point.case` is the case of the design point, `CASE_reliability.png` a picture of "
        "the probabilities by each method and of the importance factors.",
        "## calibration.csv, residuals.csv",
        "Written by `damjoint calibrate`. A row per free parameter: `parameter`, `unit`, `start`, "
        "`estimate`, `low` and `high` of its 95 % interval, `determined` (1, 0), and "
        "`correlation_NAME` with each other one. A row per measured value: `reading`, `date`, "
        "`level` [m], `series`, `measured`, `computed` and `standard_deviation` in the unit of "
        "the series, `residual`: their difference over the standard deviation.",
        "## fields/",
        "`bulk.msh` and `joint.msh` for Gmsh (a view per field with all levels as its steps); "
        "`fields.pvd` for ParaView, with a block for each body and joint, which has its name "
        "(`dam above lift 12 m`, `joint lift 12 m`; files `dam_2_t*.vtu`, `joint_2_t*.vtu`). The "
        "time that ParaView shows is the reservoir level, where it rises from each level to the "
        "next and `time_unit` is 0; else the time of the run, of an earthquake [s]. With order 2 "
        "of the condensed engine the cells are quadratic, with the displacement at their "
        "midpoints. Arrays have their unit in their name; `level [m]` is a value of each file. "
        "Bodies: `displacement [m]`, `stress [Pa]` (xx, yy, zz, xy, yz, xz), "
        "`largest principal stress [Pa]`, `smallest principal stress [Pa]` (tension > 0), "
        "`body` (1 dam, 2 foundation, 1001 dam 2, ...). Joints: "
        "`displacement [m]` of the body below, so that Warp By Vector moves them "
        "together; `opening [m]`, never negative; `jump [m]` and `traction [Pa]` along x, "
        "y, z, and the columns of joint.csv.",
    ]
    return "\n\n".join(parts) + "\n"


def validation_pages() -> None:
    """reference/ssnp142.md and published.md, and the table of README.md: the comparison with the
    published numbers, all tests computed again.
    """
    from damjoint.post.validation import FAMILIES, report, worst
    from damjoint.verification.validate import Options, compare, tests_of

    from .provenance import provenance, source_line

    source = source_line([provenance()], "Computed")
    with tempfile.TemporaryDirectory() as folder:
        options = Options(Path(folder), picture=False)
        rows = {f: list(compare(f, tests_of(f), options)) for f in FAMILIES}
    dams = [
        "# SSNP142: computed and published values",
        SSNP142,
        source,
        report(rows["ssnp142"], "github"),
        FACES,
        face_integrations([c for c in rows["ssnp142"] if c.reference.modeling in ON_FILES]),
        "![Modeling K: past the critical load](pictures/k_curve.png)",
    ]
    (REFERENCE / "ssnp142.md").write_text("\n\n".join(dams) + "\n")
    others = ["# Published tests beside SSNP142", OTHERS, source]
    for family, shows in FAMILIES.items():
        if family != "ssnp142":
            others += [f"## {family.upper()}", f"{shows[0].upper()}{shows[1:]}."]
            others += [report(rows[family], "github")]
        if family == "ssnp133":
            others += [ON_MESHES, plate_on_meshes()]
        if family == "sdnv138":
            others += [QUAKES, quake_conventions(rows[family])]
    others.append(icold_section())
    (REFERENCE / "published.md").write_text("\n\n".join(others) + "\n")
    lines = []
    for family, shows in FAMILIES.items():
        comparisons = rows[family]
        passed = sum(c.verdict == "pass" for c in comparisons)
        lines.append((family.upper(), shows, len(comparisons), passed, f"{worst(comparisons):.0%}"))
    heads = "family", "shows", "rows", "passed", "worst, of its tolerance"
    readme = Path("README.md")
    readme.write_text(between("families", readme.read_text(), markdown(lines, heads)))


#: Published points of the path of SSNP133 [m], of which the last is not judged.
PLATE = (1.15791783e-3, 5.20165353e-3, 7.72441193e-3)
ON_MESHES = (
    "The published values are those of a coarse mesh: the process zone, "
    "$E G_f/\\sigma_{max}^2$ = 75 m, is about as long as an element of the ligaments, so that the "
    "path is jagged, a tooth for each element that breaks. Some twenty meshes with as many "
    "elements (Gmsh's four algorithms, a division of an edge more or less) give -2.4 to +0.4 %, "
    "-2.1 to +0.9 % and, at the third published point, 7.724e-3 m at 4.74e6 N, -4.5 to +7 %. This "
    "one was chosen among them, so that 0.5 % at the first two points means that such a mesh "
    "exists; the third is not judged. On finer meshes all three converge, to other values; Gauss "
    "points, steps and a tangential stiffness ten times smaller change the third by less than "
    "0.1 %. How far the path is from the published points, on this mesh and finer ones:"
)


def plate_on_meshes() -> str:
    """Table of SSNP133 on meshes of both orders: how far the path is from its published points."""
    from damjoint.input.resolve import load
    from damjoint.runner import compute
    from damjoint.verification.path_tests import read, ssnp133

    lines = []
    for order in (1, 2):
        for finer in (1, 2, 4, 8):
            case = load("ssnp133", {"order": order, "n_joint": 10 * finer})
            path = read(ssnp133()["A"], compute(case, fields=False).result.history)
            apart = (f"{v / wanted - 1:+.1%}" for v, wanted in zip(path, PLATE, strict=True))
            lines.append((order, 19 * finer, *apart))
    heads = ("order", "elements on the joints", "1.0e7 N, falling", "1.1e7 N", "4.74e6 N, falling")
    return markdown(lines, heads)


def quake_conventions(published: list[Comparison]) -> str:
    """Table of SDNV138: published numbers, computed as published and by the package's own
    conventions.
    """
    from damjoint.post.validation import compare_steps, last_time
    from damjoint.verification.quake_tests import follow, sdnv138

    by_package: dict[Reference, Comparison] = {}
    for name, test in sdnv138().items():
        test = replace(test, settings={**test.settings, **OWN_CONVENTIONS})
        columns = follow(test, last_time("sdnv138"))
        by_package |= {c.reference: c for c in compare_steps("sdnv138", name, columns)}
    lines = [
        (
            c.reference.modeling,
            c.reference.quantity,
            f"{c.reference.value:.6g}",
            f"{c.computed:.6g}",
            f"{100 * c.difference:+.3f} %",
            f"{by_package[c.reference].computed:.6g}",
            f"{100 * by_package[c.reference].difference:+.2f} %",
        )
        for c in published
    ]
    heads = ("case", "quantity", "test file", "as published", "", "own conventions", "")
    return markdown(lines, heads)


def face_integrations(published: list[Comparison]) -> str:
    """Table of the cases on the geometry of their files: published numbers, computed as published
    and with the exact pressure on the face.
    """
    from damjoint.input.resolve import load
    from damjoint.post.validation import compare
    from damjoint.runner import run

    with tempfile.TemporaryDirectory() as folder:
        cases = [load(name.lower(), {"face_points": 0.0}) for name in ON_FILES]
        results = [run(case, Path(folder), False, False, False)[0] for case in cases]
    exact = {c.reference: c for result in results for c in compare(result)}
    lines = [
        (
            c.reference.modeling,
            c.reference.quantity,
            f"{c.reference.x:g}",
            *(f"{value:.6g}" for value in (c.reference.value, c.computed)),
            f"{100 * c.difference:+.3f} %",
            f"{exact[c.reference].computed:.6g}",
            f"{100 * exact[c.reference].difference:+.2f} %",
        )
        for c in published
    ]
    heads = ("case", "quantity", "x", "test file", "as published", "", "exact pressure", "")
    return markdown(lines, heads)


#: The cases on the geometry of their files whose pressure on the face is integrated as published.
ON_FILES = "C_FILE", "D_FILE", "J_FILE"
SSNP142 = (
    "The output of `damjoint validate`, written by `make pages`. Stress and jump of code_aster are "
    "node values extrapolated from the Gauss points of each element, and are compared with values "
    "computed in the same way. A value that only code_aster computes has no published tolerance: "
    "it is judged by at most 1.5 %, by 0.02 % on the mesh of the test file, and at the closing "
    "front of E, F, G, H and K, where the values are small and steep, by 3 to 10 %; the published "
    "tolerances of the family are up to 15 %. A_FILE is A with the tangential jump as its test "
    "file prints it: where the joint is released, code_aster's variable counts the slip of the "
    "last step twice (its jump itself is 2.65e-7 m). "
    "For E and F the document and the test files print different values of GEFDYN; both are "
    "judged. GEFDYN is the finite element code that SSNP142 uses as reference. The opening of I at "
    "the heel is close to the tolerance of its value, but agrees with code_aster. C, D and J have "
    "two geometries: that of the document, beside own runs of code_aster, and C_FILE, D_FILE, "
    "J_FILE, geometry and mesh of the test files (a joint 0.1 m thick below a dam of 9.9 m).\n\n"
    "Of the other modelings, the test files' meshes are not part of this package. On them, with "
    "the pressure on the face integrated as there, the values of A and I differ by 0.02 %, "
    "of G by 0.03 % (flux 0.1, opening at the closing front 2), of E by 0.1 % (there 1), "
    "of K by 0.2 % (stress at the crack front 0.5): mesh and integration are the difference."
)
FACES = """## C, D and J: the pressure on the face

The test files integrate the pressure on the face with 2 (C, D) and 4 (J) Gauss points on each side
of the mesh; the water line at 9 m cuts the longest of its ten sides. So do C_FILE, D_FILE and
J_FILE (`face_points`), which gives the published digits. With the exact pressure (`--set
face_points=0`), as everywhere else, the same meshes give the last columns."""
#: Settings of SDNV138 by the conventions of this package.
OWN_CONVENTIONS: Values = {"face_points": 0.0, "time_integration": "HHT"}
QUAKES = """The same meshes, time steps and dashpots by the conventions of this package (the
defaults of `face_points` and `time_integration`): exact pressure on the face, HHT of second order,
dashpots at each Gauss point while it is closed. With water in the joint (B, C) the dam is at the
limit of overturning, and the time step is one or two periods of its first frequency: displacements
depend on each of these."""
OTHERS = (
    "The output of `damjoint validate all`, written by `make pages`. A value of a closed form or "
    "of another code is judged by the tolerance of the test file. A value that only the published "
    "code computes has none; its tolerance is ours, never wider than those of the same family: "
    "0.1 % (SSNP162) and 1 % (SSNP164), as the closed forms at the same point; 2 % in SSNP143, "
    "where GEFDYN's values have 4 to 7 %, and 5 % for F's opening at 8.5 m.\n\n"
    "SSNP143: order, edges and sizes of the mesh are the published ones, the triangles between "
    "the edges are not; this changes the values that the published code prints by some percent, "
    "F's opening at 8.5 m by up to 8 % (order 2: by 10 %). On the meshes of the test files, which "
    "are not part of this package, A, E and G give the printed values to 3e-5, B, F and H to "
    "0.2 %. The table of a 3D test is read along z = 1 m, as published. In C and D the published "
    "test moves one side of the blocks; here they are warmed to the same effect. The shear of a "
    "few Pa in E to H comes from the mesh, the two blocks are symmetric; it is not judged.\n\n"
    "SSNP133: about as many elements as published; the triangles of the published mesh are not "
    "known. Its published values are those of its coarse mesh, see below. SSNP166: the support "
    "holds the end face; at a point, as published, it would make a dent that depends on the "
    "mesh.\n\n"
    "SSNP162: B, C, M, N and O are A on other elements, F, Q and R are E, H and I are G, P is D, "
    "K and L are J. The closed form of D II leaves out the hardening that the published code and "
    "we have. In SSNP164 C the shear across the joint is not judged: the published code has "
    "-29.7 Pa at t = 40, $B_n/B_t$ times the -6.97 Pa that its own equations give; F opens in the "
    "same way and is left out.\n\n"
    "SDNV138 is judged by what the published code computes, at 0.02 %: what remains is that its "
    "quadrangles of order 2 have eight functions, here nine, and that a record here begins with a "
    "row of zeros, at rest; without these two differences the tests of this package give the "
    "numbers to 1e-6. The reference of the test file has the values of B with its two points "
    "interchanged, and judges B, C and D by them at 1 to 30 % (no displacement of D): it is not "
    "used.\n\n"
    "SLAMMER is judged by the tolerance with which pySLAMMER verifies itself by it, 2 %; slips of "
    "less than half a centimetre, which pySLAMMER compares to 0.5 mm, are left out. Of the 18 "
    "records that pySLAMMER ships there are two here, the shortest with an interval of 0.005 s: "
    "at intervals of 0.01 and 0.02 s the slips of SLAMMER are larger than ours, by up to 8 %. The "
    "likely cause, that it integrates with the record's interval, is not shown.\n\n"
    "WTNP128 is judged by the measurements at their published tolerances, and by what the "
    "published code computes at 0.5 %. The mesh is ours (`geo/wedge.geo`, half of the specimen): "
    "the wedge is a point force, whose displacement grows as the elements around it get smaller, "
    "so that half the size moves the forces by 1 %."
)


def icold_section() -> str:
    """The section of published.md on a dam whose cracks are not judged, computed again."""
    from .icold import ABOUT, table
    from .provenance import provenance, source_line

    source = source_line([provenance()], "Computed")
    return "\n\n".join(["<!-- icold -->", ABOUT, source, table(), "<!-- /icold -->"])


def tour_page() -> str:
    """reference/tour.md with its commands run again, one after the other in a temporary folder."""
    from .provenance import provenance, source_line

    source = source_line([provenance()], "Computed")
    page = between("figures", (REFERENCE / "tour.md").read_text(), source)
    with tempfile.TemporaryDirectory() as folder:
        play = lambda block: f"```\n{played(block[1], Path(folder))}```"
        return re.sub(r"^```\n(.*?)^```$", play, page, flags=re.S | re.M)


def between(mark: str, text: str, new: str) -> str:
    """A text with `new` between the comments <!-- mark --> and <!-- /mark -->."""
    marks = rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)"
    return re.sub(marks, lambda match: f"{match[1]}{new}\n{match[2]}", text, flags=re.S)


def played(block: str, folder: Path) -> str:
    """A block of code of the tour with the output of each line `$ damjoint ...` below it; a block
    that begins with `// NAME.case` is written to that file.

    Raises ValueError if a command ends with an error of the input.
    """
    if file := re.match(r"// (\S+\.case)\n", block):
        (folder / file[1]).write_text(block)
        return block
    blocks = ""
    for command in re.findall(r"^\$ damjoint (?:.*\\\n)*.*\n", block, flags=re.M):
        words = [sys.executable, "-m", *shlex.split(command[2:].replace("\\\n", ""))]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):
            raise ValueError(f"{command}{done.stderr}")
        printed = "\n".join(line.rstrip() for line in done.stdout.splitlines())
        blocks += f"{command}{printed}\n" + f"(exit code {done.returncode})\n" * done.returncode
    return blocks


def take_bench(out: Path) -> None:
    """Page, picture and the modelings' table of README.md from a benchmark's folder."""
    shutil.copy(out / "benchmarks.md", REFERENCE)
    shutil.copy(out / "accuracy.png", REFERENCE / "pictures")
    readme, table = Path("README.md"), (out / "modelings.md").read_text()
    readme.write_text(between("modelings", readme.read_text(), table.rstrip("\n")))


def main(words: list[str]) -> None:
    """Write the pages of a name: bench, trust, parameters, results, tour, laws (a picture),
    validation, icold or all.
    """
    if words[0] == "bench":
        take_bench(Path(words[1]))
    if words[0] == "trust":
        mark, section = trust_section(Path(words[1]))
        page = REFERENCE / "trust.md"
        page.write_text(between(mark, page.read_text(), section))
    if words[0] == "icold":
        page = REFERENCE / "published.md"
        before, _, rest = page.read_text().partition("<!-- icold -->")
        after = rest.partition("<!-- /icold -->")[2] or "\n"
        page.write_text(f"{before.rstrip()}\n\n{icold_section()}{after}")
    if words[0] in ("parameters", "all"):
        (REFERENCE / "parameters.md").write_text(parameters_page())
    if words[0] in ("results", "all"):
        (REFERENCE / "results.md").write_text(results_page())
    if words[0] in ("tour", "all"):
        (REFERENCE / "tour.md").write_text(tour_page())
    if words[0] in ("laws", "all"):
        draw_laws(REFERENCE / "pictures" / "laws.png")
    if words[0] in ("validation", "all"):
        validation_pages()


if __name__ == "__main__":
    main(sys.argv[1:])
