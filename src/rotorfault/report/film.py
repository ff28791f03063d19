"""A flight as a film: an animated GIF, or a video in MP4 that slides and pages play.

Times are true: pictures are taken at the times of the flight that they will be seen at. GIF counts in hundredths of a
second, so the pictures of one have unequal durations that add up.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rotorfault.base.errors import InputError, choices, missing_extra, short
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
LATE = 1e-3  # s by which the end may be missed that is asked for, as it is told in few digits


class Film(NamedTuple):
    """How a film is made."""

    speed: float = 1.0  # of the flight, 1 for real time
    fps: float = 30.0  # pictures a second
    width: int = 960  # pixels
    start: float | None = None  # s of the flight; its beginning if not given
    until: float | None = None  # s of the flight; its end if not given
    names: Mapping[str, str] = {}  # what the above are called where they were given, if otherwise

    def called(self, name: str) -> str:
        """What a field is called where it was given."""
        return self.names.get(name, name)

    def checked(self, gif: bool) -> Film:
        """The same, if it can be made.

        Raises
        ------
        InputError
            If a value is not allowed.
        """
        fastest = GIF_FASTEST if gif else FASTEST
        self._require("speed", Real, *SPEEDS, "times real time")
        self._require("fps", Real, 1.0, fastest, "pictures a second" + (" in a GIF" if gif else ""))
        self._require("width", Integral, NARROWEST, WIDEST, "pixels")
        for name in ("start", "until"):
            if getattr(self, name) is not None:
                self._require(name, Real, 0.0, 1e9, "s")
        if self.start is not None and self.until is not None and self.until <= self.start:
            raise InputError(
                f"{self.called('until')}: got {self.until:g}; allowed: a time after {self.called('start')}, "
                f"{self.start:g} s"
            )
        return self._replace(width=int(self.width))

    def _require(self, name: str, kind: type, low: float, high: float, unit: str) -> None:
        value = getattr(self, name)
        number = isinstance(value, kind) and not isinstance(value, bool)
        right = number and low <= float(getattr(self, name)) <= high
        # An odd number of pixels is no size of a video.
        if not right or (kind is Integral and int(getattr(self, name)) % 2):
            words = "an even whole number" if kind is Integral else "a number"
            raise InputError(
                f"{self.called(name)}: got {short(value)}; allowed: {words} from {low:g} to {high:g} {unit}"
            )


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
    film = film.checked(require_kind(path))
    times, ending = moments(data, film), path.suffix.lower()
    with warnings.catch_warnings(), Bar("drawing", len(times), "pictures") as bar:
        # A letter that the font lacks is drawn as a box, which says as much.
        warnings.filterwarnings("ignore", message="Glyph")
        animation = Animation(data, label, film.width, film.speed)

        def pictures() -> Iterator[NDArray[np.uint8]]:
            last = -1.0
            picture: NDArray[np.uint8] | None = None
            for number, time in enumerate(times):
                if picture is None or time != last:
                    picture, last = animation.picture(time), time
                yield picture
                bar.update(number + 1)

        write_atomically(in_folder(path), lambda temporary: WRITERS[ending](temporary, pictures(), film.fps))


def require_kind(path: Path) -> bool:
    """Whether a film is a GIF, by the ending of its file.

    Raises
    ------
    InputError
        If the ending tells no kind of film.
    """
    if path.suffix.lower() not in WRITERS:
        raise InputError(f"{path}: its ending tells no kind of film ({choices(WRITERS)})")
    return path.suffix.lower() == ".gif"


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
    until = last if film.until is None else film.until
    for name, value in (("start", film.start), ("until", film.until)):
        latest = last + LATE if name == "until" else last
        if value is not None and not records[0] <= value <= latest:
            raise InputError(
                f"{film.called(name)}: got {value:g}; allowed: a time of the flight, {records[0]:g} to {last:g} s"
            )
    until = min(until, last)
    count = math.floor((until - start) / film.speed * film.fps + 1e-6) + 1
    if count > MOST_PICTURES:
        raise InputError(
            f"the film would have {count:,} pictures; allowed: {MOST_PICTURES:,}; take less of the flight with "
            f"{film.called('start')} and {film.called('until')}, or a greater {film.called('speed')}"
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
