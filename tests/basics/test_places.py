"""Names of places: globs, classes, sides, edges and {leg} patterns."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lptn.basics.places import class_of, edge, expand_pair, is_glob, limb_of, matching, mirrored

JOINTS = ["FL_hip", "FL_thigh", "FL_calf", "FR_hip", "FR_thigh", "FR_calf"]


def test_matching_keeps_the_order_of_the_names() -> None:
    assert matching("*_calf", JOINTS) == ["FL_calf", "FR_calf"]
    assert matching("FR_*", JOINTS) == ["FR_hip", "FR_thigh", "FR_calf"]
    assert matching("FR_calf", JOINTS) == ["FR_calf"]
    assert matching("fr_calf", JOINTS) == []


@pytest.mark.parametrize(("name", "many"), [("*", True), ("F?_hip", True), ("[FR]L_hip", True), ("FR_hip", False)])
def test_is_glob(name: str, many: bool) -> None:
    assert is_glob(name) is many


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("FR_calf", "*_calf"),
        ("left_hip_roll", "*_hip_roll"),
        ("heater2", "heater*"),
        ("pc", "pc"),
        ("12", "12"),
        ("FR_calf~FR_thigh", "*_calf~*_thigh"),
        ("FR_calf~ambient", "*_calf~ambient"),
    ],
)
def test_class_of(name: str, expected: str) -> None:
    assert class_of(name) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("FR_calf", "FR_*"),
        ("knee_left", "*_left"),
        ("arm_left_knee", "*_left_*"),
        ("m1_winding", "m1_*"),
        ("plate", "plate"),
        ("FR_calf~FR_thigh", "FR_calf~FR_thigh"),
    ],
)
def test_limb_of(name: str, expected: str) -> None:
    assert limb_of(name) == expected


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("FR_calf", "FL_calf"),
        ("RL_hip", "RR_hip"),
        ("left_elbow", "right_elbow"),
        ("Left_elbow", "Right_elbow"),
        ("elbow_l", "elbow_r"),
        ("arm_R", "arm_L"),
        ("FL_hip~FL_thigh", "FR_hip~FR_thigh"),
        ("FL_hip~ambient", "FR_hip~ambient"),
        ("FL_hip~FR_hip", "FL_hip~FR_hip"),
        ("pc", None),
        ("ambient~pc", None),
    ],
)
def test_mirrored(name: str, other: str | None) -> None:
    assert mirrored(name) == other


@pytest.mark.parametrize("name", [*JOINTS, "left_elbow", "elbow_r", "FL_hip~FL_thigh", "RR_calf~ambient"])
def test_mirrored_twice_is_the_place_itself(name: str) -> None:
    other = mirrored(name)
    assert other is not None
    assert mirrored(other) == name


@given(st.text("abc_", min_size=1), st.text("abc_", min_size=1))
def test_an_edge_has_one_name_both_ways(one: str, other: str) -> None:
    assert edge(one, other) == edge(other, one)


def test_the_same_field_stands_for_the_same_leg() -> None:
    pairs = expand_pair(("{leg}_thigh", "{leg}_calf"), JOINTS)
    assert pairs == [("FL_thigh", "FL_calf"), ("FR_thigh", "FR_calf")]


def test_different_fields_stand_for_any_legs() -> None:
    pairs = expand_pair(("{one}_hip", "{other}_calf"), JOINTS)
    assert len(pairs) == 4
    assert ("FL_hip", "FR_calf") in pairs


def test_a_glob_pairs_with_every_name_of_the_other_pattern() -> None:
    assert expand_pair(("*_hip", "trunk"), [*JOINTS, "trunk"]) == [("FL_hip", "trunk"), ("FR_hip", "trunk")]


def test_pairs_come_once_and_never_join_a_place_to_itself() -> None:
    pairs = expand_pair(("*", "*"), ["a", "b", "c"])
    assert pairs == [("a", "b"), ("a", "c"), ("b", "c")]


def test_a_field_used_twice_in_one_pattern_has_to_repeat() -> None:
    assert expand_pair(("{x}_{x}", "z"), ["a_a", "a_b", "z"]) == [("a_a", "z")]


def test_dots_and_brackets_in_names_are_plain_text() -> None:
    assert expand_pair(("a.b", "c+"), ["a.b", "axb", "c+", "cc"]) == [("a.b", "c+")]


def test_a_numbered_field_works_or_matches_nothing() -> None:
    assert expand_pair(("{1}_thigh", "{1}_calf"), JOINTS) in ([], [("FL_thigh", "FL_calf"), ("FR_thigh", "FR_calf")])


def test_brackets_choose_letters_in_links_as_they_do_in_nodes() -> None:
    assert expand_pair(("F[LR]_hip", "trunk"), [*JOINTS, "trunk"]) == [("FL_hip", "trunk"), ("FR_hip", "trunk")]


def test_an_open_brace_is_plain_text() -> None:
    assert expand_pair(("{leg_hip", "trunk"), ["{leg_hip", "trunk", "FL_hip"]) == [("{leg_hip", "trunk")]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("FR_calf", "*_calf"),
        ("knee_left", "knee_*"),
        ("front_left_knee", "front_*_knee"),
        ("joint_1", "joint_*"),
        ("heater2", "heater*"),
        ("motor", "motor"),
    ],
)
def test_the_class_of_a_name_leaves_out_its_side_or_number(name: str, expected: str) -> None:
    assert class_of(name) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [("front_left_knee", "front_right_knee"), ("knee_r", "knee_l"), ("RR_hip", "RL_hip"), ("a", None)],
)
def test_the_other_side_is_found_wherever_the_side_is_named(name: str, expected: str | None) -> None:
    assert mirrored(name) == expected
