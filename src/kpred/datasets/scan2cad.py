"""Scan2CAD on ScanNet, laid out as the public repository, or with the two data sets in folders of their own.

    ROOT/full_annotations.json
    ROOT/Assets/scannet-sample/<scene>/<scene>_vh_clean_2.ply           or SCANNET/<scene>/, SCANNET/scans/<scene>/
    ROOT/Assets/scannet-sample/<scene>/<scene>_vh_clean_2.labels.ply    labels, wanted but not needed
    ROOT/Assets/shapenet-sample/<synset>/<model>/models/model_normalized.obj              or SHAPENET/<synset>/

Its shapes are the annotated CAD models, all of them `source`: the database that scenes are fitted with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kpred.datasets.check import Check, Issue
from kpred.datasets.dataset import ShapeFile, found_in
from kpred.errors import MeshError, PackError, ScanError
from kpred.scenes.scan2cad import AlignedModel, SceneAnnotation, model_path, read_annotations

ANNOTATIONS = "full_annotations.json"


@dataclass(frozen=True)
class Scan2Cad:
    """Scan2CAD's folder.

    Attributes:
        path: the folder with `full_annotations.json`.
        scannet, shapenet: folders of scans and of models, where they are not below it.
        category: only models of this category are shapes.
    """

    path: Path
    scannet: Path | None = None
    shapenet: Path | None = None
    category: str | None = None
    kind: str = "scan2cad"

    def shapes(self) -> Sequence[ShapeFile]:
        """See `Dataset`."""
        found, _ = self._models()
        if not found:
            raise PackError(f"{self.path}: none of the annotated CAD models is there; give the folder of ShapeNet.")
        return found

    def check(self) -> Check:
        """See `Dataset`."""
        scenes = self._annotations()
        found, issues = self._models()
        scans = labels = 0
        for scene in scenes:
            scan = next((file for file in self._scans(scene.id_scan) if file.is_file()), None)
            if scan is None:
                why = f"{self._scans(scene.id_scan)[0]} is not there; download the scan from ScanNet"
                issues.append(Issue("scan", scene.id_scan, why))
                continue
            scans += 1
            label = scan.with_name(f"{scan.stem}.labels.ply")
            if label.is_file():
                labels += 1
            else:
                issues.append(
                    Issue("labels", scene.id_scan, f"{label} is not there; objects are cut by boxes without it")
                )
            issues += [Issue("annotation", item.name, item.reason) for item in scene.broken]
        numbers = {"scenes": {"annotated": len(scenes), "with scan": scans, "with labels": labels}}
        return Check(self.kind, str(self.path), {**numbers, **found_in(found)}, tuple(issues))

    def _models(self) -> tuple[list[ShapeFile], list[Issue]]:
        """List each annotated CAD model once, by id; and those that are missing."""
        wanted: dict[tuple[str, str], AlignedModel] = {}
        for scene in self._annotations():
            for model in scene.models:
                if self.category in (None, model.category):
                    wanted.setdefault((model.catid_cad, model.id_cad), model)
        found, issues = [], []
        for (catid, id_cad), model in sorted(wanted.items()):
            try:
                file = model_path(model, self.shapenet or self.path)
            except MeshError as error:
                issues.append(Issue("model", f"{catid}/{id_cad}", str(error)))
                continue
            found.append(ShapeFile(id_cad, model.category, "source", file, "half"))
        return found, issues

    def _annotations(self) -> tuple[SceneAnnotation, ...]:
        try:
            return read_annotations(self.path / ANNOTATIONS)
        except ScanError as error:
            raise PackError(str(error)) from error

    def _scans(self, id_scan: str) -> list[Path]:
        """List possible paths of a scan, the likeliest first."""
        name = f"{id_scan}_vh_clean_2.ply"
        roots = [self.path / "Assets" / "scannet-sample", self.path / "scans", self.path]
        if self.scannet is not None:
            roots = [self.scannet, self.scannet / "scans", *roots]
        return [root / id_scan / name for root in roots]
