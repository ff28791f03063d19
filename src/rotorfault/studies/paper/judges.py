"""How single claims of the paper are judged; each judge takes results and gives readings, the project's own first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rotorfault.maths.arrays import ANGLES, AXES, Array
from rotorfault.studies.paper.measures import COST_READINGS, LEAN, LEVEL
from rotorfault.studies.paper.verdicts import Reading, below, extra, fate, lost, lower, survived, text
from rotorfault.studies.runs import Result

MATCHED = "matched bandwidth"
ONSET = 1.8  # s: of the faults, in all cases
SECONDS = 5.0  # s: "within seconds", "in a short period"
CHATTER_SHARE = 0.05  # of the steady commands' power above the loop's bandwidth
CHATTER_SCALE = 0.1  # of the total variation that discontinuous switching makes
LOSS_GAP = 0.05  # of a believed loss from the true one
OVERSHOOT = 0.05  # of a step
NO_CHATTER = 1e-6  # of the power: what is less is none, and no law has less of it than another
SAME = 2.0  # a residual angle counts as reproduced within this factor


def cost(ours: Result, theirs: Result, matched: Result) -> list[Reading]:
    """Claim 1: lower cost, by comparison and by reading of the cost."""

    def own(result: Result) -> float | None:
        value = result.summary["cost"]
        return None if value is None else float(value)

    readings = lower("", ours, theirs, own) + lower(MATCHED, ours, matched, own)
    for name in COST_READINGS:
        readings += lower(name, ours, theirs, extra("cost_readings", name))
    return _once(readings)


def _once(readings: Sequence[Reading]) -> list[Reading]:
    """Without repetitions, which lost flights make."""
    return list(dict.fromkeys(readings))


def settled_within(limit: float) -> Callable[[Result], list[Reading]]:
    """Settles within 2 % on all axes earlier than `limit` in s."""

    def judge(ours: Result) -> list[Reading]:
        value = ours.summary["settle_time"]["overall"]
        measured = f"{text(value)} s" if survived(ours) else fate(ours)
        return [Reading("", measured, below(value, limit))]

    return judge


def residual(angles: Sequence[int], paper: Sequence[float], names: Sequence[str]) -> Callable[..., list[Reading]]:
    """Residual angles within a factor of the paper's; one flight per reading, in the order of `names`."""

    def judge(*results: Result) -> list[Reading]:
        readings = []
        for name, result in zip(names, results, strict=True):
            values = [abs(result.extra["attitude_end"][angle]) for angle in angles]
            near = all(p / SAME <= v <= p * SAME for v, p in zip(values, paper, strict=True))
            measured = ", ".join(f"{value:.4f}" for value in values) if survived(result) else fate(result)
            readings.append(Reading(name, measured, survived(result) and near))
        return readings

    return judge


def errors(ours: Result, theirs: Result, *matched: Result) -> list[Reading]:
    """Claim 3: mean square errors lower on most of the six coordinates, and in sum of the position axes."""

    def judged(name: str, other: Result, kind: str) -> list[Reading]:
        whole = lower(name, ours, other, lambda r: sum(r.summary["position_mse"].values()))
        if not (survived(ours) and survived(other)):
            return whole
        pairs = [(ours.summary["position_mse"][a], other.summary["position_mse"][a]) for a in AXES]
        if kind:
            first, second = (result.summary.get(kind) or result.extra[kind] for result in (ours, other))
            pairs += [(first[a], second[a]) for a in ANGLES]
        won = sum(below(a, b) for a, b in pairs)
        measured = f"{whole[0].measured} m^2; lower on {won} of {len(pairs)} coordinates"
        return [Reading(name, measured, whole[0].holds and 2 * won > len(pairs))]

    readings = judged("", theirs, "attitude_mse") + judged("position axes only", theirs, "")
    readings += judged("angles against the demand", theirs, "attitude_demand_mse")
    for other in matched:
        readings += judged(MATCHED, other, "attitude_mse")
    return _once(readings)


def smooth(ours: Result, scale: Result) -> list[Reading]:
    """Claim 4: rotor commands free of chattering; `scale` is the same law with discontinuous switching."""
    if not survived(ours):
        return [Reading("", fate(ours), False)]
    share, variation = ours.extra["chattering"]["share_above_band"], _variation(ours)
    if share is None or variation is None:
        return [Reading("", "flight too short", False)]
    band = ours.extra["chattering"]["band"]
    measured = f"{100.0 * share:.2g} % of power above {band[0]:.3g} Hz, total variation {variation:.3g} N/s per rotor"
    most = _variation(scale) if survived(scale) else None
    measured += f" (discontinuous: {text(most) + ' N/s' if most is not None else fate(scale)})"
    return [
        Reading(
            "", measured, below(share, CHATTER_SHARE) and (most is None or below(variation, CHATTER_SCALE * most))
        )
    ]


_variation = extra("chattering", "steady_total_variation")


def less_chattering(ours: Result, theirs: Result, sgn: Result) -> list[Reading]:
    """Section 5.2: less chattering than SMC; `sgn` is SMC with discontinuous switching."""

    def share(result: Result) -> float | None:
        value: float | None = extra("chattering", "share_above_band")(result)
        return None if value is None else max(value, NO_CHATTER)

    return [
        *lower("", ours, theirs, _variation),
        *lower("power above the loop's bandwidth", ours, theirs, share),
        *lower("SMC with sgn", ours, sgn, _variation),
    ]


def detected(*results: Result) -> list[Reading]:
    """Claim 6: both faulty rotors flagged, no other, losses right within 0.05, and flight goes on.

    Delays and losses are the loop's own scores, counted at every sampling instant whatever is recorded.
    """
    parts, holds = [], True
    for result in results:
        detections = result.summary["detections"]
        delays = [d["delay"] for d in detections]
        gaps = [
            None if d["loss_estimated"] is None else abs(d["loss_estimated"] - d["loss_true"]) for d in detections
        ]
        right = {d["rotor"] for d in detections} == {1, 3} and None not in delays
        right = right and all(below(gap, LOSS_GAP) for gap in gaps)
        right = right and result.summary["false_alarms"] == 0 and survived(result)
        after = "/".join("never" if delay is None else f"{1e3 * delay:.0f}" for delay in delays)
        error = max((gap for gap in gaps if gap is not None), default=None)
        measured = f"{after} ms, loss error {text(error, 2)}, false alarms {result.summary['false_alarms']}"
        parts.append(f"{result.run.id}: {measured}{'' if survived(result) else ', ' + fate(result)}")
        holds = holds and right
    return [Reading("", "; ".join(parts), holds)]


def range_of(signal: str) -> Callable[..., list[Reading]]:
    """Claim 7: range of a signal smaller than SMC's."""

    def judge(ours: Result, theirs: Result, *matched: Result) -> list[Reading]:
        readings = lower("", ours, theirs, extra(signal, "range"))
        readings += lower("without the extreme percents", ours, theirs, extra(signal, "range_98"))
        readings += lower("from 5 s on", ours, theirs, extra(signal, "range_steady"))
        for other in matched:
            readings += lower(MATCHED, ours, other, extra(signal, "range"))
        return _once(readings)

    return judge


def calmer(ours: Result, theirs: Result, matched: Result) -> list[Reading]:
    """Claim 8: roll and pitch travel less, and the attitude settles earlier."""
    readings = []
    for name, other in (("", theirs), (MATCHED, matched)):
        way = lower(name, ours, other, lambda r: sum(r.extra["attitude_path"][:2]))
        time = lower(name, ours, other, extra("attitude_settle_time"))
        for a, b in zip(way, time, strict=True):
            measured = a.measured if a == b else f"way of roll and pitch: {a.measured} rad; settling: {b.measured} s"
            readings.append(Reading(a.name, measured, a.holds and b.holds))
    return _once(readings)


def back(name: str) -> Callable[[Result], list[Reading]]:
    """Claim 10: after every switch of the square wave the error is small again within seconds."""

    def judge(ours: Result) -> list[Reading]:
        times = (ours.extra["returns"] or {}).get(name) or []
        if not survived(ours) or not times:
            return [Reading("", fate(ours) if not survived(ours) else "no switch was flown", False)]
        finite = [time for time in times if time is not None]
        longest = max(finite) if len(finite) == len(times) else None
        inside = sum(below(time, SECONDS) for time in finite)
        measured = f"longest {text(longest)} s, median {text(float(np.median(finite))) if finite else 'never'} s; "
        measured += f"{inside} of {len(times)} within {SECONDS:g} s"
        return [Reading("", measured, below(longest, SECONDS))]

    return judge


def no_reaching(*results: Result) -> list[Reading]:
    """Claim 11: ROISMC is never outside its layer before the faults, where SMC, started alike, is.

    That sigma starts at 0 is so by construction and decides nothing. A case in which SMC has no reaching phase either
    (case 2 starts on its reference) shows nothing about one that is missing.

    Parameters
    ----------
    results : Result
        ROISMC's flights, then SMC's, in the same order of cases.
    """
    half = len(results) // 2
    parts, holds = [], []
    for ours, theirs in zip(results[:half], results[half:], strict=True):
        own, other = _outside_at_first(ours), _outside_at_first(theirs)
        said = f"{ours.run.id}: outside for {100 * own:.2g} % of the time before the faults, SMC {100 * other:.2g} %"
        parts.append(said if other > 0.0 else f"{said}, which shows nothing")
        if other > 0.0:
            holds.append(own <= 0.0)
    start = max(r.extra["sigma_start"] for r in results[:half])
    return [Reading("", f"{'; '.join(parts)}; |sigma(0)| = {start:.2g}", bool(holds) and all(holds))]


def _outside_at_first(result: Result) -> float:
    """Share of the time before the faults that any axis is outside its layer."""
    layer = result.extra["outside_layer"]
    return float(max(layer["position_before_fault"], layer["attitude_before_fault"]))


def reached(constant: Result, moving: Result) -> list[Reading]:
    """Claim 12: s of SMC enters its layer within |s(0)|/K = sqrt(2 V(0))/K on every position axis."""
    first, second = _reached(constant), _reached(moving)
    return [
        Reading("", f"{first.measured}, {second.measured}", first.holds and second.holds),
        first._replace(name="constant reference"),
    ]


def _reached(result: Result) -> Reading:
    parts, holds = [], True
    for axis, entry in zip(AXES, result.extra["reaching"], strict=True):
        time, bound = entry["reached"], entry["bound"]
        # Without K there is no bound to keep, and what begins inside has nothing to reach.
        holds = holds and (time == 0.0 or below(time, bound))
        parts.append(f"{axis} {text(time)} of {text(bound)}")
    return Reading("", f"{result.run.id}: {', '.join(parts)} s", holds)


def angles_bounded(*results: Result) -> list[Reading]:
    """Assumption 1: |roll|, |pitch| below 90 degrees and |yaw| below 180 degrees throughout."""
    limits = np.array([np.pi / 2.0, np.pi / 2.0, np.pi])
    largest = np.max([r.extra["attitude_max"] for r in results], axis=0)
    measured = ", ".join(f"{name} {value:.2f}" for name, value in zip(ANGLES, largest, strict=True)) + " rad"
    fates = lost(results)
    return [Reading("", f"{measured}{'; ' + fates if fates else ''}", _within(largest, limits) and not fates)]


def _within(values: Array, limits: Array) -> bool:
    return all(below(float(value), float(limit)) for value, limit in zip(values, limits, strict=True))


def disturbance_bounded(group: str, unit: str, kinds: Mapping[str, str]) -> Callable[..., list[Reading]]:
    """Assumption 2: the largest disturbance stays below the bound that the law was given.

    Parameters
    ----------
    group : str
        Position or attitude.
    unit : str
    kinds : mapping
        What counts as the disturbance, by the name of the reading.
    """

    def judge(*results: Result) -> list[Reading]:
        bound = min(r.extra["disturbance_bound"][group] for r in results)
        readings = []
        for name, kind in kinds.items():
            each = [r.extra["disturbance"][kind] for r in results]
            measured = f"largest {', '.join(f'{value:.3g}' for value in each)}, bound {bound:.3g} {unit}"
            readings.append(Reading(name, measured, below(max(each), bound)))
        return readings

    return judge


def gust_effect(windy: Result, calm: Result) -> list[Reading]:
    """Section 5.3: gusts disturb x (travel) and z (elevation): larger errors than in still air, by the margin."""
    fates = lost((windy, calm))
    if fates:
        return [Reading("", fates, False)]
    ratios = [windy.summary["position_mse"][a] / max(calm.summary["position_mse"][a], 1e-300) for a in ("x", "z")]
    late = [windy.extra["late_rms_error"][i] / max(calm.extra["late_rms_error"][i], 1e-300) for i in (0, 2)]
    measured = f"x {ratios[0]:.2f}, z {ratios[1]:.2f} times the mean square error in still air"
    measured_late = f"x {late[0]:.2f}, z {late[1]:.2f} times the late root mean square error"
    return [
        Reading("", measured, below(1.0, min(ratios))),
        Reading("second half of the flight", measured_late, below(1.0, min(late))),
    ]


def accurate(*results: Result) -> list[Reading]:
    """Section 5, end: accurate in spite of wind and faults: settled or tracked, by `rotorfault.loop.scoring`."""
    ends = [f"{r.run.id} {r.summary['outcome']}" for r in results]
    return [Reading("", ", ".join(ends), all(r.summary["outcome"] in ("settled", "tracked") for r in results))]


def level(ours: Result) -> list[Reading]:
    """All angles within 0.1 rad of level and of the yaw reference for good within seconds, having been outside."""
    time = ours.extra["level_time"] if survived(ours) else None
    measured = f"{text(time)} s until within {LEVEL:g} rad for good" if survived(ours) else fate(ours)
    return [Reading("", measured, below(time, SECONDS) and time != 0.0)]


def level_again(ours: Result) -> list[Reading]:
    """The faults move the attitude from what trajectory and wind ask for, and it is back for good within seconds.

    The lean that is asked for is not the law's merit or fault, so it is taken off; a flight that the faults do not
    move shows nothing.
    """
    time, moved = ours.extra["lean_time"], ours.extra["lean_after"]
    if not survived(ours):
        return [Reading("", fate(ours), False)]
    measured = f"up to {text(moved)} rad off after the faults, within {LEAN:.2g} rad for good from {text(time)} s on"
    return [Reading("", measured, below(time, ONSET + SECONDS) and below(LEAN, moved))]


def monotone(ours: Result, theirs: Result) -> list[Reading]:
    """Section 5.1: smooth approach: no axis overshoots its step by more than 5 %."""
    if not survived(ours):
        return [Reading("", fate(ours), False)]
    own, other = max(ours.extra["overshoot"]), max(theirs.extra["overshoot"])
    return [Reading("", f"overshoot {100 * own:.2g} % (SMC {100 * other:.2g} %)", below(own, OVERSHOOT))]


def tracks_again(ours: Result, control: Result) -> list[Reading]:
    """Position is within 2 % of the span for good within seconds of the faults; without diagnosis it is not.

    Parameters
    ----------
    ours, control : Result
        With diagnosis, and without.
    """
    own, other = (_back(result) for result in (ours, control))
    measured = f"{own.measured}; without diagnosis: {other.measured}"
    measured += ", which passes too, so that this shows nothing" if other.holds else ""
    return [Reading("", measured, own.holds and not other.holds)]


def _back(result: Result) -> Reading:
    time = result.summary["settle_time"]["overall"]
    measured = f"from {text(time)} s on (faults at {ONSET:g} s)" if survived(result) else fate(result)
    return Reading("", measured, survived(result) and below(time, ONSET + SECONDS))
