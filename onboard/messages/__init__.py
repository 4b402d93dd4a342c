"""What travels between cars. Each message is declared once, in the module that names it.

`declaration` turns a class with annotated fields into an encoder, a decoder, a printer and a table
for the documentation. `uper` does the same for BSMs, in the packed encoding of their standard.
"""
