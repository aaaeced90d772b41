"""Barcodes, tags and names are told apart; the local decoding agrees with the server's."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_agents.intake.codes import Barcode, TagId, Text, Unusable, barcode, sgtin_96, tag_id, typed
from tms_server.objects.gtin import canonical_gtin, gtin_of_epc

JAN = "4901777018686"


@pytest.mark.parametrize(
    "code",
    [
        *(JAN, f" {JAN}\r", f"]E0{JAN}", f"]C101{JAN.zfill(14)}1726010110ABC", f"(01){JAN.zfill(14)}(17)260101"),
        *(f"https://id.gs1.org/01/{JAN.zfill(14)}/21/12", f"https://example.com/01/{JAN}?x=1"),
    ],
)
def test_forms_of_a_barcode(code):
    found = barcode(code)
    assert isinstance(found, Barcode) and found.digits.zfill(14) == JAN.zfill(14)
    assert typed(code) == found


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("4901777018687", "read wrongly"),
        ("49017770", "read wrongly"),
        ("123", "no product barcode"),
        ("", "no product barcode"),
        ("https://example.com", "no product barcode"),
        ("]C1" + "9" * 48, "no product barcode"),
        ("x" * 500, "..."),
    ],
)
def test_what_is_no_barcode(code, why):
    found = barcode(code)
    assert isinstance(found, Unusable) and why in found.why and len(found.why) < 200


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (JAN, Barcode(JAN)),
        ("49968712", Barcode("49968712")),
        ("e00401004e17f97a", TagId("E00401004E17F97A")),
        ("E0:04:01:00:4E:17:F9:7A", TagId("E00401004E17F97A")),
        ("30352B2E4401D3000000007B", TagId("30352B2E4401D3000000007B")),
        ("0123456789012345", TagId("0123456789012345")),
        ("tag: 04112233", TagId("04112233")),
        ("TAG:cup-7", TagId("CUP-7")),
        ("tag heuer", Text("tag heuer")),
        ("お茶", Text("お茶")),
        ("", Text("")),
    ],
)
def test_lines_of_the_keyboard(line, expected):
    assert typed(line) == expected


@pytest.mark.parametrize(
    ("line", "part"), [("4901777018687", "again"), ("04112233", "tag:04112233"), ("tag: あ", "no tag")]
)
def test_lines_that_are_wrong(line, part):
    found = typed(line)
    assert isinstance(found, Unusable) and part in found.why


@given(st.text(max_size=100))
def test_any_text_is_something(text):
    for found in (typed(text), barcode(text), tag_id(text)):
        if isinstance(found, Barcode):
            assert canonical_gtin(found.digits)
        if isinstance(found, TagId):
            assert 1 <= len(found.tag) <= 64 and found.tag == found.tag.upper()


@given(
    st.text("0123456789ABCDEF", min_size=22, max_size=22).map("30".__add__) | st.text("0123456789ABCDEF", max_size=30)
)
def test_the_number_inside_a_tag_is_the_one_that_the_server_finds(tag):
    mine = sgtin_96(tag)
    theirs = gtin_of_epc(tag)
    assert (mine and mine.zfill(14)) == (theirs and theirs.zfill(14)) or mine == "0" * 13


def test_a_known_tag():
    assert sgtin_96("30352B2E4401D3000000007B") == JAN
    assert sgtin_96("3074257BF7194E4000001A85") == "80614141123458"
