"""Limits of length: no function over 60 lines, no file over 300; what is longer stands here and only shrinks."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("src", "scripts", "examples", "benchmarks", "paper/src")

MAX_FUNCTION, MAX_FILE = 60, 300

LONG_FUNCTIONS: set[str] = set()
LONG_FILES: set[str] = set()


def files() -> Iterator[tuple[str, str]]:
    """Name and text of each file."""
    for folder in FOLDERS:
        for file in sorted((ROOT / folder).rglob("*.py")):
            yield file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8")


def long_functions(text: str) -> list[str]:
    """Names of functions that are too long, without their docstrings."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0]
            said = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) is not None else 0
            if node.end_lineno - node.lineno + 1 - said > MAX_FUNCTION:
                found.append(node.name)
    return found


def test_no_function_is_too_long() -> None:
    assert {f"{name}:{function}" for name, text in files() for function in long_functions(text)} == LONG_FUNCTIONS


def test_no_file_is_too_long() -> None:
    assert {name for name, text in files() if text.count("\n") > MAX_FILE} == LONG_FILES


@pytest.mark.parametrize(("lines", "found"), [(MAX_FUNCTION - 1, []), (MAX_FUNCTION, ["f"])])
def test_lines_are_counted_without_the_docstring(lines: int, found: list[str]) -> None:
    body = '    """One.\n\n    Two.\n    """\n' + "    x = 1\n" * lines
    assert long_functions(f"def f() -> None:\n{body}") == found
