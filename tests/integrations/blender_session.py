"""Run inside of Blender's Python by test_blender.py: install the add-on, fit a cloud, and print what stands where.

python blender_session.py ADDON.zip INTERPRETER SCAN.npy SCALE
"""

import json
import os
import sys

import bpy
import numpy as np


def main() -> None:
    """Install, fit, and print one line of JSON."""
    addon, interpreter, scan, scale = sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4])
    bpy.ops.extensions.package_install_files(filepath=addon, repo="user_default", enable_on_install=True)
    name = "bl_ext.user_default.kpred_fit"
    bpy.context.preferences.addons[name].preferences.interpreter = interpreter
    scene = bpy.context.scene
    scene.unit_settings.scale_length = scale
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    points = np.load(scan)
    cloud = bpy.data.meshes.new("cloud")
    cloud.from_pydata(points.tolist(), [], [])
    item = bpy.data.objects.new("cloud", cloud)
    # Not as it lies in its own coordinates, but as it stands in the world.
    item.location = (3.0, -2.0, 0.5)
    item.rotation_euler = (0.0, 0.0, 0.6)
    item.scale = (1.0 / scale,) * 3
    scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    found = bpy.ops.object.kpred_fit()
    bpy.context.view_layer.update()
    world = np.array([item.matrix_world @ vertex.co for vertex in cloud.vertices])
    meshes = [one for one in bpy.data.objects if one.type == "MESH" and one is not item]
    vertices = [one.matrix_world @ vertex.co for one in meshes for vertex in one.data.vertices]
    root = bpy.context.view_layer.objects.active
    print(
        json.dumps(
            {
                "result": sorted(found),
                "scan": [world.min(axis=0).tolist(), world.max(axis=0).tolist()],
                "mesh": [np.min(vertices, axis=0).tolist(), np.max(vertices, axis=0).tolist()] if vertices else [],
                "materials": sorted({slot.material.name for one in meshes for slot in one.material_slots}),
                "root": root.name,
                "properties": {key: value for key, value in root.items() if key.startswith("kpred_")},
            }
        )
    )
    sys.stdout.flush()
    # The module bpy crashes at times while Python ends.
    os._exit(0)


main()
