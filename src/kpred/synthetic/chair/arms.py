"""Armrests: built at the right side (+x) and mirrored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.synthetic.chair.backs import Bend
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cushion, cylinder, ellipse, frustum, rounded_rectangle, sweep
from kpred.synthetic.paths import bezier, rounded_path

ARM_STYLES = ("posts", "slatted", "panel", "loop", "pad", "sloping", "frame")


@dataclass(frozen=True)
class _Arm:
    """The right armrest: its seat and back, and where it begins and ends.

    Attributes:
        width, depth: seat's plan about the origin; seat_top, seat_bottom: its heights.
        back_z: z of the foot of the back; bend: of the back, None where it is not reached.
        x, y, front: of the front end of the rest; rear_x, rear: x and z of its rear end.
        thick, wide: section of the rest; post: side of a post.
    """

    width: float
    depth: float
    seat_top: float
    seat_bottom: float
    back_z: float
    bend: Bend | None
    x: float
    y: float
    front: float
    rear_x: float
    rear: float
    thick: float
    wide: float
    post: float

    @property
    def edge(self) -> float:
        """X of posts at the side of the seat."""
        return self.width / 2.0 + self.post * 0.35


def arm_parts(
    rng: np.random.Generator,
    style: str,
    width: float,
    depth: float,
    seat_top: float,
    seat_bottom: float,
    rise: float,
    back_z: float,
    bend: Bend | None = None,
) -> list[Part]:
    """Build both armrests in one of ARM_STYLES.

    `width`, `depth`: seat's plan about the origin; `rise`: height of the rest over `seat_top`; `back_z`: z of the
    foot of the back; `bend`: of the back, so that the rest reaches it (None: no back, or one that is not reached).
    """
    reach = between(rng, 0.55, 1.0)
    front = -depth / 2.0 + depth * reach
    thick, wide = between(rng, 0.018, 0.045), between(rng, 0.035, 0.08)
    x = width / 2.0 + between(rng, -0.3, 0.5) * wide * 0.5
    y = seat_top + rise
    rear, rear_x = back_z, x
    if bend is not None:
        rear = back_z + bend.depth_at(min(rise, bend.height * 0.95))
        rear_x = min(x, bend.half_width_at(rise))
        y = min(y, seat_top + bend.height * 0.9)
    post = between(rng, 0.02, 0.045)
    arm = _Arm(width, depth, seat_top, seat_bottom, back_z, bend, x, y, front, rear_x, rear, thick, wide, post)
    if style in ("posts", "slatted"):
        right = _on_posts(rng, arm, style == "slatted")
    elif style == "panel":
        right = _panel(rng, arm)
    elif style in ("loop", "frame"):
        right = [_loop(rng, arm, style == "loop")]
    elif style == "pad":
        right = _pad(rng, arm)
    else:
        right = _sloping(rng, arm)
    return [*right, *(part.mirrored_x() for part in right)]


def _on_posts(rng: np.random.Generator, arm: _Arm, slatted: bool) -> list[Part]:
    """Build a rest on a front post, and on a rear one where no back carries it; slats fill the side."""
    x, y, front, rear, post = arm.x, arm.y, arm.front, arm.rear, arm.post
    foot = np.array([arm.edge, arm.seat_bottom, min(front - post, arm.depth / 2.0 - post)])
    head = np.array([x, y, front - post])
    parts = [beam((arm.rear_x, y + between(rng, 0.0, 0.03), rear), (x, y, front), arm.wide, arm.thick, "arm")]
    if happens(rng, 0.5):
        parts.append(cylinder(post * 0.5, foot, head, "arm_post", 10))
    else:
        parts.append(frustum((post, post), (post, post), foot, head, "arm_post"))
    rear_post = np.array([arm.edge, arm.seat_bottom, -arm.depth / 2.0 + post * 1.5])
    if arm.bend is None or slatted or arm.rear_x < x - 0.03:
        top = np.array([x, y + 0.01, max(rear, -arm.depth / 2.0) + post * 1.5])
        parts.append(frustum((post, post), (post, post), rear_post, top, "arm_post"))
    if slatted:
        slat = (post * 0.4, post * 0.8)
        for s in np.linspace(0.0, 1.0, whole(rng, 2, 6) + 2)[1:-1]:
            low = rear_post + (foot - rear_post) * s
            parts.append(frustum(slat, slat, low, np.array([x, y, low[2]]), "arm_post"))
    return parts


def _panel(rng: np.random.Generator, arm: _Arm) -> list[Part]:
    """Build a closed side, with a board on it by chance."""
    t = between(rng, 0.018, 0.06)
    low = 0.0 if happens(rng, 0.12) else arm.seat_bottom
    long, x, z = arm.front + arm.depth / 2.0, arm.width / 2.0 + t * 0.4, (arm.front - arm.depth / 2.0) / 2.0
    parts = [box((t, arm.y - low, long), (x, (arm.y + low) / 2.0, z), "arm")]
    if happens(rng, 0.4):
        parts.append(box((t + 0.03, arm.thick, long), (x, arm.y, z), "arm"))
    return parts


def _loop(rng: np.random.Generator, arm: _Arm, tube: bool) -> Part:
    """Build a loop from the seat up, along and down again: a bent tube, or a frame of flat bars."""
    section = ellipse(0.028, 0.028, 8) if tube else rounded_rectangle(arm.wide * 0.8, arm.thick, 0.0)
    out, low = arm.width / 2.0 + (0.008 if tube else arm.wide * 0.3), arm.seat_bottom + 0.01
    corners = [
        (out, low, arm.depth / 2.0 - 0.06),
        (out, arm.y, arm.front - 0.02),
        (out, arm.y, -arm.depth / 2.0 + 0.04),
        (out, low, -arm.depth / 2.0 + 0.04),
    ]
    return sweep(section, rounded_path(corners, between(rng, 0.03, 0.1) if tube else 0.005, 4 if tube else 1), "arm")


def _pad(rng: np.random.Generator, arm: _Arm) -> list[Part]:
    """Build a padded rest on one post."""
    middle = between(rng, -0.15, 0.05) * arm.depth
    height, y = arm.y - arm.seat_bottom, (arm.y + arm.seat_bottom) / 2.0
    size = (arm.wide * 1.2, arm.thick, arm.depth * between(rng, 0.45, 0.7))
    return [
        box((0.03, height, 0.06), (arm.edge, y, middle), "arm_post"),
        cushion(size, (arm.edge, arm.y, middle + 0.02), "arm", 0.015),
    ]


def _sloping(rng: np.random.Generator, arm: _Arm) -> list[Part]:
    """Build a rest that falls in a curve to the front of the seat."""
    crest, rear = arm.y + between(rng, 0.02, 0.12), arm.rear
    if arm.bend is not None:
        crest = min(crest, arm.seat_top + arm.bend.height * 0.9)
        rear = arm.back_z + arm.bend.depth_at(crest - arm.seat_top)
    end = np.array([arm.width / 2.0, arm.seat_top - 0.01, arm.depth / 2.0 * between(rng, 0.5, 0.95)])
    control = np.array([arm.x, crest, end[2] + between(rng, -0.15, 0.05)])
    section = rounded_rectangle(arm.wide * 0.8, arm.thick, 0.0)
    parts = [sweep(section, bezier((arm.rear_x, crest, rear), control, end, 8), "arm")]
    if arm.bend is None:
        low, high = (arm.edge, arm.seat_bottom, rear + 0.01), (arm.x, crest, rear + 0.01)
        parts.append(frustum((arm.post, arm.post), (arm.post, arm.post), low, high, "arm_post"))
    return parts


def upholstered_sides(
    rng: np.random.Generator, width: float, depth: float, bottom: float, top: float, thick: float
) -> list[Part]:
    """Build solid padded sides standing outside a seat of `width`, from height `bottom` to `top`."""
    style = pick(rng, ("block", "soft", "rolled", "slanted"))
    x = (width + thick) / 2.0
    tall = top - bottom
    if style == "block":
        right = [box((thick, tall, depth), (x, (top + bottom) / 2.0, 0.0), "arm")]
    elif style == "soft":
        right = [cushion((thick, tall, depth), (x, (top + bottom) / 2.0, 0.0), "arm", between(rng, 0.02, 0.07), 3)]
    elif style == "rolled":
        roll = thick * between(rng, 0.5, 0.7)
        body = box((thick * 0.8, tall - roll, depth), (x - thick * 0.1, bottom + (tall - roll) / 2.0, 0.0), "arm")
        bar = cylinder(roll, (x, top - roll, -depth / 2.0), (x, top - roll, depth / 2.0 + 0.005), "arm", 14)
        right = [body, bar]
    else:
        drop = tall * between(rng, 0.1, 0.4)
        outline = np.array([[-depth / 2, bottom], [depth / 2, bottom], [depth / 2, top - drop], [-depth / 2, top]])
        section = outline - np.array([0.0, bottom])
        path = np.array([[x - thick / 2, bottom, 0.0], [x + thick / 2, bottom, 0.0]])
        right = [sweep(section * np.array([1.0, 1.0]), path, "arm")]
    return [*right, *(part.mirrored_x() for part in right)]
