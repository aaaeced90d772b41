"""JAN, EAN, UPC and GTIN are one number; the check digit is verified."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tms_server.objects.gtin import InvalidGtin, canonical_gtin, gtin_of_epc


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
