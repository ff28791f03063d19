"""All measurements in one run, and what they say as a table: `rotorfault bench`."""

from __future__ import annotations

import importlib.util
import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rotorfault._version import __version__
from rotorfault.base.errors import InputError, how_to_install, missing_extra
from rotorfault.base.files import write_atomically
from rotorfault.base.progress import Say
from rotorfault.base.text_table import table_lines
from rotorfault.bench import accuracy, flights, latency, peers, sdre
from rotorfault.bench.peak import peak_flops
from rotorfault.engine import have_simd
from rotorfault.engine.machine import Machines

FLOPS = {"fma": 2, "fadd": 1, "fsub": 1, "fmul": 1, "fdiv": 1, "sqrt": 1}
"""Floating-point operations of an instruction; comparisons, selections and bit operations count as none."""
IDLE = "none"  # kind of instructions that only name places


def run(with_peers: bool, quick: bool, say: Say) -> dict[str, Any]:
    """Measure everything.

    Parameters
    ----------
    with_peers : bool
        Also the other simulators, in environments that are made on first use.
    quick : bool
        Fewer and shorter repetitions.
    say : callable
        Takes what is being measured, line by line.

    Returns
    -------
    dict
        ``machine``, ``single``, ``batch`` (by size), ``frames`` (by number of rotors), ``operations``, ``noise``,
        ``scaling``, ``sdre``, ``latency``, ``accuracy`` (None without heyoka), ``peers`` (empty unless asked for).

    Raises
    ------
    InputError
        If llvmlite is not installed.
    """
    if not have_simd():
        raise InputError(
            "the compiled engine needs llvmlite, which is not installed; nothing else is worth measuring"
        )
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    say("peak of fused multiplications and additions")
    peak = peak_flops(3 if quick else 9)
    results: dict[str, Any] = {
        "machine": {
            "processor": _processor(),
            "cores": cores,
            "python": platform.python_version(),
            "rotorfault": __version__,
            "peak_gflops_per_core": peak * 1e-9,
        },
        "single": flights.measure_single(quick, say),
        "batch": flights.measure_batches(cores, quick, say),
        "frames": flights.measure_frames(quick, say),
        "noise": flights.measure_noise(quick, say),
        "scaling": flights.measure_scaling(quick, say),
    }
    best = max(part["steps_per_s_per_core"] for part in results["batch"].values())
    results["operations"] = _operations(best, peak)
    say("Riccati solvers")
    results["sdre"] = sdre.measure(quick)
    say("latency of a control update")
    results["latency"] = latency.measure(quick)
    results["accuracy"] = None
    if importlib.util.find_spec("heyoka") is not None:
        results["accuracy"] = accuracy.measure(quick, say)
    results["peers"] = peers.measure(list(peers.PEERS), quick, cores, say) if with_peers else {}
    return results


def save(results: dict[str, Any], path: Path) -> None:
    """Write the numbers as JSON."""
    text = json.dumps(results, indent=1, allow_nan=False) + "\n"
    write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def _operations(steps_per_s: float, peak: float) -> dict[str, Any]:
    """Operations of a step, counted in the trace, and the share of the machine's peak that they come to."""
    counts = Machines(flights.batch_of(8, 0.1)).get(with_signals=False).operations
    flops = sum(FLOPS.get(kind, 0) * count for kind, count in counts.items())
    return {
        "instructions": sum(count for kind, count in counts.items() if kind != IDLE),
        "by_sort": {kind: count for kind, count in sorted(counts.items(), key=lambda x: -x[1]) if kind != IDLE},
        "flops": flops,
        "gflops_per_core": flops * steps_per_s * 1e-9,
        "share_of_peak": flops * steps_per_s / peak,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


# --------------------------------------------------------------------------------------------------------------- text


def text(results: dict[str, Any]) -> str:
    """The numbers as tables to be read."""
    parts = [_machine(results), _flights(results), _limits(results)]
    parts += [_sdre(results["sdre"]), _latency(results["latency"])]
    if results["accuracy"] is not None:
        parts.append(_accuracy(results["accuracy"]))
    else:
        parts.append(f"error against cost: not measured, for heyoka is not installed; {how_to_install('bench')}")
    if results["peers"]:
        parts.append(_peers(results))
    return "\n\n".join(parts)


def _machine(results: dict[str, Any]) -> str:
    m = results["machine"]
    return (
        f"{m['processor']}, {m['cores']} cores, Python {m['python']}, rotorfault {m['rotorfault']}\n"
        f"peak of fused multiplications and additions: {m['peak_gflops_per_core']:.1f} Gflop/s per core"
    )


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Numbers below their heads, names on the left."""
    return "\n".join(table_lines([head, *rows], "<" + ">" * (len(head) - 1), rule=True))


def _flights(results: dict[str, Any]) -> str:
    rows = []
    for size, part in results["batch"].items():
        together = part.get("all_cores")
        rows.append(
            (
                f"batch of {int(size):,}",
                f"{part['steps_per_s'] * 1e-6:.2f} M",
                f"{part['simulated_s_per_s_per_core']:,.0f}",
                "" if together is None else f"{together['steps_per_s'] * 1e-6:.2f} M",
                "" if together is None else f"{together['over_one_core']:.2f}",
            )
        )
    single = results["single"]
    head = ("flights", "steps/s, one core", "simulated s/s", "all cores", "over one core")
    return (
        _table(head, rows)
        + f"\none flight of 20 s through rf.fly, with all records: {single['seconds']:.3f} s"
        + f" ({single['simulated_s_per_s']:,.0f} simulated s/s)"
        + _frames(results["frames"])
    )


def _frames(speeds: dict[str, Any]) -> str:
    rows = [
        (
            f"{rotors} rotors, {part['vehicle']}",
            f"{part['steps_per_s'] * 1e-6:.2f} M",
            f"{part['simulated_s_per_s_per_core']:,.0f}",
            f"{part['cost_factor']:.2f}",
        )
        for rotors, part in speeds.items()
    ]
    return "\n\n" + _table(("batch of 10,000 by rotors", "steps/s, one core", "simulated s/s", "cost"), rows)


def _megabytes(peak: float | None) -> str:
    return "memory not known" if peak is None else f"{peak:.0f} MB"


def _limits(results: dict[str, Any]) -> str:
    o, noise = results["operations"], results["noise"]
    kinds = ", ".join(f"{count} {kind}" for kind, count in list(o["by_sort"].items())[:9])
    scaling = ", ".join(
        f"{int(size):,}: {part['us_per_flight']:.0f} us, {_megabytes(part['peak_memory_MB'])}"
        for size, part in results["scaling"].items()
    )
    return (
        f"a step: {o['instructions']:,} vector instructions ({kinds} ...), {o['flops']:,} flop;"
        f" {o['gflops_per_core']:.1f} Gflop/s, {100 * o['share_of_peak']:.0f} % of the peak\n"
        f"cost of sensor noise {noise['noise']['cost_factor']:.2f}, of gusts {noise['gusts']['cost_factor']:.2f}, "
        f"of both {noise['noise_and_gusts']['cost_factor']:.2f} times that without\n"
        f"flights of 0.1 s through fly_many, time per flight and peak memory: {scaling}"
    )


def _sdre(results: dict[str, Any]) -> str:
    parts = []
    for size, part in results["sizes"].items():
        rows = [
            (name, "not installed", "")
            if solver is None
            else (name, f"{solver['us']:.3f}", f"{solver['residual']:.0e}")
            for name, solver in part["solvers"].items()
        ]
        parts.append(
            _table((f"Riccati equation, n = {size}", "us per solve", "residual"), rows)
            + f"\nin batch {part['batch_over_scipy']:,.0f} times faster than SciPy and "
            f"{part['batch_over_best_package']:,.0f} times than {part['best_package']}; "
            f"from a single call {part['single_over_scipy']:,.0f} times faster than SciPy"
        )
    return "\n\n".join(parts)


def _latency(latencies: dict[str, Any]) -> str:
    rows = [(name, f"{part['median_us']:,.1f}", f"{part['p99_9_us']:,.1f}") for name, part in latencies.items()]
    return _table(("one control update", "median us", "99.9 % us"), rows)


def draw(results: dict[str, Any], path: Path) -> None:
    """Draw error against cost, the peers beside ours where they were measured.

    Raises
    ------
    InputError
        If the errors were not measured.
    """
    if results["accuracy"] is None:
        raise missing_extra("--figure needs heyoka, which gives the truth", "bench")
    peers_there = {name: peer for name, peer in results["peers"].items() if "error" not in peer}
    # matplotlib takes a second to load, which the measurements need not spend.
    from rotorfault.bench import accuracy_figure

    figure = accuracy_figure.draw(results["accuracy"], peers_there or None)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=150))


def _accuracy(results: dict[str, Any]) -> str:
    parts = []
    for name, curve in results["curves"].items():
        rows = [
            (
                f"{1e3 * point['step']:g} ms",
                *(f"{point['flights'][flight]['error_m']:.1e}" for flight in ("sound", "faulty")),
                f"{point['simulated_s_per_s_per_core']:,.0f}",
            )
            for point in curve["points"]
        ]
        cheapest = curve["cheapest_step"]
        parts.append(
            _table((f"step, {name}", "error m", "with faults m", "simulated s/s per core"), rows)
            + "\ncheapest step whose error at the end does not matter: "
            + ("none" if cheapest is None else f"{1e3 * cheapest:g} ms")
        )
    return "\n\n".join(
        [*parts, f"errors below {results['limit_m']:.1e} m do not matter (a thousandth of the yardstick)"]
    )


def _peers(results: dict[str, Any]) -> str:
    ours = results["batch"]["10000"]
    rows = [
        (
            "rotorfault, whole fault-tolerant loop",
            f"{ours['steps_per_s_per_core'] * 1e-6:.3f} M",
            "1.000",
            f"{ours['simulated_s_per_s_per_core']:,.0f}",
            "1",
        )
    ]
    for name, peer in results["peers"].items():
        if "error" in peer:
            rows.append((f"{name}: {peer['error'][:60]}", "", "", "", ""))
            continue
        for label, part in (
            (name, peer),
            *((f"{name}, {key}", part) for key, part in peer.get("variants", {}).items()),
        ):
            rows.append(
                (
                    f"{label} {peer['version'] if part is peer else ''}".strip(),
                    f"{part['steps_per_s_per_core'] * 1e-6:.3f} M",
                    f"{1e3 * part['step']:g}",
                    f"{part['simulated_s_per_s_per_core']:,.0f}",
                    f"{ours['steps_per_s_per_core'] / part['steps_per_s_per_core']:,.1f}",
                )
            )
    head = ("simulator", "steps/s per core", "step ms", "simulated s/s per core", "ours over it, steps")
    return _table(head, rows)
