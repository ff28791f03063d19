"""A flight as a film: an animated GIF, or a video in MP4 that slides and pages play.

Times are true: pictures are taken at the times of the flight that they will be seen at. GIF counts in hundredths of a
second, so the pictures of one have unequal durations that add up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rotorfault.base.errors import InputError, choices, missing_extra
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.progress import Bar
from rotorfault.report.animation import Animation
from rotorfault.report.style import colours_of_loss
from rotorfault.results.flight_data import FlightData

NARROWEST, WIDEST = 320, 3840  # pixels
HOLD = 1.0  # s for which the last picture stays
GIF_FASTEST, FASTEST = 50.0, 120.0  # pictures a second; browsers show a GIF that is faster more slowly
SPEEDS = 0.001, 1000.0
MOST_PICTURES = 100_000


class Film(NamedTuple):
    """How a film is made."""

    speed: float = 1.0  # of the flight, 1 for real time
    fps: float = 30.0  # pictures a second
    width: int = 960  # pixels
    start: float | None = None  # s of the flight; its beginning if not given
    until: float | None = None  # s of the flight; its end if not given

    def checked(self, gif: bool) -> Film:
        """The same, if it can be made.

        Raises
        ------
        InputError
            If a value is not allowed.
        """
        fastest = GIF_FASTEST if gif else FASTEST
        _require("speed", self.speed, *SPEEDS, "times real time")
        _require("fps", self.fps, 1.0, fastest, "pictures a second" + (" in a GIF" if gif else ""))
        _require("width", self.width, NARROWEST, WIDEST, "pixels")
        for name, value in (("from", self.start), ("until", self.until)):
            if value is not None:
                _require(name, value, 0.0, 1e9, "s")
        return self


def _require(name: str, value: Any, low: float, high: float, unit: str) -> None:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    whole = name != "width" or isinstance(value, int)
    if not (number and whole and low <= value <= high):
        kind = "a whole number" if name == "width" else "a number"
        raise InputError(f"{name}: got {value!r}; allowed: {kind} from {low:g} to {high:g} {unit}")


def write_film(data: FlightData, label: str, path: Path, film: Film) -> None:
    """Write a flight as a film, whole or not at all.

    Parameters
    ----------
    data : FlightData
    label : str
        What the flight is called in it.
    path : Path
        Its ending, ``.gif`` or ``.mp4``, tells what it will be.
    film : Film

    Raises
    ------
    InputError
        If the ending is another, a value is not allowed, the flight has no records or none in that time, or the
        folder does not exist.
    MissingExtraError
        If a video is wanted and the library for it is not installed.
    """
    ending = path.suffix.lower()
    if ending not in WRITERS:
        raise InputError(f"{path}: its ending tells no kind of film ({choices(WRITERS)})")
    film = film.checked(ending == ".gif")
    times = moments(data, film)
    animation = Animation(data, label, film.width - film.width % 2, film.speed)
    with Bar("drawing", len(times), "pictures") as bar:

        def pictures() -> Iterator[NDArray[np.uint8]]:
            last = -1.0
            picture: NDArray[np.uint8] | None = None
            for number, time in enumerate(times):
                if picture is None or time != last:
                    picture, last = animation.picture(time), time
                yield picture
                bar.update(number + 1)

        write_atomically(in_folder(path), lambda temporary: WRITERS[ending](temporary, pictures(), film.fps))


def moments(data: FlightData, film: Film) -> list[float]:
    """Times of the flight in s that the pictures show; the last one is held for a second.

    Parameters
    ----------
    data : FlightData
    film : Film

    Raises
    ------
    InputError
        If the flight has no records, or none in the time that is wanted.
    """
    records = np.asarray(data["time"].values, dtype=float)
    if not len(records):
        raise InputError("the flight has no records; there is nothing to animate")
    last = max(float(records[-1]), float(data.attrs.get("end_time", records[-1])))
    start = float(records[0]) if film.start is None else film.start
    until = last if film.until is None else min(film.until, last)
    if start > last or until < start:
        raise InputError(
            f"from {start:g} s until {until if film.until is None else film.until:g} s there is no flight; it lasts "
            f"from {records[0]:g} to {last:g} s"
        )
    count = math.floor((until - start) / film.speed * film.fps + 1e-6) + 1
    if count > MOST_PICTURES:
        raise InputError(
            f"the film would have {count:,} pictures; allowed: {MOST_PICTURES:,}; take less of the flight with "
            "--from and --until, or a greater --speed"
        )
    times = [start + number * film.speed / film.fps for number in range(count)]
    return [*times, *[until] * round(HOLD * film.fps)]


def _write_gif(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    palette: Image.Image | None = None
    durations: list[int] = []

    def reduced() -> Iterator[Image.Image]:
        nonlocal palette
        for number, picture in enumerate(pictures):
            whole = Image.fromarray(picture)
            if palette is None:
                palette = _palette(whole)
            # Of this picture, in ms, whole hundredths of a second that add up to the time.
            durations.append(10 * (round(100.0 * (number + 1) / fps) - round(100.0 * number / fps)))
            small = whole.quantize(palette=palette, dither=Image.Dither.NONE)
            small.info["duration"] = durations[-1]
            yield small

    frames = reduced()
    first = next(frames)
    first.save(path, format="GIF", save_all=True, append_images=frames, loop=0, disposal=1)


def _palette(picture: Image.Image) -> Image.Image:
    """Colours of all pictures: those of the first one, and those that rotors can take."""
    scale = colours_of_loss(np.linspace(0.0, 1.0, 40))
    strip = np.repeat(np.concatenate([scale, (0.82 * scale).astype(np.uint8)])[None], 40, axis=0)
    grey = picture.convert("RGB")
    both = Image.new("RGB", (max(grey.width, strip.shape[1]), grey.height + strip.shape[0]), "white")
    both.paste(grey, (0, 0))
    both.paste(Image.fromarray(strip), (0, grey.height))
    return both.quantize(255, method=Image.Quantize.MEDIANCUT)


def _write_mp4(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float) -> None:
    try:
        from imageio_ffmpeg import write_frames
    except ImportError:
        raise missing_extra("a film in MP4 needs the package imageio-ffmpeg", "export") from None
    first = next(pictures)
    height, width = (side - side % 2 for side in first.shape[:2])
    # H.264 in the colours that every player knows, its head at the beginning, so that a page plays while it loads.
    options = ["-crf", "20", "-preset", "medium", "-movflags", "+faststart"]
    video = write_frames(
        path, (width, height), fps=fps, codec="libx264", quality=None, macro_block_size=2, output_params=options
    )
    video.send(None)
    try:
        for picture in _with(first, pictures):
            video.send(np.ascontiguousarray(picture[:height, :width]))
    finally:
        video.close()


def _with(first: NDArray[np.uint8], others: Iterator[NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
    yield first
    yield from others


WRITERS: dict[str, Callable[[Path, Iterator[NDArray[np.uint8]], float], None]] = {
    ".gif": _write_gif,
    ".mp4": _write_mp4,
}
"""By the ending of the file."""
