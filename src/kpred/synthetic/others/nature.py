"""What grows, moves or has no plan: plants, trees, people, blobs, balls, bags."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.organic import bumpy_ball, capsule, ellipsoid, leaf, vessel
from kpred.synthetic.part import Vector
from kpred.synthetic.parts import Part, cylinder, ellipse, lathe, rounded_rectangle, sweep
from kpred.synthetic.paths import bezier

Family = Callable[[np.random.Generator], list[Part]]


def _pot(rng: np.random.Generator, radius: float, height: float) -> list[Part]:
    foot = radius * between(rng, 0.6, 1.0)
    if happens(rng, 0.25):
        plans = [rounded_rectangle(2.0 * r, 2.0 * r, 0.1 * r, 2) for r in (foot, radius)]
    else:
        plans = [ellipse(2.0 * r, 2.0 * r, 16) for r in (foot, radius)]
    soil = cylinder(0.85 * foot, (0.0, 0.5 * height, 0.0), (0.0, 0.85 * height, 0.0), "soil")
    return [vessel(plans, [0.0, height], 0.12 * radius, "pot"), soil]


def _outward(rng: np.random.Generator, steepness: float) -> np.ndarray:
    """Draw a direction (3,) with an elevation of about `steepness` degrees."""
    around, up = between(rng, 0.0, 2.0 * np.pi), np.radians(np.clip(rng.normal(steepness, 18.0), -30.0, 88.0))
    return np.array([np.cos(around) * np.cos(up), np.sin(up), np.sin(around) * np.cos(up)])


def potted_plant(rng: np.random.Generator) -> list[Part]:
    """Build a pot with a rosette of leaves, leaves along stems, or a bush of balls."""
    size = between(rng, 0.3, 1.8)
    height = between(rng, 0.15, 0.35) * min(size, 1.0)
    parts = _pot(rng, height * between(rng, 0.4, 0.8), height)
    foot = np.array([0.0, 0.8 * height, 0.0])
    crown = size - height
    kind = pick(rng, ["rosette", "stems", "bush"])
    if kind == "rosette":
        for _ in range(whole(rng, 8, 24)):
            tip = foot + _outward(rng, between(rng, 30.0, 75.0)) * crown * between(rng, 0.6, 1.1)
            parts.append(leaf(foot, tip, crown * between(rng, 0.06, 0.2), crown * between(rng, 0.0, 0.15)))
    elif kind == "stems":
        for _ in range(whole(rng, 1, 5)):
            tip = foot + _outward(rng, 78.0) * crown * between(rng, 0.7, 1.0)
            path = bezier(foot, (foot + tip) / 2.0 + rng.normal(0.0, 0.06 * crown, 3), tip)
            parts.append(sweep(ellipse(0.02, 0.02, 5), path, "stem"))
            for _ in range(whole(rng, 4, 10)):
                start = path[whole(rng, 2, len(path) - 1)]
                end = start + _outward(rng, 20.0) * crown * between(rng, 0.15, 0.4)
                parts.append(leaf(start, end, crown * between(rng, 0.05, 0.18), crown * between(rng, -0.03, 0.06)))
    else:
        parts += _crown(rng, foot + np.array([0.0, 0.5 * crown, 0.0]), 0.5 * crown)
    return parts


def _crown(rng: np.random.Generator, center: np.ndarray, radius: float) -> list[Part]:
    parts = [bumpy_ball(rng, radius * rng.uniform(0.7, 1.1, 3), center, "foliage", bump=0.35)]
    for _ in range(whole(rng, 0, 6)):
        place = center + _outward(rng, 20.0) * radius * 0.8
        parts.append(bumpy_ball(rng, radius * rng.uniform(0.25, 0.5, 3), place, "foliage", bump=0.3))
    return parts


def tree(rng: np.random.Generator) -> list[Part]:
    """Build a bare tree or one with a crown; coat stands that branch look much like it."""
    height = between(rng, 0.8, 3.0)
    parts: list[Part] = []

    def branch(start: np.ndarray, heading: np.ndarray, length: float, thickness: float, depth: int) -> None:
        end = start + heading * length
        path = bezier(start, (start + end) / 2.0 + rng.normal(0.0, 0.08 * length, 3), end, segments=4)
        parts.append(sweep(ellipse(thickness, thickness, 5), path, "branch", np.linspace(1.0, 0.6, 5)))
        if depth == 0:
            return
        for _ in range(whole(rng, 2, 4)):
            bent = heading + rng.normal(0.0, 0.5, 3)
            fork = path[whole(rng, 2, 4)]
            branch(fork, bent / np.linalg.norm(bent), length * between(rng, 0.45, 0.75), 0.6 * thickness, depth - 1)

    branch(np.zeros(3), np.array([0.0, 1.0, 0.0]), 0.5 * height, 0.05 * height, whole(rng, 2, 3))
    if happens(rng, 0.3):
        parts += _crown(rng, np.array([0.0, 0.75 * height, 0.0]), 0.35 * height)
    return parts


def blob(rng: np.random.Generator) -> list[Part]:
    """Smooth random mass: one bumpy ball or a cluster of ellipsoids."""
    size = between(rng, 0.15, 0.8)
    if happens(rng, 0.5):
        return [bumpy_ball(rng, size * rng.uniform(0.5, 1.2, 3), (0.0, 0.0, 0.0), "blob", between(rng, 0.1, 0.6))]
    parts, center = [], np.zeros(3)
    for _ in range(whole(rng, 2, 8)):
        radii = size * rng.uniform(0.3, 0.8, 3)
        parts.append(ellipsoid(radii, center, "blob").rotated(rng.normal(size=3), between(rng, 0.0, 180.0), center))
        step = rng.normal(size=3)
        center = center + step / np.linalg.norm(step) * 0.8 * radii.min()
    return parts


def ball(rng: np.random.Generator) -> list[Part]:
    """Build a ball, egg or lens."""
    size = between(rng, 0.06, 0.5)
    flat = (1.0, between(rng, 0.3, 1.3), 1.0) if happens(rng, 0.5) else (1.0, 1.0, 1.0)
    return [ellipsoid(np.multiply(flat, size), (0.0, 0.0, 0.0), "ball", sides=20, rings=14)]


def person(rng: np.random.Generator) -> list[Part]:
    """Build a person that stands, walks or sits (without a seat)."""
    tall = between(rng, 1.0, 1.95)
    hip = 0.5 * tall * between(rng, 0.95, 1.05)
    sitting = happens(rng, 0.4)
    lean = np.array([rng.normal(0.0, 0.03), 0.33 * tall, rng.normal(0.0, 0.08)]) * between(rng, 0.9, 1.05)
    pelvis = np.array([0.0, 0.27 * tall if sitting else hip, 0.0])
    neck = pelvis + lean
    girth = between(rng, 0.055, 0.095) * tall
    parts = [capsule(pelvis, neck - 0.04 * tall * np.array([0.0, 1.0, 0.0]), girth, "torso", 1.1 * girth)]
    head = np.array([0.045, 0.065, 0.055]) * tall
    parts.append(ellipsoid(head, neck + np.array([0.0, 0.09 * tall, 0.02 * tall]), "head"))
    for side in (-1.0, 1.0):
        socket = pelvis + np.array([side * 0.05 * tall, 0.0, 0.0])
        if sitting:
            knee = socket + np.array([side * between(rng, 0.0, 0.08), 0.0, 0.25]) * tall
            foot = knee + np.array([0.0, -0.25, between(rng, -0.06, 0.1)]) * tall
        else:
            swing = rng.normal(0.0, 0.06)
            knee = socket + np.array([0.01 * side, -0.24, swing]) * tall
            foot = knee + np.array([0.01 * side, -0.23, 0.5 * swing]) * tall
        parts.append(capsule(socket, knee, 0.05 * tall, "leg", 0.035 * tall))
        parts.append(capsule(knee, foot, 0.035 * tall, "leg", 0.025 * tall))
        parts.append(capsule(foot, foot + np.array([0.0, -0.01, 0.1]) * tall, 0.025 * tall, "foot"))
        parts += _arm(rng, neck + np.array([side * 0.11, -0.05, 0.0]) * tall, side, tall)
    return parts


def _arm(rng: np.random.Generator, shoulder: np.ndarray, side: float, tall: float) -> list[Part]:
    raised = between(rng, -80.0, -20.0) if happens(rng, 0.8) else between(rng, -20.0, 60.0)
    up, forward = np.sin(np.radians(raised)), between(rng, -0.1, 0.5)
    aim = np.array([side * 0.6 * np.cos(np.radians(raised)), up, forward])
    elbow = shoulder + aim / np.linalg.norm(aim) * 0.17 * tall
    bend = aim + np.array([-0.3 * side, between(rng, 0.0, 0.8), between(rng, 0.2, 0.8)])
    hand = elbow + bend / np.linalg.norm(bend) * 0.16 * tall
    return [
        capsule(shoulder, elbow, 0.028 * tall, "arm", 0.023 * tall),
        capsule(elbow, hand, 0.023 * tall, "arm", 0.02 * tall),
    ]


def backpack(rng: np.random.Generator) -> list[Part]:
    """Build a soft bag with a pocket and two straps."""
    width, height, depth = between(rng, 0.2, 0.4), between(rng, 0.3, 0.6), between(rng, 0.12, 0.25)
    radii = np.array([width, height, depth]) / 2.0
    parts = [bumpy_ball(rng, radii, (0.0, radii[1], 0.0), "bag", bump=0.15)]
    parts.append(ellipsoid(radii * (0.6, 0.35, 0.5), (0.0, 0.6 * radii[1], 0.8 * radii[2]), "pocket"))
    for side in (-0.5, 0.5):
        top, bottom = (side * radii[0], 1.6 * radii[1], -0.6 * radii[2]), (side * radii[0], 0.4 * radii[1], -radii[2])
        parts.append(sweep(ellipse(0.05, 0.012, 6), bezier(top, _behind(top, bottom, depth), bottom), "strap"))
    return parts


def _behind(top: Vector, bottom: Vector, depth: float) -> np.ndarray:
    return (np.asarray(top) + np.asarray(bottom)) / 2.0 - np.array([0.0, 0.0, depth])


def rolled_carpet(rng: np.random.Generator) -> list[Part]:
    """Build a carpet roll, lying or leaning nearly upright, sometimes with a loose end."""
    radius, length = between(rng, 0.05, 0.2), between(rng, 0.6, 2.5)
    profile = [(radius, 0.0), (radius, length), (0.4 * radius, length), (0.4 * radius, 0.85 * length)]
    roll = lathe(profile, (0.0, 0.0, 0.0), "roll", sides=18)
    if happens(rng, 0.25):
        return [roll.rotated("x", between(rng, -15.0, 15.0))]
    parts = [roll.rotated("z", 90.0).moved((length / 2.0, radius, 0.0))]
    if happens(rng, 0.6):
        reach = between(rng, 0.1, 0.5)
        flap = sweep(
            np.array([[-0.5, -0.005], [0.5, -0.005], [0.5, 0.005], [-0.5, 0.005]]) * (length, 1.0),
            np.array([[0.0, 0.006, 0.0], [0.0, 0.006, radius + reach]]),
            "flap",
        )
        parts.append(flap)
    return parts


NATURE_FAMILIES: dict[str, Family] = {
    "potted_plant": potted_plant,
    "tree": tree,
    "blob": blob,
    "ball": ball,
    "person": person,
    "backpack": backpack,
    "rolled_carpet": rolled_carpet,
}
