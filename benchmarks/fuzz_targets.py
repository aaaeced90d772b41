"""Every parser of device bytes, with well-formed samples of what it parses: what ``fuzz_devices.py`` feeds."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tms_agents.devices.arcos import ArcosSession
from tms_agents.devices.arcos.codec import MAX_PACKET, Packet, PacketParser
from tms_agents.devices.arcos.sip import Status
from tms_agents.devices.cola import ColaSession
from tms_agents.devices.cola.framing import MAX_FRAME as MAX_COLA
from tms_agents.devices.cola.framing import Dialect
from tms_agents.devices.cola.framing import FrameParser as ColaParser
from tms_agents.devices.cola.scandata import Channel, ScanData
from tms_agents.devices.cola.values import Reader, Writer
from tms_agents.devices.lines import LineParser
from tms_agents.devices.llrp.codec import MAX_MESSAGE
from tms_agents.devices.llrp.codec import FrameParser as LlrpParser
from tms_agents.devices.llrp.session import LlrpSession
from tms_agents.devices.lms200 import Lms200Session
from tms_agents.devices.lms200 import messages as lms
from tms_agents.devices.lms200.codec import MAX_FRAME as MAX_LMS
from tms_agents.devices.lms200.codec import Frame as LmsFrame
from tms_agents.devices.lms200.codec import FrameParser as LmsParser
from tms_agents.devices.lms200.profiles import Profile
from tms_agents.devices.loadboard import RosTmsBoardBurst, RosTmsBoardSession
from tms_agents.devices.modbus import StatusRegister, WeighingMap
from tms_agents.devices.scales import DialectName, ScaleLineSession
from tms_agents.devices.scanner import ScannerSession
from tms_agents.devices.scip import MODELS, Measure, ScipSession, ScipSettings
from tms_agents.devices.scip import ReplyParser as ScipParser
from tms_agents.devices.scip import measurement as scip_measurement
from tms_agents.devices.scip import wording as scip
from tms_agents.devices.scip.frames import MAX_REPLY
from tms_agents.devices.sessions import Asking
from tms_agents.devices.text_reader import Rdm6300Parser, TextReaderSession
from tms_agents.devices.thingmagic.codec import ReplyParser
from tms_agents.devices.thingmagic.session import ThingMagicSession
from tms_agents.devices.tr3.codec import MAX_FRAME
from tms_agents.devices.tr3.codec import FrameParser as Tr3Parser
from tms_agents.devices.tr3.session import Tr3Session
from tms_agents.devices.transport import DeviceFault, Session


@dataclass(slots=True)
class Target:
    """One parser: ``feed`` takes bytes, ``held`` tells how many it keeps and ``most`` how many it may.

    ``samples`` are well-formed input, to be mutated.
    """

    feed: Callable[[bytes], object]
    held: Callable[[], int]
    most: int
    samples: Sequence[bytes]


class _Clocked:
    """A session whose time goes on: two milliseconds at most inputs, then a pause in which the line is quiet."""

    def __init__(self, session: Callable[[Callable[[], float]], Session[object]]) -> None:
        self._make, self._now, self._fed = session, 0.0, 0
        self._begin()

    def _begin(self) -> None:
        self._session = self._make(lambda: self._now)
        self._session.opened()

    def feed(self, data: bytes) -> None:
        self._fed += 1
        try:
            asking = self._session if isinstance(self._session, Asking) else None
            if asking is None or asking.answered(data) is None:
                self._session.receive(data)
            for _ in range(1 if self._fed % 7 else 5):
                self._now += 0.002 if self._fed % 7 else 0.3
                if asking is not None and self._fed % 3:
                    asking.nothing_by(self._now)
                self._session.tick()
                if asking is not None:
                    asking.finished()
                self._session.output()
        except DeviceFault:
            self._begin()
            raise

    def held(self) -> int:
        session: Any = self._session
        return int(session.pending)


def _session(
    make: Callable[[Callable[[], float]], Session[object]], most: int, samples: Sequence[bytes]
) -> Callable[[], Target]:
    def target() -> Target:
        clocked = _Clocked(make)
        return Target(clocked.feed, clocked.held, most, samples)

    return target


_TR3 = [
    bytes.fromhex(text)
    for text in (
        "02004E040000001C03730D",  # command mode
        "02004E029C0103F20D",  # antenna 1
        "02007803F0000103710D",  # inventory
        "02003000 03350D",
        "020030029C0103D40D",
        "02003002F00203290D 0200490900 7AF9174E000104E0 03140D 0200490900 7AF9174E000104E0 03140D",
        "020031014403 7B0D",
        "02004C18 C8FF4787500104E01A20F26106B1BAAE0000000000000000 03DF0D",
    )
]
_LLRP = [
    bytes.fromhex(text)
    for text in (
        "040300000014000000030000dc00090100002710",  # keepalive every 10 s
        "04140000004b0000000500b1004100000001000000b2001200b300050100b60009000000000000b700180001000000b80009"
        "000000000000ba000700010100ed000d01000100ee00061780",  # add a ROSpec
        "04180000000e0000000600000001",  # enable it
        "043f000000200ab288c900f600160080000c0004f8535baadaff010000060000",  # the reader's greeting
        "041f0000001200000004011f000800000000",  # success
        "043d0000002c4095892f00f000228d3005fb63ac1f3841ec88046781000186ce820004ec2ea8354c09880001",  # a tag
        "043e0000000a00000008",  # keepalive
    )
]
_THINGMAGIC = [
    bytes.fromhex(text)
    for text in (
        "FF14040000071023000100000320141007010702090000001052 51",  # the firmware starts
        "FF00970000779E",  # region
        "FF00930000371A",  # protocol
        "FF009100001758 FF002A000001E8",  # antenna, buffer cleared
        "FF04220000000000017BA9",  # one tag found
        "FF192900000007000102CE110080300030352B2E4401D3000000007BD1002A81",  # here it is
        "FF0E210000E200322FE20DF9311328B7E3D100AAD0",  # one tag
        "FF00210400B483",  # none
    )
]
_SCANNER = [b"4901777018686\r", b"]E04901777018686\r\n", b"]C1010490177701868610LOT\x1d21X\n", b"(01)04901777018686\r"]
_TEXT_READER = [b"E00401004E17F97A\r\n", b"UID: E0:04:01:00:4E:17:F9:7A\n"]
_RDM6300 = [b"\x024B00E29E3B0C\x03", b"\x02" + b"0123456789" + b"89" + b"\x03"]
_RDM_FRAME = 14
_MOST_THINGMAGIC = 257
_BOARD = [b"246\r\n", b'"-17"OK\r\n', b"OK\r\n8388607\r\n", b"0\n"]
_SCALES: dict[DialectName, list[bytes]] = {
    "openscale": [b"12034,0.412,kg,25.81,0,\r\n", b"12,25.81,0,1.0,lbs\r\n", b"0.4,kg,\r\n", b"Readings:\r\n"],
    "and": [b"ST,+001234.5  g\r\n", b"US,-0000012.3   g\r\n", b"OL,+9999999E+19\r\n", b"EC,E01\r\n", b"\x06\r\n"],
    "mt-sics": [b"S S     100.00 g\r\n", b"S D      -1.23 kg\r\n", b"S +\r\n", b"ES\r\n", b"T S    1.0 g\r\n"],
}
_LONGEST_TEXT = 200


def _scip(name: str, request: Measure) -> list[bytes]:
    """What a Hokuyo sensor says: when it is set up, while it measures, of its faults; all at once."""
    model = MODELS[name]
    state = scip.state(model, laser_on=True, speed=model.parameters.scan, baud=19200, stamp_ms=4711, broken=False)
    raw = np.arange(request.beams, dtype=np.int32) * 7 % 5000
    scan = scip.stamp(4711) + scip.data(raw, raw if request.code[1] == "E" else None, request.width)
    said = [
        scip.reply("QT", "00"),
        scip.reply("PP", "00", scip.fields(model.parameters.lines())),
        scip.reply("VV", "00", scip.fields(scip.version(model))),
        scip.reply("II", "00", scip.fields(state)),
        scip.reply(request.encode(), "00"),
        scip.reply(request.encode(), "99", scan),
    ]
    old = [b"QT\nE\n\n", b"SCIP2.0\n0\n\n", b"G04404701\n0\n0D0E0F0G\n\n"]
    faults = [scip.reply("QT", "0E"), scip.reply(request.encode(), "51"), scip.reply("II", "0L")]
    return [b"".join(said), b"".join(said), said[-1], *said, *old, *faults]


def _scip_frames() -> Target:
    parser = ScipParser()

    def feed(data: bytes) -> None:
        for reply in parser.feed(data):
            scip_measurement(reply)

    samples = _scip("UST-20LX", Measure("ME", 500, 560)) + _scip("URG-04LX", Measure("MS", 44, 100, 3))
    return Target(feed, lambda: parser.pending, MAX_REPLY, samples)


def _parser(make: Callable[[], Any], longest: int, samples: Sequence[bytes]) -> Callable[[], Target]:
    def target() -> Target:
        parser = make()
        return Target(parser.feed, lambda: int(parser.pending), longest, samples)

    return target


def _registers() -> Target:
    """What a module puts into its registers; the frames around them are parsed by pymodbus."""
    kinds = [
        WeighingMap(cells=(0, 2), kind=kind, low_word_first=low, status=StatusRegister(address=4, stable=1))
        for kind in ("int32", "float32", "uint16")
        for low in (True, False)
    ]

    def feed(data: bytes) -> None:
        words = data.ljust(10, b"\x00")
        registers = {i: words[2 * i] << 8 | words[2 * i + 1] for i in range(5)}
        for kind in kinds:
            kind.decode(registers)

    return Target(feed, lambda: 0, 0, [bytes(10), b"\xff" * 10, b"\x7f\xc0\x00\x00\x00\x01\x02\x03\x00\x01"])


def _scale(dialect: DialectName) -> tuple[str, Callable[[], Target]]:
    name = f"scale {dialect}"
    return name, _session(
        lambda clock: ScaleLineSession(dialect, clock=clock, software_parity=False), _LONGEST_TEXT, _SCALES[dialect]
    )


def _lms200(*, reflectivity: bool) -> list[bytes]:
    """What the scanner answers while it is set up, scans of both kinds, a power-on."""
    beams = np.arange(1000, 1101, dtype=np.uint16)
    strength = np.arange(20, dtype=np.uint8) if reflectivity else None
    code = lms.RANGES_AND_REFLECTIVITY if reflectivity else lms.RANGES
    bodies = [
        bytes([lms.reply_to(lms.SWITCH_MODE), 0]),
        bytes([lms.reply_to(lms.TYPE)]) + b"LMS200;30106;V02.10 ",
        bytes([lms.reply_to(lms.READ_CONFIG)]) + bytes(34),
        bytes([lms.reply_to(lms.VARIANT), 1, 100, 0, 100, 0]),
        bytes([lms.reply_to(lms.STATUS)]) + lms.Status(lms.STREAM, 0, 100, 1.0, "mm").encode(),
        bytes([code]) + Profile(beams, "mm", reflectivity=strength).encode(),
        bytes([lms.POWER_ON]) + b"LMS200",
    ]
    said = [b"\x06" + LmsFrame(body + b"\x00", 0x80).encode() for body in bodies]
    set_up = b"".join([*said[:5], said[0]])
    return [*said, set_up + said[5], set_up + said[5], said[5]]


def _lms200_frames() -> Target:
    parser = LmsParser()

    def feed(data: bytes) -> None:
        for item in parser.feed(data):
            if isinstance(item, LmsFrame) and item.code in (lms.RANGES, lms.RANGES_AND_REFLECTIVITY):
                with contextlib.suppress(ValueError):
                    Profile.of(item.code, item.data).ranges(0)

    samples = _lms200(reflectivity=False) + _lms200(reflectivity=True)
    return Target(feed, lambda: parser.pending, MAX_LMS, samples)


def _cola(dialect: Dialect) -> list[bytes]:
    """What the scanner answers while it is set up, a scan, refusals."""
    values = np.arange(60, dtype=np.uint16)
    scan = ScanData((Channel("DIST1", values), Channel("RSSI1", values, bits=8)), encoders=((7, 8),))
    answers = [
        Writer(dialect, "sRA", "SCdevicestate").put("B", 1),
        Writer(dialect, "sEA", "LMDscandata").put("B", 1),
        Writer(dialect, "sRA", "DeviceIdent").text("TiM571").text("V1"),
        Writer(dialect, "sRA", "SerialNumber").text("21010042"),
        Writer(dialect, "sAN", "SetAccessMode").put("B", 1),
        Writer(dialect, "sWA", "LMDscandatacfg"),
        Writer(dialect, "sAN", "LMCstartmeas").put("B", 0),
        Writer(dialect, "sAN", "Run").put("B", 1),
        Writer(dialect, "sEA", "LMDscandata").put("B", 1),
    ]
    said = [answer.telegram().encode() for answer in answers]
    said.append(scan.telegram(dialect).encode())
    refusal = Writer(dialect, "sFA").put("H", 3).telegram().encode()
    return [*said, refusal, b"".join(said), b"".join(said), said[-1]]


def _cola_frames() -> Target:
    parser = ColaParser()

    def feed(data: bytes) -> None:
        for telegram in parser.feed(data):
            with contextlib.suppress(ValueError):
                ScanData.of(Reader(telegram))

    return Target(feed, lambda: parser.pending, MAX_COLA, _cola("A") + _cola("B"))


#: Every parser of bytes that come from a device. A new driver adds its line here.
_ARCOS = [
    Packet(0).encode(),
    Packet(1).encode(),
    Packet(2, b"Name\0Pioneer\0p3dx-sh\0").encode(),
    Status(moving=False, x=5, y=0x7FFF, heading=-2048, left=0, right=0, battery=126).encode().encode(),
    Status(moving=True, x=9, y=1, heading=7, left=3, right=-3, battery=110, sonars=((0, 500), (7, 5000)), rotation=-12)
    .encode()
    .encode(),
]

TARGETS: list[tuple[str, Callable[[], Target]]] = [
    ("lines", _parser(LineParser, _LONGEST_TEXT, [*_BOARD, *_SCALES["and"]])),
    ("tr3 frames", _parser(Tr3Parser, MAX_FRAME, _TR3)),
    ("tr3 session", _session(lambda clock: Tr3Session(antennas=(0, 1), clock=clock), MAX_FRAME, _TR3)),
    ("llrp messages", _parser(LlrpParser, MAX_MESSAGE, _LLRP)),
    ("llrp session", _session(lambda _: LlrpSession(), MAX_MESSAGE, _LLRP)),
    ("llrp rounds", _session(lambda _: LlrpSession(antennas=(1, 2), round_s=0.2), MAX_MESSAGE, _LLRP)),
    ("thingmagic frames", _parser(ReplyParser, _MOST_THINGMAGIC, _THINGMAGIC)),
    (
        "thingmagic session",
        _session(lambda clock: ThingMagicSession(antennas=(1, 2), clock=clock), _MOST_THINGMAGIC, _THINGMAGIC),
    ),
    ("arcos packets", _parser(PacketParser, MAX_PACKET, _ARCOS)),
    ("arcos session", _session(lambda clock: ArcosSession(drives=True, clock=clock), MAX_PACKET, _ARCOS)),
    ("scanner", _session(lambda clock: ScannerSession(clock=clock), _LONGEST_TEXT, _SCANNER)),
    ("text reader", _session(lambda clock: TextReaderSession(clock=clock), _LONGEST_TEXT, _TEXT_READER)),
    ("rdm6300 frames", _parser(Rdm6300Parser, _RDM_FRAME, _RDM6300)),
    ("load-cell board", _session(lambda clock: RosTmsBoardSession(clock=clock), _LONGEST_TEXT, _BOARD)),
    ("board, all at once", _session(lambda clock: RosTmsBoardBurst(clock=clock), _LONGEST_TEXT, _BOARD)),
    _scale("openscale"),
    _scale("and"),
    _scale("mt-sics"),
    ("modbus registers", _registers),
    ("scip frames", _scip_frames),
    (
        "scip session",
        _session(
            lambda clock: ScipSession(reply_s=5.0, stall_s=5.0, clock=clock),
            MAX_REPLY,
            _scip("UST-20LX", Measure("ME", 0, 1080)),
        ),
    ),
    (
        "scip 2-character session",
        _session(
            lambda clock: ScipSession(
                ScipSettings(short=True, angle_min=-0.5, angle_max=0.5, cluster=3),
                reply_s=5.0,
                stall_s=5.0,
                clock=clock,
            ),
            MAX_REPLY,
            _scip("URG-04LX", Measure("MS", 303, 465, 3)),
        ),
    ),
    ("lms200 frames", _lms200_frames),
    (
        "lms200 session",
        _session(
            lambda clock: Lms200Session(angle_deg=100, resolution_deg=1.0, clock=clock),
            MAX_LMS,
            _lms200(reflectivity=False),
        ),
    ),
    (
        "lms200 reflectivity",
        _session(
            lambda clock: Lms200Session(output="reflectivity", angle_deg=100, resolution_deg=1.0, clock=clock),
            MAX_LMS,
            _lms200(reflectivity=True),
        ),
    ),
    ("cola frames", _cola_frames),
    ("cola a session", _session(lambda clock: ColaSession(clock=clock), MAX_COLA, _cola("A"))),
    ("cola b session", _session(lambda clock: ColaSession(dialect="B", clock=clock), MAX_COLA, _cola("B"))),
]
