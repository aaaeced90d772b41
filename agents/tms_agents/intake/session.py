"""One carer at work: what is scanned, read and typed becomes registrations and sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pydantic import ValidationError

from tms_agents.intake import words
from tms_agents.intake.codes import Barcode, TagId, Text, Unusable, barcode, sgtin_96, tag_id, typed
from tms_agents.intake.pairing import Again, Alone, Expired, Outcome, Pair, Pairing, Several, Waiting
from tms_client import AsyncTown
from tms_client.errors import Conflict, Forbidden, Invalid, NotFound, TownError
from tms_schemas.objects import TownObject


@dataclass(slots=True)
class Said:
    """How it goes on. ``good`` are results, ``bad`` what did not work."""

    good: Callable[[str], None]
    bad: Callable[[str], None]


@dataclass(slots=True)
class Tally:
    registered: set[str] = field(default_factory=set)
    already: set[str] = field(default_factory=set)
    failed: set[str] = field(default_factory=set)

    def in_words(self) -> str:
        return words.summary(len(self.registered), len(self.already), len(self.failed))


class Session:
    """Takes inputs one after the other; ``t`` in each is its time, seconds, monotone.

    Args:
        can_ask: somebody is at the keyboard, who may be asked for a name.
    """

    def __init__(self, town: AsyncTown, pairing: Pairing, say: Said, *, room: str | None, can_ask: bool) -> None:
        self._town, self._pairing, self._say = town, pairing, say
        self._room, self._can_ask = room, can_ask
        self._asked: Pair | None = None
        #: The tag whose registration is on its way to the server.
        self.sending: str | None = None
        self._unusable: set[str] = set()
        self.tally = Tally()

    async def line(self, t: float, text: str) -> None:
        """A line from the keyboard: a barcode, a tag, or the name that was asked for."""
        found = typed(text)
        match found:
            case Text(name) if self._asked is not None:
                await self._named(self._asked, name)
            case Text(""):
                pass
            case Text(other):
                self._say.bad(f"{other[:40]!r} is neither a barcode nor a tag. (A tag without the usual form: tag:ID)")
            case Unusable(why):
                self._not_asked()
                self._pairing.scan_failed()
                self._say.bad(why)
            case Barcode(digits):
                self._not_asked()
                await self._do(self._pairing.scanned(t, digits))
            case TagId(tag):
                self._not_asked()
                await self._do(self._pairing.typed(t, tag))

    async def scan(self, t: float, code: str) -> None:
        """From a barcode scanner."""
        self._not_asked()
        found = barcode(code)
        if isinstance(found, Unusable):
            self._pairing.scan_failed()
            self._say.bad(found.why)
        else:
            await self._do(self._pairing.scanned(t, found.digits))

    async def read(self, t: float, tag: str) -> None:
        """From a tag reader, at every read."""
        if isinstance(tag_id(tag), TagId):
            await self._do(self._pairing.read(t, tag))
        elif tag not in self._unusable:
            self._unusable.add(tag)
            self._say.bad(f"The reader sees a tag that cannot be registered, its number is too long: {tag[:40]}...")

    async def tick(self, t: float) -> None:
        await self._do(self._pairing.tick(t))

    async def register(self, tag: str, code: str | None, name: str | None = None) -> bool:
        """Tell the server; False, and said why, where it was not registered."""
        self.sending = tag
        try:
            result = await self._town.intake(tag, jan=code, name=name, room=self._room)
        except Invalid as error:
            if code is None or name is not None or await self._product(code) != words.NOT_IN_CATALOGUE:
                self._failed(tag, words.why_not(error, tag, self._room))
            elif self._can_ask:
                self._asked = Pair(tag, code)
                self._say.good(words.ask_name(code))
            else:
                self._failed(tag, f"Not registered: {words.unknown_product(code)}")
            return False
        except Conflict as error:
            self._failed(tag, words.why_not(error, tag, self._room, await self._known(tag)))
            self._pairing.registered(tag)
            return False
        except TownError as error:
            self._failed(tag, words.why_not(error, tag, self._room))
            return False
        except ValidationError as error:
            self._failed(tag, f"Not registered: {error.errors()[0]['loc'][0]}: {error.errors()[0]['msg']}.")
            return False
        finally:
            self.sending = None
        self.tally.failed.discard(tag)
        (self.tally.registered if result.created else self.tally.already).add(tag)
        self._pairing.registered(tag)
        self._say.good(words.registered(result))
        return True

    async def _do(self, outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            match outcome:
                case Pair(tag, code):
                    await self.register(tag, code)
                case Alone(tag):
                    await self._alone(tag)
                case Again(tag):
                    self._say.good(f"Tag {tag} is known already. The next thing, please.")
                case Waiting(code, instead_of):
                    self._say.good(words.scanned(code, await self._product(code), instead_of))
                case Several(tags):
                    self._say.bad(words.several(tags))
                case Expired(code, late):
                    self._say.bad(words.expired(code, late))

    async def _alone(self, tag: str) -> None:
        """A tag without a scan: it may be known, or name its product itself."""
        try:
            known = await self._known(tag)
            if known is not None:
                self.tally.already.add(tag)
                self._pairing.registered(tag)
                self._say.good(words.already(known))
            elif sgtin_96(tag) is None or not await self._names_itself(tag):
                self._say.good(words.alone(tag))
        except TownError as error:
            self._failed(tag, words.why_not(error, tag, self._room))

    async def _names_itself(self, tag: str) -> bool:
        """Registered by its own number; False where the server does not know or trust that."""
        self.sending = tag
        try:
            result = await self._town.intake(tag, room=self._room)
        except Invalid:
            return False
        finally:
            self.sending = None
        (self.tally.registered if result.created else self.tally.already).add(tag)
        self._pairing.registered(tag)
        self._say.good(words.registered(result))
        return True

    async def _named(self, asked: Pair, name: str) -> None:
        self._asked = None
        if name:
            await self.register(asked.tag, asked.code, name)
        else:
            self._failed(asked.tag, f"Left out: tag {asked.tag}.")

    def _not_asked(self) -> None:
        """The question for a name was not answered: somebody went on with the next thing."""
        if self._asked is not None:
            self._failed(self._asked.tag, f"Not registered, it has no name: tag {self._asked.tag}.")
            self._asked = None

    def _failed(self, tag: str, why: str) -> None:
        self.tally.failed.add(tag)
        self._pairing.failed(tag)
        self._say.bad(why)

    async def _known(self, tag: str) -> TownObject | None:
        """Raises ``TownError`` where the server cannot be asked."""
        try:
            return await self._town.objects.get(tag)
        except (NotFound, Forbidden):
            return None

    async def _product(self, code: str) -> str:
        try:
            return (await self._town.products.get(code)).name
        except NotFound:
            return words.NOT_IN_CATALOGUE
        except TownError:
            return ""
