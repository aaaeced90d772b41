"""What the messages mean: tag reports and states in, commands out."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from tms_agents.devices.llrp.codec import Message, Parameter, Value
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


#: Kinds of events to be told about: the ends of AISpecs, lost reports, antennas pulled and plugged in.
REPORT_BUFFER_EVENT, READER_EXCEPTION, AISPEC_EVENT, ANTENNA_EVENT = 3, 4, 6, 8


def set_config(keepalive_ms: int, events: tuple[int, ...] = ()) -> Message:
    """Keepalives of that period, and notification of kinds of events."""
    states = [Parameter("EventNotificationState", {"EventType": kind, "NotificationState": 0x80}) for kind in events]
    told = [Parameter("ReaderEventNotificationSpec", {}, tuple(states))] if states else []
    alive = Parameter("KeepaliveSpec", {"KeepaliveTriggerType": 1, "PeriodicTriggerValue": keepalive_ms})
    return Message("SET_READER_CONFIG", {"ResetToFactoryDefault": 0}, (*told, alive))


def get_antenna_properties() -> Message:
    return Message("GET_READER_CONFIG", {"AntennaID": 0, "RequestedData": 2, "GPIPortNum": 0, "GPOPortNum": 0})


def unplugged_antennas(message: Message) -> set[int]:
    """Antennas that a reader reports as not connected; none where it sees no antenna at all, as it cannot tell then."""
    connected = {
        one.number("AntennaID"): bool(one.number("AntennaConnected") & 0x80) for one in message.all("AntennaProperties")
    }
    return {antenna for antenna, yes in connected.items() if not yes} if any(connected.values()) else set()


def add_rospec(antennas: tuple[int, ...] = (0,)) -> Message:
    """Read Gen2 tags for ever on ``antennas`` (0: all), report every tag at once; starts when enabled."""
    start = Parameter("ROSpecStartTrigger", {"ROSpecStartTriggerType": 1})
    return _add_rospec(start, [_aispec(antennas, {"AISpecStopTriggerType": 0, "DurationTrigger": 0})], reads=1)


def add_round_rospec(antennas: tuple[int, ...], round_ms: int) -> Message:
    """Again and again one AISpec of ``round_ms`` per antenna; its tags are reported when it ends.

    ``ROReportTrigger`` 1 with N = 0 means: at the end of each AISpec and not before.
    """
    period = Parameter("PeriodicTriggerValue", {"Offset": 0, "Period": len(antennas) * round_ms + _REST_MS})
    start = Parameter("ROSpecStartTrigger", {"ROSpecStartTriggerType": 2}, (period,))
    stop: dict[str, Value] = {"AISpecStopTriggerType": 1, "DurationTrigger": round_ms}
    return _add_rospec(start, [_aispec((antenna,), stop) for antenna in antennas], reads=0)


#: Between the end of one ROSpec and its next start, which a reader still busy would leave out.
_REST_MS = 20


def _aispec(antennas: tuple[int, ...], stop: dict[str, Value]) -> Parameter:
    inventory = Parameter("InventoryParameterSpec", {"InventoryParameterSpecID": 1, "ProtocolID": 1})
    return Parameter("AISpec", {"AntennaIDs": antennas}, (Parameter("AISpecStopTrigger", stop), inventory))


def _add_rospec(start: Parameter, aispecs: list[Parameter], reads: int) -> Message:
    stop = Parameter("ROSpecStopTrigger", {"ROSpecStopTriggerType": 0, "DurationTriggerValue": 0})
    boundary = Parameter("ROBoundarySpec", {}, (start, stop))
    content = Parameter("TagReportContentSelector", {"Enable": REPORT_CONTENT})
    report = Parameter("ROReportSpec", {"ROReportTrigger": 1, "N": reads}, (content,))
    values = {"ROSpecID": ROSPEC_ID, "Priority": 0, "CurrentState": 0}
    return Message("ADD_ROSPEC", {}, (Parameter("ROSpec", values, (boundary, *aispecs, report)),))


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
