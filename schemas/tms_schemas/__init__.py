"""The wire of the Town Management System: pydantic models, nothing else.

``events`` is the core vocabulary shared by scenario files, room log and wire; ``observation`` what agents post;
``objects``, ``rooms``, ``agents``, ``belief`` and ``live`` what the server stores and answers; ``problem`` its errors.
"""
