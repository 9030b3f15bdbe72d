"""Pressure and flux of the water in the joints, from the written openings.

Heads at the ends by the levels; between them, by `uplift`, a straight line, the line over the
drains, or the flow through the openings: in 2D the elements are resistances in series, in a network
where joints meet, in 3D finite elements. The discretisation is that of reference/theory.md:
pressure of order 1, the cube of the aperture integrated by the points of the joint law.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .files import Files, Table
from .joint_state import is_stored, pressure, states
from .network import Network, heads_of, networks
from .reader import Request

#: Error of a pressure over the largest one, and of a flux over its scale: they are written with 12
#: digits. In 3D, of a system of equations.
DIGITS, IN_3D = 1e-9, 1e-6
#: Last digits of the heads by which a flux may differ: those of two solutions.
HEAD_DIGITS = 10


def violations(files: Files, request: Request, steps: Table) -> Iterator[str]:
    """Yield where pressure or flux differ from those that follow from the openings, but where water
    is stored, see water_in_time; in 3D of a run with fields, which have the elements of the joints.
    """
    plane = request.joints[0]["dim"] == 2
    room = DIGITS if plane else IN_3D
    if not plane and not (files.folder / "fields").is_dir():
        return
    for _, joints in states(files, request, steps):
        time = joints[0].rows["time"][0]
        together = networks(joints)
        stored = {
            joint.number
            for network in together
            for joint in network.joints
            if network.flowing and is_stored(request, time)
        }
        for joint, heads in zip(joints, heads_of(joints), strict=True):
            if joint.number in stored:
                continue
            exact = pressure(joint, heads)(joint.positions)
            scale = joint.unit_weight * max(
                joint.level, joint.tail, request.joints[0]["dam_height"]
            )
            error = np.abs(joint.rows["p"] - exact).max()
            if error > room * scale:
                yield f"joint {joint.number + 1}: p off by {error:.3g} Pa at t = {time:g}"
        for network in together:
            for k, joint in enumerate(network.joints):
                if joint.values["uplift"] == "flow" and joint.number not in stored:
                    yield from flux(files, network, k, room)


def flux(files: Files, network: Network, joint: int, room: float) -> Iterator[str]:
    """Yield where the flux in the tables of a joint differs."""
    state = network.joints[joint]
    time, history = state.rows["time"][0], files.history_of(state.number)
    means, leakage, scale, by_digits = network.flux(joint)
    written = float(history["flux"][np.argmin(np.abs(history["time"] - time))])
    for what, error in (
        ("flux", np.abs(state.rows["flux"] - means).max()),
        ("leakage", abs(written - leakage)),
    ):
        if error > max(room * scale, HEAD_DIGITS * by_digits):
            yield f"joint {state.number + 1}: {what} off by {error:.3g} kg/(m s) at t = {time:g}"
