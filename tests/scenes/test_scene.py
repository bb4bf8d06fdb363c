"""Scenes and their objects: real files in their own layout, every kind of object file, and what does not match."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError, MeshError, ScanError
from kpred.scenes.objects import SceneObject, annotation_of, objects_of
from kpred.scenes.scan2cad import BrokenModel, model_path
from kpred.scenes.scene import Scene, SceneWarning, read_scene, scene_name

SCAN = "Assets/scannet-sample/scene0470_00/scene0470_00_vh_clean_2.ply"
CORNERS = ((0.0, 0.0), (3.0, 0.0), (0.0, 3.0))
IDENTITY = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}


def room(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A z-up floor (NYU40 2) with a chair, a chair and a table on it, each a metre wide: points, labels, instances."""
    parts = [np.column_stack([rng.uniform(-1, 5, (400, 2)), np.zeros(400)])]
    labels, instances = [np.full(400, 2)], [np.zeros(400, np.int64)]
    for number, (x, y) in enumerate(CORNERS):
        parts.append(rng.uniform(0.05, 0.95, (100 + 10 * number, 3)) + [x, y, 0])
        labels.append(np.full(len(parts[-1]), 7 if number == 2 else 5))
        instances.append(np.full(len(parts[-1]), number + 1))
    return np.concatenate(parts), np.concatenate(labels), np.concatenate(instances)


def write_ply(path: Path, points: np.ndarray, order: str = "<", **columns: np.ndarray) -> Path:
    kinds = {"f": "float", "u": "uchar", "i": "int"}
    arrays = {axis: points[:, k].astype("f4") for k, axis in enumerate("xyz")} | columns
    name = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    lines = ["ply", f"format {name} 1.0", f"element vertex {len(points)}"]
    lines += [f"property {kinds[array.dtype.kind]} {key}" for key, array in arrays.items()]
    head = "\n".join([*lines, "end_header", ""]).encode()
    if order:
        rows = np.zeros(len(points), [(key, array.dtype.newbyteorder(order)) for key, array in arrays.items()])
        for key, array in arrays.items():
            rows[key] = array
        path.write_bytes(head + rows.tobytes())
    else:
        body = "\n".join(" ".join(map(str, row)) for row in zip(*arrays.values(), strict=True))
        path.write_bytes(head + body.encode() + b"\n")
    return path


@pytest.fixture
def files(tmp_path: Path, rng: np.random.Generator) -> Path:
    """room.ply with room.labels.ply beside it, and instances.npy."""
    points, labels, instances = room(rng)
    write_ply(tmp_path / "room.ply", points, red=np.full(len(points), 9, "u1"), **_green_blue(len(points)))
    write_ply(tmp_path / "room.labels.ply", points, label=labels.astype("i4"))
    np.save(tmp_path / "instances.npy", instances)
    return tmp_path


def _green_blue(count: int) -> dict[str, np.ndarray]:
    return {"green": np.full(count, 8, "u1"), "blue": np.full(count, 7, "u1")}


def summary(objects: list[SceneObject]) -> list[tuple[str, str | None, int]]:
    return [(item.name, item.category, len(item.points)) for item in objects]


WHOLE = [("chair_1", "chair", 100), ("chair_2", "chair", 110), ("table_3", "table", 120)]


def test_the_shared_scene_in_its_own_layout(shared_data: Path) -> None:
    real = shared_data / "real" / "scan2cad_scene0470_00"
    scene = read_scene(real / SCAN)
    assert (scene.name, scene.up) == ("scene0470_00", "z")
    assert scene.points.shape == (67465, 3)
    assert scene.labels is not None
    assert scene.labels.shape == (67465,)
    assert scene.faces is not None
    assert scene.colors is not None
    objects = objects_of(scene, real / "full_annotations.json")
    pairs = json.loads((real / "pairs" / "index.json").read_text())
    assert [item.category for item in objects] == [pair["category"] for pair in pairs]
    for item, pair in zip(objects, pairs, strict=True):
        crop = np.asarray(trimesh.load(real / "pairs" / pair["file"]).vertices)
        in_crop = cKDTree(crop).query(scene.points)[0] < 1e-5
        in_object = np.zeros(len(scene.points), dtype=bool)
        in_object[item.indices] = True
        assert item.problem is None
        assert (in_crop & in_object).sum() > 0.92 * (in_crop | in_object).sum(), item.name
        np.testing.assert_array_equal(item.points, scene.points[item.indices])


def test_labels_in_the_file_itself_are_the_same(shared_data: Path) -> None:
    file = shared_data / "real" / "scan2cad_scene0470_00" / SCAN
    one, other = read_scene(file), read_scene(file.with_name(f"{file.stem}.labels.ply"))
    assert one.labels is not None
    assert other.labels is not None
    np.testing.assert_array_equal(one.labels, other.labels)
    assert one.name == other.name


@pytest.mark.parametrize("order", ["<", ">", ""])
def test_ply_of_every_order(tmp_path: Path, rng: np.random.Generator, order: str) -> None:
    points, labels, instances = room(rng)
    columns = {"label": labels.astype("i4"), "instance": instances.astype("i4")}
    scene = read_scene(write_ply(tmp_path / "a.ply", points, order, **columns))
    np.testing.assert_allclose(scene.points, points, atol=1e-6)
    assert scene.labels is not None
    np.testing.assert_array_equal(scene.labels, labels)
    assert summary(objects_of(scene)) == WHOLE


def test_points_labels_and_colours_are_read(files: Path) -> None:
    scene = read_scene(files / "room.ply")
    assert scene.labels is not None
    assert scene.faces is None
    assert scene.colors is not None
    np.testing.assert_array_equal(np.unique(scene.colors, axis=0), [[9, 8, 7]])
    assert read_scene(files / "room.ply", up="y").up == "y"
    with pytest.raises(ConfigError, match="up axis"):
        read_scene(files / "room.ply", up="w")


@pytest.mark.parametrize("kind", ["npy", "npz", "txt", "ply"])
def test_instance_numbers(files: Path, kind: str) -> None:
    numbers = np.load(files / "instances.npy")
    scene = read_scene(files / "room.ply")
    file = files / f"numbers.{kind}"
    if kind == "npy":
        np.save(file, numbers[:, None])
    elif kind == "npz":
        np.savez(file, other=np.zeros(3), instances=numbers)
    elif kind == "txt":
        np.savetxt(file, numbers, fmt="%d")
    else:
        write_ply(file, scene.points, instance=numbers.astype("i4"))
    assert summary(objects_of(scene, file)) == WHOLE
    # Negative numbers are no object; then 0 is one.
    np.save(files / "from_zero.npy", numbers - 1)
    assert [len(item.points) for item in objects_of(scene, files / "from_zero.npy")] == [100, 110, 120]


def test_categories_of_instances_without_labels(files: Path) -> None:
    numbers = np.load(files / "instances.npy")
    scene = Scene(read_scene(files / "room.ply").points)
    assert [item.category for item in objects_of(scene, files / "instances.npy")] == [None] * 3
    np.save(files / "coded.npy", np.array([0, 5001, 5002, 7001])[numbers])  # ScanNet: class * 1000 + instance
    assert [item.category for item in objects_of(scene, files / "coded.npy")] == ["chair", "chair", "table"]


@pytest.mark.parametrize("length", [0, 1, 729, 731])
def test_labels_that_do_not_match(files: Path, length: int) -> None:
    scene = read_scene(files / "room.ply")
    np.save(files / "wrong.npy", np.ones(length, np.int64))
    with pytest.raises(ScanError, match=rf"wrong.npy: it labels {length} points, but the scene has 730"):
        objects_of(scene, files / "wrong.npy")


def test_semantic_labels_that_do_not_match(files: Path) -> None:
    short = read_scene(files / "room.labels.ply")
    assert short.labels is not None
    write_ply(files / "room.labels.ply", short.points[:-5], label=short.labels[:-5].astype("i4"))
    with pytest.warns(SceneWarning, match="labels 725 points"):
        scene = read_scene(files / "room.ply")
    assert scene.labels is None  # The scene is not lost.
    with pytest.raises(ScanError, match="labels 725 points"):
        read_scene(files / "room.ply", labels=files / "room.labels.ply")


@pytest.mark.parametrize("content", [np.array([1.5] * 730), np.array(["a"] * 730)])
def test_numbers_that_are_none(files: Path, content: np.ndarray) -> None:
    np.save(files / "odd.npy", content)
    with pytest.raises(ScanError, match="odd.npy"):
        objects_of(read_scene(files / "room.ply"), files / "odd.npy")


def write_boxes(folder: Path, boxes: Any) -> Path:
    (folder / "boxes.json").write_text(json.dumps(boxes))
    return folder / "boxes.json"


def test_boxes(files: Path) -> None:
    scene = read_scene(files / "room.ply")
    boxes = [
        {"name": "a", "category": "office chair", "center": [0.5, 0.5, 0.5], "size": [1, 1, 1], "yaw": 0},
        {"category": "chair", "corners": [[3, 0, 0], [4, 1, 1]]},
        [[0, 1], [3, 4], [0, 1]],
        {"category": "table", "min": [0, 3, 0], "max": [1, 4, 1]},
    ]
    found = [("a", "chair", 100), ("chair_1", "chair", 110), ("object_2", None, 120), ("table_3", "table", 120)]
    assert summary(objects_of(scene, write_boxes(files, boxes))) == found
    assert summary(objects_of(scene, write_boxes(files, {"objects": boxes}))) == found


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_boxes_turn_about_the_up_axis(tmp_path: Path, rng: np.random.Generator, up: str) -> None:
    from scipy.spatial.transform import Rotation

    yaw, size, center = 0.6, np.array([0.4, 0.8, 1.6]), np.array([1.0, 2.0, 3.0])
    axis = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    local = rng.uniform(-1, 1, (500, 3)) * 0.9
    inside = (np.abs(local) <= size / 2).all(axis=1)
    scene = Scene(Rotation.from_rotvec(yaw * axis).apply(local) + center, up=up)
    box = {"center": center.tolist(), "size": size.tolist(), "yaw": yaw}
    (item,) = objects_of(scene, write_boxes(tmp_path, [box]))
    np.testing.assert_array_equal(item.indices, np.flatnonzero(inside))


@pytest.mark.parametrize(
    ("box", "trouble"),
    [
        ({"center": [0, 0, 0]}, "neither"),
        ({"center": [0, 0, 0], "size": [1, 0, 1]}, "not positive"),
        ({"center": [0, 0, None], "size": [1, 1, 1]}, "broken"),
        ({"center": [0, 0, 0], "size": [1, 1, 1], "yaw": float("nan")}, "NaN"),
        ({"center": [0, 0], "size": [1, 1, 1]}, "three numbers"),
        ([1, 2, 3], "neither"),
        ({"center": [90, 90, 90], "size": [1, 1, 1]}, "no point of the scan lies in its box"),
    ],
)
def test_a_bad_box_costs_itself_only(files: Path, box: Any, trouble: str) -> None:
    good = {"category": "chair", "center": [0.5, 0.5, 0.5], "size": [1, 1, 1]}
    bad, fine = objects_of(read_scene(files / "room.ply"), write_boxes(files, [box, good]))
    assert bad.problem is not None
    assert bad.name in bad.problem
    assert trouble in bad.problem
    assert fine.problem is None
    assert len(fine.points) == 100


def write_segments(folder: Path, **changes: Any) -> Path:
    numbers = np.load(folder / "instances.npy")
    # Each object is two segments.
    segments = (numbers * 10 + np.arange(len(numbers)) % 2).tolist()
    (folder / "room_vh_clean_2.0.010000.segs.json").write_text(json.dumps({"segIndices": segments}))
    groups = [
        {"objectId": 0, "segments": [10, 11], "label": "office chair"},
        {"objectId": 1, "segments": [20, 21], "label": "chair"},
        {"objectId": 2, "segments": [30, 31], "label": "desk"},
    ]
    content = {"sceneId": "scannet.room", "segmentsFile": "scannet.room_vh_clean_2.0.010000.segs.json"}
    (folder / "room.aggregation.json").write_text(json.dumps(content | {"segGroups": groups} | changes))
    return folder / "room.aggregation.json"


def test_scannet_segments(files: Path) -> None:
    scene = read_scene(files / "room.ply")
    file = write_segments(files)
    assert summary(objects_of(scene, file)) == [
        ("chair_0", "chair", 100),
        ("chair_1", "chair", 110),
        ("table_2", "table", 120),
    ]
    groups = [{"objectId": 4, "segments": None, "label": "sofa"}, {"objectId": 5, "segments": [77], "label": "bed"}]
    problems = [item.problem for item in objects_of(scene, write_segments(files, segGroups=groups))]
    assert problems[0] is not None
    assert "sofa_4 has no list of segments" in problems[0]
    assert problems[1] == "bed_5: no point of the scan is in its segments."
    with pytest.raises(ScanError, match="room.aggregation.json: it has no objects"):
        objects_of(scene, write_segments(files, segGroups=[]))
    with pytest.raises(ScanError, match="segments of 730 points, but the scene has 600"):
        objects_of(Scene(scene.points[:600]), write_segments(files))
    (files / "room_vh_clean_2.0.010000.segs.json").unlink()
    with pytest.raises(ScanError, match="segs.json"):
        objects_of(scene, file)


def write_annotation(folder: Path, *models: dict[str, Any], id_scan: str = "room") -> Path:
    content = [{"id_scan": id_scan, "trs": IDENTITY, "aligned_models": list(models)}]
    (folder / "full_annotations.json").write_text(json.dumps(content))
    return folder / "full_annotations.json"


def placed(x: float, y: float, catid: str = "03001627", **changes: Any) -> dict[str, Any]:
    trs = {"translation": [x + 0.5, y + 0.5, 0.5], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
    return {"catid_cad": catid, "id_cad": "m", "trs": trs, "bbox": [0.5] * 3, "center": [0, 0, 0]} | changes


def test_annotated_models_get_the_points_of_their_class(files: Path) -> None:
    scene = read_scene(files / "room.ply")
    models = [placed(*CORNERS[0]), placed(*CORNERS[2], catid="04379243"), placed(*CORNERS[1], catid="04379243")]
    objects = objects_of(scene, write_annotation(files, *models))
    assert summary(objects) == [("chair_0", "chair", 100), ("table_1", "table", 120), ("table_2", "table", 0)]
    assert objects[2].problem == "table_2: no point of the scan of its class lies in the box of m."
    assert objects[0].annotation is not None
    # Of two models in one place, each point goes to one.
    both = objects_of(scene, write_annotation(files, placed(0, 0), placed(0.3, 0)))
    assert not set(both[0].indices) & set(both[1].indices)
    assert sum(len(item.points) for item in both) == 100


def test_broken_and_missing_models_are_told_by_name(files: Path) -> None:
    scene = read_scene(files / "room.ply")
    nan = {**IDENTITY, "scale": [1, 1, float("nan")]}
    unsized = placed(*CORNERS[1])
    del unsized["bbox"]
    file = write_annotation(files, placed(*CORNERS[0], trs=nan), unsized, placed(*CORNERS[2], catid="04379243"))
    broken, missing, fine = objects_of(scene, file)
    assert broken.problem is not None
    assert "chair_0" in broken.problem
    assert "scale" in broken.problem
    assert missing.problem is not None
    assert "chair_1: it has no bbox" in missing.problem
    assert "03001627/m is missing" in missing.problem
    assert fine.problem is None
    assert len(fine.points) == 120


def test_without_a_bbox_the_mesh_tells_the_size(files: Path) -> None:
    model = placed(*CORNERS[0])
    del model["bbox"]
    cad = files / "shapenet-sample" / "03001627" / "m" / "models"
    cad.mkdir(parents=True)
    trimesh.creation.box((1, 1, 1)).export(cad / "model_normalized.obj")
    (item,) = objects_of(read_scene(files / "room.ply"), write_annotation(files, model))
    assert len(item.points) == 100


def test_the_annotation_of_another_scene_is_refused(files: Path) -> None:
    scene = Scene(read_scene(files / "room.ply").points, name="scene0001_00")
    with pytest.raises(ScanError, match="no annotation of scene0001_00"):
        annotation_of(scene, write_annotation(files, placed(0, 0), id_scan="scene0002_00"))
    with pytest.raises(ScanError, match="it has no objects"):
        objects_of(scene, write_annotation(files, id_scan="scene0001_00"))


def test_s3dis_folder(files: Path) -> None:
    scene, numbers = read_scene(files / "room.ply"), np.load(files / "instances.npy")
    folder = files / "Annotations"
    folder.mkdir()
    for name, number in (("chair_1", 1), ("bookcase_1", 2)):
        points = scene.points[numbers == number]
        np.savetxt(folder / f"{name}.txt", np.column_stack([points, np.full((len(points), 3), 128)]))
    (folder / "table_9.txt").write_text("nothing\n")
    bookcase, chair, broken = objects_of(scene, folder)
    assert (bookcase.name, bookcase.category, len(bookcase.points)) == ("bookcase_1", "cabinet", 110)
    np.testing.assert_array_equal(chair.indices, np.flatnonzero(numbers == 1))
    assert broken.problem is not None


def test_points_that_are_not_finite_keep_labels_in_place(tmp_path: Path, rng: np.random.Generator) -> None:
    points, labels, instances = room(rng)
    points[405] = np.nan
    columns = {"label": labels.astype("i4"), "instance": instances.astype("i4")}
    scene = read_scene(write_ply(tmp_path / "a.ply", points, **columns))
    assert summary(objects_of(scene)) == [("chair_1", "chair", 99), *WHOLE[1:]]


def test_scenes_that_cannot_be_read(files: Path) -> None:
    with pytest.raises(ScanError, match="no such file"):
        read_scene(files / "none.ply")
    with pytest.raises(ScanError, match="unknown scene extension"):
        read_scene(write_ply(files / "room.docx", np.zeros((5, 3))))
    (files / "cut.ply").write_bytes((files / "room.ply").read_bytes()[:-40])
    with pytest.raises(ScanError, match="cut short"):
        read_scene(files / "cut.ply")
    with pytest.raises(ScanError, match="have no instance numbers"):
        objects_of(read_scene(files / "room.ply"))
    with pytest.raises(ScanError, match="no such file of objects"):
        objects_of(read_scene(files / "room.ply"), files / "none.json")
    with pytest.raises(ScanError, match="no finite|no point with finite"):
        read_scene(write_ply(files / "nan.ply", np.full((5, 3), np.nan)))


def test_other_files_are_scenes_too(files: Path) -> None:
    scene = read_scene(files / "room.ply")
    np.save(files / "room.npy", scene.points)
    np.savetxt(files / "room.txt", scene.points)
    for name in ("room.npy", "room.txt"):
        np.testing.assert_allclose(read_scene(files / name).points, scene.points)
    trimesh.creation.box((1, 2, 3)).export(files / "box.glb")
    box = read_scene(files / "box.glb")
    assert box.up == "y"
    assert box.faces is not None


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("scene0470_00_vh_clean_2.ply", "scene0470_00"),
        ("scene0470_00_vh_clean_2.labels.ply", "scene0470_00"),
        ("scene0470_00.ply", "scene0470_00"),
        ("office_1.txt", "office_1"),
    ],
)
def test_scene_names(file: str, name: str) -> None:
    assert scene_name(Path(file)) == name


# ---- objects of other data sets


def replica(path: Path, faces: list[tuple[list[int], int]], points: np.ndarray) -> None:
    """A scene as Replica writes it: quads and triangles with the number of their object."""
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nproperty int object_id\nend_header\n"
    body = b"".join(struct.pack(f"<B{len(f)}ii", len(f), *f, number) for f, number in faces)
    path.write_bytes(head.encode() + points.astype("<f4").tobytes() + body)


def test_objects_of_faces_as_in_replica(tmp_path: Path, rng: np.random.Generator) -> None:
    points = rng.normal(size=(12, 3))
    replica(tmp_path / "room.ply", [([0, 1, 2, 3], 4), ([4, 5, 6], 4), ([7, 8, 9], 9)], points)
    scene = read_scene(tmp_path / "room.ply")
    assert [(item.name, item.indices.tolist()) for item in objects_of(scene)] == [
        ("object_4", [0, 1, 2, 3, 4, 5, 6]),
        ("object_9", [7, 8, 9]),
    ]
    named = [{"id": 9, "class_name": "chair"}, {"id": 4, "class_name": "table"}, {"id": 5, "class_name": "lamp"}]
    (tmp_path / "info_semantic.json").write_text(json.dumps({"objects": named}))
    found = objects_of(scene, tmp_path / "info_semantic.json")
    assert [(item.name, item.category, len(item.points)) for item in found] == [
        ("chair_9", "chair", 3),
        ("table_4", "table", 7),
        ("lamp_5", "lamp", 0),
    ]
    assert found[2].problem is not None


def test_oriented_boxes_of_arkitscenes(tmp_path: Path, rng: np.random.Generator) -> None:
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    local = rng.uniform(-1, 1, size=(2000, 3))
    center, size = np.array([3.0, -2, 1]), np.array([1.0, 0.5, 1.5])
    np.save(tmp_path / "room.npy", local @ axes + center)
    box = {"centroid": center.tolist(), "axesLengths": size.tolist(), "normalizedAxes": axes.ravel().tolist()}
    entries = [{"label": "chair", "segments": {"obbAligned": box}}, {"label": "chair", "segments": {"obb": box}}, {}, 7]
    entries.append({"label": "table", "segments": {"obbAligned": box | {"normalizedAxes": [1.0] * 9}}})
    (tmp_path / "3dod_annotation.json").write_text(json.dumps({"skipped": False, "data": entries}))
    found = objects_of(read_scene(tmp_path / "room.npy"), tmp_path / "3dod_annotation.json")
    inside = np.flatnonzero((np.abs(local) <= size / 2).all(axis=1))
    for item in found[:2]:
        assert item.category == "chair"
        np.testing.assert_array_equal(item.indices, inside)
    assert [item.problem is None for item in found] == [True, True, False, False, False]


def test_boxes_of_labelcloud(tmp_path: Path, rng: np.random.Generator) -> None:
    points = rng.uniform(-3, 3, size=(3000, 3))
    np.save(tmp_path / "room.npy", points)
    item = {
        "name": "chair",
        "centroid": {"x": 0.5, "y": -0.5, "z": 0.1},
        "dimensions": {"length": 2.0, "width": 1.0, "height": 3.0},
        "rotations": {"x": 0.0, "y": 0.0, "z": 30.0},
    }
    (tmp_path / "labels.json").write_text(
        json.dumps({"filename": "room.npy", "objects": [item, item | {"rotations": {}}]})
    )
    plain = [{"center": [0.5, -0.5, 0.1], "size": [2, 1, 3], "yaw": np.radians(30), "category": "chair"}]
    (tmp_path / "boxes.json").write_text(json.dumps(plain))
    scene = read_scene(tmp_path / "room.npy")
    found, wanted = objects_of(scene, tmp_path / "labels.json"), objects_of(scene, tmp_path / "boxes.json")
    assert found[0].name == "chair_0" and len(wanted[0].indices) > 50 and found[1].problem is not None
    np.testing.assert_array_equal(found[0].indices, wanted[0].indices)


@pytest.mark.parametrize("segments", ["segments.json", "mesh.refined.0.010000.segs.v2.json", "room_vh_clean.segs.json"])
def test_segments_under_the_names_of_other_data_sets(tmp_path: Path, rng: np.random.Generator, segments: str) -> None:
    np.save(tmp_path / "room.npy", rng.normal(size=(300, 3)))
    (tmp_path / segments).write_text(json.dumps({"segIndices": (np.arange(300) // 100).tolist()}))
    groups = [{"objectId": 3, "label": "chair", "segments": [0, 2]}, {"objectId": 4, "segments": [10**30]}]
    (tmp_path / "segments_anno.json").write_text(json.dumps({"segGroups": groups}))
    found = objects_of(read_scene(tmp_path / "room.npy"), tmp_path / "segments_anno.json")
    assert found[0].name == "chair_3" and len(found[0].points) == 200
    assert found[1].problem is not None


@pytest.mark.parametrize("named", ["../secret.segs.json", "/etc/passwd", "A" * 5000, "a\0b"])
def test_segments_are_read_beside_the_annotation_only(tmp_path: Path, rng: np.random.Generator, named: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    np.save(folder / "room.npy", rng.normal(size=(300, 3)))
    (tmp_path / "secret.segs.json").write_text(json.dumps({"segIndices": [0] * 300}))
    (folder / "a.aggregation.json").write_text(json.dumps({"segmentsFile": named, "segGroups": []}))
    with pytest.raises(ScanError, match="are not beside it"):
        objects_of(read_scene(folder / "room.npy"), folder / "a.aggregation.json")


def test_ids_of_models_do_not_lead_out_of_their_folder(tmp_path: Path) -> None:
    for name in ("../..", "a/b", "A" * 5000, ".."):
        with pytest.raises(MeshError, match="no names of folders"):
            model_path(BrokenModel("chair_0", "chair", "03001627", name, ""), tmp_path)


CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def boxes_of_programs(center: list[float], turn: np.ndarray, size: np.ndarray) -> dict[str, Any]:
    """One box as single programs write it; `turn` holds its sides' directions in columns."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, center
    corners = (CUBE * size / 2) @ turn.T + center
    return {
        "Open3D": {"center": center, "extent": size.tolist(), "R": turn.tolist(), "label": "chair"},
        "SUN RGB-D": {
            "centroid": center,
            "coeffs": (size / 2).tolist(),
            "basis": turn.T.tolist(),
            "classname": "chair",
        },
        "eight corners": {"corners": corners[[3, 0, 6, 1, 7, 2, 5, 4]].tolist(), "class": "chair"},
        "RoomPlan": {"category": {"chair": {}}, "dimensions": size.tolist(), "transform": matrix.T.ravel().tolist()},
    }


def test_boxes_of_programs(tmp_path: Path, rng: np.random.Generator) -> None:
    center, size = [1.0, 2.0, 0.5], np.array([0.6, 1.2, 1.0])
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    points = rng.uniform(-1, 1, size=(4000, 3)) + center
    inside = (np.abs((points - center) @ turn) <= size / 2).all(axis=1)
    scene = Scene(points)
    for name, box in boxes_of_programs(center, turn, size).items():
        (item,) = objects_of(scene, write_boxes(tmp_path, {"objects": [box]}))
        assert item.category == "chair", name
        np.testing.assert_array_equal(item.indices, np.flatnonzero(inside), err_msg=name)
    (item,) = objects_of(
        scene, write_boxes(tmp_path, [{"center": center, "size": size.tolist(), "heading": np.pi / 6}])
    )
    np.testing.assert_array_equal(item.indices, np.flatnonzero(inside))
    (item,) = objects_of(scene, write_boxes(tmp_path, [{"corners": (CUBE * [1, 1, 0]).tolist()}]))
    assert item.problem is not None and "corners" in item.problem


def test_instance_numbers_in_lines_of_commas_and_below_a_name(tmp_path: Path, rng: np.random.Generator) -> None:
    scene = Scene(rng.normal(size=(60, 3)))
    numbers = np.arange(60) // 30 + 1
    (tmp_path / "a.csv").write_text(",".join(map(str, numbers)))
    (tmp_path / "b.csv").write_text("instance\n" + "\n".join(map(str, numbers)))
    np.savez(tmp_path / "c.npz", instance_labels=numbers, points=scene.points)
    for name in ("a.csv", "b.csv", "c.npz"):
        assert [len(item.points) for item in objects_of(scene, tmp_path / name)] == [30, 30], name


@pytest.mark.parametrize("name", ["instance_label", "instanceid", "scalar_Instance", "ins_label", "pred_instance"])
def test_instance_properties_of_programs(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    rows = "".join(f"{x} {y} {z} {number // 30 + 1}\n" for number, (x, y, z) in enumerate(rng.normal(size=(60, 3))))
    header = "".join(f"property float {word}\n" for word in ("x", "y", "z", name))
    (tmp_path / "a.ply").write_text(f"ply\nformat ascii 1.0\nelement vertex 60\n{header}end_header\n{rows}")
    assert [len(item.points) for item in objects_of(read_scene(tmp_path / "a.ply"))] == [30, 30]
