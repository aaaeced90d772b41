"""The Town Management System server: object database, room logs, belief, queries, live frames and the page."""
