"""The table of formats: unknown suffixes and missing libraries are refused before any work, in one sentence."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import OutputError
from kpred.exports.format_table import EXTENSIONS, FORMATS, check_extension
from kpred.exports.formats import save_export
from kpred.exports.furniture import Export


def test_every_format_has_its_module_and_writes_a_file_of_its_suffix(chair: Export, tmp_path: Path) -> None:
    assert {".glb", ".usdz", ".urdf", ".xml", ".sdf", ".ifc", ".obj", ".stl"} <= set(EXTENSIONS)
    for suffix, found in FORMATS.items():
        if found.library:
            pytest.importorskip(found.library)
        first, *rest = save_export(chair, tmp_path / f"a{suffix.upper()}")
        assert first.name == f"a{suffix.upper()}" and first.stat().st_size > 100
        assert all(file.name.startswith("a") for file in rest)


def test_an_unknown_suffix_is_refused_with_those_that_are_known(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"unknown extension '\.fbx'; use one of .*\.glb.*\.usdz.*\.ifc\.$"):
        check_extension(tmp_path / "a.fbx")


@pytest.mark.parametrize(("suffix", "module", "extra"), [(".usdz", "pxr", "usd"), (".ifc", "ifcopenshell", "bim")])
def test_a_missing_library_names_its_extra(
    chair: Export, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, module: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    for refuse in (
        lambda: check_extension(tmp_path / f"a{suffix}"),
        lambda: save_export(chair, tmp_path / f"a{suffix}"),
    ):
        with pytest.raises(OutputError, match=rf"needs the package {module}; pip install 'kpred\[{extra}\]'\.$"):
            refuse()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", FORMATS)
def test_meshes_that_are_not_finite_are_never_written(chair: Export, tmp_path: Path, suffix: str) -> None:
    vertices = chair.objects[0].vertices.copy()
    vertices[5, 2] = np.inf
    broken = replace(chair, objects=(replace(chair.objects[0], vertices=vertices), *chair.objects[1:]))
    with pytest.raises(OutputError, match="NaN or infinite"):
        save_export(broken, tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())
