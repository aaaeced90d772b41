"""WebSocket fan-out of a room's belief."""
