"""Load sharing: the legs of a standing robot share its weight so that the hottest joint lasts longest."""

from .body import Body, Leg, Stance, Statics, load_body, statics
from .sharing import LoadSharing, Sharing, StanceError

__all__ = ["Body", "Leg", "LoadSharing", "Sharing", "Stance", "StanceError", "Statics", "load_body", "statics"]
