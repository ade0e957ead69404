"""Bodies that heat is generated in and conducted through: exact mean temperatures from a few conductances."""

from lptn.elements.axis import Axis, ring_axis, rod_axis, slab_axis, slab_peak
from lptn.elements.shapes import KINDS, Annulus, Cuboid, Cylinder, Element, Shape

__all__ = [
    "KINDS",
    "Annulus",
    "Axis",
    "Cuboid",
    "Cylinder",
    "Element",
    "Shape",
    "ring_axis",
    "rod_axis",
    "slab_axis",
    "slab_peak",
]
