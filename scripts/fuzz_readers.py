"""Mutate valid files and read them: every reader must raise errors of the package alone, quickly and in little memory.

    python scripts/fuzz_readers.py --inputs 100000 --seed 0

Prints one line a finding (seed, index, file, what happened) and keeps the input in `--keep`; exit code 1 if there is
one. Input number i of a seed is always the same.
"""

from __future__ import annotations

import argparse
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np
from fuzz_cases import Case, cases

from kpred.errors import KpredError

SECONDS = 10.0
"""Time of one input beyond which it counts as a hang."""

MEGABYTES = 1000
"""Growth of the largest memory of the process beyond which an input counts as a bomb."""

_NUMBERS = [
    b"-1",
    b"0",
    b"nan",
    b"inf",
    b"1e400",
    b"-1e308",
    b"2147483648",
    b"18446744073709551616",
    b"9" * 60,
    b"1e-320",
]
_WORDS = [b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b'"', b",", b";", b"{", b"[" * 40, b"#", b"../", b"%2e"]


@dataclass(frozen=True)
class Finding:
    """An input that did what none may do."""

    index: int
    case: Path
    what: str


class _Hang(BaseException):
    """Raised by the alarm; no reader catches it."""


def mutated(data: bytes, generator: np.random.Generator) -> bytes:
    """Change a file in one to four places: bytes, numbers, words, cuts, repeats; half of them in its beginning."""
    result = bytearray(data)
    for _ in range(int(generator.integers(1, 5))):
        if not result:
            break
        reach = len(result) if generator.random() < 0.5 else min(len(result), 400)
        at = int(generator.integers(reach))
        kind = int(generator.integers(8))
        if kind == 0:
            result[at] = int(generator.integers(256))
        elif kind == 1:
            result[at] ^= 1 << int(generator.integers(8))
        elif kind == 2:
            del result[at:]
        elif kind == 3:
            del result[at : at + int(generator.integers(1, 64))]
        elif kind == 4:
            result[at:at] = result[at : at + int(generator.integers(1, 64))]
        elif kind == 5:
            word = _WORDS[int(generator.integers(len(_WORDS)))]
            result[at : at + (len(word) if generator.random() < 0.5 else 0)] = word
        elif kind == 6:
            _replace_number(result, at, _NUMBERS[int(generator.integers(len(_NUMBERS)))])
        else:
            length = int(generator.choice([1, 2, 4, 8]))
            result[at : at + length] = bytes([int(generator.choice([0, 0x7F, 0x80, 0xFF]))]) * length
    return bytes(result)


def _replace_number(data: bytearray, at: int, number: bytes) -> None:
    """Replace the first number of text at or behind a place."""
    digits = b"0123456789.-+e"
    start = next((i for i in range(at, min(at + 200, len(data))) if data[i] in b"0123456789"), None)
    if start is not None:
        end = start
        while end < len(data) and data[end] in digits:
            end += 1
        data[start:end] = number


def fuzz(inputs: int, seed: int, folder: Path, keep: Path | None = None) -> Iterator[Finding]:
    """Read mutated files and yield what may not happen: foreign exceptions, hangs, bombs of memory.

    Args:
        inputs: how many files are tried.
        folder: for the files, made anew.
        keep: where inputs with findings are copied.
    """
    known = cases(folder)
    valid = {case.path: case.path.read_bytes() for case in known}
    for case in known:
        case.read(case.path)
    signal.signal(signal.SIGALRM, _alarm)
    for index in range(inputs):
        generator = np.random.default_rng([seed, index])
        case = known[int(generator.integers(len(known)))]
        data = mutated(valid[case.path], generator)
        case.path.write_bytes(data)
        what = _tried(case)
        case.path.write_bytes(valid[case.path])
        if what is not None:
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{seed}-{index}-{case.path.name}").write_bytes(data)
            yield Finding(index, case.path, what)


def _tried(case: Case) -> str | None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case.read(case.path)
    except KpredError as error:
        if "\n" in str(error):
            return f"a sentence of several lines: {error}"
    except _Hang:
        return f"longer than {SECONDS:g} s"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    return f"{grown:.0f} MB of memory" if grown > MEGABYTES else None


def _alarm(_number: int, _frame: FrameType | None) -> None:
    raise _Hang


def main() -> int:
    """Fuzz, print the findings, return 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"))
    given = parser.parse_args()
    started, count = time.monotonic(), 0
    with tempfile.TemporaryDirectory(prefix="kpred-fuzz-") as folder:
        for finding in fuzz(given.inputs, given.seed, Path(folder) / "cases", given.keep):
            count += 1
            print(f"{given.seed} {finding.index} {finding.case.name}: {finding.what[:300]}", flush=True)
    print(f"{given.inputs} inputs, {count} findings, {time.monotonic() - started:.0f} s")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
