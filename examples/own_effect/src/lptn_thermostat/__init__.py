"""An effect for lptn in a package of its own."""
