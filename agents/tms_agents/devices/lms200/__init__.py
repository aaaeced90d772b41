"""SICK LMS2xx laser range finders (LMS200, 211, 220, 221, 291): serial telegrams with a check sum."""

from tms_agents.devices.lms200.emulator import Lms200Device
from tms_agents.devices.lms200.line import serial_line
from tms_agents.devices.lms200.messages import Unit
from tms_agents.devices.lms200.session import Lms200Session

__all__ = ["Lms200Device", "Lms200Session", "Unit", "serial_line"]
