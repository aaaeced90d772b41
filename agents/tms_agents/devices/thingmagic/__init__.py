"""ThingMagic M5e and M6e modules: UHF Gen2 tags, over a serial line."""
