"""Received light intensity: calibrated from the log itself, a layer of the map, a part of every match."""
