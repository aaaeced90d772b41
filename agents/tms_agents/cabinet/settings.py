"""What can be tuned in the estimator; the defaults hold for boards of some kilograms sampled at 10-100 Hz."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class EstimatorSettings:
    """Seconds, grams and metres throughout."""

    #: False for a single scale: all things stand at one place, so a place tells nothing about what happened there.
    knows_places: bool = True

    # --- noise: learned, these are only where learning begins and ends
    #: Samples are averaged over this long before anything else is done with them.
    block_s: float = 0.08
    #: A cell is never believed to be quieter than this (half a quantisation step of the laboratory's board).
    noise_floor_g: float = 0.5
    #: How long the noise level of each cell, and the excess of slow noise over white noise, are averaged.
    noise_memory_s: float = 60.0
    #: A cell that repeats its value is stuck when that had been less probable than this.
    stuck_probability: float = 1e-10
    #: A cell that shows more than this is overloaded.
    cell_limit_g: float = 1e6

    # --- zero and creep
    #: The resting level of each cell is followed with this time constant: long against an object's placing, short
    #: against creep (1 % of the load per hour) and the drift of the zero.
    level_memory_s: float = 30.0
    #: The newest samples are kept out of the resting level this long, so that a slow change is not swallowed by it.
    level_lag_s: float = 2.0
    #: What a resting load may change by itself, as a share of the load per hour (standard deviation).
    creep_per_hour: float = 0.01

    # --- change points
    #: Departure from the resting level, in standard deviations of one normal variable (false alarms: none in days).
    departure_sd: float = 5.0
    #: A changed load is told from the old one when it differs by so many standard deviations ...
    change_sd: float = 4.5
    #: ... and by so much. The laboratory's own threshold is 20 g.
    min_weight_g: float = 14.0
    #: A load must be steady this long to count, and this long where the change is far above the noise.
    settle_s: float = 0.38
    settle_clear_s: float = 0.3
    #: Steady: the trend is less than so many standard deviations, and no trend is more likely than going on, by this
    #: logarithm of odds.
    settle_sd: float = 2.0
    settle_odds: float = 3.0
    #: An unexplained or ambiguous change is held this long in the hope of more samples or tag reads.
    patience_s: float = 2.0

    #: A load without a tag must be steady this long: it may be an arm that leans on the board.
    untagged_s: float = 0.9
    #: ... and no more restless than this, relative to noise.
    restless: float = 1.6
    #: A change that nothing explains (a hand that presses, a thing half lifted) becomes the new zero only after this.
    stubborn_s: float = 4.0

    # --- tags
    #: Probability that an antenna reads a tag in its zone in one round, and that it reads one that is not there.
    read_probability: float = 0.95
    false_read_probability: float = 0.01
    #: A tag is told to be at a stay when no other explanation has more than this probability.
    doubt: float = 0.02
    #: A tag that has been present this long without a stay is told as read in the zone.
    zone_read_after_s: float = 2.5
    #: Changes so recent may be seen in a new light when tags come or go.
    revision_s: float = 8.0
    #: How far outside its zone an antenna may read.
    zone_margin_m: float = 0.05

    # --- refinement
    #: The position is told again when the better estimate is so far from what was told ...
    refine_m: float = 0.015
    #: ... and this many of its own standard deviations.
    refine_sd: float = 3.0
    #: Steady load after which that is looked at; after which the position is told again in any case, with what is known
    #: then; and after which the estimate is final.
    refine_after_s: float = 2.0
    refine_again_s: float = 4.5
    refine_until_s: float = 20.0
