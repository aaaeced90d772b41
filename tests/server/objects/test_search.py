"""Search folds width, case and kana script alike in what is stored and in what is asked."""

from __future__ import annotations

import unicodedata

import httpx
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tms_server.objects.search import fold, search_text, words

japanese = st.text(
    st.characters(min_codepoint=0x3000, max_codepoint=0x30FF)
    | st.characters(min_codepoint=0xFF00, max_codepoint=0xFFEF)
)


@given(st.text() | japanese)
@example("ヷ")
@example("ﾊﾞﾅﾅ")
@example("ẞΣς")
def test_folding_twice_is_folding_once(text: str) -> None:
    assert fold(fold(text)) == fold(text)


@given(st.text(st.characters(min_codepoint=0x30A1, max_codepoint=0x30F6)))
def test_katakana_and_hiragana_fold_alike(katakana: str) -> None:
    hiragana = "".join(chr(ord(c) - 0x60) for c in katakana)
    assert fold(katakana) == fold(hiragana)


@given(st.text() | japanese)
def test_normal_forms_and_case_fold_alike(text: str) -> None:
    for form in ("NFC", "NFD", "NFKC", "NFKD"):
        assert fold(unicodedata.normalize(form, text)) == fold(text)  # type: ignore[arg-type]


@given(st.lists(st.text(min_size=1), min_size=1, max_size=4))
def test_every_word_of_what_is_stored_is_found(parts: list[str]) -> None:
    stored = search_text(parts)
    for part in parts:
        assert all(any(spelling in stored for spelling in word) for word in words(part))


@pytest.mark.parametrize(
    ("query", "names"),
    [
        ("おちゃ", ["オチャ緑"]),
        ("ｵﾁｬ", ["オチャ緑"]),
        ("ＴＥＡ", ["Tea Bottle", "green tea"]),
        ("tea bottle", ["Tea Bottle"]),
        ("bottle　tea", ["Tea Bottle"]),  # an ideographic space
        ("bottle green", []),
        ("100%", ["ジュース100%"]),
        ("1_0", []),
        ("じゅーす", ["ジュース100%"]),
        ("STRASSE", ["Straße"]),
        ("緑", ["オチャ緑"]),
        ("e0040100", ["Straße"]),
        ("drink", ["green tea"]),
        ("", ["Tea Bottle", "green tea", "オチャ緑", "ジュース100%", "Straße"]),
        ("\\", []),
        ("'", []),
    ],
)
def test_examples(query: str, names: list[str]) -> None:
    stored = {
        "Tea Bottle": search_text(["Tea Bottle"]),
        "green tea": search_text(["green tea", "Drink"]),
        "オチャ緑": search_text(["オチャ緑"]),
        "ジュース100%": search_text(["ジュース100%"]),
        "Straße": search_text(["Straße", "E0040100AB"]),
    }
    found = [name for name, text in stored.items() if all(any(s in text for s in word) for word in words(query))]
    assert found == names


async def test_the_database_finds_what_the_rule_says(town: httpx.AsyncClient) -> None:
    objects = {
        "A1": {"name": "Tea Bottle", "synonyms": ["ペットボトル"]},
        "A2": {"name": "green tea", "category": "Drink"},
        "A3": {"name": "ジュース100%", "jan": "4901234567894"},
        "A4": {"name": "Straße_1"},
        "B5": {"name": "バナナ"},
    }
    for tag, body in objects.items():
        assert (await town.put(f"/v1/objects/{tag}", json=body)).status_code == 201

    async def find(**query: str) -> list[str]:
        answer = await town.get("/v1/objects", params=query)
        assert answer.status_code == 200, answer.text
        return [item["tag"] for item in answer.json()["items"]]

    assert await find(q="ぺっとぼとる TEA") == ["A1"]
    assert await find(q="ﾍﾟｯﾄ") == ["A1"]
    assert await find(q="100%") == ["A3"]
    assert await find(q="%") == ["A3"]
    assert await find(q="_") == ["A4"]
    assert await find(q="strasse") == ["A4"]
    assert await find(q="b5") == ["B5"]
    assert await find(q="ﾊﾞﾅﾅ") == ["B5"]
    assert await find(q="4901234567894") == ["A3"]
    assert await find(q="04901234567894") == ["A3"]
    assert await find(q="のみもの") == []
    assert await find(q="飲み物") == ["A3"]  # the category of its product
    assert await find(category="飲み物") == ["A3"]
    assert await find(category="Drink") == ["A2"]
    assert await find(q="tea drink") == ["A2"]
    assert await find(q="\ufdfa" * 200) == []
    renamed = {"name": "x", "category": "文具"}
    assert (await town.put("/v1/products/4901234567894", json=renamed)).status_code == 200
    assert await find(q="文具") == ["A3"]
    assert await find(q="飲み物") == []
