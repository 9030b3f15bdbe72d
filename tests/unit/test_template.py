"""damjoint new: a file that runs as it is, and says everything."""

from damjoint.model import casefile, parameters
from damjoint.model.case import load


def test_it_is_the_dam_of_the_defaults(command, tmp_path):
    assert command("new", "my.case")[0] == 0
    case, dam = load("my.case"), load("dam")
    assert case.values == dam.values and case.title == "my"
    assert case.levels == (30, 40, 45) and case.tail_levels == (0, 0, 3)


def test_every_parameter_stands_in_it_and_every_line_can_be_used(command, tmp_path):
    """With all comment marks in front of statements taken away it is a case still."""
    command("new", "my.case")
    text = (tmp_path / "my.case").read_text().replace("// default_", "default_")
    (tmp_path / "all.case").write_text(text)
    assert set(casefile.read(tmp_path / "all.case").defaults) == set(parameters.declared())
    assert load("all.case").values == load("dam").values


def test_nothing_is_overwritten(command, tmp_path):
    (tmp_path / "my.case").write_text("mine")
    for name, said in (("my.case", "must not exist"), ("my.txt", "must end in .case")):
        code, _, err = command("new", name)
        assert code == 2 and said in err and len(err.splitlines()) == 1
    assert (tmp_path / "my.case").read_text() == "mine"
