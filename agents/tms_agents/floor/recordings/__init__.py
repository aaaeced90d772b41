"""Scans in files: ours, and those of others."""
