"""Downloads: one file as it is, several as one ZIP, under names that are safe."""

import io
import zipfile

import pytest

from kpred.studio.save_controls import download, safe_stem
from kpred.studio.state import State


def test_one_file_is_sent_as_it_is(start: State) -> None:
    name, content = download(start.result, "chair", ".ply")
    assert name == "chair.ply" and content.startswith(b"ply")


def test_several_files_are_one_zip(start: State) -> None:
    name, content = download(start.result, "chair", ".urdf")
    assert name == "chair.urdf.zip"
    names = zipfile.ZipFile(io.BytesIO(content)).namelist()
    assert "chair.urdf" in names and len(names) > 1
    assert not any(one.startswith("/") or ".." in one for one in names)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("chair.ply", "chair"),
        ("../../etc/passwd", "passwd"),
        ("a b\n<script>.ply", "a_b_script"),
        ("…", "scan"),
        ("x" * 300 + ".ply", "x" * 60),
    ],
)
def test_names_of_files_are_safe(name: str, stem: str) -> None:
    assert safe_stem(name) == stem
