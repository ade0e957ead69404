"""The drawing of a network: every part in it, nothing on top of anything else, flows that balance."""

from __future__ import annotations

import json
import re
from importlib.resources import as_file, files
from xml.etree import ElementTree

import numpy as np
import pytest

from lptn.model.file import read_model_file
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.report.network_drawing import draw_network, heat_flows
from tests.builders import AMBIENT, link, node
from tests.report.two_joints import NODES, robot

MODELS = sorted(file.name for file in files("lptn.robots").iterdir() if file.name.endswith(".toml"))
SVG = "{http://www.w3.org/2000/svg}"


def _network(name: str) -> Network:
    with as_file(files("lptn.robots").joinpath(name)) as path:
        return read_model_file(path).network


def _boxes(drawn: ElementTree.Element) -> dict[str, tuple[float, float, float, float]]:
    boxes = {}
    for group in drawn.iter(f"{SVG}g"):
        if group.get("class") == "node":
            (box,) = group.findall(f"{SVG}rect")
            x, y, width, height = (float(box.get(name) or "nan") for name in ("x", "y", "width", "height"))
            boxes[group.get("data-node") or ""] = (x, y, x + width, y + height)
    return boxes


@pytest.mark.parametrize("name", MODELS)
def test_every_part_is_drawn_once_and_no_box_covers_another(name: str) -> None:
    network = _network(name)
    text = draw_network(network)
    drawn = ElementTree.fromstring(text)
    boxes = _boxes(drawn)
    assert list(boxes) == network.dynamic
    for one in boxes:
        for other in boxes:
            (a, b, c, d), (e, f, g, h) = boxes[one], boxes[other]
            assert one == other or a >= g or e >= c or b >= h or f >= d
    links = re.findall(r'data-link="([^"]*)"', text)
    assert len(links) == len(set(links)) >= len(network.resistors)
    assert text.count("data-effect=") == len(network.effect_instances)
    named = {parameter for element in drawn.iter() for parameter in json.loads(element.get("data-parameter", "[]"))}
    names = {parameter.name for parameter in network.parameters}
    assert named <= names
    assert {name for name in names if name.startswith(("capacity.", "resistance."))} <= named
    assert draw_network(_network(name)) == text


def test_a_chain_is_drawn_as_a_straight_limb() -> None:
    boxes = _boxes(ElementTree.fromstring(draw_network(_network("u8.toml"))))
    middles = np.array([[(a + c) / 2, (b + d) / 2] for a, b, c, d in boxes.values()])
    along = middles[-1] - middles[0]
    across = np.cross(np.append(along, 0), np.append(middles[1] - middles[0], 0))[2] / np.hypot(*along)
    assert abs(across) < 1.0


def test_twenty_six_nodes_do_not_cover_each_other() -> None:
    legs = ("FR", "FL", "RR", "RL")
    joints = [f"{leg}_{joint}" for leg in legs for joint in "abc"]
    names = [name for joint in joints for name in (joint, f"{joint}_case")] + ["pc", "body"]
    pairs = [(joint, f"{joint}_case") for joint in joints] + [("pc", "body"), ("body", "ambient")]
    for leg in legs:
        pairs += [(f"{leg}_a_case", f"{leg}_b_case"), (f"{leg}_b_case", f"{leg}_c_case"), (f"{leg}_a_case", "body")]
    network = Network("big", (*map(node, names), AMBIENT), tuple(link(*pair) for pair in pairs))
    boxes = np.array(list(_boxes(ElementTree.fromstring(draw_network(network))).values()))
    assert len(boxes) == 26
    for k, (a, b, c, d) in enumerate(boxes):
        for e, f, g, h in boxes[:k]:
            assert a >= g or e >= c or b >= h or f >= d


def test_names_are_text_and_nothing_else() -> None:
    drawn = ElementTree.fromstring(draw_network(robot()))
    assert tuple(_boxes(drawn)) == NODES


def test_flows_balance_the_rates() -> None:
    model = Model(_network("leg.toml"))
    x = np.array([[40.0, 30.0], [55.0, 31.0], [70.0, 29.0]])  # at two moments
    u = np.array([[20.0, 25.0] if name.startswith("temp") else [3.0, 1.0] for name in model.inputs])
    flows = heat_flows(model, x, u)
    into = {node: np.zeros(2) for node in model.nodes}
    for resistor in model.network.resistors:
        for end, sign in zip(resistor.ends, (1.0, -1.0), strict=True):
            if end in into:
                into[end] += sign * flows[resistor.place]
    for instance in model.network.effect_instances:
        into[instance.ends[0]] += flows[instance.label]
    rates = np.array(model.rhs(x, u, model.values))
    capacities = np.array([model.values[model.network.capacities[node]] for node in model.nodes])
    np.testing.assert_allclose(list(into.values()), rates * capacities[:, None])


def test_the_wider_the_line_the_more_heat() -> None:
    model = Model(_network("leg.toml"))
    flows = {resistor.place: float(number) for number, resistor in enumerate(model.network.resistors, start=1)}
    text = draw_network(model, {"FR_hip": 30.0, "FR_calf": 80.0}, flows)
    widths = {}
    for group in ElementTree.fromstring(text).iter(f"{SVG}g"):
        if "data-link" in group.attrib:
            widths[group.attrib["data-link"]] = float(group.findall(f"{SVG}line")[1].get("stroke-width") or "nan")
    assert sorted(widths, key=widths.__getitem__) == sorted(flows, key=flows.__getitem__)
    assert "80.0 °C" in text
    hip, calf = (re.search(rf'data-node="{name}".*?fill:rgb\((\d+),(\d+)', text) for name in ("FR_hip", "FR_calf"))
    assert hip is not None
    assert calf is not None
    assert int(hip[1]) > int(calf[1])
    assert int(hip[2]) > int(calf[2])
