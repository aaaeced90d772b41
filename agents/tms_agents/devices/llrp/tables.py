"""Layouts of LLRP messages and parameters, as data. Names are those of the standard's XML encoding (LTK).

A layout is a list of fields and whether parameters follow them. Field codes: ``B H I Q`` unsigned and ``b h`` signed
integers, big end first; ``12`` that many bytes; ``s`` UTF-8 text, ``a`` a list of u16 and ``l`` a list of u32, each
behind a u16 count; ``e`` bits behind a u16 bit count and ``y`` bytes behind a u16 count; ``*`` all bytes that are left.
Fields of a few bits are kept as the byte or word they lie in, first bit on top.

Source: EPCglobal Low Level Reader Protocol 1.1, sections 16 and 17.
"""

from __future__ import annotations

from typing import NamedTuple


class Layout(NamedTuple):
    name: str
    fields: tuple[tuple[str, str], ...] = ()
    nested: bool = False


def _layout(name: str, fields: str = "", nested: bool = False) -> Layout:
    pairs = (pair.split(":") for pair in fields.split())
    return Layout(name, tuple((field, code) for field, code in pairs), nested)


#: Parameters with a one-byte header and a fixed size.
TV = {
    1: _layout("AntennaID", "AntennaID:H"),
    2: _layout("FirstSeenTimestampUTC", "Microseconds:Q"),
    3: _layout("FirstSeenTimestampUptime", "Microseconds:Q"),
    4: _layout("LastSeenTimestampUTC", "Microseconds:Q"),
    5: _layout("LastSeenTimestampUptime", "Microseconds:Q"),
    6: _layout("PeakRSSI", "PeakRSSI:b"),
    7: _layout("ChannelIndex", "ChannelIndex:H"),
    8: _layout("TagSeenCount", "TagCount:H"),
    9: _layout("ROSpecID", "ROSpecID:I"),
    10: _layout("InventoryParameterSpecID", "InventoryParameterSpecID:H"),
    11: _layout("C1G2_CRC", "CRC:H"),
    12: _layout("C1G2_PC", "PC_Bits:H"),
    13: _layout("EPC_96", "EPC:12"),
    14: _layout("SpecIndex", "SpecIndex:H"),
    15: _layout("ClientRequestOpSpecResult", "OpSpecID:H"),
    16: _layout("AccessSpecID", "AccessSpecID:I"),
    17: _layout("OpSpecID", "OpSpecID:H"),
    18: _layout("C1G2SingulationDetails", "NumCollisionSlots:H NumEmptySlots:H"),
    19: _layout("C1G2XPCW1", "XPC_W1:H"),
    20: _layout("C1G2XPCW2", "XPC_W2:H"),
}

#: Parameters with type and length: all of LLRP 1.0.1. Those of 1.1 that are not listed are kept as bytes.
TLV = {
    128: _layout("UTCTimestamp", "Microseconds:Q"),
    129: _layout("Uptime", "Microseconds:Q"),
    137: _layout(
        "GeneralDeviceCapabilities",
        "MaxNumberOfAntennaSupported:H Flags:H DeviceManufacturerName:I ModelName:I ReaderFirmwareVersion:s",
        nested=True,
    ),
    139: _layout("ReceiveSensitivityTableEntry", "Index:H ReceiveSensitivityValue:h"),
    140: _layout("PerAntennaAirProtocol", "AntennaID:H ProtocolID:y"),
    141: _layout("GPIOCapabilities", "NumGPIs:H NumGPOs:H"),
    142: _layout(
        "LLRPCapabilities",
        "Flags:B MaxNumPriorityLevelsSupported:B ClientRequestOpSpecTimeout:H MaxNumROSpecs:I MaxNumSpecsPerROSpec:I"
        " MaxNumInventoryParameterSpecsPerAISpec:I MaxNumAccessSpecs:I MaxNumOpSpecsPerAccessSpec:I",
    ),
    143: _layout("RegulatoryCapabilities", "CountryCode:H CommunicationsStandard:H", nested=True),
    144: _layout("UHFBandCapabilities", nested=True),
    145: _layout("TransmitPowerLevelTableEntry", "Index:H TransmitPowerValue:h"),
    146: _layout("FrequencyInformation", "Hopping:B", nested=True),
    147: _layout("FrequencyHopTable", "HopTableID:B Reserved:B Frequency:l"),
    148: _layout("FixedFrequencyTable", "Frequency:l"),
    149: _layout(
        "PerAntennaReceiveSensitivityRange", "AntennaID:H ReceiveSensitivityIndexMin:H ReceiveSensitivityIndexMax:H"
    ),
    177: _layout("ROSpec", "ROSpecID:I Priority:B CurrentState:B", nested=True),
    178: _layout("ROBoundarySpec", nested=True),
    179: _layout("ROSpecStartTrigger", "ROSpecStartTriggerType:B", nested=True),
    180: _layout("PeriodicTriggerValue", "Offset:I Period:I", nested=True),
    181: _layout("GPITriggerValue", "GPIPortNum:H GPIEvent:B Timeout:I"),
    182: _layout("ROSpecStopTrigger", "ROSpecStopTriggerType:B DurationTriggerValue:I", nested=True),
    183: _layout("AISpec", "AntennaIDs:a", nested=True),
    184: _layout("AISpecStopTrigger", "AISpecStopTriggerType:B DurationTrigger:I", nested=True),
    185: _layout("TagObservationTrigger", "TriggerType:B Reserved:B NumberOfTags:H NumberOfAttempts:H T:H Timeout:I"),
    186: _layout("InventoryParameterSpec", "InventoryParameterSpecID:H ProtocolID:B", nested=True),
    187: _layout("RFSurveySpec", "AntennaID:H StartFrequency:I EndFrequency:I", nested=True),
    188: _layout("RFSurveySpecStopTrigger", "StopTriggerType:B DurationPeriod:I N:I"),
    207: _layout("AccessSpec", "AccessSpecID:I AntennaID:H ProtocolID:B CurrentState:B ROSpecID:I", nested=True),
    208: _layout("AccessSpecStopTrigger", "AccessSpecStopTrigger:B OperationCountValue:H"),
    209: _layout("AccessCommand", nested=True),
    210: _layout("ClientRequestOpSpec", "OpSpecID:H"),
    211: _layout("ClientRequestResponse", "AccessSpecID:I", nested=True),
    217: _layout("LLRPConfigurationStateValue", "LLRPConfigurationStateValue:I"),
    218: _layout("Identification", "IDType:B ReaderID:y"),
    219: _layout("GPOWriteData", "GPOPortNumber:H GPOData:B"),
    220: _layout("KeepaliveSpec", "KeepaliveTriggerType:B PeriodicTriggerValue:I"),
    221: _layout("AntennaProperties", "AntennaConnected:B AntennaID:H AntennaGain:h"),
    222: _layout("AntennaConfiguration", "AntennaID:H", nested=True),
    223: _layout("RFReceiver", "ReceiverSensitivity:H"),
    224: _layout("RFTransmitter", "HopTableID:H ChannelIndex:H TransmitPower:H"),
    225: _layout("GPIPortCurrentState", "GPIPortNum:H Config:B State:B"),
    226: _layout("EventsAndReports", "HoldEventsAndReportsUponReconnect:B"),
    237: _layout("ROReportSpec", "ROReportTrigger:B N:H", nested=True),
    238: _layout("TagReportContentSelector", "Enable:H", nested=True),
    239: _layout("AccessReportSpec", "AccessReportTrigger:B"),
    240: _layout("TagReportData", nested=True),
    241: _layout("EPCData", "EPC:e"),
    242: _layout("RFSurveyReportData", nested=True),
    243: _layout("FrequencyRSSILevelEntry", "Frequency:I Bandwidth:I AverageRSSI:b PeakRSSI:b", nested=True),
    244: _layout("ReaderEventNotificationSpec", nested=True),
    245: _layout("EventNotificationState", "EventType:H NotificationState:B"),
    246: _layout("ReaderEventNotificationData", nested=True),
    247: _layout("HoppingEvent", "HopTableID:H NextChannelIndex:H"),
    248: _layout("GPIEvent", "GPIPortNumber:H GPIEvent:B"),
    249: _layout("ROSpecEvent", "EventType:B ROSpecID:I PreemptingROSpecID:I"),
    250: _layout("ReportBufferLevelWarningEvent", "ReportBufferPercentageFull:B"),
    251: _layout("ReportBufferOverflowErrorEvent"),
    252: _layout("ReaderExceptionEvent", "Message:s", nested=True),
    253: _layout("RFSurveyEvent", "EventType:B ROSpecID:I SpecIndex:H"),
    254: _layout("AISpecEvent", "EventType:B ROSpecID:I SpecIndex:H", nested=True),
    255: _layout("AntennaEvent", "EventType:B AntennaID:H"),
    256: _layout("ConnectionAttemptEvent", "Status:H"),
    257: _layout("ConnectionCloseEvent"),
    287: _layout("LLRPStatus", "StatusCode:H ErrorDescription:s", nested=True),
    288: _layout("FieldError", "FieldNum:H ErrorCode:H"),
    289: _layout("ParameterError", "ParameterType:H ErrorCode:H", nested=True),
    327: _layout("C1G2LLRPCapabilities", "Flags:B MaxNumSelectFiltersPerQuery:H"),
    328: _layout("C1G2UHFRFModeTable", nested=True),
    329: _layout(
        "C1G2UHFRFModeTableEntry",
        "ModeIdentifier:I Flags:B MValue:B ForwardLinkModulation:B SpectralMaskIndicator:B BDRValue:I PIEValue:I"
        " MinTariValue:I MaxTariValue:I StepTariValue:I",
    ),
    330: _layout("C1G2InventoryCommand", "TagInventoryStateAware:B", nested=True),
    331: _layout("C1G2Filter", "T:B", nested=True),
    332: _layout("C1G2TagInventoryMask", "MB:B Pointer:H TagMask:e"),
    333: _layout("C1G2TagInventoryStateAwareFilterAction", "Target:B Action:B"),
    334: _layout("C1G2TagInventoryStateUnawareFilterAction", "Action:B"),
    335: _layout("C1G2RFControl", "ModeIndex:H Tari:H"),
    336: _layout("C1G2SingulationControl", "Session:B TagPopulation:H TagTransitTime:I", nested=True),
    337: _layout("C1G2TagInventoryStateAwareSingulationAction", "Flags:B"),
    338: _layout("C1G2TagSpec", nested=True),
    339: _layout("C1G2TargetTag", "Flags:B Pointer:H TagMask:e TagData:e"),
    341: _layout("C1G2Read", "OpSpecID:H AccessPassword:I MB:B WordPointer:H WordCount:H"),
    342: _layout("C1G2Write", "OpSpecID:H AccessPassword:I MB:B WordPointer:H WriteData:a"),
    343: _layout("C1G2Kill", "OpSpecID:H KillPassword:I"),
    344: _layout("C1G2Lock", "OpSpecID:H AccessPassword:I", nested=True),
    345: _layout("C1G2LockPayload", "Privilege:B DataField:B"),
    346: _layout("C1G2BlockErase", "OpSpecID:H AccessPassword:I MB:B WordPointer:H WordCount:H"),
    347: _layout("C1G2BlockWrite", "OpSpecID:H AccessPassword:I MB:B WordPointer:H WriteData:a"),
    348: _layout("C1G2EPCMemorySelector", "Flags:B"),
    349: _layout("C1G2ReadOpSpecResult", "Result:B OpSpecID:H ReadData:a"),
    350: _layout("C1G2WriteOpSpecResult", "Result:B OpSpecID:H NumWordsWritten:H"),
    351: _layout("C1G2KillOpSpecResult", "Result:B OpSpecID:H"),
    352: _layout("C1G2LockOpSpecResult", "Result:B OpSpecID:H"),
    353: _layout("C1G2BlockEraseOpSpecResult", "Result:B OpSpecID:H"),
    354: _layout("C1G2BlockWriteOpSpecResult", "Result:B OpSpecID:H NumWordsWritten:H"),
    1023: _layout("Custom", "VendorIdentifier:I ParameterSubtype:I Data:*"),
}

MESSAGES = {
    1: _layout("GET_READER_CAPABILITIES", "RequestedData:B", nested=True),
    2: _layout("GET_READER_CONFIG", "AntennaID:H RequestedData:B GPIPortNum:H GPOPortNum:H", nested=True),
    3: _layout("SET_READER_CONFIG", "ResetToFactoryDefault:B", nested=True),
    4: _layout("CLOSE_CONNECTION_RESPONSE", nested=True),
    11: _layout("GET_READER_CAPABILITIES_RESPONSE", nested=True),
    12: _layout("GET_READER_CONFIG_RESPONSE", nested=True),
    13: _layout("SET_READER_CONFIG_RESPONSE", nested=True),
    14: _layout("CLOSE_CONNECTION"),
    20: _layout("ADD_ROSPEC", nested=True),
    21: _layout("DELETE_ROSPEC", "ROSpecID:I"),
    22: _layout("START_ROSPEC", "ROSpecID:I"),
    23: _layout("STOP_ROSPEC", "ROSpecID:I"),
    24: _layout("ENABLE_ROSPEC", "ROSpecID:I"),
    25: _layout("DISABLE_ROSPEC", "ROSpecID:I"),
    26: _layout("GET_ROSPECS"),
    30: _layout("ADD_ROSPEC_RESPONSE", nested=True),
    31: _layout("DELETE_ROSPEC_RESPONSE", nested=True),
    32: _layout("START_ROSPEC_RESPONSE", nested=True),
    33: _layout("STOP_ROSPEC_RESPONSE", nested=True),
    34: _layout("ENABLE_ROSPEC_RESPONSE", nested=True),
    35: _layout("DISABLE_ROSPEC_RESPONSE", nested=True),
    36: _layout("GET_ROSPECS_RESPONSE", nested=True),
    40: _layout("ADD_ACCESSSPEC", nested=True),
    41: _layout("DELETE_ACCESSSPEC", "AccessSpecID:I"),
    42: _layout("ENABLE_ACCESSSPEC", "AccessSpecID:I"),
    43: _layout("DISABLE_ACCESSSPEC", "AccessSpecID:I"),
    44: _layout("GET_ACCESSSPECS"),
    45: _layout("CLIENT_REQUEST_OP", nested=True),
    46: _layout("GET_SUPPORTED_VERSION"),
    47: _layout("SET_PROTOCOL_VERSION", "ProtocolVersion:B"),
    50: _layout("ADD_ACCESSSPEC_RESPONSE", nested=True),
    51: _layout("DELETE_ACCESSSPEC_RESPONSE", nested=True),
    52: _layout("ENABLE_ACCESSSPEC_RESPONSE", nested=True),
    53: _layout("DISABLE_ACCESSSPEC_RESPONSE", nested=True),
    54: _layout("GET_ACCESSSPECS_RESPONSE", nested=True),
    55: _layout("CLIENT_REQUEST_OP_RESPONSE", nested=True),
    56: _layout("GET_SUPPORTED_VERSION_RESPONSE", "CurrentVersion:B SupportedVersion:B", nested=True),
    57: _layout("SET_PROTOCOL_VERSION_RESPONSE", nested=True),
    60: _layout("GET_REPORT"),
    61: _layout("RO_ACCESS_REPORT", nested=True),
    62: _layout("KEEPALIVE"),
    63: _layout("READER_EVENT_NOTIFICATION", nested=True),
    64: _layout("ENABLE_EVENTS_AND_REPORTS"),
    72: _layout("KEEPALIVE_ACK"),
    100: _layout("ERROR_MESSAGE", nested=True),
    1023: _layout("CUSTOM_MESSAGE", "VendorIdentifier:I MessageSubtype:B Data:*"),
}

MESSAGE_TYPES = {layout.name: number for number, layout in MESSAGES.items()}
PARAMETER_TYPES = {layout.name: number for number, layout in (TV | TLV).items()}
