"""What is printed fits the terminal."""

import io
import sys

import pytest
from damjoint.cli.options import say

SENTENCE = "only equilibrium is judged: required_SSF, required_OSF, required_position are not set"
TABLE = "joint           SSF  N' at x  crack  broken  slipped  N' in"


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self):
        return True


@pytest.mark.parametrize("width", [40, 60])
def test_sentences_are_broken_between_words_on_a_terminal(monkeypatch, width):
    """Tables and words are kept whole; the words are the same."""
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setattr(sys, "stdout", Terminal())
    path = "out/a_long_path/that-is-copied-from-the-terminal/into/another/command/check.csv"
    say(SENTENCE, "", TABLE, path)
    lines = sys.stdout.getvalue().splitlines()
    assert lines[-2:] == [TABLE, path]
    sentence = lines[: lines.index("")]
    assert " ".join(sentence) == SENTENCE
    assert max(map(len, sentence)) <= width < len(SENTENCE)


def test_a_file_has_a_sentence_in_one_line(monkeypatch, capsys):
    """Where it is searched by its words."""
    monkeypatch.setenv("COLUMNS", "40")
    say(SENTENCE)
    assert capsys.readouterr().out == SENTENCE + "\n"
