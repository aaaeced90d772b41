"""The room log: one ordered, durable sequence of records per room, and the snapshots of what was folded from it."""
