"""What the messages mean: tag reports and states in, commands out."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from tms_agents.devices.llrp.codec import Message, Parameter
from tms_agents.devices.tags import TagRead

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
#: Bits of TagReportContentSelector: antenna, RSSI, first seen, last seen, seen count.
REPORT_CONTENT = 0x1780
ROSPEC_ID = 1


def tag_reads(message: Message) -> list[TagRead]:
    """The tags of a RO_ACCESS_REPORT. Reports without an EPC are left out."""
    return [
        TagRead(
            tag=epc,
            antenna=found.number("AntennaID") if (found := report.find("AntennaID")) else 0,
            rssi_dbm=float(found.number("PeakRSSI")) if (found := report.find("PeakRSSI")) else None,
            first_seen=time_of(report, "FirstSeenTimestampUTC"),
            last_seen=time_of(report, "LastSeenTimestampUTC"),
            count=found.number("TagCount") if (found := report.find("TagSeenCount")) else 1,
        )
        for report in message.all("TagReportData")
        if (epc := _epc(report))
    ]


def failure(message: Message) -> str | None:
    """Why the reader refuses, or None: a status other than success, a refused connection, a reader exception."""
    status = message.find("LLRPStatus")
    if status is not None and (code := status.number("StatusCode")):
        return f"{message.name}: status {code} {status.text('ErrorDescription')}".strip()
    event = message.find("ReaderEventNotificationData")
    if event is None:
        return None
    attempt = event.find("ConnectionAttemptEvent")
    if attempt is not None and (code := attempt.number("Status")):
        return f"the reader refuses the connection: {_ATTEMPTS.get(code, f'reason {code}')}"
    exception = event.find("ReaderExceptionEvent")
    return f"reader exception: {exception.text('Message')}" if exception is not None else None


_ATTEMPTS = {
    1: "it is connected to a client on its own initiative already",
    2: "another client is connected already",
    3: "it failed for another reason",
    4: "it tried to connect to a client itself",
}


def set_keepalive(period_ms: int) -> Message:
    spec = Parameter("KeepaliveSpec", {"KeepaliveTriggerType": 1, "PeriodicTriggerValue": period_ms})
    return Message("SET_READER_CONFIG", {"ResetToFactoryDefault": 0}, (spec,))


def add_rospec(antennas: tuple[int, ...] = (0,)) -> Message:
    """Read Gen2 tags for ever on ``antennas`` (0: all), report every tag; starts when enabled."""
    boundary = Parameter(
        "ROBoundarySpec",
        {},
        (
            Parameter("ROSpecStartTrigger", {"ROSpecStartTriggerType": 1}),
            Parameter("ROSpecStopTrigger", {"ROSpecStopTriggerType": 0, "DurationTriggerValue": 0}),
        ),
    )
    inventory = Parameter(
        "AISpec",
        {"AntennaIDs": antennas},
        (
            Parameter("AISpecStopTrigger", {"AISpecStopTriggerType": 0, "DurationTrigger": 0}),
            Parameter("InventoryParameterSpec", {"InventoryParameterSpecID": 1, "ProtocolID": 1}),
        ),
    )
    report = Parameter(
        "ROReportSpec",
        {"ROReportTrigger": 1, "N": 1},
        (Parameter("TagReportContentSelector", {"Enable": REPORT_CONTENT}),),
    )
    values = {"ROSpecID": ROSPEC_ID, "Priority": 0, "CurrentState": 0}
    return Message("ADD_ROSPEC", {}, (Parameter("ROSpec", values, (boundary, inventory, report)),))


def rospec(command: str, rospec_id: int = ROSPEC_ID) -> Message:
    """DELETE, START, STOP, ENABLE or DISABLE of one ROSpec (0: all)."""
    return Message(f"{command}_ROSPEC", {"ROSpecID": rospec_id})


def success() -> Parameter:
    return Parameter("LLRPStatus", {"StatusCode": 0, "ErrorDescription": ""})


def event(at: datetime, what: Parameter) -> Message:
    data = Parameter("ReaderEventNotificationData", {}, (_timestamp("UTCTimestamp", at), what))
    return Message("READER_EVENT_NOTIFICATION", {}, (data,))


def report(reads: list[TagRead]) -> Message:
    """RO_ACCESS_REPORT; 96-bit EPCs in their short form, others as EPCData."""
    return Message("RO_ACCESS_REPORT", {}, tuple(map(_report_data, reads)))


def _report_data(read: TagRead) -> Parameter:
    raw = bytes.fromhex(read.tag)
    parts = [
        Parameter("EPC_96", {"EPC": raw}) if len(raw) == 12 else Parameter("EPCData", {"EPC": (8 * len(raw), raw)}),
        Parameter("AntennaID", {"AntennaID": read.antenna}),
    ]
    if read.rssi_dbm is not None:
        parts.append(Parameter("PeakRSSI", {"PeakRSSI": round(read.rssi_dbm)}))
    if read.first_seen is not None:
        parts.append(_timestamp("FirstSeenTimestampUTC", read.first_seen))
    if read.last_seen is not None:
        parts.append(_timestamp("LastSeenTimestampUTC", read.last_seen))
    parts.append(Parameter("TagSeenCount", {"TagCount": read.count}))
    return Parameter("TagReportData", {}, tuple(parts))


def _timestamp(name: str, at: datetime) -> Parameter:
    return Parameter(name, {"Microseconds": (at - _EPOCH) // timedelta(microseconds=1)})


def _epc(report: Parameter) -> str:
    found = report.find("EPC_96") or report.find("EPCData")
    return found.hex("EPC") if found else ""


def time_of(report: Parameter, name: str) -> datetime | None:
    """Time of a child that holds microseconds since 1970, None where there is none."""
    found = report.find(name)
    if found is None:
        return None
    try:
        return _EPOCH + timedelta(microseconds=found.number("Microseconds"))
    except OverflowError:  # a clock beyond the year 9999
        return None
