"""Drawing of results: contact sheets, figures and annotated films with charts; writing of films,
and encoding of pictures as JPEG and PNG.
"""
