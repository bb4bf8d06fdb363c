"""The command line's manners: help, exit codes, one sentence for an error, and a quick start."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from kpred import __version__
from kpred.cli import main as cli
from kpred.cli.command import Command
from kpred.cli.main import COMMANDS, FAILED, INTERRUPTED, OK, USAGE, main
from kpred.errors import KpredError

SUBCOMMANDS = {
    "data": ["generate", "info"],
    "database": ["build", "add", "remove", "info", "search"],
    "evaluate": ["shapes", "scans", "real", "compare"],
    "evaluate table": ["full", "partial", "scan2cad", "ablation", "topk", "oracle"],
    "plot": ["occlusion", "tokens", "keypoints", "influence", "grid"],
    "train": ["deformation", "retrieval", "partial", "all"],
}
LINES = [[name] for name in COMMANDS if name not in SUBCOMMANDS] + [
    [*name.split(), word] for name, words in SUBCOMMANDS.items() for word in words
]


@pytest.mark.parametrize("line", LINES, ids=" ".join)
def test_every_command_has_help_with_examples(line: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*line, "--help"]) == OK
    text = capsys.readouterr().out
    assert f"usage: kpred {' '.join(line)}" in text
    assert "examples:" in text
    assert f"kpred {' '.join(line)}" in text.partition("examples:")[2]
    assert "--json" in text
    assert "--debug" in text


@pytest.mark.parametrize("group", ["", *SUBCOMMANDS])
def test_lists_of_commands(group: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = group.split()
    assert main([*line, "--help"]) == OK
    asked = capsys.readouterr()
    assert main(line) == USAGE
    unasked = capsys.readouterr()
    assert asked.out == unasked.err
    assert asked.err == unasked.out == ""
    for word in SUBCOMMANDS[group] if group else COMMANDS:
        assert f"\n  {word} " in asked.out


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == OK
    assert capsys.readouterr().out == f"kpred {__version__}\n"


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        (["fitt"], "did you mean `kpred fit`?"),
        (["xyz"], "`kpred --help` lists the commands"),
        (["data", "infos"], "did you mean `kpred data info`?"),
        (["data", "info"], "no pack was named"),
        (["scene"], "SCENE"),
        (["fit", "scan.ply", "-o", "a.obj", "--frame", "sideways"], "sideways"),
        (["fit", "scan.ply", "-o", "a.obj", "--top-k", "many"], "many"),
        (["fit", "scan.ply", "-o", "a.obj", "--no-such-option"], "--no-such-option"),
    ],
)
def test_wrong_use_is_exit_code_2(line: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line) == USAGE
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert printed.out == ""
    assert "Traceback" not in printed.err


Raiser = Callable[[BaseException], None]


@pytest.fixture
def raising(monkeypatch: pytest.MonkeyPatch) -> Raiser:
    """Makes the command `info` raise an error."""

    def prepare(error: BaseException) -> None:
        class Raising(Command):
            def run(self, output: object) -> None:
                raise error

        from kpred.cli import info

        monkeypatch.setattr(info, "COMMAND", Raising)

    return prepare


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (KpredError("a.ply: it is\n empty; save it again."), FAILED, "kpred: a.ply: it is empty; save it again.\n"),
        (OSError(28, "No space left on device", "/full/a.obj"), FAILED, "/full/a.obj: No space left on device"),
        (PermissionError(13, "Permission denied", "/root/a.obj"), FAILED, "/root/a.obj: Permission denied"),
        (MemoryError(), FAILED, "not enough memory"),
        (ZeroDivisionError("division by zero"), FAILED, "unexpected ZeroDivisionError: division by zero"),
        (KeyboardInterrupt(), INTERRUPTED, "stopped by Ctrl-C"),
    ],
)
def test_an_error_is_one_sentence_and_an_exit_code(
    error: BaseException, code: int, words: str, raising: Raiser, capsys: pytest.CaptureFixture[str]
) -> None:
    raising(error)
    assert main(["info"]) == code
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""


def test_debug_shows_the_traceback(raising: Raiser, capsys: pytest.CaptureFixture[str]) -> None:
    raising(KpredError("a.ply: it is empty."))
    assert main(["info", "--debug"]) == FAILED
    assert "Traceback" in capsys.readouterr().err


def test_the_constants_are_the_documented_codes() -> None:
    assert (cli.OK, cli.FAILED, cli.USAGE, cli.INTERRUPTED) == (0, 1, 2, 130)


@pytest.mark.parametrize("line", [["--help"], ["fit", "--help"], ["database", "build", "--help"]], ids=" ".join)
def test_help_starts_without_torch(line: list[str]) -> None:
    code = f"import sys; from kpred.cli.main import main; main({line}); sys.exit('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr.decode()


def test_a_reader_that_goes_away_is_no_traceback() -> None:
    program = [sys.executable, "-m", "kpred", "--help"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stderr is not None
        child.stdout.close()
        assert b"Traceback" not in child.stderr.read()


def test_ctrl_c_stops_a_process_with_130(tmp_path: Path) -> None:
    fifo = tmp_path / "never.npz"
    os.mkfifo(fifo)
    code = (
        "import signal; from kpred.cli import main as cli\n"
        # A shell that runs the tests in the background has it ignored.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from kpred.cli.command import Command\n"
        "from kpred.cli import info\n"
        "class Slow(Command):\n"
        "    def run(self, output):\n"
        "        print('ready', flush=True)\n"
        f"        open({str(fifo)!r}).read()\n"
        "info.COMMAND = Slow\n"
        "raise SystemExit(cli.main(['info']))\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"ready\n"
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate(timeout=30)
    assert child.returncode == INTERRUPTED
    assert errors == b"kpred: stopped by Ctrl-C\n"


def test_cycles_are_searched_for_as_before_when_a_command_has_ended(tmp_path: Path) -> None:
    import gc

    before, frozen = gc.get_threshold(), gc.get_freeze_count()
    assert main(["fit", str(tmp_path / "none.ply"), "-o", str(tmp_path / "a.obj")]) == FAILED
    assert gc.get_threshold() == before
    # A few frozen objects end meanwhile; a command that leaves its own frozen adds tens of thousands.
    assert abs(gc.get_freeze_count() - frozen) < 1000
