"""Things of a household that are no chair, table or cabinet: lamps, vessels, screens, bathroom, bed, piano, luggage."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.organic import ring, vessel
from kpred.synthetic.parts import (
    Part,
    beam,
    box,
    cushion,
    cylinder,
    ellipse,
    lathe,
    rounded_rectangle,
    slab,
    sweep,
)
from kpred.synthetic.paths import rounded_path

Family = Callable[[np.random.Generator], list[Part]]


def _shade(rng: np.random.Generator, radius: float, height: float, bottom: float) -> Part:
    top = radius * between(rng, 0.3, 1.0)
    profile = [(radius, 0.0), (top, height), (0.9 * top, height), (0.9 * top, 0.96 * height)]
    return lathe(profile, (0.0, bottom, 0.0), "shade")


def floor_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a foot, pole and shade; sometimes three legs or an arc."""
    height, radius = between(rng, 1.2, 1.9), between(rng, 0.1, 0.28)
    shade = between(rng, 0.15, 0.4)
    parts = [cylinder(0.012, (0.0, 0.02, 0.0), (0.0, height - 0.1, 0.0), "pole", sides=8)]
    if happens(rng, 0.35):
        for angle in np.radians([90.0, 210.0, 330.0]):
            foot = (0.25 * np.cos(angle), 0.0, 0.25 * np.sin(angle))
            parts.append(cylinder(0.012, foot, (0.0, 0.6 * height, 0.0), "leg", sides=6))
    else:
        disc = between(rng, 0.1, 0.2)
        parts.append(lathe([(disc, 0.0), (disc, 0.02), (0.02, 0.04)], (0.0, 0.0, 0.0), "base"))
    return [*parts, _shade(rng, radius, shade, height - shade)]


def desk_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a foot with a shade, or with a jointed arm and a head."""
    if happens(rng, 0.4):
        height, shade = between(rng, 0.25, 0.6), between(rng, 0.1, 0.25)
        belly = between(rng, 0.03, 0.12)
        stem = [(0.06, 0.0), (0.06, 0.02), (belly, 0.3 * height), (0.015, height - shade), (0.015, height - 0.03)]
        return [lathe(stem, (0.0, 0.0, 0.0), "base"), _shade(rng, between(rng, 0.1, 0.2), shade, height - shade)]
    elbow = np.array([0.0, between(rng, 0.2, 0.4), between(rng, -0.2, 0.0)])
    wrist = elbow + np.array([0.0, between(rng, -0.05, 0.25), between(rng, 0.2, 0.35)])
    parts = [lathe([(0.09, 0.0), (0.09, 0.015), (0.02, 0.04)], (0.0, 0.0, 0.0), "base")]
    parts.append(cylinder(0.01, (0.0, 0.03, 0.0), elbow, "arm", sides=6))
    parts.append(cylinder(0.01, elbow, wrist, "arm", sides=6))
    parts.append(cylinder(0.025, wrist, wrist + np.array([0.0, -0.08, 0.06]), "head", end_radius=0.07))
    return parts


def turned_vessel(rng: np.random.Generator) -> list[Part]:
    """Build a waste bin, bucket, vase or bottle."""
    kind = pick(rng, ["bin", "bucket", "vase", "bottle"])
    if kind in ("bin", "bucket"):
        height, radius = between(rng, 0.2, 0.7), between(rng, 0.1, 0.25)
        foot = radius * between(rng, 0.7, 1.0)
        square = kind == "bin" and happens(rng, 0.4)
        long = between(rng, 1.0, 1.6)
        plans = [
            rounded_rectangle(2.0 * r * long, 2.0 * r, 0.2 * r, 2) if square else ellipse(2.0 * r, 2.0 * r, 20)
            for r in (foot, radius)
        ]
        parts = [vessel(plans, [0.0, height], 0.012, kind)]
        if kind == "bucket":
            path = [(-radius, height, 0.0), (-0.7 * radius, 1.4 * height, 0.0), (0.7 * radius, 1.4 * height, 0.0)]
            bail = rounded_path([*path, (radius, height, 0.0)], 0.5 * radius)
            parts.append(sweep(ellipse(0.012, 0.012, 6), bail, "handle"))
        return parts
    height = between(rng, 0.15, 0.8)
    radius = height * between(rng, 0.12, 0.35)
    if kind == "bottle":
        neck = radius * between(rng, 0.2, 0.4)
        profile = [(radius, 0.0), (radius, 0.6 * height), (neck, 0.75 * height), (neck, height)]
        return [lathe(profile, (0.0, 0.0, 0.0), kind)]
    rows = np.linspace(0.0, 1.0, 9)
    swing = 0.6 + 0.4 * np.sin(between(rng, 2.0, 6.0) * rows + between(rng, 0.0, 3.0))
    outer = np.column_stack([radius * swing, height * rows])
    mouth = max(0.7 * outer[-1, 0], 0.005)
    return [lathe([*outer, (mouth, height), (mouth, 0.7 * height)], (0.0, 0.0, 0.0), kind)]


def screen(rng: np.random.Generator) -> list[Part]:
    """Build a monitor or television on its stand."""
    width = between(rng, 0.4, 0.8) if happens(rng, 0.5) else between(rng, 0.8, 1.7)
    height, depth, lift = width * between(rng, 0.5, 0.65), between(rng, 0.02, 0.08), between(rng, 0.03, 0.2)
    parts = [box((width, height, depth), (0.0, lift + height / 2.0, 0.0), "screen")]
    parts[0] = parts[0].rotated("x", -between(rng, 0.0, 10.0), (0.0, lift, 0.0))
    if happens(rng, 0.6):
        parts.append(box((0.15 * width, lift + 0.3 * height, 0.03), (0.0, (lift + 0.3 * height) / 2.0, -0.03), "neck"))
        parts.append(slab(rounded_rectangle(0.45 * width, 0.25, 0.05), 0.0, 0.015, "base"))
    else:
        for x in (-0.35 * width, 0.35 * width):
            parts.append(box((0.03, lift + 0.01, 0.22), (x, lift / 2.0, 0.0), "foot"))
    return parts


def bicycle(rng: np.random.Generator) -> list[Part]:
    """Build two wheels, a frame, a saddle and handlebars, along x."""
    radius, reach = between(rng, 0.2, 0.35), between(rng, 0.45, 0.58)
    tube = between(rng, 0.025, 0.05)
    rear, front = np.array([-reach, radius, 0.0]), np.array([reach, radius, 0.0])
    crank, saddle = np.array([-0.1 * reach, 0.85 * radius, 0.0]), np.array([-0.3 * reach, 2.5 * radius, 0.0])
    head = np.array([0.72 * reach, 2.6 * radius, 0.0])
    parts = [ring(radius, between(rng, 0.03, 0.06), hub, "wheel") for hub in (rear, front)]
    lines = [(rear, crank), (rear, saddle), (crank, saddle), (crank, head), (saddle, head), (head, front)]
    parts += [cylinder(tube / 2.0, start, end, "frame", sides=6) for start, end in lines]
    for hub in (rear, front):
        for angle in np.linspace(0.0, np.pi, whole(rng, 3, 6), endpoint=False):
            spoke = radius * np.array([np.cos(angle), np.sin(angle), 0.0])
            parts.append(cylinder(0.004, hub - spoke, hub + spoke, "spoke", sides=4))
    parts.append(box((0.25, 0.05, 0.12), saddle, "saddle"))
    parts.append(cylinder(0.015, head + (0.0, 0.05, -0.28), head + (0.0, 0.05, 0.28), "handlebar", sides=6))
    return parts


def luggage(rng: np.random.Generator) -> list[Part]:
    """Build a suitcase upright with its handle drawn out, or lying open."""
    width, height, depth = between(rng, 0.3, 0.55), between(rng, 0.45, 0.8), between(rng, 0.15, 0.3)
    if happens(rng, 0.5):
        parts = [cushion((width, height, depth), (0.0, height / 2.0 + 0.04, 0.0), "case")]
        parts += [cylinder(0.03, (x, 0.03, -0.02), (x, 0.03, 0.02), "wheel") for x in (-0.35 * width, 0.35 * width)]
        pull = height + between(rng, 0.1, 0.5)
        corners = [(-0.2 * width, height, 0.0), (-0.2 * width, pull, 0.0), (0.2 * width, pull, 0.0)]
        path = rounded_path([*corners, (0.2 * width, height, 0.0)], 0.02)
        return [*parts, sweep(ellipse(0.015, 0.015, 6), path, "handle")]
    plan = rounded_rectangle(width, height, 0.05, 2)
    base = vessel([plan, plan], [0.0, 0.6 * depth], 0.015, "case")
    lid = vessel([plan, plan], [0.0, 0.4 * depth], 0.015, "lid")
    back = (0.0, 0.6 * depth, -height / 2.0)
    return [base, lid.rotated("x", 180.0 - between(rng, 80.0, 130.0)).moved(back).moved((0.0, 0.3 * height, 0.0))]


def open_box(rng: np.random.Generator) -> list[Part]:
    """Build a cardboard box or crate without a lid, its flaps standing open."""
    width, height, depth = between(rng, 0.2, 0.7), between(rng, 0.12, 0.6), between(rng, 0.2, 0.6)
    plan = rounded_rectangle(width, depth, 0.0)
    parts = [vessel([plan, plan], [0.0, height], 0.008, "box")]
    if happens(rng, 0.75):
        for turn, length, reach in ((0.0, width, depth), (90.0, depth, width), (180.0, width, depth)):
            flap = box((length, 0.45 * depth, 0.006), (0.0, 0.22 * depth, 0.0), "flap")
            flap = flap.rotated("x", between(rng, -10.0, 110.0)).moved((0.0, height, reach / 2.0))
            parts.append(flap.rotated("y", turn))
    return parts


def toilet(rng: np.random.Generator) -> list[Part]:
    """Build a bowl on a foot with a seat, and mostly a cistern behind it."""
    rim, length, width = between(rng, 0.36, 0.44), between(rng, 0.45, 0.6), between(rng, 0.34, 0.4)
    plans = [ellipse(width * s, length * s, 20) for s in (0.55, 0.5, 1.0)]
    parts = [vessel(plans, [0.0, 0.5 * rim, rim], 0.05, "bowl")]
    parts.append(box((0.6 * width, 0.9 * rim, 0.3 * length), (0.0, 0.45 * rim, -0.45 * length), "foot"))
    if happens(rng, 0.7):
        tall = between(rng, 0.3, 0.45)
        parts.append(cushion((1.1 * width, tall, 0.18), (0.0, rim + tall / 2.0 - 0.02, -0.55 * length), "cistern"))
    if happens(rng, 0.5):
        lid = slab(ellipse(width, 0.9 * length, 20), 0.0, 0.02, "lid").moved((0.0, 0.0, 0.45 * length))
        parts.append(lid.rotated("x", -between(rng, 80.0, 100.0)).moved((0.0, rim + 0.01, -0.42 * length)))
    return parts


def bathtub(rng: np.random.Generator) -> list[Part]:
    """Build a tub with sloping walls, sometimes on feet."""
    length, width, height = between(rng, 1.2, 1.9), between(rng, 0.6, 0.9), between(rng, 0.4, 0.65)
    foot = between(rng, 0.7, 1.0)
    corner = between(rng, 0.05, 0.5) * width
    plans = [rounded_rectangle(length * s, width * s, corner * s, 5) for s in (foot, 1.0)]
    parts = [vessel(plans, [0.0, height], between(rng, 0.03, 0.09), "tub")]
    if happens(rng, 0.6):
        spout = rounded_path([(0.4 * length, height - 0.1, 0.0), (0.4 * length, height + 0.2, 0.0)], 0.01)
        parts.append(sweep(ellipse(0.03, 0.03, 8), spout, "tap"))
    return parts


def sink(rng: np.random.Generator) -> list[Part]:
    """Build a wash basin on a pedestal or by itself."""
    width, depth, bowl = between(rng, 0.4, 0.7), between(rng, 0.35, 0.5), between(rng, 0.12, 0.2)
    rim = between(rng, 0.75, 0.9) if happens(rng, 0.7) else bowl
    round_one = happens(rng, 0.5)
    plans = [
        ellipse(width * s, depth * s, 20) if round_one else rounded_rectangle(width * s, depth * s, 0.06, 3)
        for s in (0.55, 1.0)
    ]
    parts = [vessel(plans, [rim - bowl, rim], 0.025, "basin")]
    if rim > bowl:
        parts.append(cylinder(0.11, (0.0, 0.0, -0.02), (0.0, rim - bowl + 0.01, -0.02), "pedestal", end_radius=0.08))
    tap = [(0.0, rim - 0.01, -0.46 * depth), (0.0, rim + 0.15, -0.46 * depth), (0.0, rim + 0.12, -0.2 * depth)]
    return [*parts, sweep(ellipse(0.03, 0.03, 8), rounded_path(tap, 0.04), "tap")]


def bed(rng: np.random.Generator) -> list[Part]:
    """Build a mattress on a frame with a headboard, pillows and sometimes a blanket."""
    width, length = between(rng, 0.8, 2.0), between(rng, 1.7, 2.2)
    frame, mattress = between(rng, 0.15, 0.4), between(rng, 0.12, 0.3)
    lift = between(rng, 0.0, 0.6) * frame
    top = frame + mattress
    parts = [box((width, frame - lift, length), (0.0, (frame + lift) / 2.0, 0.0), "frame")]
    parts.append(cushion((0.98 * width, mattress, 0.98 * length), (0.0, frame + mattress / 2.0, 0.0), "mattress"))
    if lift > 0.02:
        for x in (-0.45, 0.45):
            parts += [
                beam((x * width, 0.0, z * length), (x * width, lift, z * length), 0.06, 0.06, "leg")
                for z in (-0.45, 0.45)
            ]
    if happens(rng, 0.8):
        tall = top + between(rng, 0.1, 0.7)
        parts.append(box((width, tall, 0.06), (0.0, tall / 2.0, -length / 2.0), "headboard"))
    for x in (0.0,) if width < 1.2 else (-0.25, 0.25):
        parts.append(cushion((0.5, 0.14, 0.35), (x * width, top + 0.06, -0.4 * length), "pillow"))
    if happens(rng, 0.6):
        parts.append(
            cushion((1.06 * width, mattress, 0.6 * length), (0.0, top - 0.4 * mattress, 0.2 * length), "blanket")
        )
    return parts


def piano(rng: np.random.Generator) -> list[Part]:
    """Build a grand piano with its lid up, or an upright one with its keyboard out front."""
    if happens(rng, 0.5):
        width, height, keys = between(rng, 1.4, 1.55), between(rng, 1.0, 1.35), between(rng, 0.2, 0.3)
        parts = [box((width, height, 0.35), (0.0, height / 2.0, 0.0), "body")]
        parts.append(box((width, 0.1, keys), (0.0, 0.68, 0.175 + keys / 2.0), "keyboard"))
        for x in (-0.47, 0.47):
            parts.append(box((0.06, 0.66, 0.06), (x * width, 0.33, 0.15 + keys), "leg"))
        return [*parts, box((0.5, 0.03, 0.15), (0.0, 0.2, 0.22), "pedals")]
    width, length, tall = between(rng, 1.4, 1.55), between(rng, 1.5, 2.7), between(rng, 0.95, 1.05)
    side = np.array([[0.5, 0.0], [0.5, 0.35], [0.3, 0.5], [0.05, 0.65], [-0.05, 0.9], [-0.2, 1.0], [-0.45, 0.97]])
    outline = np.concatenate([side, [[-0.5, 0.85], [-0.5, 0.0]]]) * (width, -length)
    parts = [slab(outline, tall - 0.32, 0.3, "body"), box((width, 0.1, 0.25), (0.0, tall - 0.27, 0.125), "keyboard")]
    for x, z in ((-0.42, -0.08), (0.42, -0.08), (-0.2, -0.85)):
        foot = (x * width, 0.0, z * length)
        parts.append(cylinder(0.04, foot, (foot[0], tall - 0.3, foot[2]), "leg", sides=8, end_radius=0.06))
    if happens(rng, 0.7):
        lid = slab(outline, 0.0, 0.02, "lid").rotated("z", between(rng, 20.0, 45.0), (-width / 2.0, 0.0, 0.0))
        parts.append(lid.moved((0.0, tall - 0.02, 0.0)))
    return parts


HOUSEHOLD_FAMILIES: dict[str, Family] = {
    "floor_lamp": floor_lamp,
    "desk_lamp": desk_lamp,
    "vessel": turned_vessel,
    "screen": screen,
    "bicycle": bicycle,
    "luggage": luggage,
    "open_box": open_box,
    "toilet": toilet,
    "bathtub": bathtub,
    "sink": sink,
    "bed": bed,
    "piano": piano,
}
