"""Other people's decodings of LLRP messages, in one form with ours: values by path, in the order they come."""

from __future__ import annotations

import base64
from collections import defaultdict
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any
from xml.etree import ElementTree

from tms_agents.devices.llrp.codec import Parameter
from tms_agents.devices.llrp.tables import MESSAGES, PARAMETER_TYPES, TLV, TV

Path = tuple[str, ...]
Values = dict[Path, list[int | str]]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LAYOUTS = {layout.name: layout for table in (MESSAGES, TLV, TV) for layout in table.values()}

#: Fields of a few bits by the byte or word that the codec keeps them in: name, lowest bit, number of bits.
_BITS: dict[str, list[tuple[str, int, int]]] = {
    "GeneralDeviceCapabilities.Flags": [("CanSetAntennaProperties", 15, 1), ("HasUTCClockCapability", 14, 1)],
    "LLRPCapabilities.Flags": [
        ("CanDoRFSurvey", 7, 1),
        ("CanReportBufferFillWarning", 6, 1),
        ("SupportsClientRequestOpSpec", 5, 1),
        ("CanDoTagInventoryStateAwareSingulation", 4, 1),
        ("SupportsEventAndReportHolding", 3, 1),
    ],
    "C1G2LLRPCapabilities.Flags": [("CanSupportBlockErase", 7, 1), ("CanSupportBlockWrite", 6, 1)],
    "TagReportContentSelector.Enable": [
        ("EnableROSpecID", 15, 1),
        ("EnableSpecIndex", 14, 1),
        ("EnableInventoryParameterSpecID", 13, 1),
        ("EnableAntennaID", 12, 1),
        ("EnableChannelIndex", 11, 1),
        ("EnablePeakRSSI", 10, 1),
        ("EnableFirstSeenTimestamp", 9, 1),
        ("EnableLastSeenTimestamp", 8, 1),
        ("EnableTagSeenCount", 7, 1),
        ("EnableAccessSpecID", 6, 1),
    ],
    "C1G2EPCMemorySelector.Flags": [("EnableCRC", 7, 1), ("EnablePCBits", 6, 1)],
    "C1G2UHFRFModeTableEntry.Flags": [("DRValue", 7, 1), ("EPCHAGTCConformance", 6, 1)],
    "C1G2TargetTag.Flags": [("MB", 6, 2), ("Match", 5, 1)],
    **{
        field: [(field.partition(".")[2], 7, 1)]
        for field in (
            "GPIEvent.GPIEvent",
            "GPITriggerValue.GPIEvent",
            "EventNotificationState.NotificationState",
            "AccessSpec.CurrentState",
            "GPOWriteData.GPOData",
            "AntennaProperties.AntennaConnected",
            "GPIPortCurrentState.Config",
            "EventsAndReports.HoldEventsAndReportsUponReconnect",
            "C1G2InventoryCommand.TagInventoryStateAware",
            "FrequencyInformation.Hopping",
            "SET_READER_CONFIG.ResetToFactoryDefault",
        )
    },
    **{
        field: [(field.partition(".")[2], 6, 2)]
        for field in ("C1G2Filter.T", "C1G2TagInventoryMask.MB", "C1G2SingulationControl.Session", "C1G2Write.MB")
    },
}

#: Words of the golden XML, by field; "" for all fields. From the LLRP standard, sections 16 and 17.
_WORDS: dict[str, str] = {
    "": "false true",
    "GET_READER_CAPABILITIES.RequestedData": (
        "All General_Device_Capabilities LLRP_Capabilities Regulatory_Capabilities LLRP_Air_Protocol_Capabilities"
    ),
    "GET_READER_CONFIG.RequestedData": (
        "All Identification AntennaProperties AntennaConfiguration ROReportSpec ReaderEventNotificationSpec"
        " AccessReportSpec LLRPConfigurationStateValue KeepaliveSpec GPIPortCurrentState GPOWriteData EventsAndReports"
    ),
    "CommunicationsStandard": (
        "Unspecified US_FCC_Part_15 ETSI_302_208 ETSI_300_220 Australia_LIPD_1W Australia_LIPD_4W Japan_ARIB_STD_T89"
        " Hong_Kong_OFTA_1049 Taiwan_DGT_LP0002 Korea_MIC_Article_5_2"
    ),
    "ROReportTrigger": "None Upon_N_Tags_Or_End_Of_AISpec Upon_N_Tags_Or_End_Of_ROSpec",
    "EventNotificationState.EventType": (
        "Upon_Hopping_To_Next_Channel GPI_Event ROSpec_Event Report_Buffer_Fill_Warning Reader_Exception_Event"
        " RFSurvey_Event AISpec_Event AISpec_Event_With_Details Antenna_Event"
    ),
    "C1G2Filter.T": "Unspecified Do_Not_Truncate Truncate",
    "Target": (
        "SL Inventoried_State_For_Session_S0 Inventoried_State_For_Session_S1 Inventoried_State_For_Session_S2"
        " Inventoried_State_For_Session_S3"
    ),
    "C1G2TagInventoryStateAwareFilterAction.Action": (
        "AssertSLOrA_DeassertSLOrB AssertSLOrA_Noop Noop_DeassertSLOrB NegateSLOrABBA_Noop DeassertSLOrB_AssertSLOrA"
        " DeassertSLOrB_Noop Noop_AssertSLOrA Noop_NegateSLOrABBA"
    ),
    "C1G2TagInventoryStateUnawareFilterAction.Action": (
        "Select_Unselect Select_DoNothing DoNothing_Unselect Unselect_DoNothing Unselect_Select DoNothing_Select"
    ),
    "AISpecStopTriggerType": "Null Duration",
    "ROSpecStartTriggerType": "Null Immediate Periodic GPI",
    "ROSpecStopTriggerType": "Null Duration",
    "StopTriggerType": "Null Duration N_Iterations_Through_Frequency_Range",
    "AccessSpecStopTrigger.AccessSpecStopTrigger": "Null Operation_Count",
    "AccessReportTrigger": "Whenever_ROReport_Is_Generated End_Of_AccessSpec",
    "KeepaliveTriggerType": "Null Periodic",
    "CurrentState": "Disabled",
    "DRValue": "DRV_8 DRV_64_3",
    "MValue": "MV_FM0 MV_2 MV_4 MV_8",
    "ForwardLinkModulation": "PR_ASK",
    "SpectralMaskIndicator": "Unknown SI MI DI",
    "State": "Low High Unknown",
    "IDType": "MAC_Address",
    "ProtocolID": "Unspecified EPCGlobalClass1Gen2",
    "ROSpecEvent.EventType": "Start_Of_ROSpec End_Of_ROSpec Preemption_Of_ROSpec",
    "AISpecEvent.EventType": "End_Of_AISpec",
    "RFSurveyEvent.EventType": "Start_Of_RFSurvey End_Of_RFSurvey",
    "AntennaEvent.EventType": "Antenna_Disconnected Antenna_Connected",
    "Status": (
        "Success Failed_A_Reader_Initiated_Connection_Already_Exists"
        " Failed_A_Client_Initiated_Connection_Already_Exists Failed_Reason_Other_Than_A_Connection_Already_Exists"
        " Another_Connection_Attempted"
    ),
}

_CODES = {"M_Success": 0, "M_FieldError": 101, "A_Invalid": 300}

#: Names of the EdgeX JSON that differ from those of the standard's XML.
_EDGEX = {
    "AntennaConfigurations": "AntennaConfiguration",
    "EventNotificationStates": "EventNotificationState",
    "ReaderEventType": "EventType",
    "NotificationEnabled": "NotificationState",
    "KeepAliveSpec": "KeepaliveSpec",
    "Interval": "PeriodicTriggerValue",
    "GPIPortCurrentStates": "GPIPortCurrentState",
    "Enabled": "Config",
    "Data": "GPOData",
    "TransmitPowerIndex": "TransmitPower",
    "RFControl": "C1G2RFControl",
    "RFModeID": "ModeIndex",
    "SingulationControl": "C1G2SingulationControl",
    "EnableInventoryParamSpecID": "EnableInventoryParameterSpecID",
    "CRCEnabled": "EnableCRC",
    "PCBitsEnabled": "EnablePCBits",
    "MaxSupportedAntennas": "MaxNumberOfAntennaSupported",
    "HasUTCClock": "HasUTCClockCapability",
    "DeviceManufacturer": "DeviceManufacturerName",
    "Model": "ModelName",
    "FirmwareVersion": "ReaderFirmwareVersion",
    "ReceiveSensitivities": "ReceiveSensitivityTableEntry",
    "ReceiveSensitivity": "ReceiveSensitivityValue",
    "PerAntennaAirProtocols": "PerAntennaAirProtocol",
    "AirProtocolIDs": "ProtocolID",
    "SupportsEventsAndReportHolding": "SupportsEventAndReportHolding",
    "MaxPriorityLevelSupported": "MaxNumPriorityLevelsSupported",
    "ClientRequestedOpSpecTimeout": "ClientRequestOpSpecTimeout",
    "MaxROSpecs": "MaxNumROSpecs",
    "MaxSpecsPerROSpec": "MaxNumSpecsPerROSpec",
    "MaxInventoryParameterSpecsPerAISpec": "MaxNumInventoryParameterSpecsPerAISpec",
    "MaxAccessSpecs": "MaxNumAccessSpecs",
    "MaxOpSpecsPerAccessSpec": "MaxNumOpSpecsPerAccessSpec",
    "TransmitPowerLevels": "TransmitPowerLevelTableEntry",
    "FrequencyHopTables": "FrequencyHopTable",
    "Frequencies": "Frequency",
    "C1G2RFModes": "C1G2UHFRFModeTable",
    "UHFC1G2RFModeTableEntries": "C1G2UHFRFModeTableEntry",
    "ModeID": "ModeIdentifier",
    "DivideRatio": "DRValue",
    "IsEPCHagConformant": "EPCHAGTCConformance",
    "Modulation": "MValue",
    "SpectralMask": "SpectralMaskIndicator",
    "BackscatterDataRate": "BDRValue",
    "PIERatio": "PIEValue",
    "MinTariTime": "MinTariValue",
    "MaxTariTime": "MaxTariValue",
    "StepTariTime": "StepTariValue",
    "SupportsBlockErase": "CanSupportBlockErase",
    "SupportsBlockWrite": "CanSupportBlockWrite",
    "MaxSelectFiltersPerQuery": "MaxNumSelectFiltersPerQuery",
    "EPC96": "EPC_96",
    "FirstSeenUTC": "FirstSeenTimestampUTC",
    "UTC": "UTCTimestamp",
}
_EDGEX_OF = {
    "ROReportSpec": {"Trigger": "ROReportTrigger"},
    "KeepaliveSpec": {"Trigger": "KeepaliveTriggerType"},
    "LLRPStatus": {"Status": "StatusCode"},
    "GPIPortCurrentState": {"Port": "GPIPortNum"},
    "GPOWriteData": {"Port": "GPOPortNumber"},
}
#: Bits of LLRP 1.1 that a 1.0.1 message has zero.
_LATER = {
    "XPCBitsEnabled",
    "SupportsBlockPermalock",
    "SupportsTagRecommissioning",
    "SupportsUMIMethod2",
    "SupportsXPC",
}


def local(element: ElementTree.Element) -> str:
    return element.tag.partition("}")[2] or element.tag


def of_message(message: Parameter) -> Values:
    """What our codec found, without what is reserved."""
    return _collect(_ours(message, ()))


def of_xml(element: ElementTree.Element) -> Values:
    return _collect(_theirs(element, ()))


def of_edgex(body: dict[str, Any]) -> Values:
    return _collect(_edgex(body, ()))


def _collect(pairs: Iterator[tuple[Path, int | str]]) -> Values:
    found: Values = defaultdict(list)
    for path, value in pairs:
        found[path].append(value)
    return dict(found)


def _fields(name: str) -> list[str]:
    """Names of the fields as the standard has them: bits apart, nothing reserved."""
    names: list[str] = []
    for field, _ in _LAYOUTS[name].fields:
        names += [bit for bit, _, _ in _BITS.get(f"{name}.{field}", [(field, 0, 0)])]
    return [field for field in names if field != "Reserved"]


def _ours(parameter: Parameter, path: Path) -> Iterator[tuple[Path, int | str]]:
    alone = len(_fields(parameter.name)) == 1 and not parameter.children and path
    for field, value in parameter.values.items():
        whole = [(field, 0, 64)] if isinstance(value, int) else None
        for name, low, size in _BITS.get(f"{parameter.name}.{field}") or whole or [(field, 0, 0)]:
            at = path if alone else (*path, name)
            if field == "Reserved":
                continue
            if isinstance(value, int):
                number = value >> low & (1 << size) - 1 if size < 64 else value
                yield at, number
            elif isinstance(value, str):
                yield at, value
            elif isinstance(value, bytes):
                yield at, value.hex().upper()
            elif len(value) == 2 and isinstance(value[1], bytes):
                yield at, value[1].hex().upper()
            else:
                yield at, " ".join(map(str, value))
    for child in parameter.children:
        if not child.values and not child.children:
            yield (*path, child.name), ""
        yield from _ours(child, (*path, child.name))


def _theirs(element: ElementTree.Element, path: Path) -> Iterator[tuple[Path, int | str]]:
    parent = local(element)
    fields = _fields(parent)
    children = [one for one in element if local(one) not in fields]
    for leaf in element:
        name, text = local(leaf), (leaf.text or "").strip()
        if name in fields:
            yield path if len(fields) == 1 and not children and path else (*path, name), _value(parent, name, text)
    for child in children:
        assert local(child) in PARAMETER_TYPES, local(child)
        if not len(child) and not (child.text or "").strip() and not _fields(local(child)):
            yield (*path, local(child)), ""
        yield from _theirs(child, (*path, local(child)))


def _value(parent: str, name: str, text: str) -> int | str:
    layout = dict(_LAYOUTS[parent].fields)
    words = (_WORDS.get(f"{parent}.{name}") or _WORDS.get(name) or _WORDS[""]).split()
    if layout.get(name) == "y" and text in words:  # a list of one-byte numbers
        return f"{words.index(text):02X}"
    if layout.get(name) == "a" and parent == "C1G2Write":
        return " ".join(str(int(word, 16)) for word in text.split())
    if layout.get(name, "B") in "al":
        return " ".join(text.split())
    if layout.get(name, "B") in ("e", "y", "*", "12"):
        return text.upper()
    if layout.get(name) == "s":
        return text
    if "T" in text and name == "Microseconds":
        at = datetime.fromisoformat(text)
        return ((at if at.tzinfo else at.replace(tzinfo=UTC)) - _EPOCH) // timedelta(microseconds=1)
    return _CODES[text] if text in _CODES else words.index(text) if text in words else int(text)


def _edgex(value: Any, path: Path) -> Iterator[tuple[Path, int | str]]:
    """Absent is null, and also an uptime of zero or an EPC of no bits."""
    parent = path[-1] if path else ""
    if parent == "Uptime" and value == 0:
        return
    if isinstance(value, dict):
        if value == {"EPCNumBits": 0, "EPC": None}:
            return
        inner = [(key, one) for key, one in value.items() if key not in _LATER]
        assert not any(one for key, one in value.items() if key in _LATER)
        if not any(one is not None for _, one in inner):
            yield path, ""
        for key, one in inner:
            name = _EDGEX_OF.get(parent, {}).get(key) or _EDGEX.get(key, key)
            yield from _edgex(one, path if parent == name or (parent, name) in _WRAPPED else (*path, name))
    elif isinstance(value, list) and value and not isinstance(value[0], dict):
        yield path, " ".join(map(str, value))
    elif isinstance(value, list):
        for one in value:
            yield from _edgex(one, path)
    elif isinstance(value, str) and parent in ("EPC", "EPC_96", "ReaderID", "ProtocolID"):
        yield path, base64.b64decode(value).hex().upper()
    elif value is not None:
        yield path, int(value) if isinstance(value, bool) else value


#: Parameters of one field, which both sides write as a value.
_WRAPPED = {("EPC_96", "EPC")}
