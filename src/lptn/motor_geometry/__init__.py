"""A model file from a motor's drawing: winding, teeth, yoke, housing, shaft, rotor and end windings as elements."""

from lptn.motor_geometry.geometry import Geometry, load_geometry, parse_geometry, sample
from lptn.motor_geometry.template import model_text

__all__ = ["Geometry", "load_geometry", "model_text", "parse_geometry", "sample"]
