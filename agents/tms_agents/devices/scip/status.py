"""Status codes of SCIP 2 in words. Source: C-42-03320B; 0L, 0M and 10 from SCIP 2.2 sensors."""

from __future__ import annotations

OK, SCAN = "00", "99"

_COMMON = {
    "0A": "cannot make a reply",
    "0B": "buffer is full, or the command is being processed already",
    "0C": "too few parameters",
    "0D": "undefined command",
    "0E": "undefined command",
    "0F": "command is not supported",
    "0G": "text of more than 16 characters",
    "0H": "wrong characters in the text",
    "0I": "waits for new firmware; cut its supply",
    "0L": "abnormal state",
    "0M": "unstable, as while it starts",
    "10": "denied in this state, or the laser is off",
}
_MEASURE = {
    "01": "first step is no number",
    "02": "last step is no number",
    "03": "cluster is no number",
    "04": "last step is out of range",
    "05": "last step is before the first",
    "06": "skipped scans are no number",
    "07": "number of scans is no number",
    "98": "works again",
}
_LASER = {"01": "the laser does not work", "02": "is measuring already"}


def meaning(command: str, status: str) -> str:
    """``status 04 last step is out of range``."""
    measures = command[:1] in ("M", "G")
    words = _COMMON.get(status) or (_MEASURE if measures else _LASER).get(status, "")
    if not words and measures and status.isdigit():
        words = "is checking itself" if is_checking(status) else "hardware fault" if is_hardware(status) else ""
    return f"status {status} {words}".strip()


def is_checking(status: str) -> bool:
    """The sensor has stopped scans to find out whether something is wrong, or found that nothing is (98)."""
    return status in ("0M", "98") or (status.isdigit() and 21 <= int(status) <= 49)


def is_hardware(status: str) -> bool:
    """Laser, motor or another part has failed."""
    return status.isdigit() and 50 <= int(status) <= 97
