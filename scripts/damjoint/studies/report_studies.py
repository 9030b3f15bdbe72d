"""Reliability, fragility and calibration in a report: what was varied, results."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from .. import InputError
from ..input.parameters import of_any_joint
from ..pictures.report_picture import Picture, bands
from ..post import stored
from ..post.folder import RECORD, read_record
from ..post.summary import Table
from . import report_input, sampling
from .calibrate_study import RESIDUALS
from .fragility_picture import NAMES
from .plan import FRAGILITY, beside, quantity_of
from .plan import RECORD as SWEEP_RECORD
from .quake_summary import INTENSITIES
from .reliability_study import PICTURE, reliability_index, unit_of
from .report_input import Entry

#: A share below this is rounding [%].
LEAST_SHARE = 0.005
#: Meaning and unit of what is varied and no parameter.
MEANINGS = {
    "level": ("reservoir level", "m"),
    "record": ("record of the ground motion", ""),
    "record_sign": ("sign of the record", ""),
}


@dataclass(frozen=True)
class StudySection:
    """A reliability or a fragility in the report."""

    number: int
    kind: str
    folder: str
    title: str
    made: str
    #: the result in a few words
    answer: str
    #: how far it can be trusted
    sentences: list[str]
    tables: dict[str, Table]
    pictures: list[Picture]
    notes: list[str]
    materials: dict[str, Entry]
    other_input: dict[str, Entry]
    limits: list[str]
    versions: dict[str, str]


def read(path: Path, number: int) -> StudySection:
    """Make the section of the folder of a reliability, or of the CSV file of a sweep that has a
    fragility; number: the report's.

    Raises InputError if files are missing or damaged.
    """
    of_sweep = path.suffix == ".csv"
    record = beside(path, SWEEP_RECORD) if of_sweep else path / RECORD
    info = read_record(record)
    if of_sweep and not (info and beside(path, FRAGILITY[0]).is_file()):
        raise InputError(
            f"out = {path}: must be a folder, or of a sweep of earthquakes with its fragility, "
            f"{beside(path, FRAGILITY[0]).name}"
        )
    assert info
    try:
        case = stored.case_of(info)
        contents = fragility(path, info) if of_sweep else reliability(path, info)
        made = datetime.fromtimestamp(record.stat().st_mtime)
        return StudySection(
            number=number,
            kind="Fragility" if of_sweep else "Reliability",
            folder=str(path),
            title=case.title,
            made=f"{made:%Y-%m-%d %H:%M}",
            **contents,
            notes=info.get("notes", []),
            materials=report_input.materials(case),
            other_input=report_input.other_input(case),
            limits=[*report_input.limits(case, earthquake=of_sweep)],
            versions=versions(info),
        )
    except stored.DAMAGED as error:
        why = error if isinstance(error, InputError) else f"damaged ({error!r})"
        raise InputError(f"out = {path}: {why}; compute it again") from None


def versions(info: Mapping[str, Any]) -> dict[str, str]:
    """Versions, factorisation and machine of a study; those by earlier versions lack some."""
    others = {name: info.get(name) for name in ("commit", "factorisation", "machine")}
    return info["versions"] | {name: str(text) for name, text in others.items() if text}


def uncertain(distributions: Mapping[str, str], tied: Mapping[str, str]) -> Table:
    """Tabulate what is varied: name, meaning, distribution, values or expression, unit."""
    rows = [(*named(name), text) for name, text in (*distributions.items(), *tied.items())]
    return plain(["parameter", "meaning", "unit", "distribution, values or expression"], rows)


def plain(names: list[str], rows: Iterable[tuple[str, ...]]) -> Table:
    """A table whose columns have no units of their own."""
    return Table(names, [""] * len(names), [*rows])


def sized(name: str, values: Sequence[float]) -> tuple[str, list[str]]:
    """The unit in which values of a parameter are shown, and the values."""
    shown, factor = report_input.suitable_unit(quantity_of(name)[1], np.array(values))
    return shown, [f"{value * factor:.4g}" for value in values]


def named(name: str) -> tuple[str, str, str]:
    """Name, meaning and unit of a parameter or of what a sweep varies besides."""
    if name in MEANINGS:
        return name, *MEANINGS[name]
    return name, of_any_joint(name).description, unit_of(name)


# -- reliability
# --------------------------------------------------------------------------------------------------


def reliability(folder: Path, info: Mapping[str, Any]) -> dict[str, Any]:
    """Answer, sentences, tables and picture of a reliability."""
    entry = info["reliability"]
    *single, whole = entry["of"]
    fixed = "level" not in entry["distributions"]
    what = f"level {info['levels'][-1]:g} m" if fixed else "the level"
    count = entry["critical_levels"]
    sentences = [f"Probability that {what} exceeds the critical level, at which the dam fails."]
    sentences += [
        f"{one['joint'] or 'All joints' * bool(single)}: {one['agreement']}".removeprefix(": ")
        for one in entry["of"]
        if one["agreement"]
    ]
    if whole["form"] and not whole["converged"]:
        sentences.append("The search for the design point has not converged: FORM is doubtful.")
    sentences += [f"Rank correlation {text}." for text in entry["correlate"]]
    of = f"of {count} critical levels"
    if entry["undecided"]:
        sentences.append(f"{entry['undecided']} {of} failed: counted as failures.")
    confirmed = (
        f"{entry['not_confirmed']} {of} are not confirmed." if entry["not_confirmed"] else ""
    )
    sentences.append(confirmed or f"All {count} critical levels are confirmed.")
    tables = {
        "What is uncertain": uncertain(entry["distributions"], entry["tied"]),
        "Probability of failure": probabilities(entry["of"]),
    }
    if whole["form"]:
        tables["Design point: the most probable values at failure"] = design(whole)
    path = folder / f"{info['case']}{PICTURE}"
    return {
        "answer": answer_text(whole),
        "sentences": sentences,
        "tables": tables,
        "pictures": [Picture("full", "", bands(path))] if path.is_file() else [],
    }


def answer_text(one: Mapping[str, Any]) -> str:
    """Probability and reliability index in a few words: of the samples, else by FORM."""
    if one["samples"]:
        low, high = one["interval"]
        share = f"P = {one['sampled']:.3g} ({low:.3g} to {high:.3g})"
        beta = f", beta = {reliability_index(one['sampled']):.3g}" if one["sampled"] else ""
        return share + beta
    return f"P = {one['form']:.3g}, beta = {one['beta']:.3g} (FORM)" if one["form"] else "no result"


def probabilities(of_joints: Sequence[Mapping[str, Any]]) -> Table:
    """Tabulate probability and reliability index by each method, with intervals; of each of several
    joints, as if no other could fail, and of all.
    """
    rows = list[tuple[str, ...]]()
    several = len(of_joints) > 1
    for one in of_joints:
        methods: dict[str, tuple[float | None, list[float]]] = {
            "FORM": (one["form"], []),
            "SORM, Breitung": (one["sorm_breitung"], []),
            "SORM, Tvedt": (one["sorm_tvedt"], []),
        }
        if one["samples"]:
            methods[f"{one['samples']} samples"] = one["sampled"], one["interval"]
        for number, (method, (share, interval)) in enumerate(methods.items()):
            joint = (one["joint"] or "all joints") if number == 0 else ""
            between = " to ".join(f"{p:.4g}" for p in interval)
            betas = " to ".join(f"{reliability_index(p):.4g}" for p in reversed(interval))
            cells = ["-", "-", "-", "-"]
            if share:
                cells = [f"{share:.4g}", between, f"{reliability_index(share):.4g}", betas]
            rows.append((joint, method, *cells)[0 if several else 1 :])
    within = f"{sampling.CONFIDENCE:.0%} interval"
    names = ["joint", "method", "probability", within, "beta", within]
    return plain(names[0 if several else 1 :], rows)


def design(one: Mapping[str, Any]) -> Table:
    """Tabulate the design point and the importance factors."""
    shares = {name: 100 * share for name, share in one["importance"].items()}
    rows = list[tuple[str, ...]]()
    for name, value in one["design_point"].items():
        shown, texts = sized(name, [value])
        share = shares[name] if shares[name] > LEAST_SHARE else 0
        rows.append((*named(name)[:2], shown, *texts, f"{share:.3g}"))
    return Table(["parameter", "meaning", "unit", "value", "importance"], [""] * 4 + ["%"], rows)


# -- fragility
# --------------------------------------------------------------------------------------------------


def fragility(path: Path, info: Mapping[str, Any]) -> dict[str, Any]:
    """Answer, sentences, tables and picture of the fragility of a sweep."""
    with beside(path, FRAGILITY[0]).open(newline="", encoding="utf-8") as file:
        curves = [*csv.DictReader(file)]
    about, intensity = info["sweep"], curves[0]["intensity"]
    size = INTENSITIES[intensity].replace("s2", "s²")
    varied = {n: listed(v) for n, v in about["vary"].items()}
    varied |= dict.fromkeys(about["sample"], "random")
    records = curves[0]["records"]
    how = f"from the scatter between {records} records"
    if int(records) < 2:
        how = "of independent rows: rows of one record are not"
    rows = [
        (
            *(curve[name] for name in ("limit", "rows", "exceed", "undecided")),
            *(
                rounded(curve[name])
                for name in ("median", "median_low", "median_high", "dispersion")
            ),
        )
        for curve in curves
    ]
    names = ["limit", "rows", "exceed it", "undecided", "median", "95 %: from", "to", "dispersion"]
    picture = beside(path, FRAGILITY[1])
    known = [c for c in curves if c["median"]]
    medians = (f"{c['limit']}: median {float(c['median']):.3g} {size}" for c in known)
    return {
        "answer": "; ".join(medians) or "no curve",
        "sentences": [
            f"Probability that an earthquake exceeds a limit, lognormal in the {NAMES[intensity]}; "
            f"{sampling.CONFIDENCE:.0%} intervals {how}.",
            *(f"{c['limit']}: {c['reason']}." for c in curves if c["reason"]),
        ],
        "tables": {
            "What is varied": uncertain(varied, about["tie"]),
            "Fragility": Table(names, ["", "", "", "", size, size, size, ""], rows),
        },
        "pictures": [Picture("full", "", bands(picture))] if picture.is_file() else [],
    }


def listed(values: Sequence[Any]) -> str:
    """The values of a parameter in a sweep."""
    return ", ".join(v if isinstance(v, str) else f"{v:.6g}" for v in values)


def rounded(cell: str) -> str:
    """A number of a file with four digits; - where it has none or no limit."""
    return f"{float(cell):.4g}" if cell and float(cell) < math.inf else "-"


# -- calibration
# --------------------------------------------------------------------------------------------------


def calibration(folder: Path, info: Mapping[str, Any]) -> tuple[list[str], dict[str, Table]]:
    """Sentences and tables of a calibration: its estimates, what is left of each series."""
    entry = info["calibration"]
    rows = list[tuple[str, ...]]()
    for name, one in entry["parameters"].items():
        shown, texts = sized(name, [one["start"], one["estimate"], *one["interval"]])
        determined = "no" if name in entry["undetermined"] else "yes"
        rows.append((*named(name)[:2], shown, *texts, determined))
    names = ["parameter", "meaning", "unit", "start", "estimate", "95 %: from", "to", "determined"]
    count = f"{entry['measured_values']} measured values"
    sentences = [f"{count}, {entry['runs']} runs: {entry['verdict']}.", *entry["findings"]]
    with (folder / RESIDUALS).open(newline="", encoding="utf-8") as file:
        read = [*csv.DictReader(file)]
    residuals: dict[str, list[float]] = {}
    for row in read:
        residuals.setdefault(row["series"], []).append(float(row["residual"]))
    fits = [
        (name, f"{len(v)}", f"{np.mean(v):.3g}", f"{np.std(v):.3g}", f"{np.abs(v).max():.3g}")
        for name, v in residuals.items()
    ]
    heads = ["series", "values", "mean", "scatter", "largest"]
    return sentences, {
        "Calibration: estimates": plain(names, rows),
        "Calibration: residuals over the standard deviation of the measurements": plain(
            heads, fits
        ),
    }
