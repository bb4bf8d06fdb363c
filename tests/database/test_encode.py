"""Encoding: what an entry says about its mesh, and what it must not depend on."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from kpred.database import encode
from kpred.database.encode import deformation_basis
from kpred.errors import MeshError
from kpred.nn import KPRed, ModelConfig
from kpred.ops.cage import icosphere
from kpred.ops.mean_value import mean_value_coordinates
from kpred.shapes.mesh import Mesh

BOX = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [0, 4, 5], [0, 5, 1], [1, 5, 6], [1, 6, 2]])


def open_box(size=(1.0, 2.0, 0.5), at=(3.0, 0.0, -1.0)):
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    return Mesh(corners * size + at, BOX)


POINTS = 512  # the real number takes longer and tells no more here
encode_models = partial(encode.encode_models, count=POINTS)
prepare_mesh = partial(encode.prepare_mesh, count=POINTS)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    config = ModelConfig("chair", token_size=8, width=16, stages=1, region_points=8)
    return KPRed(config).eval().requires_grad_(False)


def test_an_entry_describes_its_mesh(network):
    mesh = open_box()
    (entry,) = encode_models([mesh], ["a"], network, seed=0, metadata=[{"split": "source"}])
    entry.check()
    assert entry.points.shape == (POINTS, 3)
    assert entry.category == "chair"
    assert entry.metadata == {"split": "source"}
    assert entry.fingerprint == network.fingerprint()
    # The frame takes the mesh into [-1, 1], touching it along its longest side, and the points lie on its surface.
    unit = entry.frame.to_unit(entry.mesh.vertices)
    np.testing.assert_allclose(np.abs(unit).max(axis=0), [0.5, 1.0, 0.25], atol=1e-5)
    low, high = entry.points.min(axis=0), entry.points.max(axis=0)
    np.testing.assert_allclose(low, [-0.5, -1, -0.25], atol=0.05)
    np.testing.assert_allclose(high, [0.5, 1, 0.25], atol=0.05)
    on_a_side = np.abs(np.abs(entry.points) - [0.5, 1.0, 0.25]).min(axis=1)
    assert on_a_side.max() < 1e-4


def test_bases_deform_as_cage_and_influence_do(network):
    entry = encode_models([open_box()], ["a"], network, seed=0)[0]
    item = prepare_mesh(open_box(), "a", 0)
    points = item.points[None]
    keypoints = network.keypoints(points)
    cage = network.cage(points)
    influence = network.influence(points, keypoints, cage)
    move = torch.randn(1, 12, 3, generator=torch.Generator().manual_seed(1)) * 0.1
    moved_cage = cage + influence.transpose(1, 2) @ move
    for positions, basis in ((item.points, entry.point_basis), (item.vertices, entry.vertex_basis)):
        coordinates = mean_value_coordinates(positions[None], cage, icosphere(1)[1])
        wanted = (coordinates @ moved_cage)[0]
        found = positions + torch.from_numpy(basis) @ move[0]
        torch.testing.assert_close(found, wanted, atol=1e-3, rtol=0)


def test_large_meshes_are_done_in_parts(network):
    item = prepare_mesh(open_box(), "a", 0)
    cage = network.cage(item.points[None])[0]
    influence = torch.rand(12, 42, generator=torch.Generator().manual_seed(0))
    whole = deformation_basis(item.points, cage, influence, network)
    torch.testing.assert_close(deformation_basis(item.points, cage, influence, network, chunk=200), whole)


def test_points_depend_on_mesh_id_and_seed_alone(network):
    meshes = [open_box(), open_box(size=(2, 1, 1)), open_box(size=(1, 1, 3))]
    forth = encode_models(meshes, ["a", "b", "c"], network, seed=3)
    back = encode_models(meshes[::-1], ["c", "b", "a"], network, seed=3)[::-1]
    alone = encode_models(meshes[1:2], ["b"], network, seed=3)[0]
    for left, right in zip([*forth, alone], [*back, forth[1]], strict=True):
        np.testing.assert_array_equal(left.points, right.points)
        np.testing.assert_allclose(left.keypoints, right.keypoints, atol=1e-5)
        np.testing.assert_allclose(left.tokens, right.tokens, atol=1e-2)
    other_seed = encode_models(meshes[:1], ["a"], network, seed=4)[0]
    other_name = encode_models(meshes[:1], ["z"], network, seed=3)[0]
    assert (other_seed.points != forth[0].points).any()
    assert (other_name.points != forth[0].points).any()


def test_moved_and_scaled_meshes_have_the_same_entry_but_for_their_frame(network):
    near = encode_models([open_box(at=(0, 0, 0))], ["a"], network, seed=0)[0]
    far_box = open_box(size=(3.0, 6.0, 1.5), at=(40.0, -7.0, 9.0))
    far = encode_models([far_box], ["a"], network, seed=0)[0]
    np.testing.assert_allclose(far.points, near.points, atol=1e-4)
    np.testing.assert_allclose(far.keypoints, near.keypoints, atol=1e-3)
    assert far.frame.scale == pytest.approx(3 * near.frame.scale)
    np.testing.assert_array_equal(far.mesh.vertices, far_box.vertices)


def test_stray_vertices_and_empty_faces_do_not_count(network):
    clean = encode_models([open_box()], ["a"], network, seed=0)[0]
    mesh = open_box()
    vertices = np.concatenate([mesh.vertices, [[1e4, 0, 0], [np.nan, 0, 0]]])
    dirty = Mesh(vertices, np.concatenate([mesh.faces, [[0, 0, 1], [2, 2, 2]]]), face_parts=np.arange(10))
    entry = encode_models([dirty], ["a"], network, seed=0)[0]
    np.testing.assert_array_equal(entry.points, clean.points)
    np.testing.assert_array_equal(entry.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(entry.mesh.face_parts, np.arange(8))


@pytest.mark.parametrize(
    "mesh",
    [
        Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])),
        Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)),
        Mesh(np.eye(3) * np.nan, np.array([[0, 1, 2]])),
        Mesh(np.outer(np.arange(3.0), [1, 2, 3]), np.array([[0, 1, 2]])),
    ],
)
def test_meshes_without_area_are_refused(network, mesh):
    with pytest.raises(MeshError, match="broken-7"):
        encode_models([replace(mesh, name="other")], ["broken-7"], network, seed=0)
