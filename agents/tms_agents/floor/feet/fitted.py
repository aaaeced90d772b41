"""The numbers that the costs of feet are made of (`likelihood`); those of legs are fitted to whose feet clusters are.

Fitted to simulated rooms with people and furniture in which every foot was assigned rightly up to the scan before: the
numbers make the right assignment of a scan likely among all there are (`benchmarks/floor_whose.py` fits them again).
Only what it costs that a foot is put down just anywhere is held, since with the fitted one somebody who comes out from
behind something would be somebody new. The numbers of shoes were set by hand, but for where one lands (`landing`).
"""

from __future__ import annotations

from typing import NamedTuple


class Legs(NamedTuple):
    """Standard deviations (m) and negative log likelihoods of where the legs of somebody are seen."""

    #: So far from the body along its way and aside.
    along_m: float = 0.427
    aside_m: float = 0.285
    #: Within a print it may move, for so much at most; it still stands while the other one goes.
    moved: float = 6.441
    left: float = 0.449
    #: Swinging it goes straight on: so far aside, farther for each second, and so far beyond where it could be.
    swings_aside_m: float = 0.057
    swings_aside_mps: float = 0.17
    beyond_m: float = 0.094
    goes_on: float = 0.99
    #: It begins to swing; it swings while the other one does.
    begins_m: float = 0.075
    begins: float = 2.731
    both: float = 1.708
    #: It is put down a stride ahead of the other, on its own side.
    stride_m: float = 0.126
    stride_aside_m: float = 0.089
    strides: float = 5.143
    #: It is put down anywhere near: so many seconds ahead of the body, or around it.
    ahead_s: float = 0.12
    ahead_m: float = 0.32
    ahead_aside_m: float = 0.24
    anywhere: float = 4.3
    around_m: float = 0.45
    around: float = 5.2
    #: The same, beside the other one, if that one was left behind.
    beside_m: float = 0.35
    beside: float = 4.2
    #: The same, of what stood there for half a second; of a leg that was seen just now, more if it could not have gone
    #: so far; less of one that was not seen for a second.
    stood: float = 3.309
    seen: float = 2.384
    seen_m: float = 0.223
    lost: float = 0.224
    #: The same, of what came there while this leg was somewhere else, and of what rested there as nobody's.
    stolen: float = 2.477
    rested: float = 1.545


class Shoes(NamedTuple):
    """The same of who shows shoes; in the same words as of legs, where it is the same."""

    along_m: float = 0.4
    aside_m: float = 0.24
    stand_m: float = 0.045
    moved: float = 2.0
    left: float = 0.5
    #: It rolls off from the heel to the toes and seems to move so far, never farther than that.
    rolls_m: float = 0.08
    rolls: float = 1.0
    farthest_m: float = 0.17
    beside_m: float = 0.35
    beside: float = 4.2
    stolen: float = 4.0
    rested: float = 2.5
    #: It is longer or shorter than his; the sine of how far it points from the way; for so much at most.
    sole_m: float = 0.015
    another: float = 2.0
    turned: float = 0.5
    astray: float = 2.0


LEGS, SHOES = Legs(), Shoes()
