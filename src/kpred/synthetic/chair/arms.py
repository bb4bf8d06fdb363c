"""Armrests: built at the right side (+x) and mirrored."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.chair.backs import Bend
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cushion, cylinder, ellipse, frustum, rounded_rectangle, sweep
from kpred.synthetic.paths import bezier, rounded_path

ARM_STYLES = ("posts", "slatted", "panel", "loop", "pad", "sloping", "frame")


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
    edge = width / 2.0 + post * 0.35
    right: list[Part] = []
    foot = np.array([edge, seat_bottom, min(front - post, depth / 2.0 - post)])
    head = np.array([x, y, front - post])
    if style in ("posts", "slatted"):
        right.append(beam((rear_x, y + between(rng, 0.0, 0.03), rear), (x, y, front), wide, thick, "arm"))
        if happens(rng, 0.5):
            right.append(cylinder(post * 0.5, foot, head, "arm_post", 10))
        else:
            right.append(frustum((post, post), (post, post), foot, head, "arm_post"))
        rear_post = np.array([edge, seat_bottom, -depth / 2.0 + post * 1.5])
        if bend is None or style == "slatted" or rear_x < x - 0.03:
            top = np.array([x, y + 0.01, max(rear, -depth / 2.0) + post * 1.5])
            right.append(frustum((post, post), (post, post), rear_post, top, "arm_post"))
        if style == "slatted":
            for s in np.linspace(0.0, 1.0, whole(rng, 2, 6) + 2)[1:-1]:
                low = rear_post + (foot - rear_post) * s
                high = np.array([x, y, low[2]])
                right.append(frustum((post * 0.4, post * 0.8), (post * 0.4, post * 0.8), low, high, "arm_post"))
    elif style == "panel":
        t = between(rng, 0.018, 0.06)
        low = 0.0 if happens(rng, 0.12) else seat_bottom
        right.append(
            box(
                (t, y - low, front + depth / 2.0),
                (width / 2.0 + t * 0.4, (y + low) / 2.0, (front - depth / 2.0) / 2.0),
                "arm",
            )
        )
        if happens(rng, 0.4):
            right.append(
                box(
                    (t + 0.03, thick, front + depth / 2.0),
                    (width / 2.0 + t * 0.4, y, (front - depth / 2.0) / 2.0),
                    "arm",
                )
            )
    elif style in ("loop", "frame"):
        tube = ellipse(0.028, 0.028, 8) if style == "loop" else rounded_rectangle(wide * 0.8, thick, 0.0)
        out = width / 2.0 + (0.008 if style == "loop" else wide * 0.3)
        path = rounded_path(
            [
                (out, seat_bottom + 0.01, depth / 2.0 - 0.06),
                (out, y, front - 0.02),
                (out, y, -depth / 2.0 + 0.04),
                (out, seat_bottom + 0.01, -depth / 2.0 + 0.04),
            ],
            between(rng, 0.03, 0.1) if style == "loop" else 0.005,
            4 if style == "loop" else 1,
        )
        right.append(sweep(tube, path, "arm"))
    elif style == "pad":
        middle = between(rng, -0.15, 0.05) * depth
        right.append(box((0.03, y - seat_bottom, 0.06), (edge, (y + seat_bottom) / 2.0, middle), "arm_post"))
        size = (wide * 1.2, thick, depth * between(rng, 0.45, 0.7))
        right.append(cushion(size, (edge, y, middle + 0.02), "arm", 0.015))
    else:
        crest = y + between(rng, 0.02, 0.12)
        if bend is not None:
            crest = min(crest, seat_top + bend.height * 0.9)
            rear = back_z + bend.depth_at(crest - seat_top)
        end = np.array([width / 2.0, seat_top - 0.01, depth / 2.0 * between(rng, 0.5, 0.95)])
        control = np.array([x, crest, end[2] + between(rng, -0.15, 0.05)])
        section = rounded_rectangle(wide * 0.8, thick, 0.0)
        right.append(sweep(section, bezier((rear_x, crest, rear), control, end, 8), "arm"))
        if bend is None:
            right.append(
                frustum(
                    (post, post), (post, post), (edge, seat_bottom, rear + 0.01), (x, crest, rear + 0.01), "arm_post"
                )
            )
    return [*right, *(part.mirrored_x() for part in right)]


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
