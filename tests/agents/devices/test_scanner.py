"""Barcode scanners: every ending and prefix, GS1 symbols as another library reads them, and misreads."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_listening import on_a_line

from tms_agents.devices.scanner import Misread, Scan, ScannerSession, check_digit, decode, product_code
from tms_agents.devices.scanner_emulator import ScannerDevice
from tms_agents.devices.transport import DeviceState, Link

JAN = "4901777018686"
codes = st.sampled_from([7, 11, 12]).flatmap(
    lambda size: st.text("0123456789", min_size=size, max_size=size).map(lambda body: body + check_digit(body))
)


@pytest.mark.parametrize(("body", "digit"), [("490177701868", "6"), ("456995111611", "7"), ("9638507", "4")])
def test_check_digits_of_known_codes(body, digit):
    assert check_digit(body) == digit


@given(codes, st.sampled_from(["\r", "\n", "\r\n"]), st.booleans(), st.lists(st.integers(1, 5), max_size=20))
def test_whatever_the_scanner_is_set_to_the_code_is_the_same(code, ending, aim, sizes):
    raw, session, got = ScannerDevice(ending=ending, aim=aim).scan(code), ScannerSession(), []
    for size in sizes:
        got += session.receive(raw[:size])
        raw = raw[size:]
    got += session.receive(raw)
    assert [scan.code[-len(code) :] for scan in got] == [code] and isinstance(got[0], Scan)


@given(codes, st.data())
def test_one_wrong_digit_is_always_noticed(code, data):
    place = data.draw(st.integers(0, len(code) - 1))
    wrong = data.draw(st.sampled_from([digit for digit in "0123456789" if digit != code[place]]))
    found = decode(code[:place] + wrong + code[place + 1 :])
    assert isinstance(found, Misread) and "check digit" in found.why


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (JAN, JAN),
        (f"]E0{JAN}", JAN),
        ("]E0490177701868", None),
        ("]E449123456", "49123456"),
        (f"]E3{JAN}12", JAN),
        (f"]C101{'0' + JAN}", JAN),
        (f"]C110ABC123\x1d01{'0' + JAN}", JAN),
        (f"]C1\x1d01{'0' + JAN}17261231", JAN),
        (f"]Q301{'0' + JAN}21XYZ\x1d10LOT", JAN),
        (f"]d217261231310300050001{'0' + JAN}", JAN),
        ("]C10180614141123458", "80614141123458"),
        (f"(01){'0' + JAN}(17)261231", JAN),
        (f"(17)261231(01){'0' + JAN}", JAN),
        (f"]Q1https://id.example.com/01/{'0' + JAN}/21/7", JAN),
        (f"]Q3https://id.example.com/01/{'0' + JAN}/21/7", JAN),
        (f"https://id.example.com/01/{'0' + JAN}?17=261231", JAN),
        ("]C1000123456789012345675", None),
        ("]C110ABC123", None),
        ("]A0HELLO", None),
        ("HELLO", None),
        ("123", None),
        ("٤٩٠١٧٧٧٠١٨٦٨٦", None),
    ],
)
def test_what_scanners_send(line, code):
    found = decode(line)
    assert found == Scan(code) if code else isinstance(found, Misread)
    assert product_code(line) == code


elements = st.lists(
    st.sampled_from(["17261231", "11260101", "3103000500", "10ABC-1\x1d", "21S/N1\x1d", "37100\x1d", "422392\x1d"]),
    max_size=3,
    unique_by=lambda element: element[:2],
)


@given(codes.filter(lambda code: len(code) == 13), elements, elements)
def test_gs1_symbols_give_the_gtin_that_biip_finds(code, before, after):
    from biip.gs1_messages import GS1Message

    text = f"{''.join(before)}010{code}{''.join(one for one in after if one not in before)}"
    expected = GS1Message.parse(text).element_strings.get(ai="01")
    assert expected is not None and expected.gtin is not None
    assert decode(f"]C1{text}") == Scan(expected.gtin.as_gtin_13())


@given(st.lists(st.binary(max_size=300), max_size=10))
def test_any_bytes_are_survived(pieces):
    session = ScannerSession()
    for piece in pieces:
        session.receive(piece)


def test_half_a_line_is_dropped_when_it_goes_no_further():
    now = [0.0]
    session = ScannerSession(clock=lambda: now[0])
    assert session.receive(b"49017") == []
    now[0] = 2.0
    session.tick()
    assert session.receive(f"{JAN}\r".encode()) == [Scan(JAN)]


@pytest.mark.parametrize("kind", ["pty", "tcp"])
async def test_a_cable_pulled_in_the_middle_of_a_code(kind):
    """Connected though nobody scans; then half a code, no cable, a cable, a code: one scan."""
    device = ScannerDevice(aim=True)
    async with on_a_line(kind, device) as (line, opener):
        seen: list[Scan | Misread | DeviceState] = []
        link = Link(opener, ScannerSession, name="scanner", silent_after_s=0.2, tick_s=0.02)
        async with asyncio.timeout(10), contextlib.aclosing(link.listen()) as groups:
            async for group in groups:
                seen += [group] if isinstance(group, DeviceState) else group
                states = [item.state for item in seen if isinstance(item, DeviceState)]
                if states == ["connected"]:
                    await asyncio.sleep(0.3)  # nobody scans
                    line.inject(device.scan(JAN)[:9])
                    await asyncio.sleep(0.1)
                    line.hang_up()
                elif states[-1] == "faulty" and kind == "pty":
                    line.plug_in()
                elif len(states) == 3 and not any(isinstance(item, Scan) for item in seen):
                    line.inject(device.scan(JAN))
                if isinstance(seen[-1], Scan | Misread):
                    break
    assert states == ["connected", "faulty", "connected"] and seen[-1] == Scan(JAN)
