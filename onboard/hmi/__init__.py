"""What the driver sees and hears, and what an operator counts.

`display.py` is the core: from what the stack says to what is to be shown. `page_server.py` is the
edge: it serves the page in `page/`, pushes each view to every browser, and answers `/metrics`.
"""
