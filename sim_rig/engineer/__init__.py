"""The engineer's page of a live run: traces and camera images of all cars, at any time of the run.

`run_view.py` and `image_store.py` are the cores: they keep trace records and camera images.
`server.py` is the edge, a process of its own; `page_process.py` starts it.
"""
