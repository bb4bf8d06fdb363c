"""Downloads of rooms: one GLB with a node for each object, alignments, or a ZIP with a folder for each object."""

import io
import zipfile

import pytest
import trimesh

from kpred.errors import OutputError
from kpred.studio.room import RoomSession
from kpred.studio.room_files import alignments_download, objects_download, room_download


def test_a_room_is_one_glb_of_what_was_kept(room: RoomSession) -> None:
    room.leave_out(room.objects[0], True)
    name, content = room_download(room.result(), "room")
    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb")
    nodes = {str(node) for node in scene.graph.nodes}
    assert name == "room.glb"
    assert any(node.startswith(room.objects[1]) for node in nodes)
    assert not any(node.startswith(room.objects[0]) for node in nodes)


def test_a_room_of_several_files_is_a_zip(room: RoomSession) -> None:
    name, content = room_download(room.result(), "room", ".urdf")
    names = zipfile.ZipFile(io.BytesIO(content)).namelist()
    assert name == "room.urdf.zip" and "room.urdf" in names and len(names) > 2


def test_objects_are_a_zip_with_a_folder_each(room: RoomSession) -> None:
    name, content = objects_download(room.result(), "room", ".ply")
    names = zipfile.ZipFile(io.BytesIO(content)).namelist()
    assert name == "room.ply.zip" and len(names) == 2
    assert all(one.endswith(".ply") and one.count("/") == 1 and ".." not in one for one in names)


def test_alignments_are_lines_of_the_objects(room: RoomSession) -> None:
    name, content = alignments_download(room.result(), "room")
    assert name == "room.csv" and len(content.decode().strip().splitlines()) >= 2


def test_an_empty_room_is_an_error(room: RoomSession) -> None:
    for name in room.objects:
        room.leave_out(name, True)
    with pytest.raises(OutputError):
        room_download(room.result(), "room")
    with pytest.raises(OutputError):
        objects_download(room.result(), "room", ".ply")
