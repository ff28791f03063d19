"""Size, first picture and frame rate of the flight page: python benchmarks/flight_page.py [--json FILE].

Two flights of 20 s with every record at 1 kHz on one page, in headless Chromium, wide and on a telephone, with one
picture and side by side. The first picture is when the replay has been drawn, from the click on: reading and
unpacking the file are part of it. Frames are counted while the flight plays for a few seconds, and beside them those
of an empty page, the most that this machine can show. What is drawn by the processor, without a graphics card, is far
slower than on a card, and shares it with whatever else runs: so the load is printed, and the time of all processors
that a frame takes, which depends on it less. Needs the extra `test` and Chromium (CHROMIUM names one).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

import rotorfault as rf
from rotorfault.base.text_table import table_lines

CASE = "paper-set-point"  # 20 s at 1 kHz
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
VIEWS = {
    "one picture, 1300 px": (1300, ""),
    "side by side, 1300 px": (1300, "&view=split"),
    "one picture, 390 px": (390, ""),
}
SECONDS = 4.0  # of playing
COUNT = """seconds => new Promise((done) => {
  const begin = performance.now();
  let frames = 0;
  const next = (now) => {
    frames += 1;
    if (now - begin < 1000 * seconds) requestAnimationFrame(next);
    else done((1000 * frames) / (now - begin));
  };
  requestAnimationFrame(next);
})"""


def busy(browser: Any) -> float:
    """Time in s that all processes of a browser have had of a processor."""
    found = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")
    return sum(float(process["cpuTime"]) for process in found["processInfo"])


def measured(browser: Any, page: Path, width: int, state: str) -> dict[str, float]:
    """First picture in s, and frames a second, of one opened page."""
    context = browser.new_context(viewport={"width": width, "height": 850})
    tab = context.new_page()
    tab.goto("about:blank")
    empty = float(tab.evaluate(COUNT, 1.0))
    tab.goto(f"{page.as_uri()}#t=0.5{state}")
    tab.wait_for_selector("body[data-ready=true]", timeout=120_000)
    # The next frame is the first that shows it.
    first = float(tab.evaluate("() => new Promise((done) => requestAnimationFrame(() => done(performance.now())))"))
    ready = float(tab.evaluate("performance.getEntriesByName('ready')[0].startTime"))
    tab.evaluate("rotorfault.clock.play()")
    tab.evaluate(COUNT, 1.5)  # until it has found how many pixels it can draw
    before = busy(browser)
    frames = float(tab.evaluate(COUNT, SECONDS))
    taken = (busy(browser) - before) / (frames * SECONDS)
    pixels = float(tab.evaluate("rotorfault.scene.renderer.getPixelRatio()"))
    context.close()
    return {
        "first_picture_s": min(ready, first) / 1000.0,
        "frames_per_s": frames,
        "processor_s_per_frame": taken,
        "empty_page_frames_per_s": empty,
        "pixel_ratio": pixels,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="file for the numbers")
    out = parser.parse_args().json
    flights = {name: rf.fly(CASE, name) for name in ("roismc", "smc")}
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as program:
        begin = time.perf_counter()
        page = rf.view(flights, out=Path(folder) / "two.html")
        result: dict[str, Any] = {
            "records": len(flights["roismc"].data.time),
            "write_s": time.perf_counter() - begin,
            "megabytes": page.stat().st_size / 1e6,
            "load": load,
            "processors": os.cpu_count(),
        }
        chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
        browser = program.chromium.launch(executable_path=chromium, args=SOFTWARE)
        result["views"] = {name: measured(browser, page, *view) for name, view in VIEWS.items()}
        browser.close()
    size, written = f"{result['megabytes']:.2f} MB", f"{result['write_s']:.2g} s"
    print(f"two flights of {result['records']} records: {size}, written in {written}")
    heads = {
        "first_picture_s": "first picture [s]",
        "frames_per_s": "frames/s",
        "empty_page_frames_per_s": "of an empty page",
        "processor_s_per_frame": "processor time a frame [s]",
        "pixel_ratio": "pixels drawn per pixel of a side",
    }
    rows = [(name, *(f"{view[key]:.2g}" for key in heads)) for name, view in result["views"].items()]
    print("\n".join(table_lines([("view", *heads.values()), *rows], "<" + len(heads) * ">")))
    print(f"drawn by the processor; load {load:.1f} on {result['processors']} processors before it began")
    if out is not None:
        out.write_text(json.dumps(result, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
