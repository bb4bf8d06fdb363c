"""Files that are written together come together or not at all."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from kpred import atomic
from kpred.atomic import atomic_path, write_together
from kpred.errors import OutputError


def text(content: str) -> Callable[[Path], object]:
    return lambda file: file.write_text(content)


def contents(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir()}


def test_all_are_written_under_their_own_extension(tmp_path: Path) -> None:
    seen: list[Path] = []

    def write(file: Path) -> None:
        seen.append(file)
        file.write_text("mesh")

    (tmp_path / "a.json").write_text("old")
    write_together({tmp_path / "a.obj": write, tmp_path / "a.json": text("record")})
    assert contents(tmp_path) == {"a.obj": "mesh", "a.json": "record"}
    assert seen[0].suffix == ".obj" and seen[0].parent == tmp_path and seen[0].name != "a.obj"


def test_one_that_cannot_be_written_keeps_all_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("old")

    def full(file: Path) -> None:
        file.write_text("half")
        raise OSError(28, os.strerror(28))

    with pytest.raises(OutputError, match=r"a\.png: No space left"):
        write_together({tmp_path / "a.obj": text("new"), tmp_path / "a.png": full})
    assert contents(tmp_path) == {"a.obj": "old"}


def test_one_that_cannot_take_its_place_takes_the_others_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.obj").write_text("old")
    replace = os.replace

    def stubborn(source: Path, target: Path) -> None:
        if Path(target).name == "c.json":
            raise PermissionError(13, os.strerror(13))
        replace(source, target)

    monkeypatch.setattr(atomic.os, "replace", stubborn)
    files = {tmp_path / name: text("new") for name in ("a.obj", "b.png", "c.json")}
    with pytest.raises(OutputError, match=r"c\.json: Permission denied"):
        write_together(files)
    assert contents(tmp_path) == {"a.obj": "old"}


def test_messages_of_writers_name_the_file_and_not_its_temporary_name(tmp_path: Path) -> None:
    def inner(file: Path) -> None:
        with atomic_path(file) as temporary:
            raise OutputError(f"Cannot write {file}: the mesh cannot be held ({temporary.suffix}).")

    with pytest.raises(OutputError) as caught:
        write_together({tmp_path / "a.stl": inner})
    assert str(caught.value) == f"Cannot write {tmp_path / 'a.stl'}: the mesh cannot be held (.stl)."
    assert not list(tmp_path.iterdir())


def test_places_are_checked(tmp_path: Path) -> None:
    (tmp_path / "b.json").mkdir()
    with pytest.raises(OutputError, match="it is a folder"):
        write_together({tmp_path / "a.obj": text("new"), tmp_path / "b.json": text("new")})
    assert [item.name for item in tmp_path.iterdir()] == ["b.json"]


def test_a_stop_in_the_middle_leaves_nothing(tmp_path: Path) -> None:
    def stopped(file: Path) -> None:
        file.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_together({tmp_path / "a.obj": text("new"), tmp_path / "b.json": stopped})
    assert not list(tmp_path.iterdir())
