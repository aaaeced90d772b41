"""Models of sensors: how each codes what it does not measure, and what an emulator of it says.

Distances below DMIN are no distances but codes. Sources: C-42-03320B tables 3 and 4; parameters of PP as real sensors
sent them (URG-04LX: urgnetwork wiki; UTM-30LX-EW: its sums are right), those of UTM-30LX from the tables of the same
document. The UST series says its far value, 65533, in no public document; texts of VV and II of UTM-30LX and UST-20LX
follow their relatives.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from tms_agents.devices.scip.parameters import Parameters


@dataclass(frozen=True, slots=True)
class Coding:
    """Values that are no distances: ``far`` nothing within reach, ``near`` too near, ``error`` any other."""

    far: int
    near: int
    error: int
    #: ME and GE. Others must never be asked: a URG-04LX is dead from then on until its supply is cut.
    intensity: bool


_URG = Coding(far=0, near=6, error=6, intensity=False)
_UTM = Coding(far=1, near=4, error=5, intensity=True)
_UST = Coding(far=65533, near=0, error=0, intensity=True)
_CODINGS = {
    **dict.fromkeys(("URG-04LX", "UBG-04LX", "UBG-05LX", "UHG-08LX"), _URG),
    **dict.fromkeys(("UTM-30LX", "UXM-30LX"), _UTM),
    "UST-": _UST,
}
#: Nobody knows its codes: far is only what is beyond its reach.
_UNKNOWN = Coding(far=(1 << 18) - 1, near=0, error=0, intensity=False)


def coding(modl: str) -> Coding:
    """By the MODL of PP."""
    return next((found for start, found in _CODINGS.items() if modl.startswith(start)), _UNKNOWN)


@dataclass(frozen=True, slots=True)
class Model:
    """What an emulated sensor says of itself."""

    parameters: Parameters
    product: str
    firmware: str
    serial: str
    protocol: str = "SCIP 2.0"
    #: Begins in SCIP 1.1 and must be told to speak SCIP 2.0.
    old: bool = False
    #: Has a serial line whose speed counts; others have USB or Ethernet.
    serial_line: bool = False
    #: Knows %ST and %SL and answers in the words of SCIP 2.2.
    states: bool = False
    #: Scans with intensity kill it.
    dies_of_intensity: bool = False
    coding: Coding = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "coding", coding(self.parameters.modl))

    @property
    def vendor(self) -> str:
        return "Hokuyo Automatic Co., Ltd." if self.states else "Hokuyo Automatic Co.,Ltd."


URG_PARAMETERS = Parameters("URG-04LX(Hokuyo Automatic Co.,Ltd.)", 20, 5600, 1024, 44, 725, 384, 600)

MODELS = {
    "URG-04LX": Model(
        URG_PARAMETERS,
        "SOKUIKI Sensor URG-04LX",
        "3.1.00(18/Jan./2007)",
        "H0614967",
        old=True,
        serial_line=True,
        dies_of_intensity=True,
    ),
    "URG-04LX-UG01": Model(
        URG_PARAMETERS,
        "SOKUIKI Sensor URG-04LX-UG01(Simple-URG)",
        "3.4.03(17/Dec./2012)",
        "H1510998",
        dies_of_intensity=True,
    ),
    "UTM-30LX": Model(
        Parameters("UTM-30LX(Hokuyo Automatic Co.,Ltd.)", 23, 60000, 1440, 0, 1080, 540, 2400),
        "SOKUIKI Sensor TOP-URG UTM-30LX",
        "1.20.02(27/Dec./2011)",
        "H0803606",
    ),
    "UTM-30LX-EW": Model(
        Parameters("UTM-30LX-EW", 23, 60000, 1440, 0, 1080, 540, 2400),
        "UTM-30LX-EW",
        "1.1.0 (2011-09-30)",
        "H0123456",
        "SCIP 2.2",
        states=True,
    ),
    "UST-10LX": Model(
        Parameters("UST-10LX", 20, 30000, 1440, 0, 1080, 540, 2400),
        "UST-10LX",
        "2.23.0000",
        "H1614934",
        "SCIP 2.2",
        states=True,
    ),
    "UST-20LX": Model(
        Parameters("UST-20LX", 20, 60000, 1440, 0, 1080, 540, 2400),
        "UST-20LX",
        "2.23.0000",
        "H1614935",
        "SCIP 2.2",
        states=True,
    ),
}
