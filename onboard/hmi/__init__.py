"""The driver's page, and the metrics for an operator.

`display.py` is the core: it turns events of the stack into views. `page_server.py` is the edge: it
serves the files in `page/`, pushes each view to every browser, and answers `/metrics`.
"""
