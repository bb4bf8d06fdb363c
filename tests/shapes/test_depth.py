"""The way from a mesh to a depth picture and back, and what of a depth picture is an object."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from kpred.errors import ConfigError, ScanError
from kpred.shapes.camera import Camera
from kpred.shapes.depth import (
    flying_pixels,
    merge_views,
    read_depth,
    read_mask,
    scan_depth,
    write_depth,
)
from kpred.shapes.depth_camera import depth_camera
from kpred.shapes.intrinsics_file import IntrinsicsFile
from kpred.shapes.mesh import Mesh
from kpred.shapes.render import render_depth, render_faces
from kpred.synthetic.generator import generate


def looking(eye: np.ndarray | list[float], at: np.ndarray | list[float], size: tuple[int, int] = (160, 120)) -> Camera:
    forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.column_stack([right, np.cross(forward, right), forward, eye])
    focal = 0.9 * size[0]
    return Camera(np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]]), *size, pose)


def cast(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> np.ndarray:
    """Depth by asking every triangle for every pixel's ray, one after the other."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = camera.unproject(np.stack([columns, rows], -1).reshape(-1, 2), np.ones(rows.size)) - camera.origin
    nearest = np.full(len(rays), np.inf)
    for a, b, c in np.asarray(vertices, dtype=np.float64)[faces]:
        normal = np.cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((a - camera.origin) @ normal) / (rays @ normal)
        hit = camera.origin + rays * depth[:, None]
        sides = np.stack([np.cross(q - p, hit - p) @ normal for p, q in ((a, b), (b, c), (c, a))])
        inside = (sides >= 0).all(axis=0) & (depth > 0.01)
        nearest = np.where(inside & (depth < nearest), depth, nearest)
    return np.where(np.isfinite(nearest), nearest, 0).reshape(camera.height, camera.width)


def distances(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Of points to the nearest triangle, by asking all of them."""
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    best = np.full(len(points), np.inf)
    for triangle in corners:
        near = trimesh.triangles.closest_point(np.broadcast_to(triangle, (len(points), 3, 3)), points)
        best = np.minimum(best, np.linalg.norm(near - points, axis=1))
    return best


def furniture(category: str, row: int = 0) -> Mesh:
    return generate(category, row + 1, seed=5)[row]


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_rendering_agrees_with_casting_rays(category: str) -> None:
    mesh, camera = furniture(category), looking([1.3, 1.1, 1.9], [0, 0.4, 0], (32, 24))
    depth, expected = render_depth(mesh.vertices, mesh.faces, camera), cast(mesh.vertices, mesh.faces, camera)
    assert (expected > 0).sum() > 40
    # A ray that grazes an edge may go either way.
    assert ((depth > 0) != (expected > 0)).mean() < 0.005
    both = (depth > 0) & (expected > 0)
    assert (np.abs(depth - expected)[both] < 1e-6).mean() > 0.99


def test_a_camera_inside_a_room_sees_a_wall_in_every_pixel() -> None:
    room = trimesh.creation.box((4, 3, 5))
    camera = looking([0.4, 0.2, 1.0], [-1, -0.3, -1], (48, 36))
    depth = render_depth(room.vertices, room.faces, camera)
    assert (depth > 0).all()
    np.testing.assert_allclose(depth, cast(room.vertices, room.faces, camera), atol=1e-9)


def test_what_is_behind_or_beside_the_camera_is_not_seen() -> None:
    box = trimesh.creation.box((1, 1, 1))
    for at in ([0, 0, 8], [9, 0, 0]):
        camera = looking([0, 0, 4], at, (32, 24)) if at[0] == 0 else looking([0, 5, 4], [9, 5, 3], (32, 24))
        depth, face = render_faces(box.vertices, box.faces, camera)
        assert (face == -1).all()
        assert np.isinf(depth).all()
    assert (render_depth(np.zeros((0, 3)), np.zeros((0, 3), dtype=int), looking([0, 0, 4], [0, 0, 0])) == 0).all()


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_back_projection_of_a_written_picture_lies_on_the_mesh(category: str, tmp_path: Path) -> None:
    mesh = furniture(category, 1)
    camera = looking([1.2, 1.3, 1.6], [0, 0.4, 0])
    depth = render_depth(mesh.vertices, mesh.faces, camera)
    write_depth(tmp_path / "depth.png", depth)
    scan = scan_depth(read_depth(tmp_path / "depth.png"), camera, remove_flying=False)
    assert len(scan.points) == (depth > 0).sum()
    rays = np.linalg.norm(camera.unproject(np.array([[0.0, 0.0]]), np.ones(1)) - camera.origin)
    assert distances(scan.points[::7], mesh).max() < 0.0005 * rays + 1e-6
    np.testing.assert_allclose(camera.project(scan.points)[0], scan.pixels, atol=1e-6)
    np.testing.assert_array_equal(scan.origin, camera.origin)


def test_millimetres_and_metres_and_any_scale_say_the_same(tmp_path: Path, rng: np.random.Generator) -> None:
    millimetres = rng.integers(300, 6000, size=(12, 16)).astype(np.uint16)
    millimetres[0, 0], millimetres[0, 1] = 0, 65535
    metres = np.where(millimetres % 65535 > 0, millimetres / 1000, 0)
    Image.fromarray(millimetres).save(tmp_path / "mm.png")
    Image.fromarray(millimetres).save(tmp_path / "mm.tiff")
    np.save(tmp_path / "mm.npy", millimetres)
    np.save(tmp_path / "wide.npy", millimetres.astype(np.int32))
    np.save(tmp_path / "m.npy", np.where(metres > 0, metres, np.nan))
    Image.fromarray(metres.astype(np.float32)).save(tmp_path / "m.tiff")
    for file in tmp_path.iterdir():
        np.testing.assert_allclose(read_depth(file), metres, atol=1e-6, err_msg=file.name)
    fifths = np.where(millimetres < 65535, millimetres * 5, 65535).astype(np.uint16)
    Image.fromarray(fifths).save(tmp_path / "fifth.png")
    np.testing.assert_allclose(read_depth(tmp_path / "fifth.png", depth_scale=5000.0), metres, atol=1e-6)


def test_what_is_written_is_read_to_half_a_millimetre(tmp_path: Path) -> None:
    depth = np.array([[0.0, 1.2344, 65.0, 70.0, np.inf, np.nan, -1.0]])
    write_depth(tmp_path / "d.png", depth)
    np.testing.assert_allclose(read_depth(tmp_path / "d.png"), [[0, 1.234, 65.0, 0, 0, 0, 0]], atol=1e-9)


def test_a_mask_selects_its_object(tmp_path: Path) -> None:
    chair, table = furniture("chair"), furniture("table")
    there = table.vertices + np.float32([1.6, 0, -0.3])
    vertices = np.concatenate([chair.vertices, there])
    faces = np.concatenate([chair.faces, table.faces + len(chair.vertices)])
    camera = looking([1.0, 1.6, 3.6], [0.7, 0.4, 0])
    depth, face = render_faces(vertices, faces, camera)
    ids = np.where(face < 0, 0, np.where(face < len(chair.faces), 3, 8)).astype(np.uint8)
    Image.fromarray(ids).save(tmp_path / "ids.png")
    np.save(tmp_path / "one.npy", ids == 8)
    mask = read_mask(tmp_path / "ids.png", 8)
    np.testing.assert_array_equal(mask, read_mask(tmp_path / "one.npy"))
    scan = scan_depth(np.where(face < 0, 0, depth), camera, mask)
    low, high = there.min(axis=0) - 1e-5, there.max(axis=0) + 1e-5
    assert ((scan.points >= low) & (scan.points <= high)).all()
    assert len(scan.points) > 0.8 * mask.sum()
    assert mask[scan.pixels[:, 1], scan.pixels[:, 0]].all()
    with pytest.raises(ScanError, match=r"2 objects \(3, 8\)"):
        read_mask(tmp_path / "ids.png")
    with pytest.raises(ScanError, match="no object has the id 4; the mask holds 3, 8"):
        read_mask(tmp_path / "ids.png", 4)


def test_pixels_that_mix_front_and_back_are_dropped() -> None:
    camera = Camera(np.array([[300.0, 0, 20], [0, 300, 15], [0, 0, 1]]), 40, 30)
    depth = np.full((30, 40), 3.0)
    depth[:, :20] = 1.0  # a front that ends in front of a wall
    depth[:, 20] = 1.9
    depth[10, 30], depth[11, 30] = 2.2, 2.3  # specks before the wall
    flying = flying_pixels(depth, camera)
    assert flying[:, 20].all()
    assert flying[10, 30]
    assert not flying[:, :20].any()
    assert not np.delete(flying[:, 21:], [9], axis=1).any()
    kept = np.zeros_like(flying)
    columns, rows = scan_depth(depth, camera).pixels.T
    kept[rows, columns] = True
    np.testing.assert_array_equal(kept, ~flying)
    assert len(scan_depth(depth, camera, remove_flying=False).points) == depth.size


def test_thin_legs_and_slanted_seats_stay() -> None:
    camera = Camera(np.array([[300.0, 0, 20], [0, 300, 15], [0, 0, 1]]), 40, 30)
    depth = np.full((30, 40), 3.0)
    depth[5:25, 12] = 1.5
    depth[8, 15:26] = 1.4
    depth[:, 30:36] = 2 + np.arange(6) * 2.0 * 11 / camera.intrinsics[0, 0]
    flying = flying_pixels(depth, camera)
    # Nothing continues the last pixel of a leg or bar that is one pixel wide; all others stay.
    assert set(zip(*np.nonzero(flying[:, :29]))) == {(5, 12), (24, 12), (8, 15), (8, 25)}
    assert not flying[9:, 31:35].any()


@pytest.mark.parametrize("category", ["chair", "table"])
def test_a_clean_picture_loses_almost_nothing(category: str) -> None:
    mesh, camera = furniture(category), looking([1.2, 1.3, 1.6], [0, 0.4, 0], (320, 240))
    depth = render_depth(mesh.vertices, mesh.faces, camera)
    assert flying_pixels(depth, camera).sum() < 0.02 * (depth > 0).sum()


def test_views_merge_to_their_union() -> None:
    mesh = furniture("chair")
    cameras = [looking([1.2, 1.3, 1.6], [0, 0.4, 0]), looking([-1.2, 0.9, -1.5], [0, 0.4, 0])]
    scans = [scan_depth(render_depth(mesh.vertices, mesh.faces, camera), camera) for camera in cameras]
    everything = np.concatenate([scan.points for scan in scans])
    whole = merge_views(scans, voxel=0.0)
    np.testing.assert_array_equal(whole.points, everything)
    np.testing.assert_array_equal(whole.origins, [camera.origin for camera in cameras])
    voxel = 0.03
    merged = merge_views(scans, voxel)
    assert set(map(tuple, merged.points)) <= set(map(tuple, everything))
    assert 100 < len(merged.points) < 0.8 * len(everything)
    cells = np.floor((merged.points - everything.min(axis=0)) / voxel)
    assert len(np.unique(cells, axis=0)) == len(cells)
    gaps = np.linalg.norm(everything[::5, None] - merged.points[None], axis=2).min(axis=1)
    assert gaps.max() <= voxel * np.sqrt(3)
    assert set(merged.views.tolist()) == {0, 1}
    for view, scan in enumerate(scans):
        assert set(map(tuple, merged.points[merged.views == view])) <= set(map(tuple, scan.points))
    cell = np.floor((everything - everything.min(axis=0)) / voxel)
    distance = np.concatenate([np.linalg.norm(scan.points - scan.origin, axis=1) for scan in scans])
    for row in range(0, len(merged.points), 37):
        shared = (cell == cells[row]).all(axis=1)
        nearest = everything[shared][distance[shared].argmin()]
        np.testing.assert_array_equal(merged.points[row], nearest)
    alone = merge_views(scans[:1], voxel)
    np.testing.assert_array_equal(alone.points, scans[0].points)


def test_depths_out_of_range_are_dropped() -> None:
    camera = looking([0, 0, 3], [0, 0, 0], (40, 30))
    depth = np.linspace(0.2, 12, 1200).reshape(30, 40)
    scan = scan_depth(depth, camera, nearest=1.0, farthest=8.0, remove_flying=False)
    deep = camera.project(scan.points)[1]
    assert deep.min() >= 1 - 1e-9
    assert deep.max() <= 8 + 1e-9
    assert len(scan.points) == ((depth >= 1) & (depth <= 8)).sum()


def test_pictures_that_show_no_object_are_refused() -> None:
    camera, depth = looking([0, 0, 3], [0, 0, 0], (40, 30)), np.full((30, 40), 2.0)
    few = np.zeros((30, 40), dtype=bool)
    few[3:8, 3:8] = True
    with pytest.raises(ScanError, match="frame.png: no pixel has a depth"):
        scan_depth(depth * 0, camera, name="frame.png")
    with pytest.raises(ScanError, match="25 pixels show the object .* of 25 in the mask, 25 have a depth"):
        scan_depth(depth, camera, few)
    with pytest.raises(ScanError, match="0 lie between 0 and 1 m"):
        scan_depth(depth, camera, farthest=1.0)
    with pytest.raises(ScanError, match="40 x 30 pixels and the mask 30 x 40"):
        scan_depth(depth, camera, few.T)
    with pytest.raises(ScanError, match="40 x 30 pixels and the camera 80 x 60"):
        scan_depth(depth, camera.resized(80, 60))
    with pytest.raises(ScanError, match="k.json is of a camera with 80 x 80"):
        depth_camera(depth, IntrinsicsFile(camera.intrinsics, (80, 80)), np.eye(4), "frame.png", "k.json")
    large = np.diag([8.0, 8.0, 1.0]) @ camera.intrinsics
    with pytest.raises(ConfigError, match="k.json: the principal point .* not that of a depth picture of 40 x 30"):
        depth_camera(depth, IntrinsicsFile(large), np.eye(4), "frame.png", "k.json")
    with pytest.raises(ConfigError, match="empty"):
        scan_depth(depth, camera, nearest=3.0, farthest=2.0)
    with pytest.raises(ConfigError, match="no depth views"):
        merge_views([])
    with pytest.raises(ConfigError, match="voxel"):
        merge_views([scan_depth(depth, camera)], voxel=-1.0)


def test_files_that_are_no_depth_pictures_are_refused_by_name(tmp_path: Path) -> None:
    Image.new("L", (8, 6), 9).save(tmp_path / "eight.png")
    Image.new("RGB", (8, 6), (9, 8, 7)).save(tmp_path / "colour.png")
    np.save(tmp_path / "row.npy", np.ones(9))
    np.save(tmp_path / "text.npy", np.array(["a"]))
    (tmp_path / "noise.png").write_bytes(b"no picture at all")
    (tmp_path / "noise.npy").write_bytes(b"no array")
    write_depth(tmp_path / "whole.png", np.random.default_rng(0).uniform(1, 2, (80, 80)))
    (tmp_path / "cut.png").write_bytes((tmp_path / "whole.png").read_bytes()[:4000])
    (tmp_path / "depth.exr").write_bytes(b"")
    names = [
        "eight.png",
        "colour.png",
        "row.npy",
        "text.npy",
        "noise.png",
        "noise.npy",
        "cut.png",
        "depth.exr",
        "no.png",
    ]
    for name in names:
        with pytest.raises(ScanError, match=name.replace(".", r"\.")):
            read_depth(tmp_path / name)
    with pytest.raises(ConfigError, match="depth_scale"):
        read_depth(tmp_path / "whole.png", depth_scale=0.0)


def test_files_that_are_no_masks_are_refused_by_name(tmp_path: Path) -> None:
    Image.new("RGB", (8, 6), (9, 8, 7)).save(tmp_path / "colour.png")
    Image.new("L", (8, 6), 0).save(tmp_path / "empty.png")
    np.save(tmp_path / "floats.npy", np.full((6, 8), 0.5))
    for name, word in (("colour.png", "one channel"), ("empty.png", "empty"), ("floats.npy", "one channel")):
        with pytest.raises(ScanError, match=word) as caught:
            read_mask(tmp_path / name)
        assert name in str(caught.value)


def test_depths_in_pgm_pfm_and_archives(tmp_path: Path) -> None:
    depth = np.linspace(0.5, 3, 48).reshape(6, 8)
    millimetres = (1000 * depth).round().astype(np.uint16)
    Image.fromarray(millimetres).save(tmp_path / "a.pgm")
    # PFM begins with the lowest row.
    (tmp_path / "a.pfm").write_bytes(b"Pf\n8 6\n-1.0\n" + depth[::-1].astype("<f4").tobytes())
    np.savez_compressed(tmp_path / "a.npz", depth=depth, colour=np.zeros((6, 8, 3), np.uint8))
    np.savez(tmp_path / "b.npz", np.asfortranarray(millimetres))
    for name in ("a.pgm", "a.pfm", "a.npz", "b.npz"):
        np.testing.assert_allclose(read_depth(tmp_path / name), depth, atol=6e-4, err_msg=name)
    np.savez(tmp_path / "c.npz", a=depth, b=depth)
    with pytest.raises(ScanError, match=r"c\.npz: none of its arrays is named depth or depths"):
        read_depth(tmp_path / "c.npz")


def test_masks_as_programs_save_them(tmp_path: Path) -> None:
    wanted = np.zeros((24, 32), bool)
    wanted[5:19, 4:29] = True
    grey = np.where(wanted, 255, 0).astype(np.uint8)
    opaque = np.full_like(grey, 255)
    photograph = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    soft = grey.copy()
    soft[4, 4:29], soft[19, 4:29] = np.arange(25) * 4 + 1, 200  # The row above fades out, the one below is inside.
    pictures = {
        "rgb": np.stack([grey] * 3, axis=2),
        "rgba": np.stack([grey] * 3 + [opaque], axis=2),
        "la": np.stack([grey, opaque], axis=2),
        "cut out": np.concatenate([photograph, grey[..., None]], axis=2),
        "soft": soft,
    }
    for name, picture in pictures.items():
        Image.fromarray(picture).save(tmp_path / "a.png")
        expected = wanted | (soft == 200) if name == "soft" else wanted
        np.testing.assert_array_equal(read_mask(tmp_path / "a.png"), expected, err_msg=name)
    for array in (wanted.astype(float), wanted[..., None], wanted[None]):
        np.save(tmp_path / "a.npy", array)
        np.testing.assert_array_equal(read_mask(tmp_path / "a.npy"), wanted)


def test_ids_with_one_of_255_are_no_soft_edge(tmp_path: Path) -> None:
    ids = np.full((20, 20), 255, np.uint8)
    ids[:2, :9] = np.arange(9) % 3
    Image.fromarray(ids).save(tmp_path / "a.png")
    with pytest.raises(ScanError, match=r"3 objects \(1, 2, 255\)"):
        read_mask(tmp_path / "a.png")


def test_masks_in_other_pictures(tmp_path: Path) -> None:
    mask = np.zeros((48, 64), bool)
    mask[10:30, 20:40] = True
    white = mask.astype(np.uint8) * 255
    for name in ("a.jpg", "a.bmp", "a.gif", "a.webp"):
        Image.fromarray(white).save(tmp_path / name, **({"lossless": True} if name == "a.webp" else {}))
    np.save(tmp_path / "a.npy", mask[None, None])
    np.savez(tmp_path / "a.npz", masks=mask, depth=np.ones((48, 64)))
    for name in ("a.jpg", "a.bmp", "a.gif", "a.webp", "a.npy", "a.npz"):
        np.testing.assert_array_equal(read_mask(tmp_path / name), mask, err_msg=name)
    Image.fromarray(np.tile(np.arange(0, 256, 4, dtype=np.uint8), (48, 1))).save(tmp_path / "ids.jpg")
    with pytest.raises(ScanError, match="JPEG changes the ids"):
        read_mask(tmp_path / "ids.jpg")
