"""Observations in: admission, bounded queues, and the group-commit writer in front of the room log."""
