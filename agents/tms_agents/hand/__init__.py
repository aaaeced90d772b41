"""The hand agent: what the tag reader of a robot's hand (or of any place without its own estimator) sees."""
