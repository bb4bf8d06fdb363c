"""Let models of the bundled database stand for 30 seconds in MuJoCo: how deep they sink, how far they move.

python scripts/measure_simulation.py [models of each category]
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np

from kpred.database import Database, Entry
from kpred.exports.formats import save_export
from kpred.exports.furniture import Export, Furniture
from kpred.fitting import bundled_database_path
from kpred.shapes.credit import Credit

SECONDS = 30.0


def stand(entry: Entry, file: Path) -> tuple[float, float, float]:
    """Export a model undeformed, run it, and return depth (m), way (m) and lean (degrees) at the end."""
    vertices = entry.mesh.vertices.astype(np.float64)
    parts, axes = entry.structure.vertex_parts, np.asarray(entry.structure.axes, dtype=np.float64)
    credit = Credit(entry.model_id, entry.category, {}, "placed")
    chair = Furniture(entry.model_id, vertices, entry.mesh.faces, parts, vertices, np.eye(3), axes, credit)
    save_export(Export((chair,), np.eye(3)), file)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = data.xpos[1].copy()
    for _ in range(int(SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, data)
    depth = -float(data.contact.dist.min()) if data.ncon else 0.0
    way = float(np.abs(data.xpos[1] - start).max())
    return depth, way, float(np.degrees(np.arccos(np.clip(data.xmat[1][8], -1, 1))))


count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
found = []
with TemporaryDirectory() as folder, Database.open(bundled_database_path(), read_only=True) as database:
    for category in database.categories():
        names = database.model_ids(category)
        for name in names[:: max(1, len(names) // count)][:count]:
            found.append(stand(database.entry(name), Path(folder, "model.xml")))
            print(category, name, *(f"{value:.3g}" for value in found[-1]))
depth, way, lean = np.max(found, axis=0)
print(
    f"{len(found)} models: deepest {1000 * depth:.2f} mm, farthest {1000 * way:.2f} mm, most leaning {lean:.2f} degrees"
)
