"""Fingerprints of databases: equal for equal content in any order, another one for another mesh, key or text."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kpred.database import Database, Entry
from kpred.database.fingerprint import CONTENT


def _fingerprint(folder: Path, entries: list[Entry]) -> str:
    file = folder / f"{len(list(folder.iterdir()))}.kpred"
    with Database.create(file) as database:
        database.add(entries)
        return database.fingerprint()


@pytest.fixture
def entries(random_entry: Callable[..., Entry]) -> list[Entry]:
    known = random_entry("a")
    return [replace(known, metadata={**known.metadata, CONTENT: "0123456789abcdef"}), random_entry("b")]


def test_the_order_does_not_matter(tmp_path: Path, entries: list[Entry]) -> None:
    assert _fingerprint(tmp_path, entries) == _fingerprint(tmp_path, entries[::-1])


def test_another_mesh_is_noticed(tmp_path: Path, entries: list[Entry]) -> None:
    before = _fingerprint(tmp_path, entries)
    known, bare = entries
    # By the hash in its metadata, as `kpred database build` writes it; without one, by the mesh itself.
    other = replace(known, metadata={**known.metadata, CONTENT: "fedcba9876543210"})
    assert _fingerprint(tmp_path, [other, bare]) != before
    for mesh in (
        replace(bare.mesh, vertices=bare.mesh.vertices * np.float32(1.5)),
        replace(bare.mesh, faces=bare.mesh.faces[:, ::-1].copy()),
    ):
        assert _fingerprint(tmp_path, [known, replace(bare, mesh=mesh)]) != before


def test_other_keypoints_and_metadata_are_noticed(tmp_path: Path, entries: list[Entry]) -> None:
    before = _fingerprint(tmp_path, entries)
    moved = replace(entries[0], keypoints=entries[0].keypoints[::-1].copy())
    titled = replace(entries[0], metadata={**entries[0].metadata, "title": "Chair"})
    assert len({before, *(_fingerprint(tmp_path, [one, entries[1]]) for one in (moved, titled))}) == 3
