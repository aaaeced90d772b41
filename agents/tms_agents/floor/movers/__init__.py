"""The life of a mover: come, believed, out of sight, back, and gone."""
