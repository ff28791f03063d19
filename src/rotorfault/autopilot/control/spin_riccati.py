r"""The Riccati equation of a spinning body's thrust axis with the rotors' lag among the states.

Seen from a frame that does not spin, with roll and pitch as one complex number (x + i y), the error e of an axis that
is fixed in a body of equal transverse moments, its rate w and the angular acceleration a that the rotors give obey

.. math:: \dot e = w, \qquad \dot w = i\beta w + a, \qquad \dot a = (i r - w_0)a + w_0u

where r is the spin, :math:`\beta = (J_zr + J_r\Omega)/J_t` the precession, :math:`w_0` the rotors' bandwidth. One
input: the optimal poles for the cost :math:`\int q_e|e|^2 + q_w|w|^2 + R|u|^2` are the stable half of the roots of

.. math:: a(s)\,\bar a(-s) = p(s)\,\bar p(-s) + \frac{w_0^2}{R}(q_e - q_ws^2), \qquad
          p(s) = s(s - i\beta)(s + w_0 - ir)

and the gains follow from a(s) by comparison of coefficients. On :math:`s = j\nu` the right side is a real polynomial
of sixth degree. a is improved by Wilson's step, which solves the equation linearised about a: the Newton-Kleinman
step of this Riccati equation. It keeps a stable, converges quadratically, and is three linear equations, for three of
the six can be put into the others.

Source of the step: G. Wilson, "Factorization of the covariance generating function of a pure moving average process",
SIAM J. Numer. Anal. 6, 1969; D. L. Kleinman, IEEE TAC 13, 1968.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.scalar import Scalar, sqrt

# Wilson's steps from afar: each halves the distance until it is small, then squares it.
STEPS = 16


class Complex(NamedTuple):
    """A complex number of two scalars."""

    re: Scalar
    im: Scalar

    def times(self, other: Complex) -> Complex:
        """Product."""
        return Complex(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)


class Poles(NamedTuple):
    """Coefficients of a(j nu)/j^3 = nu^3 + b2 nu^2 + b1 nu + b0."""

    b2: Complex  # rad/s
    b1: Complex  # (rad/s)^2
    b0: Complex  # (rad/s)^3


class SpinProblem(NamedTuple):
    """Numbers of the equation."""

    spin: Scalar  # rad/s
    precession: Scalar  # rad/s
    bandwidth: Scalar  # rad/s
    angle: Scalar  # 1/s^4: q_e/R
    rate: Scalar  # 1/s^2: q_w/R


class SpinGain(NamedTuple):
    """u = -(angle e + rate w + torque a), all complex."""

    angle: Complex  # 1/s^2
    rate: Complex  # 1/s
    torque: Complex


def optimal(problem: SpinProblem) -> Poles:
    """The solution, to rounding, from three equal real poles at least as fast as the optimal ones.

    Parameters
    ----------
    problem : SpinProblem
    """
    size = sqrt(problem.bandwidth * problem.bandwidth + sqrt(problem.angle) + problem.rate)
    poles = Poles(Complex(0.0, -3.0 * size), Complex(-3.0 * size * size, 0.0), Complex(0.0, size * size * size))
    for _ in range(STEPS):
        poles = improve(problem, poles)
    return poles


def improve(problem: SpinProblem, poles: Poles) -> Poles:
    """One of Wilson's steps.

    Parameters
    ----------
    problem : SpinProblem
    poles : Poles
        All in the left half plane.

    Returns
    -------
    Poles
        All in the left half plane too; not finite where two of the old ones were mirrored about the imaginary axis.
    """
    r, beta, w = problem.spin, problem.precession, problem.bandwidth
    (x2, y2), (x1, y1), (x0, y0) = poles
    # nu^2 (nu - beta)^2 ((nu - r)^2 + w^2) + w^2 (q_e + q_w nu^2)
    ww, bb = w * w, beta * beta
    far = r * r + ww
    f5, f4 = -2.0 * (r + beta), far + 4.0 * r * beta + bb
    f3, f2 = -2.0 * (beta * far + r * bb), bb * far + ww * problem.rate
    f0 = ww * problem.angle
    # New real parts by the new imaginary ones v2, v1, v0: u = c + d v2 + g v1 (+ ...).
    u2 = 0.5 * f5
    c1, d1 = 0.5 * (f4 + x2 * x2 + y2 * y2) - x2 * u2, -y2
    c0 = 0.5 * f3 + x2 * x1 + y2 * y1 - x1 * u2 - x2 * c1
    d0, g0 = -y1 - x2 * d1, -y2
    # The other three: rows of (v2, v1, v0) and what they are to give.
    e2 = 0.5 * (f2 + x1 * x1 + y1 * y1) + x2 * x0 + y2 * y0 - x0 * u2 - x1 * c1 - x2 * c0
    e1 = x1 * x0 + y1 * y0 - x0 * c1 - x1 * c0
    e0 = 0.5 * (f0 + x0 * x0 + y0 * y0) - x0 * c0
    a11, a12, a13 = y0 + x1 * d1 + x2 * d0, y1 + x2 * g0, y2
    a21, a22, a23 = x0 * d1 + x1 * d0, y0 + x1 * g0, y1
    a31, a32, a33 = x0 * d0, x0 * g0, y0
    m11, m12, m13 = a22 * a33 - a23 * a32, a23 * a31 - a21 * a33, a21 * a32 - a22 * a31
    inverse = 1.0 / (a11 * m11 + a12 * m12 + a13 * m13)
    v2 = (e2 * m11 + e1 * (a13 * a32 - a12 * a33) + e0 * (a12 * a23 - a13 * a22)) * inverse
    v1 = (e2 * m12 + e1 * (a11 * a33 - a13 * a31) + e0 * (a13 * a21 - a11 * a23)) * inverse
    v0 = (e2 * m13 + e1 * (a12 * a31 - a11 * a32) + e0 * (a11 * a22 - a12 * a21)) * inverse
    return Poles(Complex(u2, v2), Complex(c1 + d1 * v2, v1), Complex(c0 + d0 * v2 + g0 * v1, v0))


def spin_gain(problem: SpinProblem, poles: Poles) -> SpinGain:
    """The feedback that puts the poles there.

    Parameters
    ----------
    problem : SpinProblem
    poles : Poles
    """
    r, beta, w = problem.spin, problem.precession, problem.bandwidth
    b2, b1, b0 = poles
    a2, a1, a0 = Complex(-b2.im, b2.re), Complex(-b1.re, -b1.im), Complex(b0.im, -b0.re)
    torque = Complex((a2.re - w) / w, (a2.im + r + beta) / w)
    # a1 = -i beta (w - i r) + w k_w - i beta w k_t
    through = Complex(1.0 + torque.re, torque.im - r / w).times(Complex(0.0, beta))
    return SpinGain(Complex(a0.re / w, a0.im / w), Complex(a1.re / w + through.re, a1.im / w + through.im), torque)
