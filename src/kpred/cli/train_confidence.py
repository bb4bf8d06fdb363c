"""`kpred train confidence`: the calibration of a model's confidence, on virtual scans that look like real ones."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.scans.calibration import CalibrationSample
    from kpred.nn import Model


@dataclass(frozen=True, kw_only=True)
class ConfidenceCommand(Command):
    """Calibrate the confidence of a trained model, and write calibration.json into its folder.

    Shapes of the packs are scanned virtually, with what crops of real rooms add and leave out: floor, pieces of
    neighbours, missing blocks, noise, uneven density. Each scan is fitted; a logistic regression then says how likely a
    result of such evidence is right. A pack of the category `other` (`kpred data generate other`) shows things that
    are none of the model's categories. Take shapes that neither the training nor the database has seen. With a database
    of more categories than `recognizer` knows, calibration.json goes beside `recognizer_any`, for such databases.

    examples:
      kpred train confidence chair.npz table.npz other.npz --model runs/mine/model --database mine.kpred
      kpred train confidence packs/ --model runs/mine/model --split val --limit 300 --samples samples.json
      kpred train confidence packs/ --model runs/mine/model --room-packs rooms.npz --crops 600
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them"""
    model: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder of the trained model, which gets calibration.json"""
    database: Annotated[Path | None, arg(metavar="FILE")] = None
    """Search this database (.kpred); without it, the bundled one"""
    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are scanned"""
    limit: Annotated[int, arg(metavar="N")] = 150
    """At most so many scans a pack, drawn at random by the seed; 0: all of them"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    room_packs: Annotated[tuple[Path, ...], arg(metavar="ROOMS [ROOMS ...]")] = ()
    """Room packs (`kpred data rooms --splits val`), whose crops are fitted too"""
    crops: Annotated[int, arg(metavar="N")] = 400
    """So many crops of the rooms, three of ten of other things"""
    samples: Annotated[Path | None, arg(metavar="FILE")] = None
    """Keep evidence and outcome of each scan in this JSON file; if it is there, they are taken from it"""
    seed: Annotated[int, arg(metavar="SEED")] = 33
    """Of shapes, scans and fits"""

    def run(self, output: Output) -> None:
        """Scan and fit with a progress bar, calibrate, write and print."""
        from kpred.atomic import check_place
        from kpred.cli.table_options import print_pages
        from kpred.evaluation.scans.calibration import calibrate, sources_of
        from kpred.evaluation.scans.scan_pages import reliability_page
        from kpred.nn import load_model
        from kpred.nn.calibration import save_calibration

        if not self.packs:
            raise UsageError("no pack was named; try `kpred train confidence PACK.npz --model DIR`")
        if self.model is None:
            raise UsageError("no model was named; give the folder of its weights: --model DIR")
        if self.samples is not None:
            check_place(self.samples)
        model, remarks = load_model(self.model), list[str]()
        samples = self._samples(model, remarks)
        facts = {"packs": sources_of(self.packs), "split": self.split, "limit": self.limit or None, "seed": self.seed}
        if self.room_packs:
            facts |= {"rooms": sources_of(self.room_packs), "crops": self.crops}
        calibration, held_out = calibrate(samples, facts | {"top_k": self.top_k})
        file = save_calibration(calibration, self._folder(model, self.model))
        right = sum(sample.right for sample in samples)
        output.result({"file": file, "calibration": calibration, "held_out": held_out, "remarks": remarks})
        for name, found in held_out.items():
            output.note(f"{name}, weights of one half on the other:")
            print_pages(output, [reliability_page(found)])
        weights = [
            *zip(calibration.features, calibration.weights, (*calibration.weights_without_odds, None), strict=True)
        ]
        output.table("weights", ["feature", "with odds", "without odds"], weights)
        for sentence in remarks[:10]:
            output.note(f"note: {sentence}")
        output.note(f"wrote {file} ({len(samples)} fits, {right} of them right)")

    def _folder(self, model: Model, folder: Path) -> Path:
        """Return where the calibration belongs: beside the recognizer that gave the evidence."""
        from kpred.fitting.stages import Context
        from kpred.nn.loading import SHARED_RECOGNIZER

        used = None if self.database is None else Context.load(model, self.database, None).recognizer
        return folder / SHARED_RECOGNIZER if used is not None and used is model.shared_recognizer else folder

    def _samples(self, model: Model, remarks: list[str]) -> list[CalibrationSample]:
        """Read the samples of the file, or draw new ones."""
        from kpred.cli.progress import ProgressBar
        from kpred.errors import PackError
        from kpred.evaluation.scans.calibration import CalibrationSample, collect_samples
        from kpred.evaluation.scans.outcome import FitSettings
        from kpred.evaluation.scans.room_crops import collect_crop_samples
        from kpred.fitting.defaults import resolve_database
        from kpred.json_output import write_json
        from kpred.synthetic.rooms.pack import RoomPack

        if self.samples is not None and self.samples.is_file():
            try:
                values = json.loads(self.samples.read_text(encoding="utf-8"))["samples"]
                return [CalibrationSample.from_json(value) for value in values]
            except (ValueError, KeyError, TypeError) as error:
                raise PackError(
                    f"{self.samples}: it holds no samples of `kpred train confidence`; remove it."
                ) from error
        settings = FitSettings(model, resolve_database(self.database), self.top_k, self.seed)
        with ProgressBar() as bar:
            found = collect_samples(
                self.packs,
                settings,
                split=self.split,
                limit=self.limit or None,
                progress=bar.update,
                report=remarks.append,
            )
            rooms = [RoomPack.load(path) for path in self.room_packs]
            if rooms:
                found += collect_crop_samples(
                    rooms, settings, limit=self.crops, progress=bar.update, report=remarks.append
                )
        if self.samples is not None:
            write_json(self.samples, {"samples": [sample.to_json() for sample in found]})
        return found
