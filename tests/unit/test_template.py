"""damjoint new: a case file that runs as it is and has all parameters."""

from damjoint.input import casefile, parameters
from damjoint.input.resolve import load


def test_the_new_case_is_the_dam_of_the_defaults(command, tmp_path):
    assert command("new", "my.case")[0] == 0
    case, dam = load("my.case"), load("dam")
    assert case.values == dam.values and case.title == "my"
    assert case.levels == (30, 40, 45) and case.tail_levels == (0, 0, 3)


def test_the_new_case_has_all_parameters_in_valid_statements(command, tmp_path):
    """Without the comment marks in front of its statements it is still a case."""
    command("new", "my.case")
    text = (tmp_path / "my.case").read_text().replace("// default_", "default_")
    (tmp_path / "all.case").write_text(text)
    assert set(casefile.read(tmp_path / "all.case").defaults) == set(parameters.declared())
    assert load("all.case").values == load("dam").values


def test_all_examples_of_the_new_case_can_be_taken(command, tmp_path):
    """Lifts with the block of one of them, and a polygonal face."""
    command("new", "my.case")
    text = (tmp_path / "my.case").read_text()
    for start in ("lift_heights()", "downstream_face()", "Struct Joint::"):
        assert text.count(f"// {start}") == 1
        text = text.replace(f"// {start}", start)
    (tmp_path / "taken.case").write_text(text)
    case = load("taken.case")
    assert [*case.joint_names] == ["base", "lift 15 m", "lift 30 m"]
    assert [joint["law"] for joint in case.joints] == ["bond", "friction", "bond"]
    assert case.downstream_face == (20, 20, 8, 38)


def test_an_existing_file_is_not_overwritten(command, tmp_path):
    (tmp_path / "my.case").write_text("mine")
    for name, message in (("my.case", "must not exist"), ("my.txt", "must end in .case")):
        code, _, err = command("new", name)
        assert code == 2 and message in err and len(err.splitlines()) == 1
    assert (tmp_path / "my.case").read_text() == "mine"
