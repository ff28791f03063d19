"""The command line in a test: within the process, or as one of its own where the process is the matter."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from subprocess import CompletedProcess
from unittest import mock

import pytest
from places import SOURCE

from rotorfault.cli.main import main

MODULE = "rotorfault.cli.main"
# What Python does not show unless it is asked to.
SILENT = (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning)


def started(*arguments: str, cwd: Path | None = None, before: str = "") -> CompletedProcess[str]:
    """What a command does as a process of its own, which may run other code before."""
    program = ["-c", f"{before}\nfrom rotorfault.cli.main import main\nmain()"] if before else ["-m", MODULE]
    command = [sys.executable, *program, *arguments]
    environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent)}  # the same program, wherever it is started
    return subprocess.run(command, env=environment, capture_output=True, text=True, cwd=cwd, check=False, timeout=300)


def run(*arguments: str, cwd: Path | None = None) -> CompletedProcess[str]:
    """What a command does, by the entry point but within this process: what is loaded and compiled stays so.

    An exception that the entry point lets through is one here too, instead of a traceback among the errors.
    """
    output, errors, code = io.StringIO(), io.StringIO(), 0
    with (
        mock.patch.object(sys, "argv", ["rotorfault", *arguments]),
        contextlib.chdir(cwd or "."),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
        _warnings_as_text(),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return CompletedProcess(list(arguments), code, output.getvalue(), errors.getvalue())


@contextlib.contextmanager
def _warnings_as_text() -> Iterator[None]:
    """Warnings stand among the errors, as Python writes them: pytest would take them away."""

    def show(message: Warning | str, category: type[Warning], file: str, line: int, *_: object) -> None:
        sys.stderr.write(warnings.formatwarning(message, category, file, line))

    with warnings.catch_warnings(), pytest.MonkeyPatch.context() as patch:
        for category in SILENT:
            warnings.simplefilter("ignore", category)
        patch.setattr(warnings, "showwarning", show)
        yield


def assert_refused(done: CompletedProcess[str], *named: str) -> None:
    """One line that names what is wrong, and nothing else."""
    assert done.returncode == 2, done.stderr + done.stdout
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    for word in named:
        assert word in done.stderr
