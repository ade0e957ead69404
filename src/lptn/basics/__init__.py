"""What every room stands on: parameters, places, units, errors, files, processes.

Each file here is used by two rooms at least, mostly by ten; what one room alone needs stands in that room.
"""
