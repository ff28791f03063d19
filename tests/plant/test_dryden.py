"""Gusts: their statistics against the spectra of the standard, and what they may not change.

The filters are looked at from outside: gusts that came out, or the response of the block to single numbers put in.
Neither the filters' states nor their coefficients are named here.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from gates import needs_simd
from numpy.typing import NDArray
from scipy import linalg, signal

from rotorfault.base.errors import InputError
from rotorfault.engine import load_engine
from rotorfault.engine.batch import CHUNK, drive_rows, no_watch
from rotorfault.engine.noise import FIRST_GUST, GUSTS, SENSOR_NOISE, Noise
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.signals import Command
from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.plant import WINDS, FirstNormals, no_first_normals
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
WIND = slice(SIGNAL_NAMES.index("wind.x"), SIGNAL_NAMES.index("wind.x") + 3)
AXES = ("along", "across", "up")
MEAN = (6.0, -8.0, 0.0)  # m/s: 10 m/s along (0.6, -0.8)
H, W20 = 20.0, 15.0  # m, m/s
each_axis = pytest.mark.parametrize("axis", range(3), ids=AXES)


def dryden(**settings: Any) -> Any:
    given = {"velocity_W": MEAN, "altitude": H, "wind_at_6m": W20} | settings
    return WINDS["dryden"](WINDS["dryden"].Settings(**given))


def expected(altitude: float = H, w20: float = W20) -> tuple[Array, Array]:
    """Standard deviations [m/s] and scale lengths [m] of u, v, w, typed from the standard, all of it in feet."""
    h = altitude / 0.3048
    low = 0.177 + 0.000823 * h
    sigma_w = 0.1 * (w20 / 0.3048)
    sigma = np.array([sigma_w / low**0.4, sigma_w / low**0.4, sigma_w])
    return 0.3048 * sigma, 0.3048 * np.array([h / low**1.2, h / low**1.2, h])


SIGMA, LENGTH = expected()


def in_gust_axes(velocity: Array, mean: tuple[float, float, float] = MEAN) -> Array:
    """Gusts along, across and up from velocities of the air in world axes, shape (3, ...)."""
    along = np.array([mean[0], mean[1], 0.0]) / math.hypot(mean[0], mean[1])
    frame = np.array([along, np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, 1.0]])
    return np.tensordot(frame, velocity - np.reshape(mean, (3,) + (1,) * (velocity.ndim - 1)), axes=1)


def blow(wind: Any, period: float, steps: int, flights: int, seed: int) -> Array:
    """Gusts at the sampling instants in their own axes, shape (steps + 1, 3, flights); the first before any step."""
    draw = np.random.default_rng(seed)
    numbers = wind.parameters()
    memory = wind.initial(unflatten(no_first_normals(), list(draw.standard_normal((6, flights)))), numbers, period)
    seen = []
    for k in range(steps + 1):
        seen.append(np.array(flatten(wind.at(k * period, memory, numbers).velocity_W)))
        memory = wind.step(memory, Vec3.of(draw.standard_normal((3, flights))), numbers, period)
    return np.moveaxis(in_gust_axes(np.moveaxis(np.array(seen), 1, 0)), 1, 0)


def recursion(wind: Any, period: float) -> tuple[Array, Array, Array, Array]:
    """The block as x' = A x + B n, gust = C x, x0 = D m: read off its responses to single ones, for it is linear."""
    numbers, template = wind.parameters(), wind.initial(no_first_normals(), wind.parameters(), period)
    size = len(flatten(template))

    def step(x: Array, n: Array) -> Array:
        return np.array(flatten(wind.step(unflatten(template, x.tolist()), Vec3.of(n.tolist()), numbers, period)))

    def gust(x: Array) -> Array:
        air = wind.at(0.0, unflatten(template, x.tolist()), numbers)
        return in_gust_axes(np.array(flatten(air.velocity_W)))

    def start(m: Array) -> Array:
        return np.array(flatten(wind.initial(unflatten(no_first_normals(), m.tolist()), numbers, period)))

    rest, still = np.zeros(size), np.zeros(3)
    A = np.column_stack([step(x, still) for x in np.eye(size)])
    B = np.column_stack([step(rest, n) for n in np.eye(3)])
    return A, B, np.column_stack([gust(x) for x in np.eye(size)]), np.column_stack([start(m) for m in np.eye(6)])


def continuous(axis: int) -> tuple[Array, Array, Array]:
    """The standard's shaping filter of unit variance in continuous time, as x_dot = F x + g white noise, y = h x."""
    tau = LENGTH[axis] / 10.0
    if axis == 0:  # sqrt(2 tau)/(1 + tau s)
        return np.array([[-1.0 / tau]]), np.array([[1.0]]), np.array([[math.sqrt(2.0 / tau)]])
    # sqrt(tau) (1 + sqrt(3) tau s)/(1 + tau s)^2 in controllable form
    F = np.array([[0.0, 1.0], [-1.0 / tau**2, -2.0 / tau]])
    return F, np.array([[0.0], [1.0]]), math.sqrt(tau) / tau**2 * np.array([[1.0, math.sqrt(3.0) * tau]])


# ------------------------------------------------------------------------------------------------------- statistics


@pytest.mark.parametrize("period", [0.001, 0.1])
def test_variance(period: float) -> None:
    """Of the first sample, before any step, and of later ones: over independent flights, within four deviations."""
    flights = 40_000
    gusts = blow(dryden(), period, 150, flights, seed=1) / SIGMA[:, None]
    for k in (0, 1, 30, 150):
        assert np.abs(gusts[k].var(axis=1) - 1.0).max() < 4.0 * math.sqrt(2.0 / flights), k
        assert np.abs(gusts[k].mean(axis=1)).max() < 4.0 / math.sqrt(flights), k


@pytest.mark.parametrize("period", [1e-4, 0.001, 0.01, 0.1, 1.0, 20.0])
def test_variance_without_chance(period: float) -> None:
    """The stationary covariance of the recursion, by Lyapunov's equation: sigma^2, whatever the period; and the
    start has that very covariance, hidden states included."""
    A, B, C, D = recursion(dryden(), period)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T, method="direct")
    np.testing.assert_allclose(C @ P @ C.T, np.diag(SIGMA**2), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(D @ D.T, P, atol=1e-9)


@pytest.mark.parametrize("period", [0.001, 0.1, 2.0])
@each_axis
def test_autocorrelation_is_that_of_the_continuous_filter(period: float, axis: int) -> None:
    """Matrix exponential and Lyapunov's equation of the standard's filter, against the recursion read off."""
    A, B, C, _ = recursion(dryden(), period)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T, method="direct")
    F, g, h = continuous(axis)
    Q = linalg.solve_continuous_lyapunov(F, -g @ g.T)
    for k in (0, 1, 2, 3, 10, 100, 1000):
        found = (C @ np.linalg.matrix_power(A, k) @ P @ C.T)[axis, axis] / SIGMA[axis] ** 2
        wanted = (h @ linalg.expm(F * k * period) @ Q @ h.T).item()
        assert found == pytest.approx(wanted, abs=1e-9), k


@each_axis
def test_autocorrelation_as_sampled(axis: int) -> None:
    """At a few lags over a long batch; the closed form of the lateral one is negative beyond two time constants."""
    period, steps, flights = 0.2, 6000, 16
    gusts = blow(dryden(), period, steps, flights, seed=2)[:, axis] / SIGMA[axis]
    tau = LENGTH[axis] / 10.0
    # Neighbours within about two time constants count as one.
    spread = 4.0 * math.sqrt(4.0 * tau / (period * steps * flights))
    for lag in (1, 5, 20, 60):
        t = lag * period / tau
        wanted = math.exp(-t) * (1.0 if axis == 0 else 1.0 - 0.5 * t)
        found = np.mean(gusts[lag:] * gusts[:-lag])
        assert abs(found - wanted) < spread, lag


@each_axis
def test_power_spectral_density(axis: int) -> None:
    """Welch's estimate against the formula of the standard, a decade to each side of the corner frequency."""
    # The lengths differ by a factor of four and more: a period for each axis, far below its time constant.
    tau = LENGTH[axis] / 10.0
    period, flights, length = tau / 50.0, 128, 8192
    gusts = blow(dryden(), period, 2 * length - 1, flights, seed=3)[:, axis]
    f, density = signal.welch(gusts, fs=1.0 / period, nperseg=length, axis=0, detrend=False)
    density = density.mean(axis=1)
    omega = 2.0 * np.pi * f
    Omega = omega / 10.0  # rad/m
    s, L = SIGMA[axis], LENGTH[axis]
    spatial = {
        True: s**2 * 2.0 * L / np.pi / (1.0 + (L * Omega) ** 2),
        False: s**2 * L / np.pi * (1.0 + 3.0 * (L * Omega) ** 2) / (1.0 + (L * Omega) ** 2) ** 2,
    }[axis == 0]
    wanted = spatial * 2.0 * np.pi / 10.0  # per Hz, one-sided
    edges = np.geomspace(0.1, 10.0, 11) / tau
    for low, high in itertools.pairwise(edges):
        band = (omega >= low) & (omega < high)
        assert band.any()
        # 384 overlapping segments: 5 % on a single line, and 2 % of aliasing at the upper end.
        spread = 0.2 / math.sqrt(band.sum()) + 0.025
        assert abs(density[band].sum() / wanted[band].sum() - 1.0) < spread, (low, high)


def test_axes_are_independent() -> None:
    gusts = blow(dryden(), 0.1, 20, 40_000, seed=4)[-1] / SIGMA[:, None]
    assert np.abs(np.corrcoef(gusts) - np.eye(3)).max() < 4.0 / math.sqrt(40_000)


@pytest.mark.parametrize("altitude", [3.048, 10.0, 100.0, 304.8])
def test_intensity_and_scale_at_other_heights(altitude: float) -> None:
    A, B, C, _ = recursion(dryden(altitude=altitude, wind_at_6m=7.0), 0.1)
    sigma, length = expected(altitude, 7.0)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T, method="direct")
    np.testing.assert_allclose(C @ P @ C.T, np.diag(sigma**2), rtol=1e-8, atol=1e-8)
    poles = np.sort(np.abs(linalg.eigvals(A)))
    np.testing.assert_allclose(poles, np.sort(np.exp(-0.1 * 10.0 / length[[0, 1, 1, 2, 2]])), rtol=1e-6)


def test_at_a_thousand_feet_turbulence_is_isotropic() -> None:
    """The standard's low-altitude model meets the one above there."""
    sigma, length = expected(304.8)
    numbers = dryden(altitude=304.8).parameters()
    assert numbers.sigma_level == pytest.approx(numbers.sigma_up)
    assert numbers.length_level == pytest.approx(numbers.length_up)
    np.testing.assert_allclose([sigma[0], length[0]], [numbers.sigma_up, numbers.length_up], rtol=1e-12)


# -------------------------------------------------------------------------------------------------- the mean wind


def test_without_intensity_it_is_the_constant_wind() -> None:
    """Exactly, flown in closed loop."""
    still = {"kind": "dryden", "velocity_W": [2.0, -1.0, 0.3], "wind_at_6m": 0.0}
    steady = {"kind": "constant", "velocity_W": [2.0, -1.0, 0.3]}
    np.testing.assert_array_equal(run(short(wind=still), "python"), run(short(wind=steady), "python"))


def test_without_a_mean_wind_gusts_lie_along_x_and_come_with_the_least_speed() -> None:
    calm = dryden(velocity_W=(0.0, 0.0, 0.0), airspeed_min=2.0)
    numbers = calm.parameters()
    memory = calm.initial(FirstNormals(Vec3(1.0, 0.0, 0.0), zeros()), numbers, 0.1)
    np.testing.assert_allclose(flatten(calm.at(0.0, memory, numbers).velocity_W), [SIGMA[0], 0.0, 0.0])
    after = calm.step(memory, zeros(), numbers, 0.1)
    x = calm.at(0.0, after, numbers).velocity_W.x
    assert x == pytest.approx(SIGMA[0] * math.exp(-0.1 * 2.0 / LENGTH[0]))


def test_a_faster_mean_wind_carries_gusts_past_faster() -> None:
    """Twice the wind over half the period is the same recursion."""
    slow, fast = recursion(dryden(), 0.1), recursion(dryden(velocity_W=(12.0, -16.0, 0.0)), 0.05)
    for a, b in zip(slow[:2], fast[:2], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)
    # A vertical mean wind counts as speed, but not as direction.
    numbers = dryden(velocity_W=(0.0, 3.0, 4.0)).parameters()
    assert (numbers.along_x, numbers.along_y) == (0.0, 1.0)


# ------------------------------------------------------------------------------------- in flight: the same numbers


def short(**tables: Any) -> Scenario:
    return scenario_from(
        {
            "name": "gusty",
            "vehicle": "paper",
            "duration": 0.3,
            "period": 0.005,
            "step": 0.005,
            "seed": 7,
            "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
            "controller": {"kind": "smc", "preset": "none"},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": 0.2}],
            "wind": {"kind": "dryden", "wind_at_6m": 15.0, "altitude": 5.0},
        }
        | tables,
        "test",
    )


def run(flown: Scenario, engine: str) -> Array:
    return load_engine(engine)(assemble(flown), no_watch).signals[:, :, 0]


@pytest.mark.parametrize("sensors", ["ideal", "noisy"])
@pytest.mark.parametrize("engine", [pytest.param("simd", marks=needs_simd), "numpy", "python"])
def test_a_flight_does_not_depend_on_its_batch(engine: str, sensors: str) -> None:
    base = short(sensors=sensors)
    alone = run(base, engine)
    others = [
        short(sensors=sensors, seed=k, wind={"kind": "dryden", "altitude": 3.0 + k, "velocity_W": [k, 1.0, 0.0]})
        for k in (1, 2, 3, 4)
    ]
    together = load_engine(engine)(assemble_all([*others[:2], base, *others[2:]]), no_watch).signals
    np.testing.assert_array_equal(together[:, :, 2], alone)
    assert np.isfinite(together).all()
    assert all(np.abs(together[:, WIND, k] - alone[:, WIND]).max() > 0.1 for k in (0, 1, 3, 4))


@needs_simd
@pytest.mark.parametrize("step", [0.005, 0.0025, 0.001])
def test_compiled_it_is_the_same_flight(step: float) -> None:
    """One function for the period, or two where it has many integration steps; over more than one chunk of noise."""
    flown = short(step=step, duration=0.005 * (CHUNK + 20), sensors="noisy", fault=[])
    found, wanted = run(flown, "simd"), run(flown, "python")
    size = np.maximum(1.0, np.abs(wanted).max(axis=0))
    worst = (np.abs(found - wanted) / size).max(axis=0)
    assert worst[:3].max() <= 1e-9
    assert worst[WIND].max() <= 1e-9
    assert worst.max() <= 5e-9, SIGNAL_NAMES[int(np.argmax(worst))]


@pytest.mark.parametrize("engine", [pytest.param("simd", marks=needs_simd), "python"])
def test_the_air_moves_on_once_in_a_sampling_period(engine: str) -> None:
    """However many integration steps there are in it."""
    winds = [run(short(step=0.005 / n, duration=0.1), engine)[:, WIND] for n in (1, 2, 5)]
    np.testing.assert_allclose(winds[0], winds[1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(winds[0], winds[2], rtol=0.0, atol=1e-12)
    assert (np.abs(np.diff(winds[0], axis=0)) > 0.0).all()


def test_the_recorded_wind_is_the_block_stepped_by_hand() -> None:
    flown = short(duration=0.1)
    batch = assemble(flown)
    wind, numbers = batch.loop.plant.wind, batch.parameters.plant.wind
    first = unflatten(no_first_normals(), Noise(batch.seeds, FIRST_GUST).draw(1)[0, :, 0].tolist())
    memory = wind.initial(first, numbers, 0.005)
    assert flatten(memory) == flatten(batch.state.plant.air)
    found = run(flown, "python")[:, WIND]
    for k, normals in enumerate(Noise(batch.seeds, GUSTS).draw(20)[:, :, 0].tolist()):
        memory = wind.step(memory, Vec3.of(normals), numbers, 0.005)
        assert found[k].tolist() == flatten(wind.at(0.0, memory, numbers).velocity_W)


def test_gusts_push_by_drag() -> None:
    """Level in hover, velocity approaches that of the air with the rate k_d/m, period by period."""
    batch = assemble(short())
    plant, numbers, T = batch.loop.plant, batch.parameters.plant, 0.005
    rate = numbers.vehicle.linear_drag / numbers.vehicle.mass
    state, v = batch.state.plant, np.zeros(3)
    hover = Command(state.rotors, zeros())
    for k in range(20):
        state = plant.blown(state, Vec3(0.3, -1.0, 0.5), numbers, T)
        air = np.array(flatten(plant.observe(state, k * T, numbers).air.velocity_W))
        v = air + (v - air) * math.exp(-rate * T)
        state = plant.step(state, hover, k * T, numbers, T)
    np.testing.assert_allclose(flatten(plant.observe(state, 0.1, numbers).measurement.v_W), v, atol=1e-9)
    assert np.abs(v).min() > 1e-3


# ------------------------------------------------------------------------------------------------ streams of numbers


def rows_of(**tables: Any) -> Array:
    return np.concatenate([rows for _, rows in drive_rows(assemble(short(duration=0.005 * (CHUNK + 9), **tables)))])


def test_gusts_and_sensor_noise_leave_each_other_alone() -> None:
    """Each has its rows only where it is there, and the same numbers whatever else there is."""
    none = rows_of(wind="none")
    gusts, noise, both = rows_of(), rows_of(wind="none", sensors="noisy"), rows_of(sensors="noisy")
    assert [rows.shape[1] for rows in (none, gusts, noise, both)] == [12, 15, 24, 27]
    np.testing.assert_array_equal(both[:, :24], noise)
    np.testing.assert_array_equal(both[:, 24:], gusts[:, 12:])
    np.testing.assert_array_equal(run(short(sensors="noisy"), "python")[:, WIND], run(short(), "python")[:, WIND])


def test_sensor_noise_has_no_words_but_seed_and_index() -> None:
    wanted = Noise(((7, 4711),)).draw(30)[:, :, 0]
    np.testing.assert_array_equal(Noise(((8, 0), (7, 4711)), SENSOR_NOISE).draw(30)[:, :, 1], wanted)
    assert np.abs(Noise(((7, 4711),), GUSTS).draw(30)[:, :, 0] - wanted[:, :3]).min() > 1e-6


def test_streams_are_independent() -> None:
    """Of one flight, and of flights whose seeds are near: no two streams share numbers."""
    seeds = ((7, 0), (7, 1), (8, 0), (2**33 + 7, 0))
    count = 6000
    drawn = [Noise(seeds, stream).draw(count // stream.width) for stream in (SENSOR_NOISE, GUSTS, FIRST_GUST)]
    columns = np.concatenate([part.reshape(count, len(seeds)).T for part in drawn])
    assert np.abs(np.corrcoef(columns) - np.eye(len(columns))).max() < 5.0 / math.sqrt(count)
    pieces = Noise(seeds, GUSTS)
    again = np.concatenate([pieces.draw(1), pieces.draw(29)])
    np.testing.assert_array_equal(again, Noise(seeds, GUSTS).draw(30))


def test_a_wind_without_memory_has_no_place_in_the_state() -> None:
    for kind in ("none", "constant", "paper"):
        state = assemble(short(wind=kind)).state
        assert flatten(state.plant.air) == []
    gusty = assemble(short())
    assert len(flatten(gusty.state)) == len(flatten(state)) + 5
    assert structure(gusty.loop) == structure(assemble(short(seed=9)).loop)


# ------------------------------------------------------------------------------------------------- settings refused


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("altitude", 2.0, "greater than or equal to 3.048; got 2.0"),
        ("altitude", 400.0, "less than or equal to 304.8; got 400.0"),
        ("wind_at_6m", -1.0, "greater than or equal to 0; got -1.0"),
        ("airspeed_min", 0.0, "greater than or equal to 0.1; got 0.0"),
        ("airspeed_min", math.nan, "finite"),
        ("heigth", 5.0, "unknown key"),
    ],
)
def test_bad_settings_are_refused_in_one_line(key: str, value: float, words: str) -> None:
    with pytest.raises(InputError, match=words) as error:
        short(wind={"kind": "dryden", key: value})
    message = str(error.value)
    assert message.startswith(f"test: wind.{key}: ")
    assert "\n" not in message
