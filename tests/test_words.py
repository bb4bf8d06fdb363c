"""Language of the code and the docs: words that have a standard one (docs/glossary.md) do not come back."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# Word -> the standard one.
WORDS = {
    r"share_out": "parallel_for",
    r"as_model|as_database": "resolve_model, resolve_database",
    r"PostgresHome|SqliteHome": "backend",
    r"steadily": "retry_on_disconnect",
    r"crew|ledger": "worker pool, journal",
    r"recognis\w+": "recognize",
    r"\w*HOPELESS\w*|hopeless": "stopped",
    r"(?:MOST|LEAST)_[A-Z_]+": "MAX_, MIN_",
    r"\w+_(?:SHARE|share)": "fraction",
    r"made_by": "provenance",
    r"judged?|judges": "score",
    r"tells?|told": "show, report, predict, ...",
    r"asks|asked": "query, predict, request, ...",
    r"forgets?|forgotten": "drop, clear",
    r"nobody|whoever|busily": "(say it plainly)",
    r"stood_on|feet_missing": "floor contact",
    r"floor_stub|wall_stub|end_sheet": "detect_floor, detect_wall, find_end_patch",
}

# Files that still have such words. This list only shrinks: a file without any must leave it.
EXEMPT: set[str] = set()

# Function docstrings begin with a verb: none of these words.
NO_VERBS = {
    "A", "All", "An", "As", "Both", "Each", "Every", "For", "How", "If", "Numbers", "Of", "One", "Points", "Some",
    "That", "The", "Those", "What", "When", "Where", "Whether", "Which", "Who",
}  # fmt: skip

# Files that still have such docstrings. This list only shrinks, too.
EXEMPT_DOCSTRINGS: set[str] = set()


def files() -> list[Path]:
    """Source and documentation, but for the changelog, which names what was renamed."""
    return [*ROOT.glob("src/**/*.py"), *ROOT.glob("docs/**/*.md"), ROOT / "README.md"]


def relative(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("word", WORDS)
def test_words_with_a_standard_one_are_not_used(word: str) -> None:
    pattern = re.compile(rf"(?<!\w)(?:{word})(?!\w)")
    found = {
        f"{relative(file)}:{number}"
        for file in files()
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if pattern.search(line) and relative(file) not in EXEMPT
    }
    assert not found, f"write {WORDS[word]}"


def test_exempt_files_still_need_it() -> None:
    pattern = re.compile(rf"(?<!\w)(?:{'|'.join(WORDS)})(?!\w)")
    clean = {name for name in EXEMPT if not pattern.search((ROOT / name).read_text(encoding="utf-8"))}
    assert not clean, "remove these from EXEMPT"


def noun_docstrings(file: Path) -> list[str]:
    """Functions, but no properties, whose docstring begins with a noun, an article or a clause."""
    found = []
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.FunctionDef):
            continue
        is_property = any("property" in ast.unparse(decorator) for decorator in node.decorator_list)
        words = (ast.get_docstring(node) or "").split()
        if words and not is_property and re.sub(r"\W", "", words[0]) in NO_VERBS:
            found.append(node.name)
    return found


def test_docstrings_of_functions_begin_with_a_verb() -> None:
    found = {relative(file): noun_docstrings(file) for file in ROOT.glob("src/**/*.py")}
    assert {name: functions for name, functions in found.items() if functions and name not in EXEMPT_DOCSTRINGS} == {}
    assert not {name for name in EXEMPT_DOCSTRINGS if not found.get(name)}, "remove these from EXEMPT_DOCSTRINGS"


def test_the_words_are_found_where_they_are() -> None:
    pattern = re.compile(rf"(?<!\w)(?:{'|'.join(WORDS)})(?!\w)")
    assert all(pattern.search(word) for word in ("MOST_POINTS", "is told", "as_model(name)", "speck_share", "judged"))
    assert not any(pattern.search(word) for word in ("most points", "total", "resolve_model", "share", "fraction"))
