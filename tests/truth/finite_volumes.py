"""A leg without lumped structure: finite volumes of copper, iron and aluminium under films of air.

Nothing here is a node of anybody's model. A joint is a coil in its slots, teeth, yoke, rotor, housing, gearbox, flange
and board; tubes lie between joints; heat crosses contacts; surfaces lose it by free convection and radiation. Every
dimension is drawn. A thermistor is glued between coil and housing, and the driver logs what drivers log.

To read: ``Body`` (cells and what joins them), ``Joint`` and ``Leg`` (dimensions), ``assemble``, ``solve`` (the
balance). What may be hidden in it, which answers are then right, and its logs are in ``changes``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from lptn.virtual.robot import LEG_JOINTS, Array, stream

KELVIN = 273.15
STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m² K⁴)
WARM = 25.0  # degC, at which winding resistance and grease are given

# --- materials and cells -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Material:
    """density: kg/m³. heat: specific, J/(kg K). conductivity: W/(m K)."""

    density: float
    heat: float
    conductivity: float


# Of data sheets near 25 degC; copper and plain steel as in [IncroperaDeWitt, table A.1].
ALUMINIUM = Material(2700.0, 896.0, 167.0)  # 6061
IRON = Material(7650.0, 460.0, 25.0)  # silicon steel, in the sheets' plane
STEEL = Material(7850.0, 434.0, 60.0)
MAGNET = Material(7500.0, 450.0, 9.0)  # sintered NdFeB
LAMINATE = Material(1900.0, 1000.0, 10.0)  # FR-4 with six layers of copper, along the board
PLA = Material(1240.0, 1800.0, 0.13)
FILL = 0.45  # copper's share of the slot
# Copper 8960 kg/m³ and 385 J/(kg K) in epoxy 1200 and 1100; across the wires some 0.5 to 1 W/(m K) are measured.
_COIL_DENSITY = 8960 * FILL + 1200 * (1 - FILL)
COIL = Material(_COIL_DENSITY, (8960 * 385 * FILL + 1200 * 1100 * (1 - FILL)) / _COIL_DENSITY, 0.7)

COPPER_RISE = 0.00385  # 1/K at 25 degC: annealed copper has 0.00393 at 20 degC
GREASE_THINS = 0.03  # 1/K: viscosity of a gear grease's base oil halves in some 23 K
AIR_CONDUCTIVITY, AIR_VISCOSITY, PRANDTL = (
    0.0263,
    1.59e-5,
    0.707,
)  # W/(m K), m²/s, 1, at 300 K [IncroperaDeWitt, table A.4]


@dataclass
class Body:
    """Cells, what joins them, and their surfaces; lists have one entry a cell.

    capacity: J/K. half: resistance from the centre to either end of the cell along its row, K/W. area: m², to the air.
    diameter: of that surface, m. emissivity: of it. zone: index of the air that it is in. links: cell, cell, W/K.
    """

    capacity: list[float] = field(default_factory=list)
    half: list[float] = field(default_factory=list)
    area: list[float] = field(default_factory=list)
    diameter: list[float] = field(default_factory=list)
    emissivity: list[float] = field(default_factory=list)
    zone: list[int] = field(default_factory=list)
    links: list[tuple[int, int, float]] = field(default_factory=list)

    def row(
        self,
        material: Material,
        length: float,
        section: float,
        cells: int,
        zone: int,
        *,
        area: float = 0.0,
        diameter: float = 0.05,
        emissivity: float = 0.85,
    ) -> list[int]:
        """Add a part that conducts along its length, cut into equal cells; ``area`` (m²) is the whole surface."""
        first = len(self.capacity)
        own = list(range(first, first + cells))
        for _ in own:
            self.capacity.append(material.density * material.heat * section * length / cells)
            self.half.append(length / cells / 2 / (material.conductivity * section))
            self.area.append(area / cells)
            self.diameter.append(diameter)
            self.emissivity.append(emissivity)
            self.zone.append(zone)
        self.links += [(one, other, 1 / (2 * self.half[one])) for one, other in pairwise(own)]
        return own

    def join(self, one: int, other: int, contact: float) -> None:
        """Join the ends of two rows by a contact (W/K), in series with half of either end cell."""
        self.links.append((one, other, 1 / (self.half[one] + 1 / contact + self.half[other])))

    def lay_on(self, row: Sequence[int], cell: int, contact: float) -> None:
        """Join a cell's end sideways to all cells of a row by a contact (W/K) spread over them."""
        for one in row:
            self.links.append((one, cell, 1 / (len(row) * (self.half[cell] + 1 / contact))))


# --- the leg's dimensions ------------------------------------------------------------------------------------------


@dataclass
class Joint:
    """One joint's dimensions and losses before anything is hidden. Lengths in m, areas in m².

    Contacts are in W/(m² K). The motor is the size of a quadruped's: 85 mm wide, a gear of 9.1. Gears, iron and boards
    are good ones: beside copper they make a few percent of the heat, so that two masses a joint are nearly enough.
    """

    resistance: float = 0.15  # ohm, phase to phase and all phases together
    slot_half: float = 0.002  # half a slot's width: the way of the heat through the coil
    slot_wall: float = 0.0075  # of 24 slots, both sides
    liner: float = 560.0  # 0.25 mm of aramid paper
    tooth: float = 0.008
    tooth_section: float = 0.0014  # of 24 teeth
    yoke: float = 0.005
    stator_wall: float = 0.0044  # outside of the yoke
    paste: float = 4000.0  # stator pressed into the housing, with paste
    rotor_section: float = 0.0035
    air_gap: float = 90.0  # W/(m² K), turning rotor
    bearing: float = 0.3  # W/K
    housing: float = 0.05  # length
    housing_section: float = 0.00085  # 85 mm wide, 3 mm thick
    housing_area: float = 0.021
    diameter: float = 0.085
    board_section: float = 0.00008
    board_pad: float = 0.5  # W/K, gap pad of the driver's board on the end cap
    board_area: float = 0.0025
    ring: float = 2.5  # W/K, ring gear in the housing
    planets: float = 2.0  # W/K, through the teeth and the grease
    gear_mass: float = 0.14  # kg of steel
    flange_mass: float = 0.05  # kg of aluminium
    flange_area: float = 0.003
    face: float = 2.5  # W/K, the flange bolted on its limb, and the limb on the next housing
    back: float = 0.9  # W/K, of the calf's motor bolted to the back of the thigh's
    dry: float = 0.02  # N·m at the joint
    mesh: float = 0.007  # share of the mechanical power
    grease: float = 0.006  # N·m s at the joint, warm
    hysteresis: float = 0.012  # W s/rad, with the joint's speed
    eddy: float = 0.002  # W s²/rad²
    idle: float = 0.1  # W, the board's electronics
    on_resistance: float = 0.012  # ohm, transistors and traces
    glued_to_coil: float = 0.08  # the thermistor's share of the coil's temperature
    glued_to_yoke: float = 0.55  # and of the yoke's; the rest is the housing's
    bead: float = 5.0  # s, the thermistor's own lag

    # What a change sets, zero before.
    drop: float = 0.0  # V of a damaged transistor
    fan: float = 0.0  # m/s at the fan's full speed
    sunlit: float = 0.0  # m² of absorbing area
    block_mass: float = 0.0  # kg of aluminium bolted to the housing
    block_pad: float = 0.8  # W/K
    wax: float = 0.0  # kg
    offset: float = 0.0  # K
    drift: float = 0.0  # K/h
    weakening: float = 0.0  # 1/K, of the torque constant that the driver allows for
    draught: float = 0.0  # K
    burst: float = 0.0  # W
    cycle: float = 0.0  # W
    crack: float = 0.0  # K, the reading's jump
    scale: tuple[str, float] = ("", 1.0)  # run, factor on the torque that the driver logs
    cover: tuple[str, float] = ("", 1.0)  # run, factor on the free surface of the housing


# Relative half-widths of what is drawn. What a data sheet states is made to a few percent; castings and glue aren't.
SPREAD, DATA_SHEET_SPREAD = 0.25, 0.06
DRAWN = tuple(name for name, value in vars(Joint()).items() if isinstance(value, float) and value > 0)
EXACT = ("block_pad", "resistance")
TORQUE_CONSTANT = 9.1 * 0.0927  # N·m/A at the joint: gear and motor's constant, as the driver knows it


@dataclass
class Leg:
    """Three joints, what lies between them, and what surrounds them.

    limbs: lengths of the plate that the hip hangs on, of what carries the thigh, of the tubes of thigh and shank, m;
    limb_section: of the same, m². The thigh's motor carries the calf's on its back. strut: between the housings of hip
    and calf, W/K. wind: whether the air that it travels through cools it; on a treadmill it doesn't. clock: s by which
    temperatures are stamped before the torques of the same moment.
    """

    joints: dict[str, Joint]
    limbs: Array
    limb_section: Array
    computer: bool
    strut: float = 0.0
    wind: bool = False
    clock: float = 0.0


def draw_finite_volumes(seed: int, computer: bool = False) -> Leg:
    """Draw a leg; equal seeds give equal legs, with and without a computer.

    Raises:
        ValueError: the seed is negative.
    """
    joints = {}
    for name in LEG_JOINTS:
        rng, joint = stream(seed, "finite volumes", name), Joint()
        for one in DRAWN:
            spread = DATA_SHEET_SPREAD if one in EXACT else SPREAD
            setattr(joint, one, getattr(joint, one) * (1 + spread * rng.uniform(-1, 1)))
        joints[name] = joint
    between = stream(seed, "finite volumes", "tubes").uniform(1 - SPREAD, 1 + SPREAD, (2, 4))
    lengths, sections = np.array([0.05, 0.06, 0.2, 0.2]), np.array([3e-4, 6e-4, 2e-4, 2e-4])
    return Leg(joints, lengths * between[0], sections * between[1], computer)


# --- from dimensions to cells and sources of heat ------------------------------------------------------------------


@dataclass(frozen=True)
class Assembly:
    """A leg's cells and where its heat arises.

    sources: of shape (sources, cells): share of each source's heat in each cell; the sources are the ``KINDS`` of each
    joint in turn, and the computer. rises, thins: of each source, 1/K: its heat × (1 + rises (T - 25)) exp(-thins (T -
    25)). reads: of shape (sensors, cells): what each sensor touches. magnets: cell of each joint's rotor. fanned: the
    cells' speed of air at a fan's full speed, m/s. wax: cell, W/K and kg of each pouch.
    """

    body: Body
    sources: Array
    rises: Array
    thins: Array
    reads: Array
    magnets: list[int]
    fanned: Array
    wax: list[tuple[int, float, float]]


KINDS = ("copper", "iron", "dry", "grease", "board", "housing")


def assemble(leg: Leg, run: str = "", cells: int = 1) -> Assembly:
    """Cut a leg into cells; ``cells`` multiplies how finely, ``run`` says which run's covers are on."""
    body, wax = Body(), []
    sources: list[tuple[tuple[list[int], float], ...]] = []
    laws: list[tuple[float, float]] = []
    reads: list[tuple[tuple[list[int], float], ...]] = []
    fanned: dict[int, float] = {}
    housings: list[list[int]] = []
    magnets: list[int] = []
    hung = plate = body.row(
        ALUMINIUM, leg.limbs[0], leg.limb_section[0], 3 * cells, 0, area=0.11 * leg.limbs[0], diameter=0.03
    )
    face = 1.0  # W/K, of the plate on the hip's housing
    for zone, joint in enumerate(leg.joints.values()):
        coil = body.row(COIL, joint.slot_half, joint.slot_wall, 3 * cells, zone)
        teeth = body.row(IRON, joint.tooth, joint.tooth_section, 1, zone)
        yoke = body.row(IRON, joint.yoke, joint.stator_wall, 2 * cells, zone)
        rotor = body.row(MAGNET, 0.004, joint.rotor_section, 1, zone)
        area = joint.housing_area * (joint.cover[1] if run and joint.cover[0] == run else 1.0)
        housing = body.row(
            ALUMINIUM, joint.housing, joint.housing_section, 4 * cells, zone, area=area, diameter=joint.diameter
        )
        gear = body.row(STEEL, 0.02, joint.gear_mass / (STEEL.density * 0.02), 2, zone)
        flange_section = joint.flange_mass / (ALUMINIUM.density * 0.01)
        flange = body.row(ALUMINIUM, 0.01, flange_section, 1, zone, area=joint.flange_area)
        board = body.row(LAMINATE, 0.05, joint.board_section, 2, zone, area=joint.board_area, diameter=0.05)
        limb = body.row(
            ALUMINIUM if zone < 2 else PLA,  # the shank below the calf is printed
            leg.limbs[zone + 1],
            leg.limb_section[zone + 1],
            4 * cells,
            zone,
            area=np.pi * 0.03 * leg.limbs[zone + 1],
            diameter=0.03,
        )
        body.join(coil[-1], teeth[0], joint.liner * joint.slot_wall)
        body.join(teeth[-1], yoke[0], 1e3)  # one sheet: no contact
        body.lay_on(housing[cells : 3 * cells], yoke[-1], joint.paste * joint.stator_wall)
        body.join(teeth[0], rotor[0], joint.air_gap * joint.rotor_section)
        body.join(rotor[0], housing[0], joint.bearing)
        body.lay_on(board, housing[0], joint.board_pad)
        body.join(housing[-1], gear[0], joint.ring)
        body.join(gear[-1], flange[0], joint.planets)
        body.join(flange[0], limb[0], joint.face)
        if zone < 2:
            body.lay_on(housing[2 * cells : 3 * cells], hung[-1], face)
        else:
            body.join(housings[1][0], housing[0], joint.back)
        if joint.block_mass:
            block = body.row(ALUMINIUM, 0.03, joint.block_mass / (2700 * 0.03), 2, zone, area=0.008, diameter=0.05)
            body.lay_on(housing[cells : 2 * cells], block[0], joint.block_pad)
        if joint.wax:
            wax.append((housing[2 * cells], 3.0, joint.wax))
        sources += [((part, 1.0),) for part in (coil, [*teeth, *yoke], gear[:1], gear, board, housing)]
        laws += [(COPPER_RISE if kind == "copper" else 0, GREASE_THINS if kind == "grease" else 0) for kind in KINDS]
        rest = 1 - joint.glued_to_coil - joint.glued_to_yoke
        reads.append(((coil, joint.glued_to_coil), (yoke, joint.glued_to_yoke), (housing[cells : 2 * cells], rest)))
        fanned |= dict.fromkeys([*housing, *board, *flange], joint.fan)
        housings.append(housing)
        magnets.append(rotor[0])
        hung, face = limb, joint.face
    if leg.strut:
        # A strut from the housing of the hip to that of the calf, its own mass and surface with it.
        strut = body.row(ALUMINIUM, 0.15, leg.strut * 0.15 / ALUMINIUM.conductivity, 4 * cells, 1, area=0.006)
        body.lay_on(housings[0][cells : 2 * cells], strut[0], 8.0)
        body.lay_on(housings[2][cells : 2 * cells], strut[-1], 8.0)
    if leg.computer:
        chip = body.row(ALUMINIUM, 0.02, 0.004, 2, 3)
        box = body.row(ALUMINIUM, 0.2, 0.0008, 4 * cells, 3, area=0.045, diameter=0.1)
        body.join(chip[-1], box[0], 2.5)
        body.join(box[-1], plate[0], 1.5)
        sources.append(((chip[:1], 1.0),))
        laws.append((0, 0))
        reads.append(((chip, 0.5), (box[: 2 * cells], 0.5)))
    count = len(body.capacity)
    blown = np.zeros(count)
    blown[list(fanned)] = list(fanned.values())
    rises, thins = np.array(laws).T
    return Assembly(body, _shares(sources, count), rises, thins, _shares(reads, count), magnets, blown, wax)


def _shares(rows: Sequence[Sequence[tuple[list[int], float]]], cells: int) -> Array:
    """Return for each row of parts and their shares the share of each cell, of shape (rows, cells)."""
    shares = np.zeros((len(rows), cells))
    for k, row in enumerate(rows):
        for part, share in row:
            shares[k, part] = share / len(part)
    return shares


# --- the balance of heat -------------------------------------------------------------------------------------------

WAX_MELTS, WAX_LATENT, WAX_HEAT = 36.7, 247e3, 2200.0  # degC, J/kg, J/(kg K): eicosane, a paraffin
GAMMA = 1 - 1 / np.sqrt(2)  # makes two implicit stages stiffly accurate and L-stable [Alexander1977]
REFRESH = 4  # steps for which films of air, copper and grease stay as they are


@dataclass(frozen=True)
class Solution:
    """temperature: degC at the steps' ends and at 0, of shape (steps + 1, cells).

    generated, lost, stored: J over the run; what is stored includes the wax.
    """

    temperature: Array
    generated: float
    lost: float
    stored: float


def film(above: Array, wind: Array, diameter: Array) -> Array:
    """Return the convective film of a cylinder in air, W/(m² K), at K above the air and m/s across it.

    Free: 1.32 (ΔT / d)^¼, laminar [Holman, table 7-2]. Forced: Hilpert's Nu = C Re^m Pr^⅓ [IncroperaDeWitt, table 7.2].
    Together: their cubes are added [Churchill1977].
    """
    free = 1.32 * (np.abs(above) / diameter) ** 0.25
    reynolds = wind * diameter / AIR_VISCOSITY
    fast = reynolds > 4000
    nusselt = np.where(fast, 0.193, 0.683) * reynolds ** np.where(fast, 0.618, 0.466) * PRANDTL ** (1 / 3)
    both: Array = np.cbrt(free**3 + (nusselt * AIR_CONDUCTIVITY / diameter) ** 3)
    return both


def solve(
    assembly: Assembly,
    heat: Array,
    air: Array,
    wind: Array,
    blown: Array,
    start: float | Array,
    *,
    step: float = 1.0,
    refresh: int = REFRESH,
) -> Solution:
    """Carry the cells' temperatures through a run.

    Two-stage diagonally implicit Runge-Kutta steps, whose balance of heat closes to rounding whatever their size; the
    coefficients that change with temperature are those of the block's beginning, carried on by half its growth.

    Args:
        assembly: the cells.
        heat: W of each source in each step, at 25 degC, of shape (steps, sources).
        air: degC of each zone in each step, of shape (steps, zones).
        wind, blown: speed of the air (m/s), and the fans' share of their full speed, of shape (steps,).
        start: degC of all cells, or of each.
        step: s.
        refresh: steps between two looks at the coefficients.
    """
    from scipy.sparse import csc_array, diags_array  # here, as they take a moment to import
    from scipy.sparse.linalg import splu

    body = assembly.body
    capacity, area, diameter, emissivity = map(np.array, (body.capacity, body.area, body.diameter, body.emissivity))
    zone, count, steps = np.array(body.zone), len(body.capacity), len(heat)
    rows, columns, conductance = np.array(body.links).reshape(-1, 3).T
    laplacian = csc_array((conductance, (rows.astype(int), columns.astype(int))), shape=(count, count))
    laplacian = laplacian + laplacian.T
    laplacian = diags_array(laplacian.sum(axis=1)) - laplacian
    implicit = csc_array(diags_array(capacity) + GAMMA * step * laplacian)
    T = np.empty((steps + 1, count))
    T[0] = before = start
    wax = [_Wax(cell, contact, mass, T[0, cell]) for cell, contact, mass in assembly.wax]
    generated = lost = 0.0
    for begin in range(0, steps, refresh):
        block = slice(begin, min(begin + refresh, steps))
        middle = T[begin] + (T[begin] - before) / 2
        before = T[begin]
        surroundings = air[block][:, zone]
        around = surroundings.mean(axis=0)
        speed = np.cbrt(wind[block].mean() ** 3 + (assembly.fanned * blown[block].mean()) ** 3)
        hot, cold = middle + KELVIN, around + KELVIN
        radiation = emissivity * STEFAN_BOLTZMANN * (hot**2 + cold**2) * (hot + cold)
        loss = area * (film(middle - around, speed, diameter) + radiation)  # W/K
        warm = middle - WARM
        factor = (1 + assembly.rises[:, None] * warm) * np.exp(-assembly.thins[:, None] * warm)
        sourced = heat[block] @ (assembly.sources * factor)
        factorised = splu(implicit + diags_array(GAMMA * step * loss, format="csc"))
        exchange = (laplacian + diags_array(loss)).tocsr()
        for k in range(block.start, block.stop):
            now, gain, outside = T[k], sourced[k - begin], surroundings[k - begin]
            generated += step * gain.sum()
            for piece in wax:
                gain[piece.cell] -= piece.absorb(now[piece.cell], step)
            acting = gain + loss * outside
            first = factorised.solve(acting - exchange @ now)
            second = factorised.solve(acting - exchange @ (now + (1 - GAMMA) * step * first))
            T[k + 1] = now + step * ((1 - GAMMA) * first + GAMMA * second)
            lost += step * (
                (1 - GAMMA) * loss @ (now + GAMMA * step * first - outside) + GAMMA * loss @ (T[k + 1] - outside)
            )
    stored = capacity @ (T[-1] - T[0]) + sum(piece.absorbed for piece in wax)
    return Solution(T, generated, lost, float(stored))


class _Wax:
    """A pouch of wax on a cell: its enthalpy grows, its temperature waits while it melts."""

    def __init__(self, cell: int, contact: float, mass: float, start: float) -> None:
        self.cell, self.contact, self.mass = cell, contact, mass
        self.start, self.absorbed = min(start, WAX_MELTS), 0.0

    def absorb(self, outside: float, step: float) -> float:
        """Take up heat for one step; return it in W."""
        enthalpy = self.absorbed / self.mass
        solid = WAX_HEAT * (WAX_MELTS - self.start)
        inside = self.start + (min(enthalpy, solid) + max(0.0, enthalpy - solid - WAX_LATENT)) / WAX_HEAT
        flow = self.contact * (outside - inside)
        self.absorbed += flow * step
        return flow
