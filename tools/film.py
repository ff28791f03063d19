"""Film flights' pages as the moving pictures of README and docs: python tools/film.py [replay] [spin].

``replay`` is the paper's first case, ``spin`` a quadrotor that loses a rotor altogether. Flies it, opens its page in
Chromium and takes pictures of the replay, more slowly where much happens. Needs the extra `test` and Chromium
(CHROMIUM names one).
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import sync_playwright

import rotorfault as rf
from rotorfault.results.events import events

IMAGES = Path(__file__).parents[1] / "docs" / "images"
FRAMES = 12.5  # per second
COLOURS = 128
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


class Subject(NamedTuple):
    """What is filmed."""

    scenario: str
    settings: dict[str, Any]
    size: tuple[int, int]  # pixels
    parts: tuple[tuple[float, float, float], ...]  # from and until when in s, and how many times slower than in truth


SUBJECTS = {
    "replay": Subject("paper-set-point", {}, (640, 400), ((0.3, 1.7, 1.0), (1.7, 2.05, 12.0), (2.05, 3.2, 1.0))),
    "spin": Subject(
        "hover-fault",
        {"vehicle": "mueller-2014", "fault": [{"kind": "total", "rotor": 1, "time": 1.0}], "duration": 5.0},
        (440, 340),
        ((0.7, 0.98, 1.0), (0.98, 1.3, 8.0), (1.3, 4.2, 2.5)),
    ),
}


def moments(subject: Subject) -> list[tuple[float, float]]:
    """Times of the pictures in s, and how many times slower than in truth each is shown."""
    return [
        (float(at), slower)
        for begin, end, slower in subject.parts
        for at in np.arange(begin, end, 1.0 / (FRAMES * slower))
    ]


def font(size: int) -> Any:
    """A font that is there with matplotlib."""
    import matplotlib

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return ImageFont.truetype(str(folder / "DejaVuSans.ttf"), size)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*SUBJECTS, []], help="all if none is given")
    for name in parser.parse_args().names or SUBJECTS:
        film(SUBJECTS[name], IMAGES / f"{name}.gif")


def film(subject: Subject, out: Path) -> None:
    """Film a flight."""
    flight = rf.fly(subject.scenario, settings=subject.settings)
    width, height = subject.size
    told = [event for event in events(flight.records()) if event.kind in ("fault", "alarm", "isolated", "spin")]
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
            content=f"#stage {{ width: {2 * width}px !important; height: {2 * height}px !important; "
            "border: 0 !important }"
        )
        tab.wait_for_timeout(500)
        for at, slower in moments(subject):
            tab.evaluate(f"rotorfault.clock.seek({at}); rotorfault.scene.draw()")
            address = tab.evaluate("rotorfault.scene.renderer.domElement.toDataURL('image/png')")
            image = Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGB")
            picture = image.resize(subject.size, Image.Resampling.LANCZOS)
            draw = ImageDraw.Draw(picture)
            draw.text(
                (12, 10),
                f"{at:.3f} s" + (f"   {slower:g} times slower" if slower != 1.0 else ""),
                fill="#1b1f24",
                font=font(15),
            )
            known = [event.text for event in told if event.time <= at < event.time + 1.2]
            for k, text in enumerate(known[-3:]):
                draw.text((12, height - 66 + 20 * k), text, fill="#1b1f24", font=font(14))
            pictures.append(picture)
        browser.close()
    # One palette for all, of pictures from before and after the fault: else colours change from one to the next.
    sample = Image.new("RGB", (width, 4 * height))
    for k, share in enumerate((0.1, 0.4, 0.6, 0.9)):
        sample.paste(pictures[int(share * len(pictures))], (0, k * height))
    palette = sample.quantize(COLOURS)
    first, *rest = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    first.save(out, save_all=True, append_images=rest, duration=int(1000 / FRAMES), loop=0, optimize=True)
    print(f"wrote {out}: {len(pictures)} pictures, {out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
