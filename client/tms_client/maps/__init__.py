"""Maps as arrays: fetch, follow, upload, and the files of ``map_server``. What needs numpy is imported when called."""
