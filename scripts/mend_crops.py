"""Mend the six worst crops of the real scans by the gestures of a hand, and print the table of docs/studio.md.

    python scripts/mend_crops.py CROPS      # the folder that `kpred evaluate real --crops` takes

The gestures were chosen by a search over the distances that are reported, then looked at. They run through the same
sessions as those of the page.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.ops.closest_point import closest_points
from kpred.preprocessing.clean import clean_scan
from kpred.studio.gestures import WHOLE, ChooseCategory, ChooseModel, Gesture, RefitRest, SetSize, Turn
from kpred.studio.opening import open_scan
from kpred.studio.session import Session
from kpred.studio.state import State

UP = "y"

MENDS: dict[str, tuple[Gesture, ...]] = {
    "table_04": (Turn(180.0), ChooseModel("infinigen_TableDiningFactory_00040"), RefitRest()),
    "table_01": (ChooseModel("open_bay_desk_12_59"), SetSize(WHOLE, "x", 1.98), RefitRest()),
    "cabinet_07": (ChooseCategory("cabinet"), RefitRest()),
    "table_05": (Turn(180.0), RefitRest()),
    "table_00": (SetSize(WHOLE, "z", 0.8), RefitRest()),
    "table_06": (ChooseModel("infinigen_TableDiningFactory_00040"), SetSize(WHOLE, "z", 0.75), RefitRest()),
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


def mend(crop: Path, gestures: tuple[Gesture, ...], context: Context) -> str:
    """Mend one crop, and return its row of the table."""
    session = Session(open_scan(crop, context, FitOptions(up=UP)).start)
    start = session.state
    kept = clean_scan(start.points, UP, start.options.clean_config, seed=0).points
    said = []
    for gesture in gestures:
        said.append(described(gesture, session.state))
        session.do(gesture)
    before, after = distance(start, kept), distance(session.state, kept)
    models = f"{start.fit.source.model_id} | {session.state.fit.source.model_id}"
    return f"| {crop.stem} | {', '.join(said)} | {models} | {before:.1f} | {after:.1f} |"


def main() -> None:
    """Mend all, or the named ones, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("crops", type=Path)
    parser.add_argument("names", nargs="*", default=list(MENDS))
    options = parser.parse_args()
    context = Context.load(None, None, None)
    print("| crop | gestures | model before | model after | before, cm | after, cm |\n|---|---|---|---|---|---|")
    for name in options.names:
        print(mend(options.crops / f"{name}.ply", MENDS[name], context), flush=True)


if __name__ == "__main__":
    main()
