"""The machine's own limit: multiplications fused with additions, as many as the processor does when nothing else is.

Independent chains of fused operations on full vectors, enough of them to hide their latency. One fused operation
counts as two, as usual.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from rotorfault.engine import native
from rotorfault.engine.code import declarations
from rotorfault.engine.machine import aligned

CHAINS = 20
ROUNDS = 2_000_000


def peak_flops(repeats: int = 7) -> float:
    """Floating-point operations per second of one core, the median of several runs."""
    lanes = native.lanes()
    code = native.Native(native.compile_text(_module(lanes)), [("chains", 1, 1)])
    values = aligned((CHAINS + 1, lanes))
    values[:] = 1.0 + 1e-9 * np.arange(lanes)
    values[-1] = 1e-9
    code("chains", values, ROUNDS // 10)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        code("chains", values, ROUNDS)
        times.append(time.perf_counter() - start)
    return 2.0 * lanes * CHAINS * ROUNDS / statistics.median(times)


def _module(lanes: int) -> str:
    v = f"<{lanes} x double>"
    load = "\n".join(
        f"  %p{i} = getelementptr inbounds double, ptr %values, i64 {i * lanes}\n"
        f"  %a{i} = load {v}, ptr %p{i}, align 64"
        for i in range(CHAINS + 1)
    )
    phi = "\n".join(f"  %x{i} = phi {v} [ %a{i}, %entry ], [ %y{i}, %loop ]" for i in range(CHAINS))
    b = f"{v} %a{CHAINS}"
    work = "\n".join(f"  %y{i} = call {v} @llvm.fma.v{lanes}f64({v} %x{i}, {b}, {b})" for i in range(CHAINS))
    store = "\n".join(f"  store {v} %y{i}, ptr %p{i}, align 64" for i in range(CHAINS))
    return f"""
{chr(10).join(declarations(lanes))}
define void @chains(ptr noalias %values, i64 %rounds) {{
entry:
{load}
  br label %loop
loop:
  %k = phi i64 [ 0, %entry ], [ %k1, %loop ]
{phi}
{work}
  %k1 = add i64 %k, 1
  %more = icmp slt i64 %k1, %rounds
  br i1 %more, label %loop, label %done
done:
{store}
  ret void
}}
"""
