"""What every room stands on: parameters, places, units, errors, files, processes."""
