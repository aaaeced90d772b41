"""API library for robot code and the ``tms`` command."""
