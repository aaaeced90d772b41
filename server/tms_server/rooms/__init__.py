"""Rooms: frame, outline, furniture, sensors."""
