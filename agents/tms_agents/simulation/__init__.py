"""A simulated room: its physics, the sensor agents that watch it, and the paper's experiment played in it."""
