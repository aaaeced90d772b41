"""Every link between the pages of this repository leads somewhere: to a file, and to a heading of it."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings_that_are_there(page: Path) -> None:
    broken = []
    for target in links(page.read_text()):
        path, _, heading = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (heading and heading not in headings(file)):
            broken.append(target)
    assert not broken


def test_a_heading_is_linked_as_github_does() -> None:
    assert anchors("# One\n## Whose, then?\n## Whose, then?\n```\n# no heading\n```\n## `tms` + a_b-c") == {
        *("one", "whose-then", "whose-then-1", "tms--a_b-c")
    }


def links(text: str) -> list[str]:
    """What the text links to or shows of this repository; not what it shows as code."""
    prose = re.sub(r"`[^`]*`", "", without_blocks(text))
    linked = re.findall(r"\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\)", prose)
    shown = re.findall(r'<img [^>]*src="([^"]+)"', prose)
    return [target for target in linked + shown if not re.match(r"[a-z]+:", target)]


@cache
def headings(file: Path) -> set[str]:
    """The anchors of a page; of what is none there are none."""
    return anchors(file.read_text()) if file.suffix == ".md" else set()


def anchors(text: str) -> set[str]:
    """Lower case, without punctuation, a hyphen for each space; the second of the same name ends in -1, and so on."""
    found: set[str] = set()
    for title in re.findall(r"^#{1,6} +(.+?) *$", without_blocks(text), re.MULTILINE):
        plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title)
        name = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        same = sum(re.fullmatch(re.escape(name) + r"(-\d+)?", one) is not None for one in found)
        found.add(f"{name}-{same}" if same else name)
    return found


def without_blocks(text: str) -> str:
    """The text without what it shows between fences."""
    return re.sub(r"^(```|~~~).*?^\1", "", text, flags=re.MULTILINE | re.DOTALL)
