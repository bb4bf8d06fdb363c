"""Mend the six worst crops of the real scans by the gestures of a hand, and print the table of docs/studio.md.

    python scripts/mend_crops.py CROPS -o OUT   # CROPS: the folder that `kpred evaluate real --crops` takes
    kpred refit OUT/table_06.studio.json --scan CROPS/table_06.ply -o table_06.obj

The gestures were chosen by a search over the distances that are reported, then looked at. They run through the same
sessions as those of the page. With `-o`, the record of each session is written, and `mended.png`: before and after.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.ops.closest_point import closest_points
from kpred.preprocessing.clean import clean_scan
from kpred.rendering.contact_sheet import Tile, draw_contact_sheet
from kpred.studio.gestures import WHOLE, ChooseCategory, ChooseModel, Gesture, RefitRest, SetSize, Turn
from kpred.studio.opening import open_scan
from kpred.studio.record import session_record
from kpred.studio.session import Session
from kpred.studio.state import State

UP = "y"

MENDS: dict[str, tuple[Gesture, ...]] = {
    "table_06": (ChooseModel("pedestal_desk_12_149"), SetSize(WHOLE, "z", 0.72), RefitRest()),
    "table_01": (SetSize(WHOLE, "x", 1.82), RefitRest()),
    "cabinet_07": (ChooseCategory("cabinet"), RefitRest()),
    "table_04": (ChooseModel("pedestal_desk_12_149"), SetSize(WHOLE, "z", 0.81), RefitRest()),
    "table_05": (Turn(180.0), RefitRest()),
    "table_07": (ChooseModel("sled_12_209"),),
}


def distance(state: State, points: np.ndarray) -> float:
    """Mean distance in cm from points (N, 3) of a crop, metres, to the result's surface."""
    frame = state.fit.frame
    found, _ = closest_points(
        frame.to_unit(points), frame.to_unit(state.vertices), np.asarray(state.fit.mesh.faces, dtype=np.int64)
    )
    return 100.0 * frame.scale * float(found.mean())


def described(gesture: Gesture, before: State) -> str:
    """Say what a hand did, in the words of the page."""
    if isinstance(gesture, ChooseModel):
        ids = [one.model_id for one in before.candidates]
        if gesture.model_id not in ids:
            raise SystemExit(f"{gesture.model_id} is not among the models found any more: choose the gestures anew.")
        return f"*Use model* {ids.index(gesture.model_id) + 1}"
    if isinstance(gesture, SetSize):
        side = {"x": "width", "y": "height", "z": "depth"}[gesture.axis]
        return f"*Set the sizes*: {side} {100 * gesture.length:.0f} cm"
    if isinstance(gesture, Turn):
        return f"*Turn the front* {gesture.degrees:.0f}°"
    if isinstance(gesture, ChooseCategory):
        return f"*Category* {gesture.category}"
    return "*Refit the rest*"


@dataclass(frozen=True, eq=False)
class Mended:
    """A crop before and after.

    Attributes:
        crop: its file; session: with the gestures done; said: what a hand did, in the words of the page.
        before, after: mean distance of the kept points to the result, cm.
    """

    crop: Path
    session: Session
    said: tuple[str, ...]
    before: float
    after: float

    def row(self) -> str:
        """Return its row of the table, as Markdown."""
        first, last = self.session.start.fit.source.model_id, self.session.state.fit.source.model_id
        gestures = ", ".join(self.said)
        return f"| {self.crop.stem} | {gestures} | {first} | {last} | {self.before:.1f} | {self.after:.1f} |"

    def tiles(self) -> tuple[Tile, Tile]:
        """Pictures of it before and after."""
        start, state = self.session.start, self.session.state
        first = _tile(start, (f"{self.crop.stem}: {start.fit.category}", f"{self.before:.1f} cm"))
        return first, _tile(state, (", ".join(self.said).replace("*", ""), f"{self.after:.1f} cm"))


def mend(crop: Path, gestures: tuple[Gesture, ...], context: Context) -> Mended:
    """Do the gestures to the fit of one crop."""
    session = Session(open_scan(crop, context, FitOptions(up=UP)).start)
    start = session.state
    kept = start.points[clean_scan(start.points, UP, start.options.clean_config, seed=0).object_points]
    said = []
    for gesture in gestures:
        said.append(described(gesture, session.state))
        session.do(gesture)
    return Mended(crop, session, tuple(said), distance(start, kept), distance(session.state, kept))


def write(mended: list[Mended], folder: Path) -> None:
    """Write the record of each session, and the picture of all."""
    folder.mkdir(parents=True, exist_ok=True)
    for one in mended:
        record = session_record(one.session, one.crop.name)
        (folder / f"{one.crop.stem}.studio.json").write_text(record, encoding="utf-8")
    sheet = draw_contact_sheet([tile for one in mended for tile in one.tiles()], columns=2)
    small = sheet.resize((sheet.width * 5 // 8, sheet.height * 5 // 8), Image.Resampling.LANCZOS)
    small.quantize(48).save(folder / "mended.png", optimize=True)


def _tile(state: State, lines: tuple[str, ...]) -> Tile:
    frame = state.fit.frame
    result = trimesh.Trimesh(frame.to_unit(state.vertices), state.fit.mesh.faces, process=False)
    return Tile(lines, "open", frame.to_unit(state.points), result)


def main() -> None:
    """Mend all, or the named ones, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("crops", type=Path)
    parser.add_argument("names", nargs="*", default=list(MENDS))
    parser.add_argument("-o", "--out", type=Path, help="folder for records and mended.png")
    options = parser.parse_args()
    context = Context.load(None, None, None)
    print("| crop | gestures | model before | model after | before, cm | after, cm |\n|---|---|---|---|---|---|")
    done = []
    for name in options.names:
        done.append(mend(options.crops / f"{name}.ply", MENDS[name], context))
        print(done[-1].row(), flush=True)
    if options.out is not None:
        write(done, options.out)


if __name__ == "__main__":
    main()
