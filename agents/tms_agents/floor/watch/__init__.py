"""What is seen, as a picture: in a terminal, or as a file."""
