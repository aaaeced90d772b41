"""Where the lasers stand, found from walls and from people who walk."""
