"""Furniture that was moved: pieces of the background that have gone, and new things nearby that are these pieces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Of a leg that was moved: since when (s) it has rested where, x and y (m).
Leg = tuple[float, float, float]

#: Why a print is furniture: by its looks, or because a piece that has gone from nearby looks like it.
LOOKS, MOVED = 1, 2
#: The weight of either in the background: what only looks like it cannot turn up elsewhere as a piece, at first.
ADOPTED = (0.0, 0.1, 0.3)
#: Furniture is pushed so far at most (m); where it stands again is seen empty for so long (s) at most after its old
#: place, and for so long if it is one piece. Its width is then the same within this (m) and as far as the beams tell.
_PUSHED_M, _PUSHED_S, _ALONE_S, _WIDTH_M = 1.3, 15.0, 6.0, 0.02
#: A thin piece (m), like the leg of a chair, tells only together with another so near it (m) that went so soon (s).
_THIN_M, _GROUP_M, _GROUP_S = 0.065, 0.75, 10.0
#: Its width is the same within this (m) and as far as the beams tell.
_THIN_WIDTH_M = 0.01
#: Two pieces of one surface are so near each other (m), and one is seen to have gone so long (s) after the other.
_BESIDE_M, _TOGETHER_GONE_S = 0.1, 15.0
#: What has come back stands where it stood, but for this (m).
_BACK_M = 0.03
#: The legs of a chair that was moved stand still within so long (s), at least so far from each other (m).
_TOGETHER_S, _LEGS_M = 2.0, 0.2
#: What was somebody's foot, and has not been seen for so long (s), was lifted.
_LIFTED_S = 1.0
#: Legs that came so long ago (s) at most tell of one that is believed later; so near (m) it is the same leg.
_LEGS_S, _SAME_LEG_M = 60.0, 0.05
#: What rests somewhere looks like a piece that has gone if it is as wide, but for this share.
_ALIKE = 0.1
#: The ranges of one surface differ so little from beam to beam (m); something thin hides so much of it (m).
_SAME_M, _HIDDEN_M = 0.05, 0.15
#: A piece has gone when its beams have passed its place for so long (s), and was background by this weight.
_GONE_S, _WEIGHT = 0.8, 0.25
#: So wide (m) is an edge that noise hides now and then.
_GLIMPSED_M = 0.025
#: It cannot stand at its new place so long (s) before it is seen to have gone, unless who pushes it hides that.
_EARLY_S = 2.0


@dataclass(slots=True)
class Piece:
    """A piece of the background that is not there now: where it was, ``width`` m wide, and when its place was free.

    ``whole``: nothing of its surface is still there, or hidden.
    """

    t: float
    x: float
    y: float
    width: float
    whole: float


@njit(cache=True)
def _goes_on(centre: Array, weight: Array, i: int, r: float) -> bool:
    """Whether the background of beam i has a surface at the range r."""
    if 0 <= i < centre.shape[0]:
        for j in range(centre.shape[1]):
            if weight[i, j] > _WEIGHT and abs(centre[i, j] - r) < _SAME_M:
                return True
    return False


@njit(cache=True)
def _bridged(centre: Array, weight: Array, last: int, i: int, r: float, step: float) -> bool:
    """Whether the beams between ``last`` and i end at something thin before the range r: behind it is one piece."""
    if i - last <= 2:
        return True
    if (i - last) * step * r > _HIDDEN_M:
        return False
    for b in range(last + 1, i):
        far = 0.0
        for j in range(centre.shape[1]):
            if weight[b, j] > _WEIGHT:
                far = max(far, centre[b, j])
        if far == 0.0 or far > r - _SAME_M:
            return False
    return True


@njit(cache=True)
def _pieces(
    centre: Array, weight: Array, missing: Array, gone_at: Array, rays: Array, step: float, late: float, out: Array
) -> int:
    """Group missing components of neighbouring beams to rows of ``out`` (m, 5), as `Piece`; how many.

    ``late``: what to add to ``gone_at`` (n, k) s for the time of scans.
    """
    n, k = centre.shape
    count = 0
    last, last_r, first_r = -10, 0.0, 0.0
    first, x, y, r_sum, beams, gone = 0, 0.0, 0.0, 0.0, 0, 0.0
    for i in range(n + 1):
        r, at = 0.0, 0.0
        if i < n:
            for j in range(k):
                if weight[i, j] > _WEIGHT and missing[i, j] > _GONE_S and (r == 0.0 or centre[i, j] < r):
                    r, at = centre[i, j], gone_at[i, j]
        joined = r > 0.0 and beams > 0 and abs(r - last_r) < 0.12
        joined = joined and _bridged(centre, weight, last, i, min(r, last_r), step)
        if beams > 0 and not joined and (r > 0.0 or i == n or not _bridged(centre, weight, last, i, last_r, step)):
            if count < out.shape[0]:
                out[count, 0] = late + gone / beams
                out[count, 1], out[count, 2] = x / beams, y / beams
                out[count, 3] = (last - first + 1) * step * r_sum / beams
                left = _goes_on(centre, weight, first - 1, first_r) and _goes_on(centre, weight, first - 2, first_r)
                right = _goes_on(centre, weight, last + 1, last_r) and _goes_on(centre, weight, last + 2, last_r)
                out[count, 4] = 0.0 if left or right else 1.0
                count += 1
            beams = 0
        if r > 0.0:
            if beams == 0:
                first, first_r, x, y, r_sum, gone = i, r, 0.0, 0.0, 0.0, 0.0
            x += rays[i, 0] + r * rays[i, 2]
            y += rays[i, 1] + r * rays[i, 3]
            r_sum += r
            gone += at
            beams += 1
            last, last_r = i, r
    return count


def _legs(print_: Any, prints: Any, known: list[Leg]) -> bool:
    """Whether the print and at least two others are thin, near each other, and stand there since the same time.

    Others are ``prints``, or ``known`` to be legs.
    """
    if print_["width"] > _THIN_M or print_["given"] == 1 or print_["mutes"] > print_["hits"]:
        # What was put down by somebody who stands beside it has not been pushed there; parts of what is black or
        # glossy are no legs.
        return False
    away = np.hypot(prints["x"] - print_["x"], prints["y"] - print_["y"])
    thin = (prints["used"] == 1) & (prints["width"] < _THIN_M) & (prints["hits"] >= 4) & (prints["owner"] < 0)
    since = np.abs(prints["rested"] - print_["rested"])
    foot = (prints["revealed"] == 0) & (prints["owned"] >= prints["first"])
    thin &= ~(foot & (print_["last"] - prints["last"] > _LIFTED_S))
    legs = thin & (away > _LEGS_M) & (away < _GROUP_M) & (since < np.where(prints["revealed"] > 0, 6.0, _TOGETHER_S))
    count = int(np.count_nonzero(legs))
    for since, x, y in known:
        far = math.hypot(x - print_["x"], y - print_["y"])
        seen = np.hypot(prints["x"][legs] - x, prints["y"][legs] - y) < _SAME_LEG_M
        count += abs(since - print_["rested"]) < _TOGETHER_S and _LEGS_M < far < _GROUP_M and not seen.any()
    return count >= 2


class Furniture:
    """Matches new things with pieces of the background that have gone."""

    def __init__(self) -> None:
        #: Where pieces were that are found again: t, x, y.
        self._found: list[tuple[float, float, float]] = []
        #: Legs of furniture that was moved.
        self.legs: list[Leg] = []
        self._rows = np.zeros((128, 5))

    def pieces(self, view: Any) -> list[Piece]:
        """What has gone from the background of the sensor."""
        if view.last is None:
            return []
        b = view.background
        # Not since the time now: for a sensor that sees nothing any more nothing has gone lately.
        late = view.last - b.seconds
        count = _pieces(b.centre, b.weight, b.missing, b.gone_at, view.rays, abs(view.step), late, self._rows)
        return [Piece(*row) for row in self._rows[:count].tolist()]

    def explains(self, print_: Any, prints: Any, pieces: list[Piece], t: float, empty_until: float) -> bool:
        """Whether the print is a piece of furniture that has gone from somewhere near; each piece explains one.

        Or thin as the leg of a chair, with two more among the ``prints`` that came to stand with it. ``empty_until``
        (s): its place was last seen to be empty then.
        """
        self.legs = [leg for leg in self.legs if t - leg[0] < _LEGS_S][-64:]
        if _legs(print_, prints, self.legs) or self._gone_from(print_, pieces, t, empty_until):
            if print_["width"] < _THIN_M:
                self.legs.append((float(print_["rested"]), float(print_["x"]), float(print_["y"])))
            return True
        return False

    def _gone_from(self, print_: Any, pieces: list[Piece], t: float, empty_until: float) -> bool:
        """Whether the print is one of the ``pieces``."""
        self._found = [item for item in self._found if t - item[0] < 2 * _PUSHED_S][-64:]
        near = [p for p in pieces if p.whole and math.hypot(p.x - print_["x"], p.y - print_["y"]) < _PUSHED_M]
        near = [p for p in near if print_["rested"] - p.t + _GONE_S > -_EARLY_S and not self._is_part(p, pieces)]
        best, best_cost = None, 1.0
        width, spacing = float(print_["width"]), float(print_["spacing"])
        for piece in near:
            if any(math.hypot(piece.x - x, piece.y - y) < 0.05 for _, x, y in self._found):
                continue
            thin = width < _THIN_M
            away = math.hypot(piece.x - print_["x"], piece.y - print_["y"])
            late = empty_until - piece.t > (_PUSHED_S if thin else _ALONE_S)
            if late and away > 0.5 * (piece.width + width) + _BACK_M:
                # It may come back to where it stood whenever it likes.
                continue
            if thin and not self._grouped(piece, pieces, _THIN_M + spacing):
                continue
            least = _THIN_WIDTH_M if min(width, piece.width) < _THIN_M else _WIDTH_M
            difference = abs(piece.width - width) / (least + 0.15 * max(piece.width, width) + spacing)
            cost = 0.3 * away / _PUSHED_M + 0.7 * difference
            # What somebody put down must look just like the piece.
            if difference < (0.5 if print_["given"] == 1 else 1.0) and cost < best_cost:
                best, best_cost = piece, cost
        if best is None:
            return False
        self._found.append((t, best.x, best.y))
        return True

    @staticmethod
    def lacks(pieces: list[Piece]) -> bool:
        """Whether anything has gone, and not only an edge that noise hides now and then."""
        return any(piece.width > _GLIMPSED_M for piece in pieces)

    @staticmethod
    def was(begun: Any, width: float, pieces: list[Piece]) -> bool:
        """Whether what has ``begun`` (first, x0, y0) began where a piece of background about as wide has gone then."""
        return any(
            math.hypot(piece.x - begun["x0"], piece.y - begun["y0"]) < _PUSHED_M
            and 0.5 * width < piece.width < 1.5 * width
            and abs(piece.t - begun["first"]) < _GROUP_S
            for piece in pieces
        )

    @staticmethod
    def misses(width: float, rests_at: float, pieces: list[Piece]) -> bool:
        """Whether one of the ``pieces``, about so wide (m), had gone when what is so wide came to rest."""
        gone = [piece for piece in pieces if piece.whole and piece.t < rests_at + _EARLY_S]
        return any(abs(piece.width - width) < _ALIKE * width for piece in gone)

    @staticmethod
    def _is_part(piece: Piece, pieces: list[Piece]) -> bool:
        """Whether a larger piece has gone from beside it: what was pushed is larger than this."""
        return any(
            other.width > piece.width
            and abs(other.t - piece.t) < _TOGETHER_GONE_S
            and math.hypot(other.x - piece.x, other.y - piece.y) < 0.5 * (piece.width + other.width) + _BESIDE_M
            for other in pieces
        )

    @staticmethod
    def _grouped(piece: Piece, pieces: list[Piece], thin: float) -> bool:
        return piece.width < thin and any(
            other is not piece
            and other.width < thin
            and 0.06 < math.hypot(other.x - piece.x, other.y - piece.y) < _GROUP_M
            and abs(other.t - piece.t) < _GROUP_S
            for other in pieces
        )

    def save(self) -> dict[str, Any]:
        """JSON values."""
        return {"furniture": list(self._found), "legs": list(self.legs)}

    def restore(self, saved: Any) -> None:
        """Raises KeyError, TypeError or ValueError where that is nothing that ``save`` gave."""
        self._found, self.legs = (
            [(float(t), float(x), float(y)) for t, x, y in saved[name]] for name in ("furniture", "legs")
        )
