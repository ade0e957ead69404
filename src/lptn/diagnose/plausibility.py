"""Which sizes of an effect's parameter are usual, and which nobody believes."""

from __future__ import annotations

import math

from lptn.basics.parameters import Parameter

FACTOR = 3.0
"""Usual sizes are meant to a factor of three: of an error so much more is one standard deviation; a thing so much
larger, or smaller, is e times less probable, and so is a change of a factor by so many times what is usual."""
BELIEVED = 3.0
"""Standard deviations, and factors, beyond which no size is believed."""
LEAST_SHARE = 1e-12
"""Of a usual size, or of a misfit: what a search leaves of a zero still has a logarithm."""
_AT_BOUND = 1e-3  # relative; so near a bound a size is only a limit


def log_prior_of_size(parameter: Parameter, value: float) -> float:
    """How usual a value is, as a logarithm: 0 for what is usual, less for what is not.

    Errors, which may be of either sign, are normal about none. But any shift of a temperature has a cause, such as a
    byte whose offset nobody took away: beyond what is believed of calibration all sizes are alike, and rare. Sizes of
    things, and factors, vary by decades (a fan multiplies what a surface loses by ten): theirs is a double exponential
    of the logarithm. Time constants are usual anywhere between those that an effect is scored at.
    """
    off = _factors_off(parameter, value)
    if _is_shift(parameter):
        off = min(off, BELIEVED)
    return -0.5 * off**2 if is_error(parameter) else -off


def is_beyond_belief(parameter: Parameter, value: float) -> bool:
    """Whether a value is larger than anyone would believe."""
    lower, upper = believed(parameter)
    return not lower <= value <= upper


def believed(parameter: Parameter) -> tuple[float, float]:
    """The least and the largest value that somebody would believe, in the parameter's unit."""
    usual = abs(parameter.typical)
    if _is_shift(parameter):
        return parameter.bounds
    if is_error(parameter):
        off = parameter.off or 0.0
        return off - BELIEVED * FACTOR * usual, off + BELIEVED * FACTOR * usual
    if _is_change(parameter):
        largest = BELIEVED * _usual_change(parameter)
        return math.expm1(-largest), math.expm1(largest)
    largest = FACTOR**BELIEVED * max(_usual_sizes(parameter))
    return -largest, largest


def is_beyond_calibration(parameter: Parameter, value: float) -> bool:
    """Whether a shift of temperatures is larger than calibration leaves: numbers are sent, or read, another way."""
    return _is_shift(parameter) and _factors_off(parameter, value) > BELIEVED


def is_at(value: float, bound: float) -> bool:
    """Whether a value has gone as far as a bound allows."""
    return abs(value - bound) <= _AT_BOUND * abs(bound)


def _is_change(parameter: Parameter) -> bool:
    """Whether it is the change of a factor, which may be of either sign."""
    return _either_sign(parameter) and parameter.unit == "1"


def is_error(parameter: Parameter) -> bool:
    """Whether it is an error of a sensor or a clock, or a difference, which may be of either sign."""
    return _either_sign(parameter) and parameter.unit != "1"


def _is_shift(parameter: Parameter) -> bool:
    """Whether it is an error by which all readings of a temperature are off alike."""
    return is_error(parameter) and parameter.unit == "K"


def _usual_change(parameter: Parameter) -> float:
    """Logarithm of a factor that is e times less probable than none: a loss changes by a fifth, a fan's air by more."""
    return FACTOR * math.log1p(abs(parameter.typical))


def _either_sign(parameter: Parameter) -> bool:
    return parameter.off is not None and parameter.off > parameter.bounds[0]


def _usual_sizes(parameter: Parameter) -> tuple[float, ...]:
    return parameter.grid if parameter.off is None and parameter.grid else (abs(parameter.typical),)


def _factors_off(parameter: Parameter, value: float) -> float:
    """By how many standard deviations of an error, or factors of three, a value is off what is usual."""
    usual = abs(parameter.typical)
    if is_error(parameter):
        return abs(value - (parameter.off or 0.0)) / (FACTOR * usual)
    if _is_change(parameter):
        return abs(math.log(max(1.0 + value, LEAST_SHARE))) / _usual_change(parameter)
    sizes, size = _usual_sizes(parameter), max(abs(value), LEAST_SHARE * usual)
    return abs(math.log(size / min(max(size, min(sizes)), max(sizes)))) / math.log(FACTOR)
