"""Real scans measured in one run: crops of single objects, and the objects of annotated scenes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kpred.evaluation.database_source import Progress
from kpred.evaluation.header import provenance, versions
from kpred.evaluation.metrics.summary import Summary
from kpred.evaluation.scans.outcome import FitSettings
from kpred.evaluation.scans.real_crops import CropOutcome, evaluate_crops, read_crops, summarise_crops
from kpred.evaluation.scans.scenes import SceneOutcome, evaluate_scenes, summarise_scenes
from kpred.rendering.contact_sheet import Tile


@dataclass(frozen=True)
class RealConfig:
    """Which real scans are fitted, and what is given.

    Attributes:
        crops: folder of crops; up: their up axis, None for that of their index, `auto` to have it found.
        scene: folder of Scan2CAD scenes; annotations: their file, if it lies elsewhere.
    """

    crops: Path | None = None
    up: str | None = None
    scene: Path | None = None
    annotations: Path | None = None


@dataclass(frozen=True, eq=False)
class RealReport:
    """All that was measured.

    Attributes:
        header: what it was made by; summaries: of every category, and of all; crops, objects: one by one.
    """

    header: dict[str, Any]
    summaries: list[Summary] = field(default_factory=list)
    crops: list[CropOutcome] = field(default_factory=list)
    objects: list[SceneOutcome] = field(default_factory=list)

    @property
    def tiles(self) -> list[Tile]:
        """Pictures of all scans."""
        tiles = [*(crop.tile for crop in self.crops), *(item.tile for item in self.objects)]
        return [tile for tile in tiles if tile is not None]

    def to_json(self) -> dict[str, Any]:
        """Return plain values: header, rows, crops, objects."""
        return {
            "header": self.header,
            "rows": [row.to_json() for row in self.summaries],
            "crops": [outcome.to_json() for outcome in self.crops],
            "objects": [outcome.to_json() for outcome in self.objects],
        }


def evaluate_real(config: RealConfig, settings: FitSettings, progress: Progress | None = None) -> RealReport:
    """Measure fits of crops, and of objects of scenes.

    Raises:
        ScanError: scans or annotations are missing or broken, or nothing is of a known category.
        ConfigError: an up axis is none of x, y, z, -x, -y, -z.
    """
    remarks: list[str] = []
    finds_up = config.up == "auto"
    header = {
        **provenance(settings.model),
        "database": str(settings.database.path),
        "top_k": settings.top_k,
        "seed": settings.seed,
        "up": "found by the fit" if finds_up else "given",
        "remarks": remarks,
        "versions": versions(),
    }
    report = RealReport(header)
    if config.crops is not None:
        crops = read_crops(config.crops, None if finds_up else config.up)
        report.crops.extend(evaluate_crops(crops, settings, find_up=finds_up, progress=progress, report=remarks.append))
        report.summaries.extend(summarise_crops(report.crops, config.crops.resolve().name, settings.seed))
    if config.scene is not None:
        report.objects.extend(
            evaluate_scenes(config.scene, settings, config.annotations, progress=progress, report=remarks.append)
        )
        report.summaries.extend(summarise_scenes(report.objects, config.scene.resolve().name, settings.seed))
    return report
