"""`kpred database get furniture`, from a package file; what is kept can be listed."""

import json
import shutil
import subprocess

import pytest

from kpred.cli.main import main
from kpred.datasets.sweethome3d.package import find_libraries
from kpred.errors import MeshError


def run(capsys, *words):
    assert main([*map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_one_command_makes_a_database_with_authors_and_licences(write_library, tmp_path, capsys):
    models = {
        "one": {},
        "two": {"name": "Desk"},
        "lamp": {"name": "Lamp"},
        "bound": {"LICENSE": "Released under\nnone\n"},
    }
    library = write_library(tmp_path / "a.sh3f", models)
    file = tmp_path / "f.kpred"
    assert run(capsys, "database", "get", "furniture", "--source", library, "-o", file)["added"] == 3
    rows = {row["model_id"]: row for row in run(capsys, "database", "list", file)}
    assert list(rows) == ["chair/test-one", "lamp/test-lamp", "table/test-two"]
    wanted = {"author": "Ann", "licence": "CC-BY-3.0", "category": "chair", "width": "0.4", "title": "Chair"}
    assert rows["chair/test-one"].items() >= wanted.items()
    assert run(capsys, "database", "info", file)["licences"] == {"CC-BY-3.0": 3}


@pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="no dpkg here")
def test_libraries_of_a_package_file_are_found(write_library, tmp_path):
    folder = tmp_path / "package" / "usr/share/sweethome3d/furniture"
    folder.mkdir(parents=True)
    write_library(folder / "a.sh3f", {"one": {}})
    (tmp_path / "package" / "DEBIAN").mkdir()
    control = "Package: sweethome3d-furniture\nVersion: 1\nArchitecture: all\nMaintainer: a <a@b.c>\nDescription: x\n"
    (tmp_path / "package" / "DEBIAN" / "control").write_text(control)
    package = tmp_path / "a.deb"
    subprocess.run(["dpkg-deb", "-b", str(tmp_path / "package"), str(package)], check=True, capture_output=True)
    (found,) = find_libraries(package, tmp_path / "scratch")
    assert found.read_bytes() == (folder / "a.sh3f").read_bytes()


def test_what_is_no_package_is_refused(tmp_path):
    (tmp_path / "a.deb").write_bytes(b"no package")
    for place in (tmp_path / "a.deb", tmp_path / "none.deb", tmp_path):
        with pytest.raises(MeshError):
            find_libraries(place, tmp_path / "scratch")
