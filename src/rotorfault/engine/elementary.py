r"""Elementary functions as straight-line vector code, without a branch: sine, cosine, exponential, arc tangent.

A library's vector functions take another way for all lanes of a group where one lane is huge or NaN, and round
differently there; a lost flight would then change the last bits of its neighbours. These here do the same for every
lane. Errors stay within about one unit in the last place (tests/engine/test_elementary.py).

- Sine and cosine: x less a multiple n of pi/2, in three steps with pi/2 as a sum of three numbers (Cody and Waite
  1980; each product fused with its difference), then polynomials on [-pi/4, pi/4]. NaN beyond 1e14 rad, where
  neighbouring numbers are a hundredth of a radian apart.
- Exponential: x less a multiple n of ln 2, a polynomial, times 2^n put into the exponent in two halves.
- Arc tangent: the smaller over the larger of \|y\| and \|x\|; above tan(pi/8) from pi/4 on, by
  atan(m/M) = pi/4 + atan((m - M)/(m + M)); a polynomial; the quadrant by signs.

Polynomials are Chebyshev fits in 50 digits, made for these intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from rotorfault.engine.code import Code

LARGEST_ANGLE = 1e14  # rad

# Highest power first, in r^2: (sin r / r - 1)/r^2, and (cos r - 1 + r^2/2)/r^4.
_SIN = (
    1.591810123027412e-10, -2.5051131455427946e-08, 2.755731610068303e-06, -0.0001984126983675497,
    0.008333333333330946, -0.16666666666666666,
)  # fmt: skip
_COS = (
    -1.1382614868556325e-11, 2.0876146024689747e-09, -2.7557317270560326e-07, 2.4801587298763433e-05,
    -0.0013888888888887395, 0.041666666666666664,
)  # fmt: skip
# (exp r - 1 - r)/r^2 on |r| <= ln(2)/2.
_EXP = (
    2.0914686968086876e-09, 2.5105217004720745e-08, 2.75572736431103e-07, 2.7557255400206422e-06,
    2.4801587325547743e-05, 0.00019841269874820627, 0.0013888888888883748, 0.008333333333326136,
    0.04166666666666667, 0.1666666666666667, 0.5,
)  # fmt: skip
# (2 artanh(s)/s - 2)/s^2 in s^2, on |s| <= (sqrt 2 - 1)/(sqrt 2 + 1).
_LOG = (
    0.14616585424888623, 0.15331710618210773, 0.18182889455674947, 0.22222211130259878, 0.2857142862600327,
    0.39999999999899444, 0.666666666666667,
)  # fmt: skip
# (atan t / t - 1)/t^2 in t^2, on |t| <= tan(pi/8).
_ATAN = (
    0.016285756855221028, -0.034570561981427744, 0.04551593220626549, -0.05230454270650244, 0.05878928997834775,
    -0.06666424885738255, 0.07692296375032143, -0.09090908753500877, 0.11111111105155447, -0.14285714285659828,
    0.19999999999999804, -0.3333333333333333,
)  # fmt: skip

_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
_LN2 = (0.6931471803691238, 1.9082149292705877e-10)  # the first has 21 trailing zero bits
_TO_INTEGER = 1.5 * 2.0**52  # added, it leaves the nearest whole number in the lowest bits
_TAN_PI_8 = math.sqrt(2.0) - 1.0


def _polynomial(code: Code, z: str, coefficients: Sequence[float]) -> str:
    value = code.constant(coefficients[0])
    for coefficient in coefficients[1:]:
        value = code.fma(value, z, code.constant(coefficient))
    return value


def sine(code: Code, x: str) -> str:
    """sin x."""
    return _sine_or_cosine(code, x, 0)


def cosine(code: Code, x: str) -> str:
    """cos x."""
    return _sine_or_cosine(code, x, 1)


def tangent(code: Code, x: str) -> str:
    """tan x."""
    return code.op("fdiv", sine(code, x), cosine(code, x))


def _sine_or_cosine(code: Code, x: str, quarter_turns: int) -> str:
    """sin(x + quarter_turns pi/2); both share all but the last lines."""
    shifted = code.fma(x, code.constant(2.0 / math.pi), code.constant(_TO_INTEGER))
    n = code.op("fsub", shifted, code.constant(_TO_INTEGER))
    minus_n = code.negative(n)
    r = x
    for part in _HALF_PI:
        r = code.fma(minus_n, code.constant(part), r)
    sin_r, cos_r = _kernels(code, r)
    signed = _in_quadrant(code, shifted, quarter_turns, sin_r, cos_r)
    plain = code.compare("ole", code.magnitude(x), code.constant(LARGEST_ANGLE))
    return code.select(plain, signed, code.constant(math.nan))


def _kernels(code: Code, r: str) -> tuple[str, str]:
    """Sine and cosine on [-pi/4, pi/4]."""
    z = code.op("fmul", r, r)
    sine = code.fma(code.op("fmul", z, r), _polynomial(code, z, _SIN), r)
    straight = code.fma(z, code.constant(-0.5), code.constant(1.0))
    return sine, code.fma(code.op("fmul", z, z), _polynomial(code, z, _COS), straight)


def _in_quadrant(code: Code, shifted: str, quarter_turns: int, sin_r: str, cos_r: str) -> str:
    """The sine `quarter_turns` beyond the quadrant that the lowest bits of `shifted` name."""
    quadrant = code.integer_op("add", code.bits(shifted), code.integer(quarter_turns))
    value = code.select(code.bit_set(quadrant, 1), cos_r, sin_r)
    flip = code.integer_op("shl", code.integer_op("and", quadrant, code.integer(2)), code.integer(62))
    return code.number(code.integer_op("xor", code.bits(value), flip))


def sine_and_cosine_of_turn(code: Code, turns: str) -> tuple[str, str]:
    """Sine and cosine of an angle in turns, 0 to 1 and a multiple of 2^-32, so that its quarters part exactly."""
    quarters = code.op("fmul", turns, code.constant(4.0))
    shifted = code.op("fadd", quarters, code.constant(_TO_INTEGER))
    rest = code.op("fsub", quarters, code.op("fsub", shifted, code.constant(_TO_INTEGER)))
    sin_r, cos_r = _kernels(code, code.op("fmul", rest, code.constant(_HALF_PI[0])))
    sine, cosine = (_in_quadrant(code, shifted, shift, sin_r, cos_r) for shift in (0, 1))
    return sine, cosine


def logarithm(code: Code, x: str) -> str:
    """Natural logarithm of an ordinary positive number: m 2^e with m around 1, ln m = 2 artanh((m - 1)/(m + 1))."""
    bits = code.bits(x)
    fraction = code.integer_op("and", bits, code.integer((1 << 52) - 1))
    m = code.number(code.integer_op("or", fraction, code.integer(0x3FF << 52)))
    large = code.compare("ogt", m, code.constant(math.sqrt(2.0)))
    m = code.select(large, code.op("fmul", m, code.constant(0.5)), m)
    exponent = code.integer_op("lshr", bits, code.integer(52))
    biased = code.number(code.integer_op("or", exponent, code.integer(0x4330 << 48)))  # 2^52 + e + 1023
    e = code.op("fsub", biased, code.constant(2.0**52 + 1023.0))
    e = code.select(large, code.op("fadd", e, code.constant(1.0)), e)
    one = code.constant(1.0)
    s = code.op("fdiv", code.op("fsub", m, one), code.op("fadd", m, one))
    z = code.op("fmul", s, s)
    tail = code.fma(code.op("fmul", s, z), _polynomial(code, z, _LOG), code.op("fmul", e, code.constant(_LN2[1])))
    return code.fma(e, code.constant(_LN2[0]), code.fma(s, code.constant(2.0), tail))


def logarithm_anywhere(code: Code, x: str) -> str:
    """Natural logarithm of any number, NaN at zero and below; subnormal numbers count as zero."""
    inside, infinite = (
        code.compare("oge", x, code.constant(2.0**-1022)),
        code.compare("oeq", x, code.constant(math.inf)),
    )
    outside = code.select(infinite, x, code.constant(math.nan))
    finite = code.compare("olt", x, code.constant(math.inf))
    return code.select(finite, code.select(inside, logarithm(code, x), outside), outside)


def exponential(code: Code, x: str) -> str:
    """exp x."""
    # Beyond these the result is infinite, or zero, anyway; the multiple of ln 2 must stay small.
    limited = code.minimum(code.maximum(x, code.constant(-746.0)), code.constant(710.0))
    shifted = code.fma(limited, code.constant(1.0 / math.log(2.0)), code.constant(_TO_INTEGER))
    minus_n = code.negative(code.op("fsub", shifted, code.constant(_TO_INTEGER)))
    r = code.fma(minus_n, code.constant(_LN2[1]), code.fma(minus_n, code.constant(_LN2[0]), limited))
    value = code.op("fadd", code.fma(code.op("fmul", r, r), _polynomial(code, r, _EXP), r), code.constant(1.0))
    # The lowest bits of `shifted` hold n in two's complement; 2^n itself may be out of range where the result is not.
    n = code.integer_op("ashr", code.integer_op("shl", code.bits(shifted), code.integer(13)), code.integer(13))
    first = code.integer_op("ashr", n, code.integer(1))
    second = code.integer_op("sub", n, first)
    for half in (first, second):
        exponent = code.integer_op("shl", code.integer_op("add", half, code.integer(1023)), code.integer(52))
        value = code.op("fmul", value, code.number(exponent))
    return value


def arc_tangent(code: Code, y: str, x: str) -> str:
    """Angle of the point (x, y), in [-pi, pi]."""
    ay, ax = code.magnitude(y), code.magnitude(x)
    small, large = code.minimum(ay, ax), code.maximum(ay, ax)
    above = code.compare("ogt", small, code.op("fmul", large, code.constant(_TAN_PI_8)))
    numerator = code.select(above, code.op("fsub", small, large), small)
    denominator = code.select(above, code.op("fadd", small, large), large)
    # At the origin: 0/1. At infinity the quotient has no value; 1 and 0 are the limits that libraries give.
    at_origin = code.compare("oeq", large, code.constant(0.0))
    t = code.op("fdiv", numerator, code.select(at_origin, code.constant(1.0), denominator))
    infinite = code.compare("oeq", large, code.constant(math.inf))
    both_infinite = code.compare("oeq", small, code.constant(math.inf))
    t = code.select(infinite, code.constant(0.0), t)
    z = code.op("fmul", t, t)
    angle = code.fma(code.op("fmul", z, t), _polynomial(code, z, _ATAN), t)
    # In two parts, pi/4 = 0.785... + 3.06e-17, for the sum to be right to the last place.
    from_diagonal = code.op(
        "fadd", code.constant(math.pi / 4.0), code.op("fadd", angle, code.constant(_HALF_PI[1] / 2.0))
    )
    diagonal = code.select(both_infinite, both_infinite, above, kind="truth")
    angle = code.select(diagonal, from_diagonal, angle)
    steep = code.compare("ogt", ay, ax)
    mirrored = code.op("fadd", code.constant(_HALF_PI[0]), code.op("fsub", code.constant(_HALF_PI[1]), angle))
    angle = code.select(steep, mirrored, angle)
    backward = code.compare_integer("slt", code.bits(x), code.integer(0))
    turned = code.op("fadd", code.constant(math.pi), code.op("fsub", code.constant(2.0 * _HALF_PI[1]), angle))
    angle = code.select(backward, turned, angle)
    return code.with_sign_of(angle, y)


def arc_sine(code: Code, x: str) -> str:
    """asin x, by the other leg of the triangle; NaN outside [-1, 1]."""
    one = code.constant(1.0)
    other = code.square_root(code.op("fmul", code.op("fsub", one, x), code.op("fadd", one, x)))
    return arc_tangent(code, x, other)


def hyperbolic_tangent(code: Code, x: str) -> str:
    """tanh x = (1 - q)/(1 + q) with q = exp(-2 |x|); near 0, where that cancels, a series."""
    size = code.magnitude(x)
    q = exponential(code, code.op("fmul", size, code.constant(-2.0)))
    one = code.constant(1.0)
    far = code.op("fdiv", code.op("fsub", one, q), code.op("fadd", one, q))
    z = code.op("fmul", size, size)
    series = (
        -929569.0 / 638512875.0,
        21844.0 / 6081075.0,
        -1382.0 / 155925.0,
        62.0 / 2835.0,
        -17.0 / 315.0,
        2.0 / 15.0,
        -1.0 / 3.0,
    )
    near = code.fma(code.op("fmul", z, size), _polynomial(code, z, series), size)
    close = code.compare("olt", size, code.constant(0.1))
    return code.with_sign_of(code.select(close, near, far), x)
