"""What a robot that maps sends to the server."""
