"""Laws of room packs: what is written is read again, rooms depend on seed and index alone, damage is one sentence."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kpred.errors import ConfigError, PackError
from kpred.synthetic.generator import generate
from kpred.synthetic.rooms.generate import generate_rooms, grid_nodes
from kpred.synthetic.rooms.pack import GRID, UNIT, RoomPack, concatenate_rooms


@pytest.fixture(scope="module")
def pack() -> RoomPack:
    return generate_rooms(2, 5, scanner="mesh", points=20_000)


def same(one: RoomPack, other: RoomPack) -> bool:
    return all(
        np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in dataclasses.fields(RoomPack)
    )


def test_a_pack_is_read_as_it_was_written(pack: RoomPack, tmp_path: Path) -> None:
    pack.save(tmp_path / "rooms.npz")
    assert same(RoomPack.load(tmp_path / "rooms.npz"), pack)


def test_a_room_depends_on_seed_and_index_alone(pack: RoomPack) -> None:
    assert same(generate_rooms(1, 5, first=1, scanner="mesh", points=20_000), second_room(pack))


def second_room(pack: RoomPack) -> RoomPack:
    rows, objects = slice(int(pack.point_offsets[1]), None), slice(int(pack.object_offsets[1]), None)
    used = pack.surface_row[objects]
    first = int(used[used >= 0].min())
    return dataclasses.replace(
        pack,
        points=pack.points[rows],
        instance=pack.instance[rows],
        point_offsets=pack.point_offsets[1:] - pack.point_offsets[1],
        object_offsets=pack.object_offsets[1:] - pack.object_offsets[1],
        scanner=pack.scanner[1:],
        seed=pack.seed[1:],
        **{name: getattr(pack, name)[objects] for name in ("name", "category", "pose", "box")},
        surface_row=np.where(used < 0, -1, used - first).astype(np.int32),
        **{name: getattr(pack, name)[first:] for name in ("surface", "seen", "grid")},
    )


def test_packs_are_concatenated_in_order(pack: RoomPack) -> None:
    twice = concatenate_rooms([pack, pack])
    assert len(twice) == 2 * len(pack)
    for index in range(len(twice)):
        points, instance, objects = twice.room(index)
        expected, labels, _ = pack.room(index % len(pack))
        np.testing.assert_array_equal(points, expected)
        np.testing.assert_array_equal(instance, labels)
        assert instance.max() < objects.stop - objects.start


def test_surfaces_fill_their_boxes(pack: RoomPack) -> None:
    for row in np.flatnonzero(pack.surface_row >= 0):
        cloud, box = pack.surface[pack.surface_row[row]] * UNIT, pack.box[row]
        assert (cloud >= box[0] - UNIT).all()
        assert (cloud <= box[1] + UNIT).all()
        assert (np.ptp(cloud, axis=0) > 0.6 * np.ptp(box, axis=0)).all()


def test_seen_surface_has_points_and_hidden_surface_has_none(pack: RoomPack) -> None:
    points, instance, objects = pack.room(0)
    shares = []
    for number, row in enumerate(range(objects.start, objects.stop)):
        line = int(pack.surface_row[row])
        mine = points[instance == number]
        if line < 0 or len(mine) < 200:
            continue
        cloud = pack.surface[line] * UNIT @ pack.pose[row, :3, :3].T + pack.pose[row, :3, 3]
        near = np.min(np.linalg.norm(cloud[:, None] - mine[None, ::2], axis=2), axis=1) < 0.12
        seen = np.unpackbits(pack.seen[line]).astype(bool)
        shares.append((near[seen].mean(), near[~seen].mean() if (~seen).any() else 0.0))
    assert len(shares) >= 2
    means = np.mean(shares, axis=0)
    assert means[0] > 0.8
    assert means[0] > means[1] + 0.2


def test_grids_say_what_surfaces_say(pack: RoomPack) -> None:
    agreed = []
    for row in np.flatnonzero(pack.surface_row >= 0):
        line = int(pack.surface_row[row])
        nodes, box = grid_nodes(pack.box[row].astype(float)), pack.box[row]
        cloud = pack.surface[line, ::8] * UNIT
        distance, nearest = cKDTree(nodes).query(cloud)
        assert (distance < 0.11 * np.ptp(box, axis=0).max()).all()
        grid = np.unpackbits(pack.grid[line])[: GRID**3].astype(bool)
        agreed.append(grid[nearest] == np.unpackbits(pack.seen[line]).astype(bool)[::8])
    assert np.concatenate(agreed).mean() > 0.8


def test_mesh_packs_furnish_rooms() -> None:
    shapes = generate("chair", 2, 9, splits=False)
    named = dataclasses.replace(shapes, extra={"factory": np.array(["ChairFactory", "OfficeChairFactory"])})
    rooms = generate_rooms(3, 6, [named], scanner="view", points=500)
    assert {"ChairFactory", "OfficeChairFactory"} & set(rooms.name.tolist())


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ConfigError, match="positive count"):
        generate_rooms(0, 1)
    with pytest.raises(ConfigError, match="no scanner 'sonar'"):
        generate_rooms(1, 1, scanner="sonar")


def test_damaged_packs_are_refused(pack: RoomPack, tmp_path: Path) -> None:
    file = tmp_path / "rooms.npz"
    with pytest.raises(PackError, match=r"rooms\.npz"):
        RoomPack.load(file)
    file.write_bytes(b"no pack")
    with pytest.raises(PackError, match="not a readable"):
        RoomPack.load(file)
    generate("chair", 1, 0).save(file)
    with pytest.raises(PackError, match="kpred data rooms"):
        RoomPack.load(file)
    with pytest.raises(PackError, match="names an object"):
        dataclasses.replace(pack, instance=np.full_like(pack.instance, 3000))


def test_the_command_writes_a_pack(tmp_path: Path) -> None:
    file = tmp_path / "rooms.npz"
    command = [
        sys.executable,
        "-m",
        "kpred",
        "data",
        "rooms",
        "-n",
        "1",
        "--scanner",
        "view",
        "-o",
        str(file),
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert '"rooms": 1' in done.stdout
    assert RoomPack.load(file).scanner.tolist() == ["view"]
