"""How fast the mesh follows the hand in `kpred studio`: from the message of a moved handle to that of the moved mesh.

    python benchmarks/studio_drag.py [--vertices 20000] [--moves 300]

A tab without a browser connects by websocket, moves the handle of a keypoint, and waits for the vertices; then it moves
the handle again. The model of the sample scan is subdivided to the number of vertices. Drawing in the browser comes on
top. Processor time of the whole program is given too, which other work disturbs less than the clock.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from kpred.fitting import sample_scan
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.shapes.mesh import Mesh
from kpred.studio.opening import Opened, open_scan
from kpred.studio.serve import Studio
from kpred.studio.state import State
from kpred.studio.tabs import scan_tabs


def subdivided(state: State, count: int) -> State:
    """Return the state with the model's mesh subdivided to at least `count` vertices."""
    fit = state.fit
    entry = fit.placed.entry
    vertices, faces = np.asarray(entry.mesh.vertices, dtype=np.float64), np.asarray(entry.mesh.faces)
    parts = entry.structure.vertex_parts.astype(np.float64)[:, None]
    while len(vertices) < count:
        # The longest edges first, so that the number is met.
        area = trimesh.triangles.area(vertices[faces])
        largest = np.argsort(-area)[: max(1, min(len(faces), (count - len(vertices)) // 2 + 1))]
        vertices, faces, more = trimesh.remesh.subdivide(
            vertices, faces, face_index=largest, vertex_attributes={"parts": parts}
        )
        parts = np.asarray(more["parts"])
    structure = replace(entry.structure, vertex_parts=parts[:, 0].round().astype(entry.structure.vertex_parts.dtype))
    finer = replace(entry, mesh=Mesh(vertices, faces), structure=structure)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return state.with_fit(replace(fit, mesh=mesh, placed=replace(fit.placed, entry=finer, mesh=mesh)))


def moves(url: str, studio: Studio, count: int) -> list[float]:
    """Drag a keypoint to `count` places and time each, seconds."""
    import msgspec
    from websockets.sync.client import connect

    pack, unpack = msgspec.msgpack.encode, msgspec.msgpack.decode
    times = []
    with connect(url.replace("http", "ws"), max_size=None, origin=url, compression=None) as tab:
        camera = {"wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 3.0), "fov": 1.0, "near": 0.1, "far": 100.0}
        more = {"aspect": 1.0, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 1.0, 0.0)}
        tab.send(pack({"type": "ViewerCameraMessage", **camera, **more}))
        _wait(tab, unpack, "MeshMessage", "/result")
        page = studio.tabs[0].page
        page.select(0)
        start = page.state.shape.keypoints[0]
        for number in range(count):
            place = start + [0.0, 0.1 * np.sin(0.1 * (number + 1)), 0.0]
            handle = {"name": "/handle", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": tuple(float(x) for x in place)}
            begun = time.perf_counter()
            tab.send(pack({"type": "TransformControlsUpdateMessage", **handle}))
            _wait(tab, unpack, "SceneNodeUpdateMessage", "/result")
            times.append(time.perf_counter() - begun)
    return times


def _wait(tab: Any, unpack: Any, kind: str, name: str) -> None:
    """Wait for a message about a node of the scene."""
    while True:
        for message in unpack(tab.recv(timeout=300)):
            if message["type"] == kind and message["name"] == name:
                return


def main() -> None:
    """Measure and print as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=20_000)
    parser.add_argument("--moves", type=int, default=300)
    options = parser.parse_args()
    opened = open_scan(sample_scan(), Context.load(None, None, None), FitOptions())
    state = subdivided(opened.start, options.vertices)
    studio = Studio(scan_tabs(Opened(state, opened.name)), port=0)
    cpu = time.process_time()
    times = np.array(moves(studio.url, studio, options.moves)[10:]) * 1000
    cpu = (time.process_time() - cpu) / options.moves * 1000
    studio.stop()
    middle, most = np.quantile(times, [0.5, 0.95])
    found = {"vertices": len(state.shape.vertices), "median_ms": middle, "percentile_95_ms": most, "processor_ms": cpu}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
