"""Intake at the cabinet: scan the barcode, hold the thing at the reader, done."""
