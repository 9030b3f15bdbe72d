"""The tour: its commands print what the page shows."""

import re
from pathlib import Path

import pytest
from damjoint import __version__
from damjoint_tools import pages
from numpy.testing import assert_allclose

PAGE = Path(__file__).parents[2] / "reference" / "tour.md"
NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def words_and_numbers(text):
    """The text without numbers, blanks, rules of tables and the line of origin; the numbers."""
    text = pages.between("figures", text, "")
    words = re.sub(r"[\s-]+", " ", NUMBER.sub("#", text))
    return words, [float(number) for number in NUMBER.findall(text)]


@pytest.mark.heavy
def test_the_tour_is_current():
    """After a change of printed output: `make pages`. The last digits depend on the machine."""
    words, numbers = words_and_numbers(PAGE.read_text())
    words_now, numbers_now = words_and_numbers(pages.tour_page())
    assert words_now == words
    assert_allclose(numbers_now, numbers, rtol=2e-3)


def test_the_output_of_a_command_is_written_below_it(tmp_path):
    block = "$ damjoint \\\n    --version\n1.2.3 of long ago\n"
    assert pages.played(block, tmp_path) == f"$ damjoint \\\n    --version\n{__version__}\n"


@pytest.mark.heavy
def test_a_case_file_of_the_tour_is_written_and_a_refused_command_is_an_error(tmp_path):
    block = '// my.case\ntitle = "no dam";\ndefault_dam_height = -1;\n'
    assert pages.played(block, tmp_path) == block
    assert (tmp_path / "my.case").read_text() == block
    with pytest.raises(ValueError, match="dam_height = -1"):
        pages.played("$ damjoint run my.case\n", tmp_path)
