"""What sources of diagnosis speak for, by what they flag and what they flagged before."""

from __future__ import annotations

import numpy as np
import pytest

from rotorfault.logs.detectors import Said
from rotorfault.logs.witness import WRONG, heard

BEGIN, ONSET = 10.0, 40.0
RIGHT = Said("right", ((2, ONSET + 0.03, 0.4), (1, ONSET + 1.5, 0.9)), "")
OTHER = Said("other", ((3, ONSET + 0.05, 0.4),), "")
QUIET = Said("quiet", (), "")
WILD = Said("wild", ((1, 14.0, 0.2), (4, 15.0, 0.2), (2, ONSET + 0.03, 0.2)), "")
NOT = Said("not", (), "the log has no attitude")


def rotors(*said: Said) -> np.ndarray:
    found = heard(said, BEGIN, ONSET, 4)
    assert found is not None
    return found.rotors


def test_a_source_that_was_quiet_until_then_speaks_for_its_rotor() -> None:
    told = rotors(RIGHT)
    assert told[1] > 3.0
    assert (told[[0, 2, 3]] < 0.5).all()


def test_many_that_say_the_same_count_as_one() -> None:
    assert rotors(RIGHT, RIGHT, RIGHT, NOT) == pytest.approx(rotors(RIGHT))


def test_sources_that_contradict_each_other_speak_for_neither() -> None:
    told = rotors(RIGHT, OTHER)
    assert told[1] == pytest.approx(told[2])
    assert told[1] < 1.0


def test_a_source_that_flagged_others_before_speaks_for_nothing() -> None:
    assert rotors(WILD) == pytest.approx(np.ones(4), rel=0.01)


def test_one_that_flags_nobody_says_little_against_a_loss() -> None:
    told = rotors(QUIET)
    assert (told < 1.0).all()
    assert (told > 0.7).all()


def test_where_none_ran_nothing_is_said() -> None:
    assert heard([NOT], BEGIN, ONSET, 4) is None


def test_the_less_time_there_was_the_less_a_source_is_believed() -> None:
    times = [heard([RIGHT], ONSET - quiet, ONSET, 4) for quiet in (1.0, 5.0, 20.0, 80.0)]
    told = [one.rotors[1] for one in times if one is not None]
    assert told == sorted(told)
    assert told[0] < 0.8 * told[-1]
    assert WRONG < 0.05
