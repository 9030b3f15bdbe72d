"""The graph of bodies and joints."""

from damjoint.input.joint_graph import JointGraph

#: Two blocks on the rock, with a contraction joint between them, and a lift in the first one.
BLOCKS = JointGraph((("foundation", "a"), ("foundation", "b"), ("a", "b"), ("a", "top")))


def test_bodies_without_a_connection_to_the_rock():
    assert BLOCKS.separated(()) == set()
    assert BLOCKS.separated((0,)) == set()  # held by the other block
    assert BLOCKS.separated((0, 2)) == {"a", "top"}
    assert BLOCKS.separated((0, 1)) == {"a", "b", "top"}


def test_joints_whose_failure_detaches_a_body():
    assert BLOCKS.separating((2, 3)) == (3,)
    assert BLOCKS.separating((0, 1, 2)) == (0, 1)
    assert BLOCKS.separating((0, 2)) == ()


def test_joints_between_bodies_that_other_joints_hold():
    assert [BLOCKS.is_internal(k) for k in range(4)] == [False, False, True, False]
