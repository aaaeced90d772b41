"""Weighing modules with Modbus RTU or TCP; needs the extra ``modbus``."""

from tms_agents.devices.modbus.link import ClientOpener, ModbusLink, modbus_rtu, modbus_tcp
from tms_agents.devices.modbus.registers import (
    Kind,
    StatusRegister,
    WeighingMap,
    laumas_tlu,
    pavone_dat_400,
    pt113,
)

__all__ = [
    "ClientOpener",
    "Kind",
    "ModbusLink",
    "StatusRegister",
    "WeighingMap",
    "laumas_tlu",
    "modbus_rtu",
    "modbus_tcp",
    "pavone_dat_400",
    "pt113",
]
