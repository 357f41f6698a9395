"""The one flow of an impact: record -> prepared -> scored -> a document to answer and a row to keep.

Routes, imports and the command line all go this way, so that they give the same numbers.
"""
