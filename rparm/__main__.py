"""Runs a command of rparm.commands, and ends as it ends."""

import os
import shlex
import signal
import sys
from argparse import Namespace
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from io import TextIOWrapper
from typing import NoReturn, TextIO

from rparm import command_line, console, project
from rparm.command_line import Answered, Ended
from rparm.errors import UserError, reason
from rparm.files import from_here, write_text, written
from rparm.interruption import handle_endings
from rparm.needs import COMMANDS, DEFAULT, NO_READER

LONGEST_MESSAGE = 2000  # characters; some quote what a file says


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code, as `needs.EXIT_CODES` says."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # names that it cannot encode are no reason to stop
            stream.reconfigure(errors="backslashreplace")
    project.set_library_caches()
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = given[: given.index("--")] if "--" in given else given
    as_json = "--json" in options  # a mistake in the arguments is a document, too
    try:
        with console.results_stream(as_json, "--quiet" in options) as results:
            return _say(_ended(given or [DEFAULT]), as_json, results)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever read the output has left: as if SIGPIPE had ended it
        _drop_output()
        return NO_READER
    except OSError as error:
        _drop_output()
        return _refuse(f"{error.filename or 'output or temporary files'}: {reason(error)}")
    except MemoryError:
        return _refuse("out of memory")


def _ended(arguments: Sequence[str]) -> Ended:
    try:
        project.check_current_folder()
        options = command_line.parsed(arguments)
        if getattr(options, "no_cache", False):
            os.environ[project.NO_CACHE] = "1"  # for processes that it starts, too
        # imported here because it takes long: so Ctrl-C during the import leaves no traceback
        ended = command_line.function(options.command, "do_{}")(options)
        _keep_document(options, ended)
        _show_page(options, ended)
        return _with_next(arguments, options, ended)
    except Answered as answer:
        return Ended(0, answer.text, {answer.name: answer.text})
    except UserError as error:
        return Ended(error.code, "", error=error)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("rparm"):
            raise
        extra = COMMANDS[options.command].extra or "all"
        return Ended(2, "", error=project.not_installed(str(error.name), extra))


def _with_next(arguments: Sequence[str], options: Namespace, ended: Ended) -> Ended:
    """Say in the last line where the page is, and how to open it."""
    if ended.page is None or ended.page.suffix != ".html":
        return ended
    parts = [ended.verdict, str(from_here(ended.page))]
    if not options.open:
        parts.append(f"open it: {shlex.join([project.PROGRAM, *arguments, '--open'])}")
    return replace(ended, verdict="; ".join(filter(None, parts)))


def _keep_document(options: Namespace, ended: Ended) -> None:
    """Write the document of a command that writes nothing else."""
    folder = getattr(options, "document", None)
    if folder is not None:
        path = folder / f"{options.command}.json"
        with written(path):
            write_text(path, f"{console.json_line(_document(ended))}\n")


def _show_page(options: Namespace, ended: Ended) -> None:
    if not options.open:
        return
    if ended.page is None:
        if ended.error is None:
            print(f"--open: {options.command} has written no page", file=sys.stderr)
        return
    import webbrowser  # takes long

    page = ended.page.absolute()
    try:
        opened = webbrowser.open_new_tab(page.as_uri())
    except webbrowser.Error:
        opened = False
    if not opened:
        print(f"no browser found, open this file in one: {page}", file=sys.stderr)


def _document(ended: Ended) -> dict[str, object]:
    """Return the document of a command's end, for programs."""
    error = {} if ended.error is None else {"error": str(ended.error)}
    return {"exit_code": ended.code, **ended.document, **error}


def _say(ended: Ended, as_json: bool, results: TextIO | None) -> int:
    """Print how a command has ended; the exit code."""
    if ended.error is not None:
        _refuse(str(ended.error))
    if ended.verdict:
        print(ended.verdict, file=sys.stdout if as_json else results)
    if as_json:
        print(console.json_line(_document(ended)), file=results)
    for stream in (sys.stdout, results):
        if stream is not None:
            stream.flush()
    return ended.code


def _refuse(text: str) -> int:
    """Say in one line what is wrong, with what would move the cursor escaped."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    text = text if len(text) <= LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]} ..."
    with suppress(OSError):  # standard error may be full too
        print(f"error: {text}", file=sys.stderr)
    return 2


def _drop_output(stream: TextIO | None = None) -> None:
    """Discard what is still buffered, or the interpreter would fail to write it at exit."""
    with suppress(OSError, ValueError, AttributeError):  # closed, or not of the system
        os.dup2(os.open(os.devnull, os.O_WRONLY), (stream or sys.stdout).fileno())


def _as_program() -> int:
    """Run `main`; whatever a library's code makes of a signal, it ends after files are removed."""
    received = handle_endings()
    try:
        return main()
    except SystemExit as ending:
        return ending.code
    except Exception:
        if not received:
            raise
        if received[0] == signal.SIGINT:
            print("interrupted", file=sys.stderr)
        return 128 + received[0]


def _end(code: int) -> NoReturn:
    """End the process, but not HELICS, which may wait for ever for a process that is gone."""
    exec("")  # a Ctrl-C that was caught above another exec would count: CPython ends by the signal
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError, AttributeError):  # closed, full, or not there
            _drop_output(stream)
    if "helics" in sys.modules:
        os._exit(code or 0)
    sys.exit(code)


def script() -> NoReturn:
    """Run the command rparm of an installed package."""
    _end(_as_program())


if __name__ == "__main__":
    script()
