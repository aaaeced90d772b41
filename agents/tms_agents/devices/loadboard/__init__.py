"""The load-cell board of the ROS-TMS cabinets: USB-serial, 115200 8N1, one character asks for one cell."""

from tms_agents.devices.loadboard.burst import RosTmsBoardBurst
from tms_agents.devices.loadboard.session import RosTmsBoardSession

__all__ = ["RosTmsBoardBurst", "RosTmsBoardSession"]
