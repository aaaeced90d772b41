"""Byte-level drivers, each with its emulator beside it.

A driver is a parser and a ``Session`` (see ``transport``) that do no I/O: bytes in, readings out. One module moves the
bytes, over TCP, a serial line or a pseudo terminal.
"""
