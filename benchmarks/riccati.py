"""Time per solve of the SDRE Riccati equation (22): packaged solvers against rotorfault's, as a table.

What is measured, and on which problems, is said in `rotorfault.bench.sdre`.
"""

from __future__ import annotations

import argparse
import os

# Before NumPy is loaded: at this size the threads of BLAS only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from rotorfault.bench.sdre import measure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer problems and repetitions")
    found = measure(parser.parse_args().quick)

    print(f"Newton-Kleinman steps from the guaranteed gain: {found['steps']}, residual {found['own_residual']:.1e}")
    print(f"in flight, one warm step with residual and test of stability: {found['in_flight_us']:.3f} us per problem")
    for size, part in found["sizes"].items():
        print(f"\n{'n = ' + size:<34}{'us per solve':>14}{'worst residual':>16}")
        for name, solver in part["solvers"].items():
            if solver is None:
                print(f"{name:<34}{'not installed':>14}")
            else:
                print(f"{name:<34}{solver['us']:>14.3f}{solver['residual']:>16.1e}")
        print(
            f"batch of {found['batch']}: {part['batch_over_scipy']:,.0f} times faster than SciPy, "
            f"{part['batch_over_best_package']:,.0f} times than {part['best_package']}; "
            f"single call: {part['single_over_scipy']:,.0f} times faster than SciPy"
        )


if __name__ == "__main__":
    main()
