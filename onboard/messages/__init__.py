"""What travels between cars. Each message is declared once, in the module that names it.

`declaration` turns a class with annotated fields into an encoder, a decoder, a printer and a table
for the documentation. The J2735 messages are declared in ASN.1, because their standard is.
"""
