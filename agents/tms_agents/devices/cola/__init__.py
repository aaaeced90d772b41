"""SICK laser range finders that speak CoLa A or B (TiM, LMS1xx, LMS5xx), over TCP port 2111 or 2112."""

from tms_agents.devices.cola.emulator import MODELS, ColaDevice, ColaModel
from tms_agents.devices.cola.messages import PASSWORDS
from tms_agents.devices.cola.session import ColaSession

__all__ = ["MODELS", "PASSWORDS", "ColaDevice", "ColaModel", "ColaSession"]
