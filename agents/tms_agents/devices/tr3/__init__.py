"""Takaya TR3 readers: 13.56 MHz, ISO 15693 tags, over RS-232, USB or TCP port 9004."""
