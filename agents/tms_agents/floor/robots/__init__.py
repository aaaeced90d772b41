"""Robots: wide and rigid, followed by their outline where their size is known."""
