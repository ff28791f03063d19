"""Flights as films: what is seen, at which times, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import assert_refused, run
from exported import flight, mean_flight
from PIL import Image

import rotorfault as rf
from rotorfault.report.animation import Animation
from rotorfault.report.film import Film, moments
from rotorfault.report.vehicle_view import CAMERA, Camera, rotations


def test_the_camera_sees_right_up_and_near() -> None:
    from_the_right = Camera(azimuth=-90.0, elevation=0.0)  # looks along +y
    assert np.allclose(from_the_right.seen(np.array([1.0, 5.0, 2.0])), (1.0, 2.0))
    assert np.allclose(CAMERA.axes @ CAMERA.axes.T, np.eye(3))
    assert CAMERA.nearness(np.array([1.0, -1.0, 1.0])) > CAMERA.nearness(np.zeros(3))


def test_rotations_are_those_of_the_quaternions() -> None:
    angles = np.array([0.3, -0.2, 0.7])
    q = rf.Quat.from_euler(rf.Vec3(*angles))
    (found,) = rotations(np.array([[q.w, q.x, q.y, q.z]]))
    wanted = q.matrix()
    rows = [[getattr(wanted, f"{a}{b}") for b in "xyz"] for a in "xyz"]
    assert np.allclose(found, rows)


def animation(width: int = 480) -> Animation:
    return Animation(flight().records(), "a flight", width, 1.0)


def test_a_picture_is_of_its_time_whatever_was_drawn_before() -> None:
    one, other = animation(), animation()
    for time in (0.0, 0.3, 0.11):
        one.picture(time)
    assert np.array_equal(one.picture(0.2), other.picture(0.2))
    assert not np.array_equal(one.picture(0.2), one.picture(0.0))
    assert one.picture(0.2).shape == (270, 480, 3)
    assert np.array_equal(one.picture(-5.0), one.picture(0.0))


def pixels(picture: Any, colour: tuple[int, int, int], off: int = 25) -> int:
    return int((np.abs(picture.astype(int) - colour).max(axis=-1) < off).sum())


def test_a_rotor_changes_its_colour_with_its_loss() -> None:
    """The bar of the rotor is the largest area that does."""
    drawn = animation(960)
    before, after = drawn.picture(0.05), drawn.picture(0.2)
    yellow = (235, 201, 57)  # of 30 %
    assert pixels(before[290:430, 640:800], yellow) == 0
    assert pixels(after[290:430, 640:800], yellow) > 500


@pytest.mark.parametrize("kind", ["gif", "mp4"])
def test_a_film_is_as_long_as_the_flight_at_its_speed(kind: str, tmp_path: Path) -> None:
    path = flight().animate(tmp_path / f"a.{kind}", speed=0.5, fps=20.0, width=320, until=0.3)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    # 0.3 s at half speed, its first and its last picture, and a second at the end.
    wanted = 1.0 + 0.6 + 1 / 20
    if kind == "gif":
        with Image.open(path) as film:
            assert film.size == (320, 180)
            assert film.info["loop"] == 0
            durations = []
            for number in range(film.n_frames):  # type: ignore[attr-defined]
                film.seek(number)
                durations.append(film.info["duration"])
        assert sum(durations) == pytest.approx(1000.0 * wanted)
    else:
        import imageio_ffmpeg

        about = next(imageio_ffmpeg.read_frames(path))
        assert about["size"] == (320, 180)
        assert about["fps"] == 20.0
        assert about["duration"] == pytest.approx(wanted, abs=0.051)
        assert about["codec"] == "h264"


def test_pictures_are_taken_at_true_times() -> None:
    data = flight().records()
    times = moments(data, Film(speed=0.5, fps=10.0, start=0.1))
    assert np.allclose(times[:3], (0.1, 0.15, 0.2))
    assert times[-11:] == [0.5] * 11  # the end itself, and a second
    assert len(moments(data, Film(fps=30.0))) == 15 + 1 + 30


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("a.avi", {}, r"its ending tells no kind of film \(allowed: .gif, .mp4\)"),
        ("a.gif", {"fps": 60.0}, "fps: got 60.0; allowed: a number from 1 to 50 pictures a second in a GIF"),
        ("a.mp4", {"fps": 0.0}, "fps: got 0.0; allowed: a number from 1 to 120 pictures a second"),
        ("a.gif", {"speed": float("nan")}, "speed: got nan; allowed: a number from 0.001 to 1000 times real time"),
        ("a.gif", {"width": 100}, "width: got 100; allowed: an even whole number from 320 to 3840 pixels"),
        ("a.gif", {"width": 400.0}, "width: got 400.0; allowed: an even whole number"),
        ("a.gif", {"width": 321}, "width: got 321; allowed: an even whole number"),
        ("a.gif", {"start": 3.0}, "start: got 3; allowed: a time of the flight, 0 to 0.5 s"),
        ("a.gif", {"start": 0.3, "until": 0.2}, "until: got 0.2; allowed: a time after start, 0.3 s"),
        ("a.gif", {"start": 0.2, "until": 0.2}, "until: got 0.2; allowed: a time after start, 0.2 s"),
        ("a.gif", {"until": 9.0}, "until: got 9; allowed: a time of the flight, 0 to 0.5 s"),
        ("a.mp4", {"fps": 120.0, "speed": 0.001, "width": 320}, None),
        ("none/a.gif", {"until": 0.01}, "there is no folder"),
    ],
)
def test_bad_input_is_one_clear_line(name: str, given: dict[str, Any], message: str | None, tmp_path: Path) -> None:
    if message is None:
        assert len(moments(flight().records(), Film(**given))) > 50_000
        given = {"fps": 120.0, "speed": 0.001, "until": 0.5, "width": 320}
        with pytest.raises(rf.InputError, match="allowed: 100,000"):
            moments(rf.fly("paper-set-point", settings={"duration": 1.0}).records(), Film(fps=120.0, speed=0.001))
        return
    with pytest.raises(rf.InputError, match=message):
        flight().animate(tmp_path / name, **given)
    assert not list(tmp_path.iterdir())


def test_mean_names_and_flights_of_one_record_are_drawn(tmp_path: Path) -> None:
    assert mean_flight().animate(tmp_path / "a.gif", fps=2.0, width=320).stat().st_size > 5000
    one = rf.Flight(flight().data.isel(time=slice(1)), flight().outcome, flight().scores)
    assert one.animate(tmp_path / "b.gif", fps=2.0, width=320).stat().st_size > 1000


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--fps", "0"], "--fps: got 0.0; allowed: a number from 1 to 50"),
        (["--width", "319"], "--width: got 319; allowed: an even whole number"),
        (["--from", "-1"], "--from: got -1.0; allowed: a number from 0"),
        (["--from", "2", "--until", "1"], "--until: got 1; allowed: a time after --from, 2 s"),
    ],
)
def test_the_command_refuses_options_by_their_names_before_it_reads(
    option: list[str], message: str, tmp_path: Path
) -> None:
    assert_refused(run("animate", "none.nc", *option, cwd=tmp_path), f"rotorfault: {message}")


def test_sizes_may_be_numbers_of_numpy() -> None:
    assert Film(width=np.int64(400), fps=np.float32(20.0)).checked(gif=True).width == 400
