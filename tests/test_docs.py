"""The documentation names what exists: modules, files, headings, commands and options; and it names every command."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

from kpred.cli.main import COMMANDS, MODULES, main

REPOSITORY = Path(__file__).resolve().parents[1]
PAGES = sorted(
    [
        *REPOSITORY.glob("*.md"),
        REPOSITORY / "NOTICE",
        *(REPOSITORY / "docs").rglob("*.md"),
        *(REPOSITORY / "src" / "kpred" / "bundled").rglob("*.md"),
        *(REPOSITORY / "paper").rglob("*.md"),
    ]
)
CHANGELOG = REPOSITORY / "CHANGELOG.md"
CURRENT = [page for page in PAGES if page != CHANGELOG]
"""Pages that describe this version; the changelog also names what is gone."""

_NAMES_ONLY = {"kpred.bundled"}
"""Folders of data, not modules."""

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.M | re.S)
_INLINE = re.compile(r"`([^`]+)`")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_NAME = re.compile(r"(?<![\w./-])kpred(?:\.[A-Za-z_]\w*)+")
_PATH = re.compile(r"(?<![\w./<-])(?:[a-z_]\w*/)+\w+\.(?:py|md|toml|yml|yaml)\b")
_HEADING = re.compile(r"^#+ +(.*)$", re.M)


def _page_name(page: Path) -> str:
    return str(page.relative_to(REPOSITORY))


@pytest.mark.parametrize("page", CURRENT, ids=_page_name)
def test_every_dotted_name_can_be_imported(page: Path) -> None:
    missing = {name for name in _dotted_names(page) - _NAMES_ONLY if not _exists(name)}
    assert not missing


@pytest.mark.parametrize("page", CURRENT, ids=_page_name)
def test_every_path_exists(page: Path) -> None:
    roots = (REPOSITORY, REPOSITORY / "src" / "kpred", page.parent)
    missing = {path for path in _source_paths(page) if not any((root / path).exists() for root in roots)}
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=_page_name)
def test_every_local_link_leads_somewhere(page: Path) -> None:
    for target, heading in _links(page):
        assert target.exists(), target
        if heading:
            assert heading in _anchors(target), f"{target}#{heading}"


@pytest.mark.parametrize("page", CURRENT, ids=_page_name)
def test_every_command_and_option_exists(page: Path) -> None:
    for words in _command_lines(page):
        command = _command(words)
        assert command is not None, words
        unknown = _options(words) - _options_in(_help(command)) - {"--help", "--version", "--json", "--debug"}
        assert not unknown, f"kpred {' '.join(command)} has no {unknown}: {words}"


def test_every_command_is_documented() -> None:
    documented = {_command(words) for page in CURRENT for words in _command_lines(page)}
    assert set(_leaves()) <= documented


def test_architecture_shows_the_floors_that_the_linter_holds() -> None:
    contracts = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    floors = next(contract["layers"] for contract in contracts if contract["name"] == "floors")
    blocks = [block for _, block in _FENCE.findall((REPOSITORY / "docs" / "architecture.md").read_text())]
    assert "\n".join(floors) + "\n" in blocks
    packages = {folder.name for folder in (REPOSITORY / "src" / "kpred").iterdir() if (folder / "__init__.py").exists()}
    assert packages <= set(re.findall(r"\w+", "\n".join(floors)))


def test_checks_find_what_is_wrong(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("`kpred.fitting.no_such` in `fitting/no_such.py` ([x](no.md)) `kpred fti a` ```\n")
    assert not any(map(_exists, _dotted_names(page)))
    assert _source_paths(page) == {"fitting/no_such.py"}
    assert [target.exists() for target, _ in _links(page)] == [False]
    assert [_command(words) for words in _command_lines(page)] == [None]
    assert _options(["fit", "--no-such=1", "-o", "a-b"]) == {"--no-such", "-o"}


def _links(page: Path) -> Iterator[tuple[Path, str]]:
    """Local links of a page: the file that each points to, and the heading within it or ""."""
    for target in _LINK.findall(_FENCE.sub("", page.read_text())):
        if not re.match(r"[a-z]+:", target):
            name, _, heading = target.partition("#")
            yield (page.parent / name).resolve() if name else page, heading


def _anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and the site make them."""
    titles = _HEADING.findall(_FENCE.sub("", page.read_text()))
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def _dotted_names(page: Path) -> set[str]:
    """Names such as `kpred.shapes.MeshPack` that a page holds."""
    return set(_NAME.findall(page.read_text()))


def _source_paths(page: Path) -> set[str]:
    """Paths of source and text files that a page names, such as `ops/nearest.py`."""
    return set(_PATH.findall(_LINK.sub("", page.read_text())))


def _command_lines(page: Path) -> Iterator[list[str]]:
    """Words of each `kpred ...` command of a page, in fenced blocks and between backticks, without what precedes it."""
    text = page.read_text()
    lines = [line for language, block in _FENCE.findall(text) if language == "sh" for line in _joined(block)]
    lines += [code for code in _INLINE.findall(_FENCE.sub("", text)) if re.match(r"(\S+ )*?kpred [a-z]", code)]
    for line in lines:
        try:
            words = shlex.split(line, comments=True)
        except ValueError:
            continue
        for start, word in enumerate(words):
            if word.rpartition("/")[2] == "kpred" and start + 1 < len(words):
                yield words[start + 1 :]


def _joined(block: str) -> list[str]:
    return block.replace("\\\n", " ").splitlines()


def _exists(name: str) -> bool:
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        module = ".".join(parts[:length])
        if (REPOSITORY / "src" / Path(*parts[:length])).with_suffix(".py").exists() and length == len(parts):
            return True  # a module, which may need a package of an extra
        try:
            found = import_module(module)
        except ImportError:
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def _options(words: list[str]) -> set[str]:
    return {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}


def _options_in(text: str) -> set[str]:
    return set(re.findall(r"(?<![\w-])--?[a-z][\w.-]*", text))


def _command(words: list[str]) -> tuple[str, ...] | None:
    """The words that name the command of a command line; None if there is no such command."""
    first = words[0]
    if first.startswith("--"):
        return ()
    if first not in COMMANDS:
        return None
    path, found, rest = (first,), _module_command(first), words[1:]
    while isinstance(found, Mapping):
        if not rest or rest[0] == "--help" or not re.fullmatch(r"[a-z0-9-]+", rest[0]):
            return path
        if rest[0] not in found:
            return None
        path, found, rest = (*path, rest[0]), found[rest[0]], rest[1:]
    return path


def _module_command(name: str) -> object:
    return import_module(f"kpred.cli.{MODULES.get(name, name)}").COMMAND


def _leaves() -> Iterator[tuple[str, ...]]:
    def below(path: tuple[str, ...], found: object) -> Iterator[tuple[str, ...]]:
        if not isinstance(found, Mapping):
            yield path
            return
        for word, inner in found.items():
            yield from below((*path, word), inner)

    for name in COMMANDS:
        yield from below((name,), _module_command(name))


@cache
def _help(command: tuple[str, ...]) -> str:
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        assert main([*command, "--help"]) == 0
    return text.getvalue()
