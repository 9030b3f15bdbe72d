"""damjoint tables: the tables of results for a spreadsheet."""

import csv
import math
import sys

import pytest
from damjoint.post import spreadsheet

HISTORY = "level,crest_ux,verdict\n3,1.25e-05,stands\n6,nan,'=stands\n"


@pytest.fixture
def results(tmp_path):
    """A folder of results with tables in it and below it."""
    folder = tmp_path / "out" / "my"
    (folder / "none").mkdir(parents=True)
    (folder / "history.csv").write_text(HISTORY)
    (folder / "none" / "history.csv").write_text("level\n3\n")
    return folder


def test_csv_files_with_a_decimal_comma(command, results):
    """Beside the results, which stay; semicolons between the cells, nothing for an unknown one."""
    code, out, _ = command("tables", results, "--decimal", ",")
    assert code == 0 and out == f"2 tables; {results}_tables\n"
    written = results.with_name("my_tables") / "history.csv"
    with written.open(newline="") as file:
        head, first, second = csv.reader(file, delimiter=";")
    assert head == ["level", "crest_ux", "verdict"]
    assert (first, second) == (["3", "1,25e-05", "stands"], ["6", "", "'=stands"])
    assert (written.parent / "none history.csv").read_text() == "level\n3\n"
    assert (results / "history.csv").read_text() == HISTORY
    command("tables", results / "history.csv", "--decimal", ".", "--out", "plain")
    assert (results.parents[1] / "plain" / "history.csv").read_text() == HISTORY.replace("nan", "")


def test_a_workbook_has_a_sheet_for_each_table(command, results):
    openpyxl = pytest.importorskip("openpyxl")
    code, out, _ = command("tables", results)
    assert code == 0 and out == f"2 tables; {results}_tables.xlsx\n"
    workbook = openpyxl.load_workbook(f"{results}_tables.xlsx")
    assert workbook.sheetnames == ["history", "none history"]
    rows = list(workbook["history"].values)
    assert rows == [
        ("level", "crest_ux", "verdict"),
        (3, 1.25e-05, "stands"),
        (6, None, "'=stands"),
    ]
    assert workbook["history"].freeze_panes == "A2"


def test_what_can_not_be_written_is_reported_in_one_line(refused, results, monkeypatch):
    message = refused("tables", results.parents[1] / "nowhere")
    assert "must be a folder of results with tables, or a CSV file" in message
    refused("tables", results, "--decimal", "x")
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert "needs openpyxl" in refused("tables", results)
    (results / "bad.csv").write_bytes(b"\xff\xfe")
    assert "bad.csv: must be a CSV file" in refused("tables", results, "--decimal", ",")


def test_names_of_sheets_are_short_and_different():
    taken = set()
    for table in ("a" * 40, "a" * 41, "A" * 42, "b: [c]"):
        name = spreadsheet.sheet_name(table, taken)
        assert len(name) <= 31 and name.lower() not in taken and not set(name) & set("[]:*?/\\")
        taken.add(name.lower())


def test_cells_are_numbers_or_texts_as_they_are():
    cells = map(spreadsheet.parsed_cell, ("1e3", "-0.5", "nan", "inf", "", "lift 12 m"))
    assert list(cells) == [1000.0, -0.5, "", "inf", "", "lift 12 m"]
    assert math.isclose(float(spreadsheet.number_text(1 / 3, ".")), 1 / 3, rel_tol=1e-11)
