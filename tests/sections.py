"""Loads on the part of a section above its joint, by integration over its outline: independent of
segments, meshes and engines of the package.
"""

from itertools import pairwise

import numpy as np


def clip(polygon, point, direction):
    """Part of a polygon (n, 2) on the left of a line."""
    across = np.array([-direction[1], direction[0]])
    heights = (polygon - point) @ across
    found = []
    for i in range(len(polygon)):
        k = (i + 1) % len(polygon)
        if heights[i] >= -1e-9:
            found.append(polygon[i])
        if heights[i] * heights[k] < 0 and min(abs(heights[i]), abs(heights[k])) > 1e-9:
            share = heights[i] / (heights[i] - heights[k])
            found.append(polygon[i] + share * (polygon[k] - polygon[i]))
    found = np.array(found)
    apart = np.linalg.norm(found - np.roll(found, 1, axis=0), axis=1) > 1e-9
    return found[apart]


def outline(case):
    """Section counterclockwise from the heel of its base; start and direction of its joint."""
    v = case.values
    slope = np.radians(v["joint_slope"])
    toe_y = 0 if v["joint_height"] else v["dam_base"] * np.tan(slope)
    crest = v["batter"] + v["dam_crest"]
    neck = (crest + bool(v["neck_height"]) * v["neck_batter"], v["dam_height"] - v["neck_height"])
    face = case.downstream_face or neck
    points = [
        (0, 0),
        (v["dam_base"], toe_y),
        *zip(face[::2], face[1::2], strict=True),
        (crest, v["dam_height"]),
        (v["batter"], v["dam_height"]),
        (v["batter"], v["batter_height"]),
    ]
    x = v["batter"] * min(v["joint_height"] / v["batter_height"], 1)
    start, direction = np.array([x, v["joint_height"]]), np.array([np.cos(slope), np.sin(slope)])
    return clip(np.array(points, float), start, direction), start, direction


def integrate(a, b, pressure, kinks):
    """Force (2,) and moment about the origin of a pressure(y) on the edge from a to b, with the
    body on its left; kinks: heights at which the pressure has a kink.
    """
    along = b - a
    inwards = np.array([-along[1], along[0]])
    cuts = [(y - a[1]) / along[1] for y in kinks if along[1]]
    cuts = np.unique(np.clip([0, 1, *cuts], 0, 1))
    x, w = np.polynomial.legendre.leggauss(60)
    force, moment = np.zeros(2), 0.0
    for low, high in pairwise(cuts):
        for u, weight in zip(low + (high - low) * (x + 1) / 2, w * (high - low) / 2, strict=True):
            place = a + u * along
            part = pressure(place[1]) * weight * inwards
            force += part
            moment += place[0] * part[1] - place[1] * part[0]
    return force, moment


def depth(y, level):
    """Depth of a point at height y below a level; 0 above it."""
    return max(level - y, 0)


def loads(case, level, tail):
    """All loads but uplift, each in full, per metre: force (2,), moment about the origin."""
    v = case.values
    polygon, start, direction = outline(case)
    nxt = np.roll(polygon, -1, axis=0)
    cross = polygon[:, 0] * nxt[:, 1] - nxt[:, 0] * polygon[:, 1]
    area = cross.sum() / 2
    centre = ((polygon + nxt) * cross[:, None]).sum(axis=0) / (6 * area)
    weight = v["rho_dam"] * v["g"] * area
    parts = [(centre, weight * np.array([v["k_h"], v["k_v"] - 1]))]
    unit = v["rho_water"] * v["g"]
    top = v["silt_height"]
    silt = v["rho_silt"] * v["g"] * v["silt_K0"]
    force, moment = np.zeros(2), 0.0
    for a, b in zip(polygon, nxt, strict=True):
        along = (b - a) / np.linalg.norm(b - a)
        if abs((a - start) @ [-direction[1], direction[0]]) < 1e-6 and (
            abs((b - start) @ [-direction[1], direction[0]]) < 1e-6
        ):
            continue  # the joint
        outwards = np.array([along[1], -along[0]])
        pressures = []
        if abs(outwards[0]) < 1e-9:
            pressures = [(lambda y: unit * depth(y, level), [level])] * int(v["crest_water"])
        elif outwards[0] < 0:
            share = v["added_mass"] * 7 / 8 * v["k_h"] * -outwards[0]
            quake = lambda y, share=share: share * np.sqrt(level * depth(y, level))
            pressures = [(lambda y, quake=quake: unit * (depth(y, level) + quake(y)), [level])]
        else:
            pressures = [(lambda y: unit * depth(y, tail), [tail])]
        for pressure, kinks in pressures:
            f, m = integrate(a, b, pressure, kinks)
            force, moment = force + f, moment + m
        if outwards[0] < -1e-9:
            f, _ = integrate(a, b, lambda y: silt * depth(y, top), [top])
            arm, _ = integrate(a, b, lambda y: y * silt * depth(y, top), [top])
            force, moment = force + np.array([f[0], 0]), moment - arm[0]
    crest = v["dam_height"]
    if v["ice_force"]:
        x = v["batter"] * min(v["ice_level"] / v["batter_height"], 1)
        parts.append(([x, v["ice_level"]], np.array([v["ice_force"], 0])))
    if v["anchor_force"]:
        tilt = np.radians(v["anchor_angle"])
        pull = v["anchor_force"] * np.array([-np.sin(tilt), -np.cos(tilt)])
        parts.append(([v["batter"] + v["anchor_at"], crest], pull))
    if v["force_x"] or v["force_y"]:
        assert v["force_face"] == "crest"
        place = [v["batter"] + v["force_at"], crest]
        parts.append((place, np.array([v["force_x"], v["force_y"]])))
    for place, part in parts:
        force, moment = force + part, moment + place[0] * part[1] - place[1] * part[0]
    return force, moment


def resultants(case, level, tail, uplift=0.0, arm=0.0):
    """N, T, M of the joint; uplift: its resultant, at a distance arm from the toe."""
    polygon, start, direction = outline(case)
    across = np.array([-direction[1], direction[0]])
    on_joint = polygon[np.abs((polygon - start) @ across) < 1e-6]
    toe = on_joint[np.argmax(on_joint[:, 0])]
    force, moment = loads(case, level, tail)
    moment -= toe[0] * force[1] - toe[1] * force[0]
    # reaction of the joint: N across, T along, M > 0 restoring
    return -force @ across - uplift, force @ direction, moment - uplift * arm
