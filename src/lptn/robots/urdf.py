"""A model file to begin with from a robot's URDF, or a log's columns: a node for each driven joint, links along chains.

A URDF says which joints there are, what each is bolted to, how far apart they sit and what torque each may give. It
says nothing of motors: heat capacitances, resistances and losses are guessed from the torque limit, as starts for a
fit to logs. A log's columns say less: which joints there are.
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from lptn.basics.bounds import DESCRIPTION, NODES
from lptn.basics.errors import InputError, one_line
from lptn.basics.files import bytes_of
from lptn.basics.places import EVERYWHERE, class_of, matching
from lptn.effects.copper_loss import CopperLoss
from lptn.logs.columns import AMBIENT
from lptn.logs.guess import joints_in
from lptn.logs.reading import GUESSED, open_log, run_name
from lptn.logs.tables import column_sources
from lptn.model.file import parse_model

# --- What a torque limit says of a joint's motor and gear, as a start ------------------------------

_DENSITY = 45.0
"""N·m/kg: peak torque of motor with gear over their mass. Unitree A1 33.5 N·m of 0.6 kg, ANYdrive 40 of 1.1, UR5's
shoulder 150 of 3.3, each by its data sheet."""
_SPECIFIC_HEAT = 500.0  # J/(kg K): copper 385, steel 460, aluminium 900
_BULK = 4000.0  # kg/m³: steel, copper and air gaps together; sets the surface of a cube of that mass
_TO_AIR = 10.0  # W/(m² K): free convection and radiation of a warm surface
_LOSS = 7.0  # W of copper loss for each N·m of the limit, at the limit: A1 237 W at 33.5 N·m [QuadrupedLPTN, eq. 3]
_JOINTED, _TUBE = 2.0, 160.0 * 6e-4  # K/W of two flanges; W m/K of an aluminium tube of 6 cm² between two joints
_RANGE = 20.0  # times: how far the fit may go from such a guess, up and down
_NO_LIMIT = 20.0  # N·m: where a URDF states no effort
_PINION = 0.02  # m: radius at which a sliding joint's motor makes its force, a pinion of 4 cm or so

_MOVED = ("revolute", "continuous", "prismatic")
_NOT_DRIVEN = ("fixed", "floating", "planar")  # the other types that a URDF has
_SUFFIX = re.compile(r"_(joint|motor|actuator)$")
_NOT_IN_NAMES = re.compile(r"[^\w-]")
_MOTORS = 1e-3, 1e5  # N·m behind the gear: small servos give 0.01, the axes of the largest robot arms 5e4
_FARTHEST = 1000.0  # m between two joints; what is farther was drawn in millimetres
_URDF = "a URDF: XML with <robot> outermost (expand a .xacro first)"
_BY_TORQUE = CopperLoss()
_AIR = 'ambient = "temperature.ambient"'
_log = logging.getLogger("lptn.robots")


@dataclass(frozen=True)
class Joint:
    """A driven joint.

    Args:
        name: of its node.
        effort: largest torque [N·m]; largest force [N] of a joint that slides.
        slides: whether it slides.
        before: node of the driven joint that carries it, `None` for one on the base.
        distance: from that joint [m].
        body: what it sits on.
        assumed: whether the URDF states no effort.
    """

    name: str
    effort: float
    slides: bool
    before: str | None
    distance: float
    body: str
    assumed: bool = False

    @property
    def torque(self) -> float:
        """What its motor and gear are sized for [N·m]."""
        return self.effort * _PINION if self.slides else self.effort


def urdf_model_text(path: str | Path, copper: CopperLoss = _BY_TORQUE) -> str:
    """The text of a model file for the robot that a URDF describes.

    Args:
        path: the URDF; a xacro has to be expanded before.
        copper: the copper loss of each joint, by torque or by current, and what its resistance and amperes are.

    Raises:
        InputError: not a URDF, or a robot without driven joints.
    """
    robot, joints = read_joints(path)
    text = "\n".join(_lines(f"{one_line(Path(path).name)} by `lptn new --urdf`", robot, joints, copper))
    parse_model(text, Path(path))
    return text


def log_model_text(path: Path) -> str:
    """The text of a model file for the joints that a log's columns name: a node a joint, each in air by itself.

    Its `[columns]` are what `--map guess` proposes of them, with what speaks for each.

    Args:
        path: the log.

    Raises:
        InputError: it can't be opened, or names no joint with a temperature and a torque or current.
    """
    table, _ = open_log(path, {})
    load, names, guesses = joints_in(table)
    joints = [Joint(name, _NO_LIMIT, slides=False, before=None, distance=0.0, body=name) for name in names]
    NODES.check(len(joints), path, "joints")
    made_of, copper = f"the columns of {one_line(path.name)} by `lptn new --log`", CopperLoss(input=load)
    lines = [*_lines(made_of, run_name(path), joints, copper)]
    lines.insert(lines.index("[model]") - 1, f"# The log states no limits; taken for each joint: {_NO_LIMIT:g} N·m.")
    if AMBIENT not in {*column_sources(table, {}), *(guess.key for guess in guesses)}:
        lines[lines.index(_AIR)] = 'ambient = "start"   # no column of the air: the log is taken to begin at rest in it'
    lines += ["[columns]", *(f"{guess.line}   # {GUESSED}{one_line(guess.why)}" for guess in guesses), ""]
    text = "\n".join(lines)
    parse_model(text, path)
    return text


# --- Reading -----------------------------------------------------------------------------------------


def read_joints(path: str | Path) -> tuple[str, list[Joint]]:
    """The robot's name and its driven joints, each behind the one that carries it.

    Raises:
        InputError: not a URDF, or a robot without driven joints.
    """
    root = _parsed(path)
    driven = {joint.get("name") for joint in root.iterfind("transmission/joint")}
    joints = root.findall("joint")
    carrying = {_end(path, joint, "child"): joint for joint in joints}
    for joint in joints:
        if (kind := joint.get("type")) not in (*_MOVED, *_NOT_DRIVEN):
            _log.warning("%s: joint %s: type %r; taken as fixed", path, joint.get("name"), kind)
    moved = [joint for joint in joints if joint.get("type") in _MOVED and joint.find("mimic") is None]
    moved = [joint for joint in moved if joint.get("name") in driven] or moved
    if not moved:
        raise InputError(path, "robot", "no joint that moves", f"joints of type {', '.join(_MOVED)}")
    NODES.check(len(moved), path, "robot")
    names = _node_names(path, moved)
    result = []
    for joint in moved:
        body, distance, before = _end(path, joint, "parent"), 0.0, None
        below, seen = body, set[str]()
        # Up the chain, over fixed joints and those that nothing drives, to the driven joint that carries this one.
        step = joint
        while before is None:
            distance += _length(path, step)
            if below not in carrying or below in seen:
                break
            seen.add(below)
            step = carrying[below]
            before, below = names.get(str(step.get("name"))), _end(path, step, "parent")
        slides = joint.get("type") == "prismatic"
        stated = _effort(path, joint)
        name, effort = names[str(joint.get("name"))], _NO_LIMIT if stated is None else stated
        result.append(Joint(name, effort, slides, before, distance, body, assumed=stated is None))
    return one_line(root.get("name", "robot")), result


def _parsed(path: str | Path) -> ElementTree.Element:
    content = bytes_of(Path(path), DESCRIPTION, _URDF)
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(path, "file", f"no XML: {error}", _URDF) from error
    if root.tag != "robot":
        raise InputError(path, "file", f"<{one_line(root.tag)}> outermost", _URDF)
    return root


def _end(path: str | Path, joint: ElementTree.Element, which: str) -> str:
    body = joint.find(which)
    name = None if body is None else body.get("link")
    if not name:
        raise InputError(path, f"joint {joint.get('name')}", f"no <{which} link=…>", "what the joint connects")
    return name


def _node_names(path: str | Path, moved: list[ElementTree.Element]) -> dict[str, str]:
    """A node's name for each joint's: without `_joint` behind it where that leaves them different."""
    given = [joint.get("name", "") for joint in moved]
    if len(set(given)) < len(given) or "" in given:
        raise InputError(path, "joint", "one without a name, or a name twice", "joints with names of their own")
    legal = [_NOT_IN_NAMES.sub("_", name) for name in given]
    short = [_SUFFIX.sub("", name) for name in legal]
    for names in (short, legal):
        if len(set(names)) == len(names):
            return dict(zip(given, names, strict=True))
    raise InputError(path, "joint", "names that differ in signs only", "names of letters, digits, - and _")


def _effort(path: str | Path, joint: ElementTree.Element) -> float | None:
    """The limit that is stated; `None` where there is none, or none that limits."""
    limit = joint.find("limit")
    effort = 0.0 if limit is None else _number(path, joint, limit.get("effort", "0"))
    slides = joint.get("type") == "prismatic"
    torque = effort * (_PINION if slides else 1.0)
    if _MOTORS[0] <= torque <= _MOTORS[1]:
        return effort
    if effort not in (0, math.inf):
        stated = f"effort {effort:g} {'N' if slides else 'N·m'}, which no motor has"
        _log.warning("%s: joint %s: %s; taken as no limit, like 0", path, joint.get("name"), stated)
    return None


def _length(path: str | Path, joint: ElementTree.Element) -> float:
    """How far a joint sits from the origin of what it is fixed to [m]."""
    origin = joint.find("origin")
    words = [] if origin is None else origin.get("xyz", "").split()
    length = math.hypot(*(_number(path, joint, word) for word in words)) if words else 0.0
    if not length <= _FARTHEST:
        raise InputError(path, f"joint {joint.get('name')}", f"{length:g} m to it", f"at most {_FARTHEST:g} m")
    return length


def _number(path: str | Path, joint: ElementTree.Element, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise InputError(path, f"joint {joint.get('name')}", f"'{word}'", "a number") from None


# --- Writing ----------------------------------------------------------------------------------------


def _lines(made_of: str, robot: str, joints: list[Joint], copper: CopperLoss) -> Iterator[str]:
    names = [joint.name for joint in joints]
    by_current = copper.chosen["input"] == "current"
    yield f"# {robot}: its {len(joints)} driven joints, each a node; made of {made_of}."
    heats = "current.<joint>" if by_current else "torque.<joint> (a sliding joint's force)"
    yield f"# Log columns: time, temperature.<joint>, {heats}, temperature.ambient."
    yield "# Capacities, resistances and losses are guesses from each joint's torque limit, starts for `lptn fit`. Put"
    constant = {True: "", False: " and torque constant at the joint"}[by_current]
    yield f"# in what data sheets say, the winding's resistance{constant}: by it the others have their scale."
    assumed = [joint for joint in joints if joint.assumed]
    if assumed:
        named = ", ".join(joint.name for joint in assumed)
        yield f"# The URDF states no limit of {named}; taken for it: {_NO_LIMIT:g} N·m (of a sliding joint N)."
    yield from ("", "[model]", f"name = {_quoted(robot)}", "joints = [")
    yield from (f"    {_quoted(name)}," for name in names)
    yield from ("]", _AIR)
    groups = _groups(joints)
    scale = groups[0][1].torque
    for pattern, joint in groups:
        mass = joint.torque / _DENSITY
        surface = 6.0 * (mass / _BULK) ** (2 / 3)
        yield from (
            "",
            f"# --- {'all joints' if pattern == EVERYWHERE else pattern}: {joint.effort:g} {_unit(joint)} ---",
        )
        yield from ("", f"[nodes.{_quoted(pattern)}]", f"capacity = {_guess(_SPECIFIC_HEAT * mass, 'J/K')}")
        yield from ("", "[[links]]", f'between = [{_quoted(pattern)}, "ambient"]')
        yield f"resistance = {_guess(1.0 / (_TO_AIR * surface), 'K/W')}"
        yield from ("", "[[effects]]", 'kind = "copper_loss"', f"at = {_quoted(pattern)}")
        yield from (f'{name} = "{word}"' for name, word in copper.chosen.items() if word != copper.options[name][0])
        # By torque 1 A gives 1 N·m, or 1 N; by current what its pinion makes of 1 N·m.
        loss = _LOSS * joint.torque / (joint.torque if by_current else joint.effort) ** 2 / copper.factor
        # One kind of motor sets the scale. The guess for another kind is off by a factor of its own, which logs tell.
        held = f"{loss:.3g}          # ohm: guessed, and held: it sets the scale of all others"
        yield f"resistance = {held if joint.torque == scale else _guess(loss, 'ohm', 'all', free=True)}"
        if not by_current:
            yield f"torque_constant = 1.0       # {_unit(joint)} at the joint per ampere: guessed"
    yield from ("", "# --- what drives and bearings add, whatever is held ---")
    yield from ("", "[[effects]]", 'kind = "constant_heat"', f"at = {_quoted(EVERYWHERE)}", 'share = "each"')
    carried = [joint for joint in joints if joint.before is not None]
    if carried:
        yield from ("", "# --- along the chains: each joint with the one that carries it ---")
    for joint in carried:
        yield from ("", "[[links]]", f"between = [{_quoted(str(joint.before))}, {_quoted(joint.name)}]")
        yield f"resistance = {_guess(_JOINTED + joint.distance / _TUBE, 'K/W')}"
    on_base: dict[str, list[str]] = {}
    for joint in joints:
        if joint.before is None:
            on_base.setdefault(joint.body, []).append(joint.name)
    for body, together in on_base.items():
        if len(together) > 1:
            yield from ("", f"# {', '.join(together)} sit on {one_line(body)} and may warm each other through it:")
            yield "# `lptn improve` says whether your logs show that (conduction, or a mass that they share)."
    yield ""


def _groups(joints: list[Joint]) -> list[tuple[str, Joint]]:
    """Patterns of joints that are alike, all or such as `*_calf`, with one of them; others by name."""
    names, groups = [joint.name for joint in joints], dict[str, Joint]()
    if len({(joint.effort, joint.slides) for joint in joints}) == 1:
        return [(EVERYWHERE, joints[0])]
    for joint in joints:
        pattern = class_of(joint.name)
        alike = {(member.effort, member.slides) for member in joints if member.name in matching(pattern, names)}
        classes = {class_of(name) for name in matching(pattern, names)}
        several = len(matching(pattern, names)) > 1 and len(alike) == 1 and classes == {pattern}
        groups.setdefault(pattern if several else joint.name, joint)
    return list(groups.items())


def _unit(joint: Joint) -> str:
    return "N" if joint.slides else "N·m"


def _guess(value: float, unit: str, share: str = "each", *, free: bool = False) -> str:
    """A start for the fit; `free` where it would be held otherwise."""
    least, start, most = (f"{float(f'{number:.3g}'):g}" for number in (value / _RANGE, value, value * _RANGE))
    said = f'value = {start}, unit = "{unit}", bounds = [{least}, {most}], share = "{share}"'
    return f"{{ {said}, fixed = false }}" if free else f"{{ {said} }}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
