"""Pages in headless Chromium: what they show, complain of and ask for."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

BROWSER = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
NEEDED = pytest.mark.skipif(BROWSER is None, reason="needs Chromium, such as Debian's package; CHROMIUM names one")
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
READY = "body[data-ready=true]"  # what a flight page has once it shows its flights


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser, for the tests of a file."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    with sync_api.sync_playwright() as program:
        started = program.chromium.launch(executable_path=BROWSER, args=SOFTWARE)
        yield started
        started.close()


class Opened:
    """A page in a browser, and what it complained of or asked for."""

    def __init__(
        self,
        browser: Any,
        path: Path,
        address: str = "",
        width: int = 1300,
        scheme: str = "light",
        ready: str = READY,
    ) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 850}, color_scheme=scheme)
        self.page = self.context.new_page()
        self.said: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("dialog", self._dialog)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri() + address)
        self.page.wait_for_selector(ready, timeout=60_000)

    def _dialog(self, dialog: Any) -> None:
        self.said.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    @property
    def complaints(self) -> list[str]:
        """Errors, dialogs and what else was said; but for what drivers of graphics say of reading pictures back."""
        return [text for text in self.said if "GPU stall" not in text]

    @property
    def elsewhere(self) -> list[str]:
        """What was asked for that is no file."""
        return [url for url in self.requests if not url.startswith(("file:", "data:", "blob:"))]

    def ask(self, script: str) -> Any:
        return self.page.evaluate(script)

    @property
    def time(self) -> float:
        return float(self.ask("rotorfault.clock.time"))
