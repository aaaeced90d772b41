"""A session and an emulated device that talk without a line, on a clock of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from tms_agents.devices.tags import RoundEnd, TagItem, TagRead


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def converse(
    session, device, clock: Clock, seconds: float, *, step_s: float = 0.01, line: Callable[[bytes], bytes] = bytes
) -> list[TagItem]:
    """Everything the session delivers in that time; ``line`` may damage what the device sends."""
    items: list[TagItem] = []
    for _ in range(round(seconds / step_s)):
        clock.now += step_s
        session.tick()
        # as long as something is said: a reader answers much faster than it is polled
        for _ in range(20):
            said = session.output()
            answer = line(device.receive(said)) if said else b""
            if not answer:
                break
            items += session.receive(answer)
    return items


def rounds(items: list[TagItem]) -> list[tuple[int, set[str]]]:
    """Per ``RoundEnd``: its antenna and the tags read there since its last one."""
    found: list[tuple[int, set[str]]] = []
    seen: dict[int, set[str]] = {}
    for item in items:
        if isinstance(item, TagRead):
            seen.setdefault(item.antenna, set()).add(item.tag)
        else:
            assert isinstance(item, RoundEnd)
            found.append((item.antenna, seen.pop(item.antenna, set())))
    return found


def assert_true(items: list[TagItem], truth: Mapping[int, set[str]]) -> None:
    """Nothing is read that is not there, and a round that ended has read everything there is."""
    assert all(isinstance(item, RoundEnd) or item.tag in truth[item.antenna] for item in items)
    assert all(tags == truth[antenna] for antenna, tags in rounds(items))


class DisturbedLine:
    """Harms answers on their way: (number of the answer, place in it, "flip", "drop" or "insert", value)."""

    def __init__(self, harm: Sequence[tuple[int, int, str, int]]) -> None:
        self._harm, self._answers = harm, 0

    def __call__(self, answer: bytes) -> bytes:
        raw = bytearray(answer)
        for number, at, what, value in self._harm:
            if number == self._answers and raw:
                place = at % len(raw)
                if what == "flip":
                    raw[place] ^= value
                elif what == "drop":
                    del raw[place]
                else:
                    raw.insert(place, value)
        self._answers += 1
        return bytes(raw)
