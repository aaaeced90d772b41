"""``WS /v1/live``: the belief of a room and its log as they grow, to many viewers.

One ``Feed`` per watched room makes a ``Version`` of the room whenever its state changed; each viewer goes from the
version it has to the newest one at its own pace. Nothing is queued per viewer: who is slow skips versions, and reads
the events it still has to get from the log.
"""
