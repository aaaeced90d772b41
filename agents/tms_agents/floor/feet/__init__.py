"""Feet, and what stands on the floor like one: how likely a cluster is to be whose."""
