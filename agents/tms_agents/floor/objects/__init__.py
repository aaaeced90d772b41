"""The life of an object: put down, hidden, and taken away."""
