"""Drawing of results: contact sheets, figures, annotated films."""
