"""Printed measurements of real scans: crops, and the objects of annotated scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from kpred.evaluation.page import Page
from kpred.evaluation.scans.real_crops import CropOutcome
from kpred.evaluation.scans.scenes import MAX_CENTRE_CM, MAX_RATIO, SceneOutcome


def crop_page(crops: Sequence[CropOutcome]) -> Page:
    """Lay out crops, one a row."""
    finds_up = any(crop.up_right is not None for crop in crops)
    given = "nothing given" if finds_up else "nothing given but the up axis"
    return Page(
        f"crops, {given}; mean distance of points to the result's surface, cm, scan's frame; tilt of facets along the "
        "axes, degrees; flatness, % of the longest side",
        ["crop", "found", "model", "step", "kept", "all", "tilt °", "flat %", "confidence", "warnings", "ms", ""],
        [
            (
                crop.file,
                crop.found,
                crop.model,
                crop.step,
                _centimetres(crop.distance_kept),
                _centimetres(crop.distance_all),
                None if crop.cleanliness is None else round(crop.cleanliness.axis_tilt, 4),
                None if crop.cleanliness is None else round(100 * crop.cleanliness.flatness, 4),
                crop.confidence,
                crop.warnings,
                None if crop.milliseconds is None else round(crop.milliseconds),
                "failed" if crop.failure else "" if crop.near and crop.category_right else "wrong",
            )
            for crop in crops
        ],
    )


def crop_notes(crops: Sequence[CropOutcome]) -> Iterator[str]:
    """Count what is near and right, and list failures."""
    n = len(crops)
    yield (
        f"{sum(crop.near for crop in crops)} of {n} under 4 cm (kept points; all points: "
        f"{sum(crop.all_near for crop in crops)} of {n}); {sum(crop.category_right for crop in crops)} of {n} of the "
        "right category"
    )
    if any(crop.up_right is not None for crop in crops):
        yield f"{sum(crop.up_right is True for crop in crops)} of {n} with the right up axis"
    clean = [crop.cleanliness for crop in crops if crop.cleanliness is not None]
    if clean:
        tilt, flat = (sum(getattr(one, name) for one in clean) / len(clean) for name in ("axis_tilt", "flatness"))
        yield f"mean over {len(clean)} results: facets tilt by {tilt:.2g} degrees, flat to {100 * flat:.2g} %"
    yield from (f"failed: {crop.file}: {crop.failure}" for crop in crops if crop.failure is not None)


def object_page(objects: Sequence[SceneOutcome]) -> Page:
    """Lay out annotated objects, one a row."""
    columns = [
        "object",
        "found if not given",
        "model",
        "result",
        "annotated",
        "ratio",
        "centre",
        "yaw °",
        "confidence",
        "ms",
    ]
    return Page(
        "annotated objects; mean distance of their points to result and annotated CAD model, cm, scan's frame",
        [*columns, ""],
        [
            (
                f"{item.scene} {item.name}",
                item.found,
                item.model,
                _centimetres(item.distance),
                _centimetres(item.annotated_distance),
                item.ratio,
                item.centre_cm,
                item.yaw,
                item.confidence,
                None if item.milliseconds is None else round(item.milliseconds),
                "failed" if item.failure else "" if item.passes else "fails",
            )
            for item in objects
        ],
    )


def object_notes(objects: Sequence[SceneOutcome]) -> Iterator[str]:
    """Count what passes, and list failures."""
    passed = sum(item.passes for item in objects)
    limits = f"ratio at most {MAX_RATIO:g} and centre within {MAX_CENTRE_CM:g} cm"
    yield f"{passed} of {len(objects)} pass: {limits}"
    yield from (f"failed: {item.scene} {item.name}: {item.failure}" for item in objects if item.failure is not None)


def _centimetres(metres: float | None) -> float | None:
    return None if metres is None else 100 * metres
