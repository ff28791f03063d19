"""Film a flight's page as the moving picture of the README: python tools/film.py [--out docs/images/replay.gif].

Flies the paper's first case, opens its page in Chromium and takes pictures of the replay: in true time until shortly
before the faults at 1.8 s, then twelve times slower. Needs the extra `test` and Chromium (CHROMIUM names one).
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import sync_playwright

import rotorfault as rf
from rotorfault.results.events import events

SIZE = 640, 400  # pixels
FRAMES = 12.5  # per second
FAULT = 1.7, 2.05  # s, around the faults
SLOWER = 12.0  # there
COLOURS = 128
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def moments() -> list[float]:
    """Times of the pictures in s."""
    step = 1.0 / FRAMES
    return [*np.arange(0.3, FAULT[0], step), *np.arange(*FAULT, step / SLOWER), *np.arange(FAULT[1], 3.2, step)]


def font(size: int) -> Any:
    """A font that is there with matplotlib."""
    import matplotlib

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return ImageFont.truetype(str(folder / "DejaVuSans.ttf"), size)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/images/replay.gif"))
    out = parser.parse_args().out
    flight = rf.fly("paper-set-point")
    told = [event for event in events(flight.records()) if event.kind in ("fault", "alarm", "isolated")]
    pictures = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as program:
        page = flight.view(Path(folder) / "flight.html")
        chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
        browser = program.chromium.launch(executable_path=chromium, args=SOFTWARE)
        tab = browser.new_page(viewport={"width": 1300, "height": 900}, device_scale_factor=1)
        tab.goto(page.as_uri() + "#camera=follow")
        tab.wait_for_selector("body[data-ready=true]")
        # The picture alone, larger than it will be: software draws without smooth edges, and shrinking smooths them.
        tab.add_style_tag(
            content="#stage { width: 1280px !important; height: 800px !important; border: 0 !important }"
        )
        tab.wait_for_timeout(500)
        for at in moments():
            tab.evaluate(f"rotorfault.clock.seek({at}); rotorfault.scene.draw()")
            address = tab.evaluate("rotorfault.scene.renderer.domElement.toDataURL('image/png')")
            image = Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGB")
            picture = image.resize(SIZE, Image.Resampling.LANCZOS)
            draw = ImageDraw.Draw(picture)
            slow = FAULT[0] <= at < FAULT[1]
            draw.text(
                (12, 10),
                f"{at:.3f} s" + (f"   {SLOWER:g} times slower" if slow else ""),
                fill="#1b1f24",
                font=font(15),
            )
            known = [event.text for event in told if event.time <= at < event.time + 1.2]
            for k, text in enumerate(known[-3:]):
                draw.text((12, SIZE[1] - 66 + 20 * k), text, fill="#1b1f24", font=font(14))
            pictures.append(picture)
        browser.close()
    # One palette for all, of pictures from before and after the fault: else colours change from one to the next.
    sample = Image.new("RGB", (SIZE[0], 4 * SIZE[1]))
    for k, share in enumerate((0.1, 0.4, 0.6, 0.9)):
        sample.paste(pictures[int(share * len(pictures))], (0, k * SIZE[1]))
    palette = sample.quantize(COLOURS)
    first, *rest = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    first.save(out, save_all=True, append_images=rest, duration=int(1000 / FRAMES), loop=0, optimize=True)
    print(f"wrote {out}: {len(pictures)} pictures, {out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
