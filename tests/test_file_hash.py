"""The hash of a file follows its bytes and nothing else."""

import hashlib
from pathlib import Path

import pytest

from kpred.file_hash import file_sha256


@pytest.mark.parametrize("content", [b"", b"scan", bytes(range(256)) * 5000])
def test_it_is_the_sha256_of_the_bytes_under_any_name(tmp_path: Path, content: bytes) -> None:
    for name in ("a.ply", "b.npy"):
        (tmp_path / name).write_bytes(content)
        assert file_sha256(tmp_path / name) == hashlib.sha256(content).hexdigest()


def test_one_other_byte_gives_another_hash(tmp_path: Path) -> None:
    file = tmp_path / "scan"
    file.write_bytes(b"0" * 1000)
    before = file_sha256(file)
    file.write_bytes(b"0" * 999 + b"1")
    assert file_sha256(file) != before


def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        file_sha256(tmp_path / "nothing")
