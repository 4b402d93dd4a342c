"""Messages between cars, each declared once in the module that names it.

`record` turns a frozen dataclass with annotated fields (`fields`) into an encoder, a decoder, a
printer and a table for the documentation: BSMs in the packed encoding of their standard, LCCA
messages and the MVS footer in fields of fixed width. `columns` decodes many footer entries at once.
"""
