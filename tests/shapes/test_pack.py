import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpred.errors import OutputError, PackError
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack, concatenate


def random_mesh(rng: np.random.Generator, vertices: int, faces: int, parts: bool) -> Mesh:
    return Mesh(
        rng.normal(size=(vertices, 3)),
        rng.integers(0, vertices, (faces, 3)),
        face_parts=rng.integers(0, 2, faces) if parts else None,
    )


def a_pack(
    seed: int = 0, count: int = 3, parts: bool = False, category: str = "chair", **extra: np.ndarray
) -> MeshPack:
    rng = np.random.default_rng(seed)
    meshes = [random_mesh(rng, 5 + i, 4 + i, parts) for i in range(count)]
    ids = [f"m{seed}_{i}" for i in range(count)]
    splits = (["source", "train", "val"] * count)[:count]
    return MeshPack.from_meshes(
        meshes, ids, splits, category, part_names=["seat", "leg"] if parts else None, extra=extra
    )


@given(st.lists(st.tuples(st.integers(1, 9), st.integers(0, 9)), max_size=6), st.booleans(), st.integers(0, 99))
def test_a_saved_pack_comes_back(tmp_path_factory, sizes, parts, seed):
    rng = np.random.default_rng(seed)
    meshes = [random_mesh(rng, *size, parts) for size in sizes]
    ids = [f"id{i}" for i in range(len(sizes))]
    splits = [str(rng.choice(["source", "train", "val"])) for _ in sizes]
    path = tmp_path_factory.mktemp("pack") / "stool.npz"
    MeshPack.from_meshes(meshes, ids, splits, "chair").save(path)
    back = MeshPack.load(path)
    assert len(back) == len(meshes) and back.category == "chair"
    assert list(back.model_id) == ids and list(back.split) == splits
    for i, mesh in enumerate(meshes):
        np.testing.assert_array_equal(back[i].vertices, mesh.vertices)
        np.testing.assert_array_equal(back[i].faces, mesh.faces)
        if parts:
            np.testing.assert_array_equal(back[i].face_parts, mesh.face_parts)
    for split in ("source", "train", "val"):
        assert list(back.indices(split)) == [i for i, s in enumerate(splits) if s == split]
    assert [path.name] == [file.name for file in path.parent.iterdir()]


def test_saving_twice_gives_the_same_bytes(tmp_path):
    a_pack(parts=True).save(tmp_path / "a.npz")
    a_pack(parts=True).save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_category_of_a_file_without_one_is_its_stem(tmp_path):
    pack = a_pack()
    arrays = {k: getattr(pack, k) for k in ("vertices", "faces", "vertex_offsets", "face_offsets", "model_id", "split")}
    np.savez(tmp_path / "table.npz", **arrays)
    assert MeshPack.load(tmp_path / "table.npz").category == "table"


def test_concatenate_renumbers_parts_and_joins_extras():
    first = a_pack(1, 2, parts=True, factory=np.array(["A", "B"]), version=np.array(3))
    second = a_pack(2, 3, category="chair", version=np.array(3))
    third = MeshPack.from_meshes(
        [random_mesh(np.random.default_rng(5), 4, 6, True)], ["z"], ["val"], "chair", part_names=["leg", "arm"]
    )
    both = concatenate([first, second, third])
    assert len(both) == 6 and list(both.part_names) == ["seat", "leg", "arm"]
    assert list(both.extra["factory"]) == ["A", "B", "", "", "", ""]
    assert "version" not in both.extra
    names = np.array(["seat", "leg", "arm", "none"])
    np.testing.assert_array_equal(names[both[1].face_parts], np.array(["seat", "leg"])[first[1].face_parts])
    assert (both[3].face_parts == -1).all()
    np.testing.assert_array_equal(names[both[5].face_parts], np.array(["leg", "arm"])[third[0].face_parts])
    for i, mesh in enumerate([*first, *second, *third]):
        np.testing.assert_array_equal(both[i].vertices, mesh.vertices)
        np.testing.assert_array_equal(both[i].faces, mesh.faces)


def test_concatenate_asks_for_one_category():
    with pytest.raises(PackError, match="chair, table"):
        concatenate([a_pack(), a_pack(category="table")])
    assert concatenate([a_pack(), a_pack(category="table")], "any").category == "any"
    with pytest.raises(PackError, match="no pack"):
        concatenate([])


def test_every_cut_of_a_file_is_named(tmp_path):
    path = tmp_path / "chair.npz"
    a_pack().save(path)
    data = path.read_bytes()
    for size in (0, 1, 10, len(data) // 3, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:size])
        with pytest.raises(PackError, match=r"chair\.npz.*(damaged|cut short|is empty)"):
            MeshPack.load(path)


def test_damaged_bytes_are_named(tmp_path):
    path = tmp_path / "chair.npz"
    a_pack(count=40).save(path)
    data = bytearray(path.read_bytes())
    middle = len(data) // 4
    data[middle : middle + 50] = bytes(50)
    path.write_bytes(data)
    with pytest.raises(PackError, match=r"chair\.npz"):
        MeshPack.load(path)


def test_foreign_files_are_named(tmp_path):
    np.savez(tmp_path / "other.npz", points=np.zeros((4, 3)))
    with pytest.raises(PackError, match=r"other\.npz: it is not a mesh pack, it lacks vertices"):
        MeshPack.load(tmp_path / "other.npz")
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(PackError, match="single array"):
        MeshPack.load(tmp_path / "one.npy")
    with pytest.raises(PackError, match="no such file"):
        MeshPack.load(tmp_path / "none.npz")
    with pytest.raises(PackError, match="it is a folder"):
        MeshPack.load(tmp_path)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("vertex_offsets", np.array([0, 5, 4, 18])),
        ("vertex_offsets", np.array([0, 5, 11])),
        ("face_offsets", np.array([1, 4, 9, 15])),
        ("faces", np.full((15, 3), 99)),
        ("faces", np.full((15, 4), 0)),
        ("vertices", np.array(["a", "b"])),
        ("split", np.array(["source"])),
        ("face_part", np.zeros(2)),
    ],
)
def test_arrays_that_do_not_fit_are_named(tmp_path, key, value):
    path = tmp_path / "chair.npz"
    a_pack().save(path)
    arrays = dict(np.load(path))
    np.savez(path, **{**arrays, key: value})
    with pytest.raises(PackError, match=r"chair\.npz.*write the pack again"):
        MeshPack.load(path)


def test_a_failed_save_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "chair.npz"
    a_pack().save(path)
    before = path.read_bytes()

    def full(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OutputError, match=r"chair\.npz: No space left"):
        a_pack(7).save(path)
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1


def test_saving_where_nothing_can_be_written(tmp_path):
    with pytest.raises(OutputError, match="does not exist"):
        a_pack().save(tmp_path / "none" / "chair.npz")
    with pytest.raises(OutputError, match="it is a folder"):
        a_pack().save(tmp_path)


def test_index_from_the_end_and_out_of_range():
    pack = a_pack()
    np.testing.assert_array_equal(pack[-1].vertices, pack[2].vertices)
    with pytest.raises(IndexError):
        pack[3]


@pytest.mark.parametrize("name", ["sa_partnet/table.npz", "infinigen/chair.npz"])
def test_development_packs_load(shared_data, name):
    pack = MeshPack.load(shared_data / name)
    assert len(pack) > 500 and pack.category == name[-9:-4]
    assert ("factory" in pack.extra) == name.startswith("infinigen")
    assert sum(len(pack.indices(s)) for s in ("source", "train", "val")) == len(pack)
    assert all(pack[int(i)].area() > 0 for i in pack.indices()[::50])
