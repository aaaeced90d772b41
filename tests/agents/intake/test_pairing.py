"""Which scan belongs to which tag: any order, never a stale one, never twice, never in doubt."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from tms_agents.intake.pairing import Again, Alone, Expired, Pair, Pairing, Several, Waiting

TEA, CUP = "4901777018686", "4569951116117"
EXPIRES, SETTLE, GONE = 30.0, 0.5, 2.0


def pairing() -> Pairing:
    return Pairing(expires_s=EXPIRES, settle_s=SETTLE, gone_s=GONE)


def hold(one: Pairing, t: float, *tags: str, for_s: float = 1.0) -> list:
    """Tags at the reader from ``t`` on, read ten times a second."""
    found = []
    for step in range(int(for_s * 10) + 1):
        for tag in tags:
            found += one.read(t + step * 0.1, tag)
    return found


def wait(one: Pairing, t: float, for_s: float) -> list:
    return [outcome for step in range(int(for_s * 10) + 1) for outcome in one.tick(t + step * 0.1)]


def test_scan_then_read():
    one = pairing()
    assert one.scanned(0, TEA) == [Waiting(TEA)]
    assert hold(one, 5, "A") == [Pair("A", TEA)]


def test_read_then_scan():
    one = pairing()
    assert hold(one, 0, "A") == [Alone("A")]
    assert one.scanned(5, TEA) == [Pair("A", TEA)]


def test_a_tag_typed_is_taken_at_once():
    one = pairing()
    assert one.typed(0, "A") == [Alone("A")]
    assert one.scanned(1, TEA) == [Pair("A", TEA)]


@given(st.floats(0, 29), st.booleans(), st.booleans())
def test_the_order_does_not_matter(between, typed, scan_first):
    one = pairing()

    def present(t: float) -> list:
        return one.typed(t, "A") if typed else hold(one, t, "A")

    found = one.scanned(0, TEA) + present(between) if scan_first else present(0) + one.scanned(between + 1, TEA)
    assert [outcome for outcome in found if isinstance(outcome, Pair)] == [Pair("A", TEA)]


def test_one_scan_is_for_one_thing():
    one = pairing()
    one.scanned(0, TEA)
    assert hold(one, 1, "A") == [Pair("A", TEA)]
    assert wait(one, 2, 5) == []
    assert hold(one, 10, "B") == [Alone("B")]


def test_an_old_scan_expires():
    one = pairing()
    one.scanned(0, TEA)
    assert wait(one, 29, 2) == [Expired(code=TEA)]
    assert hold(one, 32, "A") == [Alone("A")]


def test_a_tag_taken_away_waits_only_so_long():
    one = pairing()
    hold(one, 0, "A")
    assert wait(one, 1, 32) == [Expired(tag="A")]
    assert one.scanned(40, TEA) == [Waiting(TEA)]


def test_a_tag_that_stays_at_the_reader_does_not_expire():
    one = pairing()
    assert hold(one, 0, "A", for_s=60) == [Alone("A")]
    assert one.scanned(60, TEA) == [Pair("A", TEA)]


def test_the_last_scan_counts_and_a_failed_one_takes_the_one_before_with_it():
    one = pairing()
    one.scanned(0, TEA)
    assert one.scanned(1, TEA) == [Waiting(TEA)]
    assert one.scanned(2, CUP) == [Waiting(CUP, instead_of=TEA)]
    one.scan_failed()
    assert hold(one, 3, "A") == [Alone("A")]


def test_several_tags_are_refused_until_the_reader_was_empty():
    one = pairing()
    one.scanned(0, TEA)
    assert hold(one, 1, "B", "A") == [Several(("A", "B"))]
    assert hold(one, 2.1, "A", for_s=5) == []  # B may only be hidden
    assert wait(one, 8, 2.5) == []
    assert hold(one, 11, "A") == [Pair("A", TEA)]


def test_a_second_tag_within_the_settling_time_is_no_race():
    one = pairing()
    one.scanned(0, TEA)
    assert one.read(1.0, "A") + one.read(1.3, "A") + one.read(1.4, "B") == [Several(("A", "B"))]


def test_a_registered_thing_that_lies_near_the_reader_does_not_disturb():
    one = pairing()
    one.scanned(0, TEA)
    assert hold(one, 1, "A") == [Pair("A", TEA)]
    one.registered("A")
    one.scanned(3, CUP)
    assert hold(one, 3, "A", for_s=3) == []
    assert hold(one, 6.1, "A", "B") == [Pair("B", CUP)]


def test_a_registered_thing_that_comes_back_is_said_once_and_takes_no_scan():
    one = pairing()
    one.scanned(0, TEA)
    hold(one, 1, "A")
    wait(one, 2, 5)
    one.scanned(8, CUP)
    assert hold(one, 9, "A", for_s=3) == [Again("A")]
    assert hold(one, 20, "B") == [Pair("B", CUP)]


def test_a_failed_thing_starts_over():
    one = pairing()
    one.scanned(0, TEA)
    assert hold(one, 1, "A") == [Pair("A", TEA)]
    one.failed("A")
    assert one.scanned(3, CUP) == [Waiting(CUP)]  # probably the next thing: A is still at the reader
    assert hold(one, 3, "A") == []
    wait(one, 4, 3)
    assert hold(one, 8, "A") == [Pair("A", CUP)]  # held again


def test_a_waiting_tag_is_forgotten_when_another_one_comes():
    one = pairing()
    hold(one, 0, "A")
    one.read(5, "B")  # not settled yet
    assert one.scanned(5.1, TEA) == [Waiting(TEA)]
    assert hold(one, 5.2, "B") == [Pair("B", TEA)]


ACTION = st.one_of(
    st.tuples(st.just("scan"), st.sampled_from(["1", "2", "3"])),
    st.tuples(st.just("bad"), st.just("")),
    st.tuples(st.sampled_from(["read", "read", "read", "typed", "fail", "registered"]), st.sampled_from("ABC")),
    st.tuples(st.just("tick"), st.just("")),
)
PAUSE = st.sampled_from([0.0, 0.1, 0.1, 0.3, 0.6, 1.0, 2.5, 12.0, 31.0])


class Watch:
    """Checks every outcome against what happened so far."""

    def __init__(self) -> None:
        self.scan: tuple[str, float] | None = None  # the last good scan, not used yet
        self.known: set[str] = set()  # registered, or on the way
        self.seen: list[tuple[float, str, bool]] = []  # when, which, and whether it was known then

    def check(self, t: float, outcomes: list) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Several):
                assert len(outcome.tags) > 1 and not self.known & set(outcome.tags)
            if not isinstance(outcome, Pair):
                continue
            assert self.scan is not None and outcome.code == self.scan[0], "a scan is used once, and only the last one"
            assert t - self.scan[1] <= EXPIRES, "never a stale scan"
            assert outcome.tag not in self.known, "never registers twice"
            last = max(when for when, tag, _ in self.seen if tag == outcome.tag)
            assert t - last <= EXPIRES, "never a stale tag"
            since = {tag for when, tag, known in self.seen if when > last and not known} - {outcome.tag} - self.known
            assert not since, "no other thing was at the reader since"
            self.scan = None
            self.known.add(outcome.tag)


@settings(max_examples=500)
@given(st.lists(st.tuples(PAUSE, ACTION), max_size=60))
def test_laws(steps):
    one, watch, t = pairing(), Watch(), 0.0
    for pause, (what, value) in steps:
        t += pause
        watch.check(t, one.tick(t))
        if what in ("read", "typed"):
            watch.seen.append((t, value, value in watch.known))
        match what:
            case "scan":
                watch.scan = (value, t)
                watch.check(t, one.scanned(t, value))
            case "bad":
                watch.scan = None
                one.scan_failed()
            case "read":
                watch.check(t, one.read(t, value))
            case "typed":
                watch.check(t, one.typed(t, value))
            case "fail":
                one.failed(value)
                watch.known.discard(value)
            case "registered":
                one.registered(value)
                watch.known.add(value)
