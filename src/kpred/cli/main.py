"""The command `kpred`: finds the command, parses its options, and turns errors into one sentence and an exit code.

Exit codes: 0 done, 1 an error that the sentence on standard error explains, 2 wrong use, 130 stopped by Ctrl-C, 143 by
SIGTERM, 129 by SIGHUP.
"""

from __future__ import annotations

import gc
import os
import shlex
import sys
import traceback
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from importlib import import_module
from typing import TYPE_CHECKING, Any, TextIO

from kpred._version import __version__
from kpred.cli.compilation import cache_problem, reported_compilation
from kpred.cli.stopping import report_stop, stopped_by_signals
from kpred.cli.usage import UsageError
from kpred.errors import KpredError

if TYPE_CHECKING:
    from kpred.cli.command import Command, Group

COMMANDS = {
    "fit": "Fit a CAD model to a scan: mesh, record and picture.",
    "fit-many": "Fit CAD models to very many scans: folders or Parquet manifests, processes or a Ray cluster.",
    "refit": "Make a fit again from its record, to the bit.",
    "fit-depth": "Fit a CAD model to depth pictures of a known camera, and draw it over the photograph.",
    "scene": "Fit a CAD model to every object of a scanned scene: one GLB, records and picture.",
    "serve": "Serve fits over HTTP: POST a scan, get its mesh; kpred fit --server then starts at once.",
    "studio": "Look at a fit in the browser, and correct it by hand.",
    "demo": "Fit the bundled sample scan with the bundled models.",
    "database": "Build, change, search and describe a database of CAD models.",
    "data": "Generate synthetic furniture; describe mesh packs; check and prepare data sets.",
    "train": "Train the networks of one category, stage by stage.",
    "evaluate": "Measure a model: on whole shapes, on virtual scans, on real scans.",
    "plot": "Draw figures: occlusion curves, maps of tokens, keypoints, influence, grids of results.",
    "bench": "Measure speed and memory on this machine, beside the plain way of doing the same.",
    "compile": "Compile the code of a fit ahead of the first one.",
    "info": "Show versions, bundled models and the bundled database.",
}
"""Name -> one line. A command's module is `kpred.cli.<name>` and is imported only when it is called."""

MODULES = {"fit-depth": "depth", "fit-many": "fit_many"}
"""Modules of commands whose name is no module's."""

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130

RARELY = (50_000, 20, 100)
"""Thresholds of Python's search for cycles (`gc.set_threshold`) in commands that fit."""

_EXAMPLES = """\
examples:
  kpred demo
  kpred fit chair.ply -o chair.obj
  kpred database build meshes/ -o mine.kpred
  kpred fit chair.ply -o chair.glb --database mine.kpred --category chair"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    try:
        with stopped_by_signals(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            if not debug:
                warnings.simplefilter("ignore", DeprecationWarning)
                warnings.simplefilter("ignore", FutureWarning)
            code = _dispatch(words)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt as error:
        return report_stop(error)
    except BrokenPipeError:
        # The reader of a pipe has gone: what is still in the buffer is of no use, and must not fail again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else OK if error.code is None else FAILED
    except Exception as error:
        if debug:
            print(_traceback(), file=sys.stderr, end="")
        else:
            print(f"kpred: {_sentence(error)}", file=sys.stderr)
        return USAGE if isinstance(error, UsageError) else FAILED
    finally:
        if arguments is None:
            # This process ends now: a search for cycles among all that torch has loaded would take most of a second.
            gc.freeze()


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help"):
        print(_help(), file=sys.stdout if words else sys.stderr)
        return OK if words else USAGE
    if words[0] in ("-V", "--version"):
        print(f"kpred {__version__}")
        return OK
    if words[0] not in COMMANDS:
        return _unknown(words[0], "kpred", COMMANDS)
    return _run(words[0], words[1:])


def _run(name: str, words: list[str]) -> int:
    import tyro

    from kpred.cli.output import Output
    from kpred.database.address import masked

    module = import_module(f"kpred.cli.{MODULES.get(name, name)}")
    line = masked(shlex.join(["kpred", name, *words]))
    found: Group | type[Command] = module.COMMAND
    summary, implied = COMMANDS[name], getattr(module, "IMPLIED", None)
    while isinstance(found, dict):
        if not words or words[0] in ("-h", "--help"):
            lines = {word: _summary(kind) for word, kind in found.items()}
            text = f"usage: kpred {name} COMMAND [options]\n\n{summary}\n\n{_list(lines)}\n\n"
            text += f"`kpred {name} COMMAND --help` shows options and examples."
            print(text, file=sys.stdout if words else sys.stderr)
            return OK if words else USAGE
        if implied is not None and words[0] not in found and _no_word(words[0]):
            words = [implied, *words]
        if words[0] not in found:
            return _unknown(words[0], f"kpred {name}", found)
        name, found, words, implied = f"{name} {words[0]}", found[words[0]], words[1:], None
        summary = _summary(found)
    kind = found
    start: Any = module.default(kind, words) if hasattr(module, "default") else None
    shown = [masked(word) for word in words]
    # Messages about wrong use repeat the words: they see the masked ones first.
    for given in [words] if shown == words else [shown, words]:
        command: Command = tyro.cli(
            kind,
            prog=f"kpred {name}",
            args=given,
            default=start,
            config=(tyro.conf.FlagCreatePairsOff,),
        )
    output = Output(as_json=command.json, command=line)
    with (
        reported_compilation(output.caution) if command.compiles else nullcontext(),
        _few_collections() if command.fits else nullcontext(),
    ):
        command.run(output)
    return OK


@contextmanager
def _few_collections() -> Iterator[None]:
    """Search for cycles less often: loading the libraries makes many objects and no garbage."""
    before = gc.get_threshold()
    gc.set_threshold(*RARELY)
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _summary(found: Group | type[Command]) -> str:
    """Return the first line of the help of a command or group."""
    if isinstance(found, dict):
        return getattr(found, "summary", "") or f"One of: {', '.join(found)}."
    return (found.__doc__ or "").partition("\n")[0]


def _no_word(word: str) -> bool:
    """Test whether an argument is an option or a path, not a misspelt command."""
    return word.startswith("-") or "." in word or os.sep in word or os.path.exists(word)


def _traceback() -> str:
    """Format the error that is handled, without the passwords of addresses."""
    from kpred.database.address import masked

    return masked(traceback.format_exc())


def _sentence(error: Exception) -> str:
    """Format an error and its mend on one line."""
    from kpred.cli.output import printable
    from kpred.database.address import masked

    if isinstance(error, KpredError | UsageError):
        text = str(error)
    elif (problem := cache_problem(error)) is not None:
        text = problem
    elif isinstance(error, OSError):
        where = error.filename if error.filename is not None else "a file"
        text = f"{where}: {error.strerror or error}; make room, or choose a place that can be read and written"
    elif isinstance(error, MemoryError):
        text = "not enough memory; give a smaller input"
    else:
        text = f"unexpected {type(error).__name__}: {error}; run again with --debug and report what it shows"
    return printable(masked(" ".join(text.split())))


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    from kpred.cli.output import printable
    from kpred.database.address import masked

    print(f"kpred: warning: {printable(masked(' '.join(str(message).split())))}", file=sys.stderr)


def _help() -> str:
    return (
        "usage: kpred COMMAND [options]\n\n"
        "Scan in, CAD mesh out: retrieve a CAD model for a scan and deform it to match.\n\n"
        f"{_list(COMMANDS)}\n\n{_EXAMPLES}\n\n"
        "`kpred COMMAND --help` shows a command's options; every command takes --json and --debug."
    )


def _list(lines: Mapping[str, str]) -> str:
    width = max(map(len, lines))
    return "\n".join(["commands:", *(f"  {name:<{width}}  {text}" for name, text in lines.items())])


def _unknown(word: str, program: str, commands: Iterable[str]) -> int:
    import difflib

    near = difflib.get_close_matches(word, list(commands), n=1)
    hint = f"did you mean `{program} {near[0]}`?" if near else f"`{program} --help` lists the commands."
    print(f"kpred: there is no command {word!r}; {hint}", file=sys.stderr)
    return USAGE


if __name__ == "__main__":
    sys.exit(main())
