"""A newcomer finds things by names: the answers in `docs/architecture.md` exist, and hold words of their questions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
SECTION = "## Where is what?\n"

COMMON = {"a", "an", "and", "another", "are", "as", "come", "do", "does", "for", "from", "i", "in", "is", "of", "or"}


def _rows() -> list[tuple[str, list[str]]]:
    page = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = page.partition(SECTION)[2].partition("\n## ")[0]
    lines = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("|")][2:]
    return [(question.strip(), re.findall(r"`([^`]+)`", answer)) for question, answer in lines]


def test_there_are_twelve_questions_or_more() -> None:
    assert len(_rows()) >= 12


@pytest.mark.parametrize(("question", "answers"), _rows(), ids=lambda value: value if isinstance(value, str) else "")
def test_the_answer_exists_and_its_name_says_so(question: str, answers: list[str]) -> None:
    assert answers
    for answer in answers:
        assert (REPOSITORY / "src" / "kpred" / answer).exists(), answer
    words = {word[:5] for word in re.findall(r"[a-z]+", question.lower())} - COMMON
    names = {word[:5] for word in re.findall(r"[a-z]+", answers[0].partition("/")[2].removesuffix(".py"))}
    assert words & names, f"no word of the question is in {answers[0]}"
