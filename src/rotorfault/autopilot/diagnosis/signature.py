r"""Which rotors explain a missing torque, on frames of any number of rotors.

A body shows four numbers, thrust and three torques, so with more than four rotors their thrusts cannot be told from
them one by one. Faults are few, though: a rotor that lacks :math:`f_i` leaves the torque :math:`-b_i f_i`, its
*signature*, b_i the torques of a newton of it. With V, squares of what of the observed torque :math:`\tau` may be
no fault: `noise` standard deviations of noise, and what a wrong model explains,

- rotors that are flagged explain what they can of it together, :math:`f = PB^T(BPB^T + V)^{-1}(-\tau)`, with as much
  thrust as they may lack for prior deviations, :math:`P`;
- of the others, one explains of the rest :math:`\tau'` by itself :math:`f_i = -b_i^TV^{-1}\tau' / b_i^TV^{-1}b_i`,
  with the evidence :math:`\Delta_i = (b_i^TV^{-1}\tau')^2 / b_i^TV^{-1}b_i`. The one with the most is the suspect, if
  it has more than any other by 1, so that what is no fault cannot have made the difference; else nobody is;
- where two rotors, each of them lacking thrust, explain more than any one by 1, one is no explanation. With
  :math:`m_i = -b_i^TV^{-1}\tau'` and :math:`G_{ij} = b_i^TV^{-1}b_j` the thrusts of a pair are

  .. math:: f_i = \frac{G_{jj}m_i - G_{ij}m_j}{G_{ii}G_{jj} - G_{ij}^2}, \qquad \Delta_{ij} = f_im_i + f_jm_j .

  The pair with the most is suspected if it has more than any other by 1. If no pair has, several explain it alike,
  and nobody is suspected; but one rotor is that explains `NEARLY` all of it, for the rest may be what no rotor does.

So losses are found one after another, or two at once, the sparsest explanation first. Thrust itself is not looked at:
a vertical wind, a wrong mass, or a battery that is running down shows in it alone, and is nobody's fault.

What that cannot tell apart. Only thrust that is missing is looked for: on a hexarotor whose rotors alternate, a rotor
that gives too much turns the body as a loss of the opposite one does. Coaxial rotors differ in yaw alone, where the
signature is shortest: which of them it is takes that much more of a loss.

Source of the test: S. Mallat, Z. Zhang, "Matching pursuits with time-frequency dictionaries", IEEE Trans. Signal
Process. 41(12), 1993, here in the metric of the noise.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, both, either, greater, maximum, minimum, negated, select, sqrt
from rotorfault.model.effectiveness import WrenchRows

# Of the evidence of the best pair, squared: a loss that explains as much, 18 degrees away from what is seen, is not
# given up for want of a clear pair. Our choice.
NEARLY = 0.9
PARALLEL = 1e-9  # of the product of their lengths, squared: signatures nearer to parallel than this are one
TINY = 1e-30  # (N m)^2: keeps quotients finite where nothing varies


class Explained(NamedTuple):
    """What is laid to each rotor."""

    residual: PerRotor  # N: thrust by which it falls behind a sound one, below zero; 0 for those not suspected
    noise: PerRotor  # N: standard deviation of it by noise
    model_error: PerRotor  # N^2: its variance by what the model may be wrong about


def explained(
    matrix: WrenchRows,
    torque: Vec3,
    noise: Vec3,
    model_error: Vec3,
    flagged: PerRotor,
    most: Scalar,
    apart: Scalar,
) -> Explained:
    """Lay a torque that the model does not explain to as few rotors as can be.

    Parameters
    ----------
    matrix : WrenchRows
        The effectiveness.
    torque : Vec3, N m
        Observed less expected.
    noise, model_error : Vec3, (N m)^2
        Variances of it.
    flagged : PerRotor
        1 where a fault is declared.
    most : scalar, N
        Thrust that a rotor may lack.
    apart : scalar
        Standard deviations of noise by which one explanation must be better than any other.
    """
    rows = (matrix.roll, matrix.pitch, matrix.yaw)
    variance = Vec3(*(apart * apart * a + b + TINY for a, b in zip(noise, model_error, strict=True)))
    prior = flagged * (most * most)

    # What flagged rotors explain: P B' (B P B' + V)^-1 (-tau).
    y = _solved([row * prior for row in rows], rows, variance, torque)
    lacking = (rows[0] * y.x + rows[1] * y.y + rows[2] * y.z) * prior
    left = Vec3(*(t - row.dot(lacking) for t, row in zip(torque, rows, strict=True)))

    # What any other explains alone.
    over = Vec3(*(1.0 / v for v in variance))
    weighted = [row * weight for row, weight in zip(rows, over, strict=True)]
    lengths = [row * other for row, other in zip(rows, weighted, strict=True)]
    length = lengths[0] + lengths[1] + lengths[2]
    along = weighted[0] * left.x + weighted[1] * left.y + weighted[2] * left.z
    per_length = length.map(lambda size: 1.0 / maximum(size, TINY))
    evidence = along.map(_evidence, per_length, flagged)
    best, second = _two_largest(evidence)
    pairs = _pairs_of(rows, weighted, length, along, flagged)
    best_pair, second_pair = _two_largest(PerRotor.of(pair.evidence for pair in pairs))
    needed = greater(best_pair - best, 1.0)
    clear_pair = both(needed, greater(best_pair - second_pair, 1.0))
    enough = either(negated(needed), greater(best, NEARLY * best_pair))
    clear = both(both(greater(best - second, 1.0), enough), negated(clear_pair))
    alone = along * per_length
    suspect = evidence.map(lambda e: both(clear, both(greater(e, 0.0), negated(greater(best, e)))))
    residual = lacking + suspect.map(lambda on, f: select(on, f, 0.0), alone)
    residual = residual - _laid_to_pair(pairs, clear_pair, best_pair, len(residual))

    shares = [(row * per_length).map(lambda c: c * c) for row in weighted]
    return Explained(
        residual,
        _sum_of(shares, noise).map(_root),
        _sum_of(shares, model_error),
    )


class Pair(NamedTuple):
    """Two rotors that may lack thrust at once."""

    rotors: tuple[int, int]  # from 0
    missing: tuple[Scalar, Scalar]  # N
    evidence: Scalar  # 0 where one of them would have to give more, or is flagged


def _pairs_of(
    rows: tuple[PerRotor, ...], weighted: list[PerRotor], length: PerRotor, along: PerRotor, flagged: PerRotor
) -> list[Pair]:
    """What each two rotors explain together."""
    found = []
    for i, j in combinations(range(len(along)), 2):
        shared = sum(row[i] * other[j] for row, other in zip(rows, weighted, strict=True))
        product = length[i] * length[j]
        apart = product - shared * shared
        over = 1.0 / maximum(apart, maximum(PARALLEL * product, TINY))
        first = (shared * along[j] - length[j] * along[i]) * over
        second = (shared * along[i] - length[i] * along[j]) * over
        possible = both(both(greater(first, 0.0), greater(second, 0.0)), greater(apart, PARALLEL * product))
        possible = both(possible, negated(either(flagged[i], flagged[j])))
        explains = -(first * along[i] + second * along[j])
        found.append(Pair((i, j), (first, second), select(possible, explains, 0.0)))
    return found


def _laid_to_pair(pairs: list[Pair], clear: Scalar, best: Scalar, rotors: int) -> PerRotor:
    """Thrust in N that each rotor lacks by the best pair, where it is clear which that is."""
    lacking: list[Scalar] = [0.0] * rotors
    for pair in pairs:
        on = both(clear, negated(greater(best, pair.evidence)))
        for rotor, missing in zip(pair.rotors, pair.missing, strict=True):
            lacking[rotor] = lacking[rotor] + select(on, missing, 0.0)
    return PerRotor.of(lacking)


def _root(x: Scalar) -> Scalar:
    return sqrt(maximum(x, 0.0))


def _evidence(along: Scalar, per_length: Scalar, flagged: Scalar) -> Scalar:
    """Of a thrust that is missing; 0 where a rotor would have to give more."""
    missing = both(greater(0.0, along), negated(flagged))
    return select(missing, along * along * per_length, 0.0)


def _two_largest(values: PerRotor) -> tuple[Scalar, Scalar]:
    best, second = maximum(values[0], values[1]), minimum(values[0], values[1])
    for value in [*values][2:]:
        # The loser of the two best so far.
        best, second = maximum(best, value), maximum(second, minimum(best, value))
    return best, second


def _sum_of(rows: list[PerRotor], factors: Vec3) -> PerRotor:
    x, y, z = factors
    total: PerRotor = rows[0] * x + rows[1] * y + rows[2] * z
    return total


def _solved(weighted: list[PerRotor], rows: tuple[PerRotor, ...], added: Vec3, right: Vec3) -> Vec3:
    """Solution of (weighted rows' + diag(added)) x = right, symmetric and positive definite."""
    a, b, c = (weighted[0].dot(row) for row in rows)
    d, e = weighted[1].dot(rows[1]), weighted[1].dot(rows[2])
    f = weighted[2].dot(rows[2])
    a, d, f = a + added.x, d + added.y, f + added.z
    l1, l2 = b / a, c / a
    d = d - l1 * b
    e = e - l1 * c
    l3 = e / d
    f = f - l2 * c - l3 * e
    y, z = right.y - l1 * right.x, right.z
    z = z - l2 * right.x - l3 * y
    z = z / f
    y = y / d - l3 * z
    return Vec3(right.x / a - l1 * y - l2 * z, y, z)
