"""Pioneer robots (ARCOS, P2OS, AmigOS): odometry, battery, bumpers, and driving, over a serial line or TCP."""

from tms_agents.devices.arcos.emulator import PioneerDevice
from tms_agents.devices.arcos.odometry import Odometry
from tms_agents.devices.arcos.session import ArcosSession, BaseStatus

__all__ = ["ArcosSession", "BaseStatus", "Odometry", "PioneerDevice"]
