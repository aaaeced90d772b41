"""JAN, EAN, UPC and GTIN are one number; the check digit is verified."""

from __future__ import annotations

import random

import pytest
from epcpy.epc_schemes.sgtin import SGTIN, SGTINFilterValue
from hypothesis import given
from hypothesis import strategies as st

from tms_server.objects.gtin import InvalidGtin, canonical_gtin, gtin_of_epc, in_store, names_its_company


def with_check_digit(payload: str) -> str:
    """By the rule of GS1: weights 3, 1, 3 ... from the right."""
    total = sum(int(digit) * (3 if i % 2 == 0 else 1) for i, digit in enumerate(reversed(payload)))
    return payload + str(-total % 10)


digits = st.text("0123456789", min_size=1)
gtins = (
    st.sampled_from([8, 12, 13, 14])
    .flatmap(lambda n: st.text("0123456789", min_size=n - 1, max_size=n - 1).filter(lambda t: set(t) != {"0"}))
    .map(with_check_digit)
)


@given(gtins)
def test_all_forms_of_a_number_have_one_canonical_form(gtin: str) -> None:
    canonical = canonical_gtin(gtin)
    assert int(canonical) == int(gtin)
    assert len(canonical) in (8, 13, 14)
    number = gtin.lstrip("0")
    for length in (8, 12, 13, 14):
        if len(number) <= length:
            assert canonical_gtin(number.zfill(length)) == canonical


@given(gtins, st.integers(1, 9))
def test_another_check_digit_is_refused(gtin: str, by: int) -> None:
    wrong = gtin[:-1] + str((int(gtin[-1]) + by) % 10)
    with pytest.raises(InvalidGtin, match="check digit"):
        canonical_gtin(wrong)


@pytest.mark.parametrize(
    ("given_form", "canonical"),
    [
        ("4901234567894", "4901234567894"),
        ("04901234567894", "4901234567894"),
        ("036000291452", "0036000291452"),
        ("0036000291452", "0036000291452"),
        ("00036000291452", "0036000291452"),
        ("49968712", "49968712"),
        ("0000049968712", "49968712"),
        ("10614141000415", "10614141000415"),
    ],
)
def test_known_numbers(given_form: str, canonical: str) -> None:
    assert canonical_gtin(given_form) == canonical


@pytest.mark.parametrize(
    "text", ["", "4901234567890", "490123456789", "abc", "٤٩٠١٢٣٤٥٦٧٨٩٤", "4901234567894\n", "0" * 13]
)
def test_what_is_no_gtin(text: str) -> None:
    with pytest.raises(InvalidGtin):
        canonical_gtin(text)


def test_an_sgtin_tag_carries_its_gtin() -> None:
    # The example of the GS1 Tag Data Standard: urn:epc:id:sgtin:0614141.812345.6789.
    assert gtin_of_epc("3074257BF7194E4000001A85") == "80614141123458"


@given(
    st.text("0123456789ABCDEF", min_size=24, max_size=24)
    | st.text("0123456789ABCDEF", min_size=22, max_size=22).map("30".__add__)
)
def test_any_other_tag_carries_none_and_breaks_nothing(tag: str) -> None:
    found = gtin_of_epc(tag)
    assert found is None or canonical_gtin(found) == found


def sgtin(company: str, item: str) -> str:
    """An SGTIN-96 tag; the first digit of ``item`` is the indicator."""
    tag: str = SGTIN.from_epc_uri(f"urn:epc:id:sgtin:{company}.{item}.123").hex(
        binary_coding_scheme=SGTIN.BinaryCodingScheme.SGTIN_96, filter_value=SGTINFilterValue.POS_ITEM
    )
    return tag.upper()


@pytest.mark.parametrize(
    ("company", "item", "gtin", "trusted"),
    [
        ("4901777", "001868", "4901777018686", True),  # seven digits
        ("456995111", "0161", "4569951111617", True),  # nine
        ("4901777", "101868", "14901777018683", True),  # a packing of several
        ("490177", "0701868", "4901777018686", False),  # the same number, its prefix cut in the wrong place
        ("2012345", "000001", "2012345000018", False),  # in-store
        ("0212345", "000001", "0212345000014", False),
    ],
)
def test_a_tag_is_trusted_by_its_company_prefix(company: str, item: str, gtin: str, trusted: bool) -> None:
    tag = sgtin(company, item)
    assert canonical_gtin(with_check_digit(gtin[:-1])) == gtin
    assert gtin_of_epc(tag) == gtin
    assert names_its_company(tag) is trusted


def test_made_up_tags_are_rarely_trusted() -> None:
    rng = random.Random(1)
    tags = ["30" + "".join(rng.choices("0123456789ABCDEF", k=22)) for _ in range(1000)]
    with_gtin = [tag for tag in tags if gtin_of_epc(tag)]
    assert len(with_gtin) > 300
    assert sum(map(names_its_company, with_gtin)) < 0.1 * len(with_gtin)
    assert not names_its_company("E00401004E17F97A")


@pytest.mark.parametrize(
    ("payload", "expected"),
    [
        *((digits, True) for digits in ("2" + "0" * 11, "290000000000", "021234500000", "041234500000", "2000000")),
        *((digits, False) for digits in ("490177701868", "1490177701868", "4996871")),
    ],
)
def test_in_store_numbers(payload: str, expected: bool) -> None:
    assert in_store(with_check_digit(payload)) is expected
