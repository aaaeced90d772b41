"""Text search over Japanese and Latin names: stored text and query are folded by the same rule."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable

from tms_server.objects.gtin import InvalidGtin, canonical_gtin

#: Katakana (small a to small ke, and the iteration marks) to the hiragana of the same sound.
_HIRAGANA = {code: code - 0x60 for code in (*range(0x30A1, 0x30F7), 0x30FD, 0x30FE)}


#: One word of a query: any of these spellings will do.
Word = tuple[str, ...]


def fold(text: str) -> str:
    """One spelling for what reads the same: width (NFKC), case, and the two kana scripts.

    ``fold(fold(text)) == fold(text)``.
    """
    composed = unicodedata.normalize("NFKC", text).casefold()
    return unicodedata.normalize("NFKC", composed).translate(_HIRAGANA)


def search_text(parts: Iterable[str | None]) -> str:
    """What is stored to be searched. No word of a query can reach across two parts."""
    return "\n".join(fold(part) for part in parts if part)


def words(query: str) -> list[Word]:
    """The folded words of a query, all of which must occur."""
    return [_alternatives(word) for word in fold(query).split()]


def _alternatives(word: str) -> Word:
    """A GTIN is looked for in the form that is stored, too."""
    try:
        return (word, canonical_gtin(word))
    except InvalidGtin:
        return (word,)
