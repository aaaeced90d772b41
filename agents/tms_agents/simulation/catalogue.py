"""The ten objects of the experiment.

Products carry JANs of the range for use inside a house (20...), tags are made-up ISO 15693 UIDs. The weights are what
the things really weigh; they are registered only where the demo is asked to.
"""

from __future__ import annotations

from dataclasses import dataclass

from tms_agents.simulation.world import Thing


@dataclass(frozen=True, kw_only=True, slots=True)
class Item:
    """One line of the catalogue: a product of which the room has one specimen."""

    number: int
    name: str
    synonyms: tuple[str, ...]
    category: str
    weight_g: float

    @property
    def tag(self) -> str:
        """ISO 15693 UID: E0, the chip maker's code, then the serial number."""
        return f"E0040150{0x3A7C10B2 + 0x1F3D * self.number:08X}"

    @property
    def jan(self) -> str:
        return with_check_digit(f"2000000{4100 + 7 * self.number:05d}")

    def thing(self) -> Thing:
        return Thing(number=self.number, tag=self.tag, weight_g=self.weight_g)


ITEMS = tuple(
    Item(number=number, name=name, synonyms=synonyms, category=category, weight_g=weight_g)
    for number, (name, synonyms, category, weight_g) in enumerate(
        [
            ("Tissue box", ("ティッシュ箱", "tissues"), "daily goods", 152.0),
            ("Glasses case", ("眼鏡ケース", "spectacles"), "personal", 88.0),
            ("Mug", ("マグカップ", "cup"), "tableware", 318.0),
            ("Tea bottle", ("お茶のボトル", "お茶", "green tea"), "drink", 541.0),
            ("Medicine box", ("薬箱", "medicine"), "medical", 236.0),
            ("TV remote", ("テレビのリモコン", "remote control"), "personal", 121.0),
            ("Picture book", ("絵本",), "book", 402.0),
            ("Hand towel", ("タオル",), "textile", 64.0),
            ("Biscuit tin", ("ビスケット缶", "biscuits"), "food", 463.0),
            ("Hand cream", ("ハンドクリーム",), "personal", 187.0),
        ]
    )
)


def with_check_digit(digits: str) -> str:
    """``digits`` followed by the check digit of EAN/JAN/GTIN (weights 3 and 1 from the right)."""
    total = sum(int(digit) * (3 if place % 2 == 0 else 1) for place, digit in enumerate(reversed(digits)))
    return digits + str(-total % 10)
