"""Agents: who is alive, since when, how late."""
