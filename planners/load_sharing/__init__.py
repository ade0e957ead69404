"""Load sharing: the legs of a standing robot share its weight so that the hottest joint lasts longest."""

from .body import Body, Leg, load_body
from .sharing import LoadSharing, Sharing, StanceError
from .stance import Stance, Statics, statics

__all__ = ["Body", "Leg", "LoadSharing", "Sharing", "Stance", "StanceError", "Statics", "load_body", "statics"]
